//! The optimization methods of a task behind one interface.

use crate::grin_design::GrinTaskError;
use crate::grin_design::evaluation::loss::{LossEvaluation, evaluate, evaluate_rows};
use crate::grin_design::evaluation::outcome::RayCounts;
use crate::grin_design::evaluation::penalties::FieldPenalties;
use crate::grin_design::evaluation::views::ViewRays;
use crate::grin_design::field::GrinField;
use crate::grin_design::task::GrinMethod;
use crate::solve::{Adam, Lbfgs, LevenbergMarquardt, ParameterBounds, ResidualRows};

/// Adam's rate falls to this fraction over the second half of a level.
const ANNEALED: f64 = 0.1;

/// An optimization method with its state.
#[derive(Debug, Clone)]
pub(super) enum FieldSolver {
    /// Adam, with its rate at the beginning of the level.
    Adam(Adam, f64),
    Lbfgs(Lbfgs),
    LeastSquares(LevenbergMarquardt),
}

/// The loss as a function of the parameters of a field.
pub(super) struct LossFunction<'a> {
    pub(super) shape: &'a GrinField,
    pub(super) views: &'a [ViewRays],
    pub(super) penalties: &'a FieldPenalties,
    pub(super) limits: &'a ParameterBounds,
}

/// The result of one step.
pub(super) struct SolverStep {
    pub(super) loss: f64,
    pub(super) counts: RayCounts,
    /// The number of evaluations of the loss.
    pub(super) evaluations: usize,
    /// True if further steps would change nothing.
    pub(super) converged: bool,
}

impl LossFunction<'_> {
    fn field(&self, parameters: &[f64]) -> GrinField {
        let mut field = self.shape.clone();
        field.parameters_mut().copy_from_slice(parameters);
        field
    }

    fn evaluate(&self, parameters: &[f64]) -> Result<LossEvaluation, GrinTaskError> {
        evaluate(self.field(parameters).index_field(), self.views, self.penalties)
    }

    fn rows(&self, parameters: &[f64]) -> Result<ResidualRows, GrinTaskError> {
        evaluate_rows(self.field(parameters).index_field(), self.views, self.penalties)
    }
}

impl FieldSolver {
    pub(super) fn new(method: GrinMethod, level: usize) -> Self {
        match method {
            GrinMethod::Adam { rate, fall } => {
                let rate = rate * fall.powi(level as i32);
                Self::Adam(Adam::new(rate), rate)
            }
            GrinMethod::Lbfgs => Self::Lbfgs(Lbfgs::default()),
            GrinMethod::LeastSquares => Self::LeastSquares(LevenbergMarquardt::default()),
        }
    }

    /// Discards the state that belongs to a previous loss function.
    pub(super) fn restart(&mut self) {
        match self {
            Self::Adam(..) => {}
            Self::Lbfgs(lbfgs) => lbfgs.restart(),
            Self::LeastSquares(squares) => squares.restart(),
        }
    }

    /// Takes one step; `share` is the completed fraction of the level.
    pub(super) fn step(
        &mut self,
        parameters: &mut [f64],
        problem: &LossFunction<'_>,
        share: f64,
    ) -> Result<SolverStep, GrinTaskError> {
        let limits = problem.limits;
        match self {
            Self::Adam(adam, rate) => {
                let found = problem.evaluate(parameters)?;
                adam.rate = *rate * ANNEALED.powf((2.0 * share - 1.0).max(0.0));
                adam.step(parameters, &found.gradient, limits);
                let counts = found.counts();
                Ok(SolverStep { loss: found.loss, counts, evaluations: 1, converged: false })
            }
            Self::Lbfgs(lbfgs) => step_lbfgs(lbfgs, parameters, problem),
            Self::LeastSquares(squares) => {
                let mut evaluations = 0;
                let step = squares.step(parameters, limits, |p| {
                    evaluations += 1;
                    problem.rows(p)
                })?;
                let counts = RayCounts::default();
                Ok(SolverStep { loss: step.value, counts, evaluations, converged: step.converged })
            }
        }
    }
}

fn step_lbfgs(
    lbfgs: &mut Lbfgs,
    parameters: &mut [f64],
    problem: &LossFunction<'_>,
) -> Result<SolverStep, GrinTaskError> {
    let (mut failed, mut counts) = (None, RayCounts::default());
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
    Ok(SolverStep {
        loss: done.value,
        counts,
        evaluations: done.evaluations,
        converged: done.converged,
    })
}
