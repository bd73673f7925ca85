//! The sharpness and light of a lens, to compare the design with the lenses of runs.

use super::run::{LatestRequestWorker, catch_panic};
use crate::lens::Lens;
use crate::optimize::pareto::ParetoPoint;
use crate::pupil::limited_by_stop;
use std::io;
use std::sync::Arc;

/// The relative error of the numbers.
const ERROR: f64 = 1e-4;

/// A lens with its sharpness and light, evaluated as a sweep of the Pareto front does.
#[derive(Debug, Clone)]
pub struct ScoredLens {
    /// The lens.
    pub lens: Arc<Lens>,
    /// Its sharpness and light when its stop limits the beam, or the reason why it has none.
    pub score: Result<ParetoPoint, String>,
}

impl ScoredLens {
    /// Evaluates a lens; a panic is an error, too.
    pub(super) fn new(lens: Arc<Lens>) -> Self {
        let score = catch_panic(|| score(&lens));
        Self { lens, score }
    }
}

fn score(lens: &Lens) -> Result<ParetoPoint, String> {
    let lens = limited_by_stop(lens).map_err(|why| why.to_string())?;
    ParetoPoint::evaluate(&lens, None, ERROR).map_err(|why| why.to_string())
}

/// Evaluates the design in the background, once for each version of it.
#[derive(Debug)]
pub(super) struct DesignScore {
    worker: LatestRequestWorker<Arc<Lens>, ScoredLens>,
    requested: Option<Arc<Lens>>,
}

impl DesignScore {
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let worker = LatestRequestWorker::spawn("score", wake, |lens, output| {
            output.publish(ScoredLens::new(lens));
        })?;
        Ok(Self { worker, requested: None })
    }

    /// Requests the score of the design while there is a run to compare it with.
    pub(super) fn sync(&mut self, design: &Arc<Lens>, is_needed: bool) {
        if !is_needed {
            self.requested = None;
        } else if !self.requested.as_ref().is_some_and(|lens| Arc::ptr_eq(lens, design)) {
            self.requested = Some(Arc::clone(design));
            self.worker.request(Arc::clone(design));
        }
    }

    /// The latest score, maybe of the design before; `None` while it is not needed.
    pub(super) fn latest(&self) -> Option<Arc<ScoredLens>> {
        self.worker.latest().filter(|_| self.requested.is_some())
    }
}
