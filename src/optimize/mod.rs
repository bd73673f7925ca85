//! Local optimization of a lens, one step at a time: the caller owns the loop.
//!
//! An [`Optimizer`] uses no threads, clocks or files. It works on its own copy of the lens, never
//! lets it become invalid, and always has a best lens.

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

/// A local optimizer that its caller steps, observes and stops.
pub trait Optimizer: Send + Debug {
    /// Takes one step; a step that would make the lens invalid is shortened.
    fn step(&mut self) -> OptimizationProgress;
    /// Evaluates the best lens with newly found rays, as the optimizer itself does from time to
    /// time. Call it when the optimizer is stopped, so that the best lens is verified.
    fn verify_best(&mut self);
    /// The best lens so far.
    fn best(&self) -> &Lens;
    /// The lens at the current step.
    fn current(&self) -> &Lens;
    /// Every term of the merit function for the best lens so far.
    fn terms(&self) -> Result<Vec<TermValue>, MeritError>;
}

/// The progress of an optimizer after a step.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OptimizationProgress {
    /// The number of steps so far.
    pub step: usize,
    /// The merit of the current lens.
    pub merit: f64,
    /// The merit of the best lens so far.
    pub best: f64,
    /// The fraction of the proposed step that was taken: 1 for a full step, 0 for none.
    pub accepted: f64,
    /// The reason for which steps were rejected or shortened, with the parameter and the ray.
    pub refused: Option<String>,
    /// True if further steps would change nothing.
    pub finished: bool,
}

/// The method of a local optimizer.
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
    /// The name of the method in menus.
    pub fn name(self) -> &'static str {
        match self {
            Self::Adam => "Adam",
            Self::DampedLeastSquares => "Damped least squares",
        }
    }
}

/// Creates an optimizer for a lens; spot radii are accurate to the relative `tolerance`.
///
/// # Errors
/// A lens without variables, or without a merit: see [`MeritError`].
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

/// Creates an Adam optimizer with cosine annealing over this many steps; spot radii are accurate to
/// the relative `tolerance`.
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
