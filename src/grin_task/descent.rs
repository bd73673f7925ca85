//! The methods that a task may ask for, behind one step.

use super::check::TaskError;
use super::hold::Hold;
use super::least_squares::{LeastSquares, Rows};
use super::medium::Medium;
use super::scene::{Counts, Evaluation, Shot, evaluate, rows};
use super::task::Method;
use crate::grin::{Adam, Lbfgs, Limits};

/// Adam's rate falls to this part over the second half of a level.
const ANNEALED: f64 = 0.1;

/// What descends.
#[derive(Debug, Clone)]
pub(super) enum Descent {
    /// With the rate at the beginning of the level.
    Adam(Adam, f64),
    Lbfgs(Lbfgs),
    LeastSquares(LeastSquares),
}

/// The loss as a function of the numbers of a field.
pub(super) struct Problem<'a> {
    pub(super) shape: &'a Medium,
    pub(super) shots: &'a [Shot],
    pub(super) hold: &'a Hold,
    pub(super) limits: &'a Limits,
}

/// What a step did.
pub(super) struct Step {
    pub(super) loss: f64,
    pub(super) counts: Counts,
    /// How often the loss was asked for.
    pub(super) evaluations: usize,
    /// Whether further steps would change nothing.
    pub(super) settled: bool,
}

impl Problem<'_> {
    fn medium(&self, parameters: &[f64]) -> Medium {
        let mut medium = self.shape.clone();
        medium.parameters_mut().copy_from_slice(parameters);
        medium
    }

    fn evaluate(&self, parameters: &[f64]) -> Result<Evaluation, TaskError> {
        evaluate(self.medium(parameters).field(), self.shots, self.hold)
    }

    fn rows(&self, parameters: &[f64]) -> Result<Rows, TaskError> {
        rows(self.medium(parameters).field(), self.shots, self.hold)
    }
}

impl Descent {
    pub(super) fn new(method: Method, level: usize) -> Self {
        match method {
            Method::Adam { rate, fall } => {
                let rate = rate * fall.powi(level as i32);
                Self::Adam(Adam::new(rate), rate)
            }
            Method::Lbfgs => Self::Lbfgs(Lbfgs::default()),
            Method::LeastSquares => Self::LeastSquares(LeastSquares::default()),
        }
    }

    /// Forgets what it knows of the loss, which has become another one.
    pub(super) fn restart(&mut self) {
        match self {
            Self::Adam(..) => {}
            Self::Lbfgs(lbfgs) => lbfgs.restart(),
            Self::LeastSquares(squares) => squares.restart(),
        }
    }

    /// Takes one step; `share` of the level is done.
    pub(super) fn step(
        &mut self,
        parameters: &mut [f64],
        problem: &Problem<'_>,
        share: f64,
    ) -> Result<Step, TaskError> {
        let limits = problem.limits;
        match self {
            Self::Adam(adam, rate) => {
                let found = problem.evaluate(parameters)?;
                adam.rate = *rate * ANNEALED.powf((2.0 * share - 1.0).max(0.0));
                adam.step(parameters, &found.gradient, limits);
                let counts = found.counts();
                Ok(Step { loss: found.loss, counts, evaluations: 1, settled: false })
            }
            Self::Lbfgs(lbfgs) => by_lbfgs(lbfgs, parameters, problem),
            Self::LeastSquares(squares) => {
                let mut evaluations = 0;
                let (loss, settled) = squares.step(parameters, limits, |p| {
                    evaluations += 1;
                    problem.rows(p)
                })?;
                Ok(Step { loss, counts: Counts::default(), evaluations, settled })
            }
        }
    }
}

fn by_lbfgs(
    lbfgs: &mut Lbfgs,
    parameters: &mut [f64],
    problem: &Problem<'_>,
) -> Result<Step, TaskError> {
    let (mut failed, mut counts) = (None, Counts::default());
    let done = lbfgs.step(parameters, problem.limits, |p| match problem.evaluate(p) {
        Ok(found) => {
            counts = found.counts();
            (found.loss, found.gradient)
        }
        Err(error) => {
            failed = Some(error);
            (f64::INFINITY, vec![0.0; p.len()])
        }
    });
    failed.map_or(Ok(()), Err)?;
    Ok(Step { loss: done.value, counts, evaluations: done.evaluations, settled: done.finished })
}
