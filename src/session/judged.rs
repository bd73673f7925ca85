//! What a lens is worth in plain numbers: sharpness and light, as a sweep judges its own lenses.

use super::background::guarded;
use crate::lens::Lens;
use crate::optimize::pareto::ParetoPoint;
use crate::pupil::limited_by_stop;
use std::sync::Arc;

/// The relative error of the numbers.
const ERROR: f64 = 1e-4;

/// A lens, and what it is worth beside others.
#[derive(Debug, Clone)]
pub struct ScoredLens {
    /// The lens.
    pub lens: Arc<Lens>,
    /// What it is worth, or why nothing.
    pub score: Result<ParetoPoint, String>,
}

impl ScoredLens {
    /// Judges a lens; a panic is a reason, too.
    pub(super) fn new(lens: Arc<Lens>) -> Self {
        let found = guarded(|| score(&lens));
        Self { lens, score: found }
    }
}

/// A lens as it is when its stop alone limits the beam.
pub(super) fn score(lens: &Lens) -> Result<ParetoPoint, String> {
    let lens = limited_by_stop(lens).map_err(|why| why.to_string())?;
    ParetoPoint::evaluate(&lens, None, ERROR).map_err(|why| why.to_string())
}
