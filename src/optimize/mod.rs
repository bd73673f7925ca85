//! Local optimization of a lens, one step at a time: the caller owns the loop.
//!
//! An [`Optimizer`] uses no threads, clocks or files. It works on its own copy of the lens, never
//! lets it become invalid, and always has a best lens.

mod adam;
mod exchanging;
mod glass_prediction;
mod glasses;
mod least_squares;
mod limited;
pub mod pareto;
mod segment;
mod state;
mod trust_region;

pub use exchanging::start_exchanging;
pub(crate) use glasses::hold_powers;
pub use glasses::{GlassExchange, GlassRound, GlassSearch, GlassSearchError};
pub use segment::{
    DescentState, LimitedSegment, SegmentResult, SegmentSettings, run_limited_segment, run_segment,
};

use crate::lens::Lens;
use crate::merit::{ConstraintMargin, Goal, Merit, MeritError, TermValue};
use serde::{Deserialize, Serialize};
use std::fmt::Debug;

/// A local optimizer that its caller steps, observes and stops.
pub trait Optimizer: Send + Sync + Debug {
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
    /// The number of evaluations of the merit with its derivatives so far; 0 for a method that tells it with
    /// its steps alone.
    fn evaluations(&self) -> usize {
        0
    }
    /// The limits that hold the best lens verified last; empty for a method or a goal without
    /// constraints.
    fn binding_limits(&self) -> &[LimitPrice] {
        &[]
    }
    /// The smallest set of limits that contradict each other, if the optimizer has ended because of
    /// them.
    fn conflict(&self) -> &[String] {
        &[]
    }
}

/// A limit that holds a lens, with its price.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LimitPrice {
    /// The limited number.
    #[serde(flatten)]
    pub limit: ConstraintMargin,
    /// The bound at which it is, in mm or as a ratio.
    pub bound: f64,
    /// The gain in merit, in mm² per mm or per unit of the ratio, by a looser bound. For a number
    /// with a prescribed value: by a larger one, negative for a loss.
    pub price: f64,
}

/// The progress of an optimizer after a step.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OptimizationProgress {
    /// The number of steps so far.
    pub step: usize,
    /// The number of evaluations of the merit with its derivatives so far.
    pub evaluations: usize,
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
    /// The reason why the optimizer has ended, if it has.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub end: Option<OptimizationEnd>,
}

/// The reason why an optimizer has ended by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OptimizationEnd {
    /// The gradient is a millionth of what it was, apart from variables at their bounds.
    Gradient,
    /// No step promises a gain above the tolerance of the spots.
    Tolerance,
    /// Several steps have gained nothing.
    NoGain,
    /// No lens near this one keeps all limits.
    Conflict,
}

impl OptimizationEnd {
    /// True for an end where nothing can be gained.
    pub fn is_minimum(self) -> bool {
        matches!(self, Self::Gradient | Self::Tolerance)
    }

    /// The reason in words.
    pub fn text(self) -> &'static str {
        match self {
            Self::Gradient => "the gradient has vanished",
            Self::Tolerance => "nothing can be gained at the tolerance of the spots",
            Self::NoGain => "several steps have gained nothing",
            Self::Conflict => "the limits contradict each other",
        }
    }
}

/// The method of a local optimizer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DescentMethod {
    /// First order, with moments (Kingma and Ba, ICLR 2015).
    Adam,
    /// Damped least squares (Levenberg 1944; Marquardt 1963).
    DampedLeastSquares,
    /// A trust region with secant second derivatives (Dennis, Gay, Welsch 1981).
    #[default]
    TrustRegion,
}

impl DescentMethod {
    /// All methods, the default one first.
    pub const ALL: [Self; 3] = [Self::TrustRegion, Self::DampedLeastSquares, Self::Adam];

    /// The name of the method in menus.
    pub fn name(self) -> &'static str {
        match self {
            Self::Adam => "Adam",
            Self::DampedLeastSquares => "Damped least squares",
            Self::TrustRegion => "Trust region",
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
    start_from(method, Merit::new(lens, goal, tolerance)?, lens, tolerance)
}

/// As [`start`], from a merit function of the lens.
///
/// # Errors
/// As [`start`].
pub fn start_from(
    method: DescentMethod,
    merit: Merit,
    lens: &Lens,
    tolerance: f64,
) -> Result<Box<dyn Optimizer>, MeritError> {
    Ok(match method {
        DescentMethod::Adam => {
            Box::new(adam::AdamOptimizer::new(merit, lens, adam::LearningRate::ReduceOnPlateau)?)
        }
        DescentMethod::DampedLeastSquares => {
            Box::new(least_squares::LeastSquaresOptimizer::new(merit, lens)?)
        }
        DescentMethod::TrustRegion if merit.has_limits() => {
            Box::new(limited::LimitedOptimizer::new(merit, lens, tolerance)?)
        }
        DescentMethod::TrustRegion => {
            Box::new(trust_region::TrustRegionOptimizer::new(merit, lens, tolerance)?)
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
