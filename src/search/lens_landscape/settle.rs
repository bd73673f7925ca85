//! Limits kept exactly: a lens near one that a search has found, at which every limit of the goal holds.
//!
//! A search counts limits as penalties, so that mutants may break them on their way; a minimum of the loss
//! lies a little outside of them. What is retained is moved to where they hold as constraints.

use super::LensLandscape;
use crate::lens::Lens;
use crate::merit::{DerivativeLevel, Goal, LimitTreatment, Merit, MeritError};
use crate::optimize::{DescentMethod, Optimizer, start_from};
use crate::search::Settlement;
use std::sync::Arc;

/// The largest violation of a limit, in its unit, of a lens that keeps it.
const KEPT: f64 = 1e-9;
/// The steps of a constrained descent that leads a lens in where a correction is not enough, and how often
/// they are tried.
const STEPS: usize = 8;
const ROUNDS: usize = 3;

impl LensLandscape {
    /// The merit function of a lens with the limits of the goal as constraints.
    ///
    /// # Errors
    /// The lens has no merit.
    pub fn constrained_merit(&self, lens: &Lens) -> Result<Merit, MeritError> {
        let goal = Goal { limits: LimitTreatment::Constraints, ..self.goal.clone() };
        let merit = Merit::new(&self.with_variables(lens), &goal, self.local.tolerance)?;
        Ok(merit.with_initial_light(&self.light))
    }

    /// The largest violation of a limit of the goal, in its unit; 0 if all are kept.
    ///
    /// # Errors
    /// The lens has no merit.
    pub fn limit_violation(&self, lens: &Lens) -> Result<f64, MeritError> {
        violation(&self.constrained_merit(lens)?, lens)
    }

    /// A lens near another one that keeps every limit of the goal.
    pub(super) fn settlement(&self, lens: &Arc<Lens>) -> Settlement<Arc<Lens>> {
        let Ok(merit) = self.constrained_merit(lens) else {
            return Settlement::Broken { gradients: 0 };
        };
        if violation(&merit, lens).is_ok_and(|violation| violation <= KEPT) {
            return Settlement::Kept;
        }
        let free = self.with_variables(lens);
        let tolerance = self.local.tolerance;
        let started = start_from(DescentMethod::TrustRegion, merit, &free, tolerance);
        let Ok(mut optimizer) = started else { return Settlement::Broken { gradients: 1 } };
        for round in 0..ROUNDS {
            if round > 0 && take_steps(optimizer.as_mut()) {
                break;
            }
            optimizer.verify_best();
            let mut there = optimizer.best().clone();
            there.variables.clone_from(&lens.variables);
            if self.limit_violation(&there).is_ok_and(|violation| violation <= KEPT)
                && let Ok(loss) = self.evaluate(&there)
            {
                let gradients = optimizer.evaluations() as u64;
                return Settlement::Restored { point: Arc::new(there), loss, gradients };
            }
        }
        Settlement::Broken { gradients: optimizer.evaluations() as u64 }
    }

    /// A lens that a search has found, moved to where every limit of the goal is kept; the lens itself if it
    /// keeps them or if no such lens was found near it.
    pub fn settled(&self, lens: &Arc<Lens>) -> Arc<Lens> {
        match self.settlement(lens) {
            Settlement::Restored { point, .. } => point,
            Settlement::Kept | Settlement::Broken { .. } => lens.clone(),
        }
    }
}

/// The largest violation of the limits of a merit function by a lens.
fn violation(merit: &Merit, lens: &Lens) -> Result<f64, MeritError> {
    if !merit.has_limits() {
        return Ok(0.0);
    }
    let found = merit.evaluate_with_limits(&merit.values(lens), DerivativeLevel::Value)?;
    Ok(found.limits.iter().map(crate::merit::Limit::violation).fold(0.0, f64::max))
}

/// Takes some steps; true if the descent had ended before.
fn take_steps(optimizer: &mut dyn Optimizer) -> bool {
    for step in 0..STEPS {
        if optimizer.step().finished {
            return step == 0;
        }
    }
    false
}
