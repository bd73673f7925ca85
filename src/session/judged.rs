//! What a lens is worth in plain numbers: sharpness and light, as a sweep judges its own lenses.

use super::background::guarded;
use crate::lens::Lens;
use crate::optimize::pareto::Design;
use crate::pupil::limited_by_stop;
use std::sync::Arc;

/// The relative error of the numbers.
const ERROR: f64 = 1e-4;

/// A lens, and what it is worth beside others.
#[derive(Debug, Clone)]
pub struct Judged {
    /// The lens.
    pub lens: Arc<Lens>,
    /// What it is worth, or why nothing.
    pub found: Result<Design, String>,
}

impl Judged {
    /// Judges a lens; a panic is a reason, too.
    pub(super) fn of(lens: Arc<Lens>) -> Self {
        let found = guarded(|| judge(&lens));
        Self { lens, found }
    }
}

/// A lens as it is when its stop alone limits the beam.
pub(super) fn judge(lens: &Lens) -> Result<Design, String> {
    let lens = limited_by_stop(lens).map_err(|why| why.to_string())?;
    Design::of(&lens, None, ERROR).map_err(|why| why.to_string())
}
