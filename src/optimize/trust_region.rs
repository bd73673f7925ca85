//! A trust-region descent with secant second derivatives: [`TrustRegion`] applied to a merit
//! function.
//!
//! The merit of a step is that of rays found for an earlier lens. From time to time rays are found
//! anew: as long as both merits agree to the tolerance of the spots the earlier ones stay, so that
//! the function does not change under the method; otherwise the new ones take their place.
//!
//! Limits as penalties are known to the model by themselves, and what needs no rays, such as a focal
//! length, is kept as a step has promised it.

use super::state::OptimizerState;
use super::{OptimizationEnd, OptimizationProgress, Optimizer};
use crate::lens::Lens;
use crate::merit::{DerivativeLevel, Merit, MeritError, SumOfSquares, TermValue};
use crate::solve::{
    LeastSquaresPoint, SeparateResidual, TrustRegion, TrustRegionMemory, TrustRegionStep,
};
use nalgebra::DVector;

/// The number of accepted steps between two checks of the rays, at most.
const CHECK_INTERVAL: usize = 20;
/// The projected gradient relative to the first one that ends the descent.
const SMALL_GRADIENT: f64 = 1e-6;
/// The promised gain relative to the merit above which a small gradient ends nothing.
const FLAT: f64 = 1e-3;
/// The number of consecutive steps that promise nothing above the tolerance which end the descent.
const PATIENCE: usize = 5;

/// The number of corrections of a trial.
const CORRECTIONS: usize = 3;
/// The promised gain, relative to the tolerance of the spots, below which a step is idle.
const SMALL_GAIN: f64 = 1e-2;

#[derive(Debug)]
pub(super) struct TrustRegionOptimizer {
    state: OptimizerState,
    region: TrustRegion,
    /// The merit at the current values, by scaled variables.
    point: LeastSquaresPoint,
    /// The norm of the projected gradient at the start.
    first_gradient: f64,
    tolerance: f64,
    /// The accepted steps since the rays were checked, and their number until the next check.
    unchecked: usize,
    interval: usize,
    /// The consecutive steps that promised nothing above the tolerance.
    idle: usize,
    end: Option<OptimizationEnd>,
}

impl TrustRegionOptimizer {
    pub(super) fn new(merit: Merit, lens: &Lens, tolerance: f64) -> Result<Self, MeritError> {
        let (state, sum) = OptimizerState::with_evaluation(merit, lens, DerivativeLevel::Normal)?;
        Ok(Self::resume(state, &sum, tolerance))
    }

    /// A descent from a lens that has been evaluated.
    pub(super) fn resume(state: OptimizerState, sum: &SumOfSquares, tolerance: f64) -> Self {
        let mut region = TrustRegion::new(state.values.len());
        let point = scaled_point(&state, sum);
        let first_gradient = region.projected_gradient(&point, &state.room());
        Self {
            state,
            region,
            point,
            first_gradient,
            tolerance,
            unchecked: 0,
            interval: CHECK_INTERVAL,
            idle: 0,
            end: None,
        }
    }

    /// The same descent with the region of an earlier one.
    pub(super) fn with_memory(mut self, memory: Option<&TrustRegionMemory>) -> Self {
        if let Some(memory) = memory {
            self.region = TrustRegion::resume(memory, &self.state.scales);
        }
        self
    }

    /// The region, to go on with; `None` once it has vanished.
    pub(super) fn memory(&self) -> Option<TrustRegionMemory> {
        if self.region.is_exhausted(&self.point) {
            return None;
        }
        self.region.memory(&self.state.scales)
    }

    /// The state of the descent.
    pub(super) fn into_state(self) -> OptimizerState {
        self.state
    }

    /// Tries up to this many steps with the same rays.
    pub(super) fn take_steps(&mut self, steps: usize) {
        (0..steps).take_while(|_| self.try_step().is_ok()).for_each(drop);
    }

    /// Tries one step; returns the part of it that was taken, 0 or 1, or the reason for which none
    /// is worth trying.
    fn try_step(&mut self) -> Result<f64, OptimizationEnd> {
        let room = self.state.room();
        let gradient = self.region.projected_gradient(&self.point, &room);
        let step = self.region.propose(&self.point, &room).ok_or(OptimizationEnd::Gradient)?;
        // A step within the region promises no more than one without it, which takes longer to find.
        let promises_at_most = |part: f64| {
            let most = part * self.point.value;
            step.predicted <= most && self.region.attainable_decrease(&self.point, &room) <= most
        };
        // At the start of a descent broken limits make gradients that dwarf those of sharpness.
        if gradient <= SMALL_GRADIENT * self.first_gradient && promises_at_most(FLAT) {
            return Err(OptimizationEnd::Gradient);
        }
        if self.region.is_exhausted(&self.point) {
            let is_flat = promises_at_most(FLAT);
            return Err(if is_flat { OptimizationEnd::Tolerance } else { OptimizationEnd::NoGain });
        }
        let is_idle = promises_at_most(SMALL_GAIN * self.tolerance);
        self.idle = if is_idle { self.idle + 1 } else { 0 };
        if self.idle >= PATIENCE {
            return Err(OptimizationEnd::Tolerance);
        }
        Ok(if self.take(&step) { 1.0 } else { 0.0 })
    }

    /// Evaluates a step, and takes it if that lowers the merit.
    fn take(&mut self, step: &TrustRegionStep) -> bool {
        let values = self.corrected(step);
        let change = self.state.scaled_change(&values);
        let (sum, pupils) = match self.state.evaluate(&values, DerivativeLevel::Normal) {
            Ok(found) => found,
            Err(cause) => {
                self.state.record_refusal(change.as_slice(), &cause);
                self.region.note_failure(step);
                return false;
            }
        };
        self.state.evaluations += 1;
        let to = scaled_point(&self.state, &sum);
        let accepted = self.region.note_trial(step, &change, &self.point, &to);
        if accepted {
            self.state.accept_step(values, sum.value, pupils);
            self.point = to;
            self.unchecked += 1;
        }
        accepted
    }

    /// The values behind a step, corrected until the residuals that need no rays are as the step has
    /// promised.
    fn corrected(&self, step: &TrustRegionStep) -> Vec<f64> {
        let mut values = self.state.proposal(step.change.as_slice(), 1.0);
        if !self.point.separate.iter().any(|residual| residual.is_cheap) {
            return values;
        }
        for _ in 0..CORRECTIONS {
            let found = self.state.check_finite(&values);
            let found = found.and_then(|()| self.state.merit.residuals_without_rays(&values));
            let Ok(found) = found else { break };
            let now = scaled_residuals(&self.state, &found);
            let Some(change) = self.region.correction(step, &self.point, &now) else { break };
            values = self.state.moved(&values, change.as_slice());
        }
        values
    }

    /// Ends the descent, unless the rays turn out to be others by now.
    fn conclude(&mut self, end: OptimizationEnd) {
        if self.unchecked == 0 || !self.check_rays() {
            self.end = Some(end);
        }
        self.idle = 0;
    }

    /// Compares the merit with that of newly found rays; true if those took the place of the
    /// earlier ones.
    fn check_rays(&mut self) -> bool {
        self.unchecked = 0;
        let failures = self.state.failed_verifications;
        let Some(sum) = self.state.check_rays(2.0 * self.tolerance) else {
            self.interval = CHECK_INTERVAL;
            return false;
        };
        self.interval = (self.interval / 2).max(1);
        self.region.note_other_function(self.state.failed_verifications > failures);
        self.point = scaled_point(&self.state, &sum);
        if self.state.has_ended() {
            self.end = Some(OptimizationEnd::Tolerance);
        }
        true
    }
}

/// The merit with its derivatives by scaled variables.
pub(super) fn scaled_point(state: &OptimizerState, sum: &SumOfSquares) -> LeastSquaresPoint {
    let scales = DVector::from_column_slice(&state.scales);
    let half_gradient = sum.gradient.component_mul(&scales) * 0.5;
    let mut normal = sum.normal.clone();
    for i in 0..scales.len() {
        for j in 0..scales.len() {
            normal[(i, j)] *= scales[i] * scales[j];
        }
    }
    let separate = scaled_residuals(state, &sum.separate);
    LeastSquaresPoint { value: sum.value, half_gradient, normal, separate }
}

/// Residuals with their derivatives by scaled variables.
fn scaled_residuals(
    state: &OptimizerState,
    residuals: &[SeparateResidual],
) -> Vec<SeparateResidual> {
    let scales = DVector::from_column_slice(&state.scales);
    let scaled = |residual: &SeparateResidual| SeparateResidual {
        slope: residual.slope.component_mul(&scales),
        ..*residual
    };
    residuals.iter().map(scaled).collect()
}

impl Optimizer for TrustRegionOptimizer {
    fn step(&mut self) -> OptimizationProgress {
        if self.end.is_some() {
            return self.state.progress(0.0, self.end);
        }
        let tried = self.try_step();
        if let Err(end) = tried {
            self.conclude(end);
        } else if self.unchecked >= self.interval {
            self.check_rays();
        }
        self.state.progress(tried.unwrap_or(0.0), self.end)
    }

    fn verify_best(&mut self) {
        self.check_rays();
    }

    fn best(&self) -> &Lens {
        &self.state.best
    }

    fn current(&self) -> &Lens {
        &self.state.current
    }

    fn terms(&self) -> Result<Vec<TermValue>, MeritError> {
        self.state.terms()
    }
}
