//! A stretch of a descent: steps that depend on nothing but the lens where they begin and what is
//! remembered of the stretches before, so that a search can be written down between two of them
//! and taken up again without a trace.

use super::DescentMethod;
use super::least_squares::LeastSquaresOptimizer;
use super::state::OptimizerState;
use crate::lens::Lens;
use crate::merit::{DerivativeLevel, Merit, MeritError};
use crate::solve::{AdamMoments, NielsenDamping};
use serde::{Deserialize, Serialize};

/// How a stretch goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentSettings {
    /// What descends.
    pub method: DescentMethod,
    /// How many steps it tries.
    pub steps: usize,
    /// The rate of Adam at the beginning of a descent, in scaled variables: a step of one alters
    /// the residuals by as much as they are.
    pub rate: f64,
}

/// What a descent remembers from one stretch to the next; the default begins a new one.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DescentState {
    moments: AdamMoments,
    /// The part of its first rate that Adam has.
    pace: Option<f64>,
    /// The damping of least squares, and how fast it grows.
    damping: Option<NielsenDamping>,
    /// Steps so far.
    pub steps: usize,
}

/// Where a stretch has led.
#[derive(Debug, Clone, PartialEq)]
pub struct SegmentResult {
    /// The lens where it ends.
    pub lens: Lens,
    /// The merit where it began.
    pub initial_merit: f64,
    /// Steps, those that were tried and not taken included: each takes the merit and its derivatives.
    /// At least the one with which it began.
    pub gradients: usize,
}

/// The pace may not fall below this part of the first one.
const MIN_RATE: f64 = 0.02;
/// A stretch that went well is followed by a faster one, up to this part of the first pace.
const MAX_RATE: f64 = 2.0;
const RATE_GROWTH: f64 = 1.2;
/// One that led to nothing better, by a slower one.
const RATE_DECAY: f64 = 0.8;

impl DescentState {
    /// The stretch has led to something better: the next one may be bolder.
    pub fn grow_step(&mut self) {
        self.pace = Some((RATE_GROWTH * self.pace.unwrap_or(1.0)).min(MAX_RATE));
    }

    /// The stretch has led to nothing better: the next one is more cautious.
    pub fn shrink_step(&mut self) {
        self.pace = Some((RATE_DECAY * self.pace.unwrap_or(1.0)).max(MIN_RATE));
    }

    /// The stretch has led to something worse: the next one is more cautious and begins afresh.
    pub fn restart_slower(&mut self) {
        self.pace = Some((0.5 * self.pace.unwrap_or(1.0)).max(MIN_RATE));
        self.moments = AdamMoments::default();
    }
}

/// Takes steps from a lens, whose merit has its own rays. A step that
/// would make the lens invalid is shortened; where none is left, the stretch ends early.
///
/// # Errors
/// A lens without variables, or one without merit.
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
    })
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
