//! A stretch of a descent: steps that depend on nothing but the lens where they begin and what is
//! remembered of the stretches before, so that a search can be written down between two of them
//! and taken up again without a trace.

use super::Method;
use super::adam::Moments;
use super::least_squares::LeastSquares;
use super::state::State;
use crate::lens::Lens;
use crate::merit::{Detail, Merit, MeritError};
use serde::{Deserialize, Serialize};

/// How a stretch goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    /// What descends.
    pub method: Method,
    /// How many steps it tries.
    pub steps: usize,
    /// The rate of Adam at the beginning of a descent, in scaled variables: a step of one alters
    /// the residuals by as much as they are.
    pub rate: f64,
}

/// What a descent remembers from one stretch to the next; the default begins a new one.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Memory {
    moments: Moments,
    /// The part of its first rate that Adam has.
    pace: Option<f64>,
    /// The damping of least squares, and how fast it grows.
    damping: Option<[f64; 2]>,
    /// Steps so far.
    pub steps: usize,
}

/// Where a stretch has led.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretched {
    /// The lens where it ends.
    pub lens: Lens,
    /// The merit where it began.
    pub before: f64,
    /// Steps, those that were tried and not taken included: each takes the merit and its derivatives.
    /// At least the one with which it began.
    pub gradients: usize,
}

/// The pace may not fall below this part of the first one.
const SLOWEST: f64 = 0.02;
/// A stretch that went well is followed by a faster one, up to this part of the first pace.
const FASTEST: f64 = 2.0;
const FASTER: f64 = 1.2;
/// One that led to nothing better, by a slower one.
const SLOWER: f64 = 0.8;

impl Memory {
    /// The stretch has led to something better: the next one may be bolder.
    pub fn encourage(&mut self) {
        self.pace = Some((FASTER * self.pace.unwrap_or(1.0)).min(FASTEST));
    }

    /// The stretch has led to nothing better: the next one is more cautious.
    pub fn slow_down(&mut self) {
        self.pace = Some((SLOWER * self.pace.unwrap_or(1.0)).max(SLOWEST));
    }

    /// The stretch has led to something worse: the next one is more cautious and begins afresh.
    pub fn discourage(&mut self) {
        self.pace = Some((0.5 * self.pace.unwrap_or(1.0)).max(SLOWEST));
        self.moments = Moments::default();
    }
}

/// Takes steps from a lens, whose merit has its own rays. A step that
/// would make the lens invalid is shortened; where none is left, the stretch ends early.
///
/// # Errors
/// A lens without variables, or one without merit.
pub fn stretch(
    merit: Merit,
    lens: &Lens,
    asked: Stretch,
    memory: &mut Memory,
) -> Result<Stretched, MeritError> {
    let (mut state, sum) = State::with_sum(merit, lens, Detail::Normal)?;
    memory.steps += asked.steps;
    let before = sum.value;
    let state = match asked.method {
        Method::Adam => {
            state.rescale(&sum);
            adam(state, sum.gradient.as_slice(), asked, memory)
        }
        Method::DampedLeastSquares => {
            let mut search = LeastSquares::resumed(state, sum, memory.damping);
            search.take_steps(asked.steps);
            memory.damping = Some(search.damping());
            search.into_state()
        }
    };
    Ok(Stretched { lens: state.current, before, gradients: (state.evaluations - 1).max(1) })
}

fn adam(mut state: State, gradient: &[f64], asked: Stretch, memory: &mut Memory) -> State {
    let mut gradient = gradient.to_vec();
    for _ in 0..asked.steps {
        let rate = asked.rate * memory.pace.unwrap_or(1.0);
        let step = memory.moments.step(&gradient, &state, rate);
        let (_, sum) = state.advance(&step, Detail::Gradient, |_| true);
        let Some(sum) = sum else {
            memory.discourage();
            break;
        };
        gradient.copy_from_slice(sum.gradient.as_slice());
    }
    state
}
