//! Local optimization, and then the exchange of glasses, as one optimizer.

use super::glasses::{GlassSearch, GlassSearchError};
use super::{DescentMethod, LimitPrice, OptimizationEnd, OptimizationProgress, Optimizer, start};
use crate::lens::Lens;
use crate::lens::glass::Glass;
use crate::merit::{Goal, MeritError, TermValue};

/// An optimizer that exchanges glasses once nothing is left to gain without: each step is a round of the
/// search among them.
#[derive(Debug)]
struct ExchangingOptimizer {
    /// That of the best lens so far.
    optimizer: Box<dyn Optimizer>,
    search: GlassSearch,
    /// The progress since the local optimization has ended; `None` before.
    exchange: Option<OptimizationProgress>,
}

/// Creates an optimizer that exchanges the glasses of a lens for some others, in an order that depends on
/// a seed, after a local optimization.
///
/// # Errors
/// A lens without variables, without a merit or without a glass to exchange, or glasses without an index.
pub fn start_exchanging(
    method: DescentMethod,
    lens: &Lens,
    goal: &Goal,
    tolerance: f64,
    glasses: impl IntoIterator<Item = &'static Glass>,
    seed: u64,
) -> Result<Box<dyn Optimizer>, GlassSearchError> {
    Ok(Box::new(ExchangingOptimizer {
        optimizer: start(method, lens, goal, tolerance)?,
        search: GlassSearch::new(lens, goal, tolerance, glasses, seed)?,
        exchange: None,
    }))
}

impl ExchangingOptimizer {
    /// A step of the local optimization, after the last of which glasses are exchanged.
    fn descend(&mut self) -> OptimizationProgress {
        let mut progress = self.optimizer.step();
        if !progress.finished {
            return progress;
        }
        self.optimizer.verify_best();
        progress.finished = match self.search.restart(self.optimizer.best()) {
            Ok(()) => false,
            Err(why) => {
                progress.refused = Some(why.to_string());
                true
            }
        };
        progress.end = progress.end.filter(|_| progress.finished);
        self.exchange = Some(progress.clone());
        progress
    }

    /// A round of the search among glasses.
    fn round(&mut self, mut progress: OptimizationProgress) -> OptimizationProgress {
        progress.step += 1;
        match self.search.round().and_then(|round| {
            if round.accepted.is_some() {
                self.optimizer = self.search.resume()?;
            }
            Ok(round)
        }) {
            Ok(round) => {
                progress.accepted = f64::from(u8::from(round.accepted.is_some()));
                (progress.merit, progress.best) = (round.merit, round.merit);
                progress.finished = round.finished;
                progress.end = round.finished.then_some(OptimizationEnd::NoGain);
            }
            Err(why) => {
                progress.refused = Some(why.to_string());
                progress.finished = true;
            }
        }
        self.exchange = Some(progress.clone());
        progress
    }
}

impl Optimizer for ExchangingOptimizer {
    fn step(&mut self) -> OptimizationProgress {
        match self.exchange.take() {
            None => self.descend(),
            Some(progress) => self.round(progress),
        }
    }

    fn verify_best(&mut self) {
        self.optimizer.verify_best();
    }

    fn best(&self) -> &Lens {
        self.optimizer.best()
    }

    fn current(&self) -> &Lens {
        self.optimizer.current()
    }

    fn terms(&self) -> Result<Vec<TermValue>, MeritError> {
        self.optimizer.terms()
    }

    fn binding_limits(&self) -> &[LimitPrice] {
        self.optimizer.binding_limits()
    }

    fn conflict(&self) -> &[String] {
        self.optimizer.conflict()
    }
}
