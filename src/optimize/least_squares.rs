//! Damped least squares: the normal equations of the residuals with Marquardt's damping.
//!
//! `(JᵀJ + λ diag JᵀJ) δ = −Jᵀ r` in scaled variables, variables at a bound held there. A step that
//! does not reduce the merit, or makes the lens invalid, raises the damping; a good one lowers it
//! (Marquardt 1963; Nielsen 1999 for the update).

use super::state::OptimizerState;
use super::{OptimizationProgress, Optimizer};
use crate::lens::Lens;
use crate::merit::{DerivativeLevel, Merit, MeritError, SumOfSquares, TermValue};
use nalgebra::{DMatrix, DVector};

/// The first damping.
const DAMPING: f64 = 1e-3;
/// How much more a step is damped after the first one that was no good; twice as much each time.
const GROWTH: f64 = 2.0;
const LEAST_DAMPING: f64 = 1e-12;
/// Above this no step is worth taking.
const MOST_DAMPING: f64 = 1e10;
/// Relative improvement below which a step counts as none.
const SMALLEST_GAIN: f64 = 1e-10;
/// Relative improvement below which a step hardly gains anything.
const SMALL_GAIN: f64 = 1e-4;
/// As many steps without a gain end the search.
const PATIENCE: usize = 3;

#[derive(Debug)]
pub(super) struct LeastSquaresOptimizer {
    state: OptimizerState,
    sum: SumOfSquares,
    damping: f64,
    growth: f64,
    idle: usize,
    /// When this often the merit was taken, no other damping is tried.
    max_evaluations: usize,
}

impl LeastSquaresOptimizer {
    pub(super) fn new(merit: Merit, lens: &Lens) -> Result<Self, MeritError> {
        let (state, sum) = OptimizerState::with_evaluation(merit, lens, DerivativeLevel::Normal)?;
        Ok(Self::resume(state, sum, None))
    }

    /// A search that goes on with the damping, and its growth, of one before.
    pub(super) fn resume(
        state: OptimizerState,
        sum: SumOfSquares,
        damping: Option<[f64; 2]>,
    ) -> Self {
        let [damping, growth] = damping.unwrap_or([DAMPING, GROWTH]);
        Self { state, sum, damping, growth, idle: 0, max_evaluations: usize::MAX }
    }

    /// The damping, and how fast it grows.
    pub(super) fn damping(&self) -> [f64; 2] {
        [self.damping, self.growth]
    }

    /// Where it stands.
    pub(super) fn into_state(self) -> OptimizerState {
        self.state
    }

    /// So many steps, those that are tried and not taken included, or fewer where hardly anything is
    /// left to gain.
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

    /// The damped step in scaled variables, and the reduction of the merit that it promises.
    fn proposal(&self) -> Option<(Vec<f64>, f64)> {
        let scales = DVector::from_column_slice(&self.state.scales);
        let gradient: Vec<f64> = self.sum.gradient.iter().copied().collect();
        let held = self.state.at_bounds(&gradient);
        let half = self.sum.gradient.component_mul(&scales) * 0.5;
        let mut matrix = &self.sum.normal * 1.0;
        let mut right = -&half;
        let largest =
            (0..scales.len()).map(|i| matrix[(i, i)] * scales[i].powi(2)).fold(0.0, f64::max);
        scale(&mut matrix, &scales);
        for i in 0..scales.len() {
            if held[i] {
                matrix.row_mut(i).fill(0.0);
                matrix.column_mut(i).fill(0.0);
                matrix[(i, i)] = 1.0;
                right[i] = 0.0;
            } else {
                let floor = 1e-9 * largest;
                matrix[(i, i)] += self.damping * matrix[(i, i)].max(floor) + f64::MIN_POSITIVE;
            }
        }
        let step = matrix.cholesky()?.solve(&right);
        let promised =
            -(2.0 * half.dot(&step) + step.dot(&(scaled(&self.sum.normal, &scales) * &step)));
        Some((step.iter().copied().collect(), promised))
    }

    fn lower_damping(&mut self, gain: f64) {
        self.damping =
            (self.damping * (1.0 - (2.0 * gain - 1.0).powi(3)).max(1.0 / 5.0)).max(LEAST_DAMPING);
        self.growth = GROWTH;
    }

    fn raise_damping(&mut self) {
        self.damping *= self.growth;
        self.growth *= 2.0;
    }

    fn differentiate(&mut self) {
        if let Ok(sum) = self.state.merit.evaluate(&self.state.values, DerivativeLevel::Normal) {
            self.sum = sum;
        }
    }

    /// Tries dampings until a step reduces the merit; returns how much of the first one was taken.
    pub(super) fn descend(&mut self) -> f64 {
        let before = self.state.value;
        let mut first = None;
        while self.damping < MOST_DAMPING {
            if self.state.evaluations >= self.max_evaluations {
                return 0.0;
            }
            let Some((step, promised)) = self.proposal() else {
                self.raise_damping();
                continue;
            };
            let length = step.iter().map(|v| v * v).sum::<f64>().sqrt();
            let asked = *first.get_or_insert(length);
            let (accepted, sum) =
                self.state.advance(&step, DerivativeLevel::Normal, |v| v < before);
            if let Some(sum) = sum {
                self.sum = sum;
                let gain = (before - self.state.value) / promised.max(f64::MIN_POSITIVE);
                if accepted < 1.0 {
                    self.raise_damping();
                } else {
                    self.lower_damping(gain.min(1.0));
                }
                return if asked > 0.0 { accepted * length / asked } else { 1.0 };
            }
            self.raise_damping();
        }
        (self.damping, self.growth) = (DAMPING, GROWTH);
        0.0
    }
}

/// `S A S` for a diagonal S.
fn scaled(matrix: &DMatrix<f64>, scales: &DVector<f64>) -> DMatrix<f64> {
    let mut copy = matrix.clone();
    scale(&mut copy, scales);
    copy
}

fn scale(matrix: &mut DMatrix<f64>, scales: &DVector<f64>) {
    for i in 0..scales.len() {
        for j in 0..scales.len() {
            matrix[(i, j)] *= scales[i] * scales[j];
        }
    }
}

impl Optimizer for LeastSquaresOptimizer {
    fn step(&mut self) -> OptimizationProgress {
        if self.idle >= PATIENCE || self.state.has_ended() {
            return self.state.progress(0.0, true);
        }
        let before = self.state.value;
        let accepted = self.descend();
        let gain = (before - self.state.value) / before.max(f64::MIN_POSITIVE);
        self.idle = if gain > SMALLEST_GAIN { 0 } else { self.idle + 1 };
        let finished = self.idle >= PATIENCE;
        if finished {
            self.verify_best();
        }
        let progress = self.state.progress(accepted, finished);
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
