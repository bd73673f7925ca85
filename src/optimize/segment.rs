//! A segment of a descent: steps that depend only on the lens at its start and on the serializable
//! [`DescentState`], so that a search can be saved between two segments and resumed with identical
//! results.

use super::least_squares::LeastSquaresOptimizer;
use super::limited::LimitedOptimizer;
use super::state::OptimizerState;
use super::trust_region::TrustRegionOptimizer;
use super::{DescentMethod, Optimizer as _};
use crate::lens::Lens;
use crate::merit::{DerivativeLevel, Merit, MeritError};
use crate::solve::{AdamMoments, LimitedTrustRegionMemory, NielsenDamping, TrustRegionMemory};
use serde::{Deserialize, Serialize};

/// The settings of a segment of a descent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentSettings {
    /// The local optimizer.
    pub method: DescentMethod,
    /// The number of steps to try.
    pub steps: usize,
    /// The rate of Adam at the start of a descent, in scaled variables: a step of 1 changes the
    /// residuals by their own size.
    pub rate: f64,
}

/// The settings of a segment that keeps the limits of its goal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitedSegment {
    /// The number of evaluations with derivatives that are never exceeded.
    pub evaluations: usize,
    /// The relative tolerance of the spots.
    pub tolerance: f64,
}

/// The state of a descent between two segments; the default starts a new descent.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DescentState {
    moments: AdamMoments,
    /// The rate of Adam relative to the initial one.
    pace: Option<f64>,
    /// The damping of least squares and its growth factor.
    damping: Option<NielsenDamping>,
    /// The trust region.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    region: Option<TrustRegionMemory>,
    /// The trust region of segments that keep the limits.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    limited_region: Option<LimitedTrustRegionMemory>,
    /// True if the next segment keeps the limits of the goal.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub keeps_limits: bool,
    /// True if limits are penalties to the end of the descent.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub penalties_only: bool,
    /// The most times as long as the first one that a later segment which keeps the limits may be; `None`: as
    /// long.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub largest_multiple: Option<usize>,
    /// The number of segments in a row so far that kept the limits.
    #[serde(default)]
    pub limited_segments: usize,
    /// True if the last segment met a test that ends the descent.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub has_ended: bool,
    /// The number of segments that kept the limits and gained nothing.
    #[serde(default)]
    pub failures_with_limits: usize,
    /// The number of steps so far.
    pub steps: usize,
}

/// The result of a segment.
#[derive(Debug, Clone, PartialEq)]
pub struct SegmentResult {
    /// The lens at its end.
    pub lens: Lens,
    /// The merit at its start.
    pub initial_merit: f64,
    /// The number of evaluations of the merit with derivatives, those of rejected steps included;
    /// at least 1 for the start.
    pub gradients: usize,
    /// True if a test of the method has ended the descent: more steps are expected to gain nothing.
    pub has_ended: bool,
}

/// The evaluations of a segment that are left for corrections at its end.
const CORRECTIONS: usize = 8;
/// The minimum rate, relative to the initial one.
const MIN_RATE: f64 = 0.02;
/// The maximum rate, relative to the initial one, and its growth after a successful segment.
const MAX_RATE: f64 = 2.0;
const RATE_GROWTH: f64 = 1.2;
/// The factor of the rate after a segment without improvement.
const RATE_DECAY: f64 = 0.8;
/// The factor of the trust region after a segment that worsened the merit.
const REGION_DECAY: f64 = 0.25;

impl DescentState {
    /// A new descent whose limits are penalties to its end.
    pub fn with_penalties() -> Self {
        Self { penalties_only: true, ..Self::default() }
    }

    /// Raises the rate after a segment that improved the merit.
    pub fn grow_step(&mut self) {
        self.pace = Some((RATE_GROWTH * self.pace.unwrap_or(1.0)).min(MAX_RATE));
    }

    /// Lowers the rate after a segment that did not improve the merit.
    pub fn shrink_step(&mut self) {
        self.pace = Some((RATE_DECAY * self.pace.unwrap_or(1.0)).max(MIN_RATE));
    }

    /// Halves the rate and resets the moments after a segment that worsened the merit.
    pub fn restart_slower(&mut self) {
        self.pace = Some((0.5 * self.pace.unwrap_or(1.0)).max(MIN_RATE));
        self.moments = AdamMoments::default();
        self.region.iter_mut().for_each(|region| region.shrink(REGION_DECAY));
        self.limited_region.iter_mut().for_each(|region| region.shrink(REGION_DECAY));
    }
}

/// Takes the steps of a segment from a lens, whose rays `merit` holds. A step that would make the
/// lens invalid is shortened; if none remains, the segment ends early.
///
/// # Errors
/// A lens without variables or without a merit.
pub fn run_segment(
    merit: Merit,
    lens: &Lens,
    asked: SegmentSettings,
    memory: &mut DescentState,
) -> Result<SegmentResult, MeritError> {
    let (mut state, sum) = OptimizerState::with_evaluation(merit, lens, DerivativeLevel::Normal)?;
    memory.steps += asked.steps;
    let before = sum.value;
    let state = match asked.method {
        DescentMethod::Adam => {
            state.rescale(&sum);
            adam(state, sum.gradient.as_slice(), asked, memory)
        }
        DescentMethod::TrustRegion => {
            let search = TrustRegionOptimizer::resume(state, &sum, 0.0);
            let mut search = search.with_memory(memory.region.as_ref());
            search.take_steps(asked.steps);
            memory.region = search.memory();
            search.into_state()
        }
        DescentMethod::DampedLeastSquares => {
            let mut search = LeastSquaresOptimizer::resume(state, sum, memory.damping);
            search.take_steps(asked.steps);
            memory.damping = Some(search.damping());
            search.into_state()
        }
    };
    Ok(SegmentResult {
        lens: state.current,
        initial_merit: before,
        gradients: (state.evaluations - 1).max(1),
        has_ended: false,
    })
}

/// The segment of a descent that keeps the limits of its goal: steps, and corrections after which the lens
/// at its end keeps every limit if one near it does.
///
/// # Errors
/// A lens without variables or without a merit; limits that contradict one another.
pub fn run_limited_segment(
    merit: Merit,
    lens: &Lens,
    asked: LimitedSegment,
    memory: &mut DescentState,
) -> Result<SegmentResult, MeritError> {
    let search = LimitedOptimizer::new(merit, lens, asked.tolerance)?;
    let initial_merit = search.objective();
    let most = asked.evaluations;
    let mut search = search.into_segment(most, memory.limited_region.as_ref());
    memory.steps += most;
    // Steps that need no evaluation come to an end too.
    for _ in 0..most {
        if search.evaluations_left() <= CORRECTIONS || search.step().finished {
            break;
        }
    }
    memory.limited_region = search.memory();
    let has_ended = search.is_at_minimum();
    search.verify_best();
    let state = search.into_state();
    let gradients = (state.evaluations - 1).max(1);
    Ok(SegmentResult { lens: state.best, initial_merit, gradients, has_ended })
}

fn adam(
    mut state: OptimizerState,
    gradient: &[f64],
    asked: SegmentSettings,
    memory: &mut DescentState,
) -> OptimizerState {
    let mut gradient = gradient.to_vec();
    for _ in 0..asked.steps {
        let rate = asked.rate * memory.pace.unwrap_or(1.0);
        let step = state.adam_step(&mut memory.moments, &gradient, rate);
        let (_, sum) = state.advance(&step, DerivativeLevel::Gradient, |_| true);
        let Some(sum) = sum else {
            memory.restart_slower();
            break;
        };
        gradient.copy_from_slice(sum.gradient.as_slice());
    }
    state
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_falls_after_segments_without_improvement_and_rises_after_others() {
        let mut state = DescentState::default();
        let mut paces = vec![1.0];
        for _ in 0..40 {
            state.shrink_step();
            paces.extend(state.pace);
        }
        assert!(paces[..6].is_sorted_by(|a, b| a > b), "{paces:?}");
        assert_eq!(paces.last(), Some(&MIN_RATE));
        state.grow_step();
        assert!(state.pace > Some(MIN_RATE));
        (0..100).for_each(|_| state.grow_step());
        assert_eq!(state.pace, Some(MAX_RATE));
        state.restart_slower();
        assert_eq!(state.pace, Some(0.5 * MAX_RATE));
    }
}
