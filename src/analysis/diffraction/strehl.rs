//! The Strehl ratio: at the image point of the chief ray, and at the brightest point in space.

use super::blur::BlurPeaks;
use super::brightest::brightest;
use super::pupil_samples::PupilSamples;
use super::{Interruption, never};
use crate::analysis::reference_sphere::ReferenceSphere;
use crate::analysis::{AnalysisError, Estimate, lit_region};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, RayModel};

/// The Strehl ratios of a field at one wavelength.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strehl {
    /// The intensity at the image point of the chief ray, over that of the same pupil without
    /// aberrations.
    pub at_chief: Estimate,
    /// The largest intensity found in space.
    pub best: Estimate,
    /// The position of that point from the image point of the chief ray: x, y and along the axis, in
    /// mm.
    pub best_at: [f64; 3],
    /// True if all of the blur was searched, and no brighter point was found. False if it is too large for
    /// that, and the best point is only brighter than those around it.
    pub is_brightest: bool,
    /// True if the tolerance was reached.
    pub reached: bool,
}

impl Strehl {
    /// The name of the largest intensity: "best", or "locally best" if not all of the blur was looked at.
    pub fn best_name(&self) -> &'static str {
        if self.is_brightest { "best" } else { "locally best" }
    }
}

/// The Strehl ratios of a field at a wavelength; errors are absolute. The error of the best one counts
/// the quadrature; `is_brightest` tells if all of the blur was looked at.
///
/// # Errors
/// The field is dark or its pupil folds.
pub fn strehl(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    accuracy: Accuracy,
) -> Result<Strehl, AnalysisError> {
    strehl_unless(model, field, wavelength, accuracy, &never)
}

/// The same unless it is interrupted, which is asked for before every order of the quadrature and in the search.
///
/// # Errors
/// The same, and [`AnalysisError::Interrupted`].
pub fn strehl_unless(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    accuracy: Accuracy,
    interrupted: &Interruption<'_>,
) -> Result<Strehl, AnalysisError> {
    let region = lit_region(model, field, wavelength)?;
    let sphere = ReferenceSphere::for_region(&region)?;
    let peaks = BlurPeaks::find(&region, &sphere, accuracy, interrupted)?;
    let mut best_at = [0.0; 3];
    let ratios = |light: &PupilSamples| {
        best_at = brightest(light, &peaks.points);
        Ok(vec![light.intensity([0.0; 2]), light.intensity_at(best_at)])
    };
    let least = |_: &PupilSamples| peaks.nodes;
    let found =
        PupilSamples::converge_from(&region, &sphere, least, accuracy, interrupted, ratios)?;
    best_at[2] *= sphere.direction.z.signum();
    let rays = found.rays + peaks.rays;
    let estimate = |k: usize| Estimate::new(found.values[k], found.errors[k], rays);
    Ok(Strehl {
        at_chief: estimate(0),
        best: estimate(1),
        best_at,
        is_brightest: peaks.is_whole,
        reached: found.converged,
    })
}
