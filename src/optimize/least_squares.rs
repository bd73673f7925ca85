//! Damped least squares: the normal equations of the residuals with Marquardt's damping.
//!
//! `(JᵀJ + λ diag JᵀJ) δ = −Jᵀ r` in scaled variables, with variables at a bound fixed. A step that
//! does not reduce the merit, or makes the lens invalid, raises the damping; a successful one
//! lowers it (Marquardt 1963; Nielsen 1999 for the update).

use super::state::OptimizerState;
use super::{OptimizationEnd, OptimizationProgress, Optimizer};
use crate::lens::Lens;
use crate::merit::{DerivativeLevel, Merit, MeritError, SumOfSquares, TermValue};
use crate::solve::{Damping, NielsenDamping, damped_step, predicted_decrease};
use nalgebra::DVector;

/// The relative improvement below which a step counts as no improvement.
const SMALLEST_GAIN: f64 = 1e-10;
/// The relative improvement below which a segment counts a step as idle.
const SMALL_GAIN: f64 = 1e-4;
/// The number of consecutive idle steps that end the descent.
const PATIENCE: usize = 3;

#[derive(Debug)]
pub(super) struct LeastSquaresOptimizer {
    state: OptimizerState,
    sum: SumOfSquares,
    damping: NielsenDamping,
    idle: usize,
    /// The number of evaluations after which no further damping is tried.
    max_evaluations: usize,
}

impl LeastSquaresOptimizer {
    pub(super) fn new(merit: Merit, lens: &Lens) -> Result<Self, MeritError> {
        let (state, sum) = OptimizerState::with_evaluation(merit, lens, DerivativeLevel::Normal)?;
        Ok(Self::resume(state, sum, None))
    }

    /// A search that continues with the damping of a previous one.
    pub(super) fn resume(
        state: OptimizerState,
        sum: SumOfSquares,
        damping: Option<NielsenDamping>,
    ) -> Self {
        let damping = damping.unwrap_or_default();
        Self { state, sum, damping, idle: 0, max_evaluations: usize::MAX }
    }

    /// The damping of the next step.
    pub(super) fn damping(&self) -> NielsenDamping {
        self.damping
    }

    /// The state of the descent.
    pub(super) fn into_state(self) -> OptimizerState {
        self.state
    }

    /// Takes up to this many steps, rejected ones included; fewer when the merit hardly improves.
    pub(super) fn take_steps(&mut self, steps: usize) {
        self.max_evaluations = self.state.evaluations + steps;
        let mut idle = 0;
        while self.state.evaluations < self.max_evaluations {
            let before = self.state.value;
            let accepted = self.descend();
            let gain = (before - self.state.value) / before.max(f64::MIN_POSITIVE);
            idle = if gain > SMALL_GAIN { 0 } else { idle + 1 };
            if accepted == 0.0 || idle >= PATIENCE {
                return;
            }
        }
    }

    /// The damped step in scaled variables, and the decrease of the merit that it promises.
    fn proposal(&self) -> Option<(Vec<f64>, f64)> {
        let scales = DVector::from_column_slice(&self.state.scales);
        let active = self.state.at_bounds(self.sum.gradient.as_slice());
        let half_gradient = self.sum.gradient.component_mul(&scales) * 0.5;
        let mut normal = self.sum.normal.clone();
        for i in 0..scales.len() {
            for j in 0..scales.len() {
                normal[(i, j)] *= scales[i] * scales[j];
            }
        }
        let damping = Damping::Marquardt(self.damping.damping);
        let step = damped_step(&normal, &half_gradient, &active, damping)?;
        let predicted = predicted_decrease(&normal, &half_gradient, &step);
        Some((step.as_slice().to_vec(), predicted))
    }

    fn differentiate(&mut self) {
        if let Ok(sum) = self.state.merit.evaluate(&self.state.values, DerivativeLevel::Normal) {
            self.sum = sum;
        }
    }

    /// Raises the damping until a step reduces the merit; returns the length of that step relative
    /// to the first one tried, 0 if none does.
    pub(super) fn descend(&mut self) -> f64 {
        let before = self.state.value;
        let mut first = None;
        while !self.damping.is_exhausted() {
            if self.state.evaluations >= self.max_evaluations {
                return 0.0;
            }
            let Some((step, predicted)) = self.proposal() else {
                self.damping.raise();
                continue;
            };
            let length = step.iter().map(|v| v * v).sum::<f64>().sqrt();
            let asked = *first.get_or_insert(length);
            let (accepted, sum) =
                self.state.advance(&step, DerivativeLevel::Normal, |v| v < before);
            if let Some(sum) = sum {
                self.sum = sum;
                let gain = (before - self.state.value) / predicted.max(f64::MIN_POSITIVE);
                if accepted < 1.0 {
                    self.damping.raise();
                } else {
                    self.damping.lower(gain.min(1.0));
                }
                return if asked > 0.0 { accepted * length / asked } else { 1.0 };
            }
            self.damping.raise();
        }
        self.damping = NielsenDamping::default();
        0.0
    }
}

impl Optimizer for LeastSquaresOptimizer {
    fn step(&mut self) -> OptimizationProgress {
        if self.idle >= PATIENCE || self.state.has_ended() {
            return self.state.progress(0.0, Some(OptimizationEnd::NoGain));
        }
        let before = self.state.value;
        let accepted = self.descend();
        let gain = (before - self.state.value) / before.max(f64::MIN_POSITIVE);
        self.idle = if gain > SMALLEST_GAIN { 0 } else { self.idle + 1 };
        let finished = self.idle >= PATIENCE;
        if finished {
            self.verify_best();
        }
        let progress = self.state.progress(accepted, finished.then_some(OptimizationEnd::NoGain));
        if self.state.resample_if_due() {
            self.differentiate();
        }
        progress
    }

    fn verify_best(&mut self) {
        self.state.verify_best();
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
