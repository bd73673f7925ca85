//! Paraxial projection (Teh 2023, section 4.5): after a mutation, the numbers of the rest of the lens
//! move as little as possible so that it focuses as it did before.

use serde::Serialize;

/// What a projection did.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Projection {
    /// How many Newton steps it took.
    pub steps: usize,
    /// By how much the height and slope of the marginal ray at the image still differ, relative to
    /// its height at the first surface.
    pub error: f64,
    /// The largest change of a curvature, in 1/mm.
    pub curvature: f64,
    /// The largest change of a distance, in mm.
    pub distance: f64,
}
