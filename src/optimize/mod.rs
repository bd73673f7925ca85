//! Local search, one step at a time: the caller owns the loop.

use crate::lens::Lens;
use serde::{Deserialize, Serialize};

/// A search that can be stepped, watched and stopped by its caller.
pub trait Optimizer: Send + std::fmt::Debug {
    /// Takes one step; a step that would make the lens invalid is refused and shortened.
    fn step(&mut self) -> Progress;
    /// The best lens so far.
    fn best(&self) -> &Lens;
    /// The lens at the current step.
    fn current(&self) -> &Lens;
}

/// What a step did.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Progress {
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Method {
    /// First order, with moments (Kingma and Ba 2015).
    Adam,
    /// Damped least squares (Levenberg 1944).
    DampedLeastSquares,
}
