//! The intensity at points of the image of a point.

use super::pupil_samples::PupilSamples;
use super::{Interruption, never};
use crate::analysis::reference_sphere::{ReferenceForm, ReferenceSphere};
use crate::analysis::{AnalysisError, Estimate, lit_region};
use crate::lens::FieldPoint;
use crate::pupil::{Accuracy, RayModel};

/// The diffraction image of a point at one wavelength.
#[derive(Debug, Clone, PartialEq)]
pub struct PointSpread {
    /// The intensity at each point asked for, over the peak of the same pupil without aberrations.
    pub intensities: Vec<Estimate>,
    /// The Strehl ratio at the centre of the reference sphere, the image point of the chief ray.
    pub strehl: Estimate,
    /// The centre of the reference sphere, x and y in mm.
    pub center: [f64; 2],
    /// True if the tolerance was reached.
    pub reached: bool,
    /// The sphere on which light is counted.
    pub reference: ReferenceForm,
}

/// The diffraction image of a field at a wavelength at some points, x and y in mm from the image point
/// of the chief ray; errors are absolute, relative to a perfect peak.
///
/// # Errors
/// The field is dark or its pupil folds.
pub fn point_spread(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    points: &[[f64; 2]],
    accuracy: Accuracy,
) -> Result<PointSpread, AnalysisError> {
    point_spread_unless(model, field, wavelength, points, accuracy, &never)
}

/// The same unless it is interrupted, which is asked for before every point of the image.
///
/// # Errors
/// The same, and [`AnalysisError::Interrupted`].
pub fn point_spread_unless(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    points: &[[f64; 2]],
    accuracy: Accuracy,
    interrupted: &Interruption<'_>,
) -> Result<PointSpread, AnalysisError> {
    let region = lit_region(model, field, wavelength)?;
    let sphere = ReferenceSphere::for_region(&region)?;
    let reach = points.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max);
    let intensities = |light: &PupilSamples| {
        let all = std::iter::once([0.0; 2]).chain(points.iter().copied());
        let intensity = |point| {
            if interrupted() { Err(AnalysisError::Interrupted) } else { Ok(light.intensity(point)) }
        };
        all.map(intensity).collect()
    };
    let reach = Some(reach);
    let found =
        PupilSamples::converge(&region, &sphere, reach, accuracy, interrupted, intensities)?;
    let estimate = |k: usize| Estimate::new(found.values[k], found.errors[k], found.rays);
    Ok(PointSpread {
        intensities: (1..found.values.len()).map(estimate).collect(),
        strehl: estimate(0),
        center: [sphere.center.x, sphere.center.y],
        reached: found.converged,
        reference: sphere.form,
    })
}
