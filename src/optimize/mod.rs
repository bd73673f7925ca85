//! Local search, one step at a time: the caller owns the loop.
//!
//! An [`Optimizer`] knows nothing of threads, clocks or files. It keeps its own copy of the lens,
//! never lets it become invalid, and always has a best one to give.

mod adam;
mod least_squares;
pub mod pareto;
mod segment;
mod state;

pub use segment::{DescentState, SegmentResult, SegmentSettings, run_segment};

use crate::lens::Lens;
use crate::merit::{Goal, Merit, MeritError, TermValue};
use serde::{Deserialize, Serialize};
use std::fmt::Debug;

/// A search that can be stepped, watched and stopped by its caller.
pub trait Optimizer: Send + Debug {
    /// Takes one step; a step that would make the lens invalid is refused and shortened.
    fn step(&mut self) -> OptimizationProgress;
    /// Judges the best lens by its own rays, as the search itself does from time to time; to be
    /// called when it is stopped, so that the best lens is one that is known to be better.
    fn verify_best(&mut self);
    /// The best lens so far.
    fn best(&self) -> &Lens;
    /// The lens at the current step.
    fn current(&self) -> &Lens;
    /// Every term of the merit function for the best lens so far.
    fn terms(&self) -> Result<Vec<TermValue>, MeritError>;
}

/// What a step did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OptimizationProgress {
    /// Steps so far.
    pub step: usize,
    /// Merit of the current lens.
    pub merit: f64,
    /// Merit of the best lens so far.
    pub best: f64,
    /// The size of the step relative to what was proposed: 1 for a full step, 0 for none.
    pub accepted: f64,
    /// Why steps were refused or shortened, naming the parameter and the ray.
    pub refused: Option<String>,
    /// Whether further steps would change nothing.
    pub finished: bool,
}

/// Which method searches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DescentMethod {
    /// First order, with moments (Kingma and Ba, ICLR 2015).
    Adam,
    /// Damped least squares (Levenberg 1944; Marquardt 1963).
    #[default]
    DampedLeastSquares,
}

impl DescentMethod {
    /// What it is called in menus.
    pub fn name(self) -> &'static str {
        match self {
            Self::Adam => "Adam",
            Self::DampedLeastSquares => "Damped least squares",
        }
    }
}

/// Begins a search of a lens; spots are good to `tolerance` of their radius.
///
/// # Errors
/// A lens without variables, or one without merit: see [`MeritError`].
pub fn start(
    method: DescentMethod,
    lens: &Lens,
    goal: &Goal,
    tolerance: f64,
) -> Result<Box<dyn Optimizer>, MeritError> {
    let merit = Merit::new(lens, goal, tolerance)?;
    Ok(match method {
        DescentMethod::Adam => {
            Box::new(adam::AdamOptimizer::new(merit, lens, adam::LearningRate::ReduceOnPlateau)?)
        }
        DescentMethod::DampedLeastSquares => {
            Box::new(least_squares::LeastSquaresOptimizer::new(merit, lens)?)
        }
    })
}

/// Begins a search by Adam that takes this many steps while its rate falls to zero; spots are good
/// to `tolerance` of their radius.
///
/// # Errors
/// As [`start`].
pub fn start_annealed(
    lens: &Lens,
    goal: &Goal,
    tolerance: f64,
    steps: usize,
) -> Result<Box<dyn Optimizer>, MeritError> {
    let merit = Merit::new(lens, goal, tolerance)?;
    Ok(Box::new(adam::AdamOptimizer::new(merit, lens, adam::LearningRate::CosineAnnealing(steps))?))
}
