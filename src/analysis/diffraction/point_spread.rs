//! The intensity at points of the image of a point.

use super::image_light::{ColorIntensities, ColorParts, ImageLight, color_intensities};
use super::{Interruption, never};
use crate::analysis::reference_sphere::ReferenceForm;
use crate::analysis::{AnalysisError, Estimate};
use crate::lens::FieldPoint;
use crate::math::Vec3;
use crate::pupil::{Accuracy, RayModel};

/// The diffraction image of a point.
#[derive(Debug, Clone, PartialEq)]
pub struct PointSpread {
    /// The intensity at each point asked for, over the peak of the same pupil without aberrations.
    pub intensities: Vec<Estimate>,
    /// The Strehl ratio at the point that the image is looked at about: the image point of the chief ray.
    pub strehl: Estimate,
    /// That point, x and y in mm.
    pub center: [f64; 2],
    /// True if the tolerance was reached.
    pub reached: bool,
    /// The sphere on which light is counted; that of the first wavelength of several.
    pub reference: ReferenceForm,
    /// The share of the weight of wavelengths without light, which are left out.
    pub dark_share: f64,
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
    let light = ImageLight::Wavelength(wavelength);
    point_spread_unless(model, field, (light, points), accuracy, &never)
}

/// The diffraction image of a field in one or all wavelengths unless it is interrupted, which is asked for before
/// every point of the image. Over several wavelengths the points are those from the image point of the chief ray of
/// the primary one, and the peak is that of images without aberrations about one point; errors count the wavelengths
/// that are refused.
///
/// # Errors
/// The field is dark or its pupil folds at every wavelength, or [`AnalysisError::Interrupted`].
pub fn point_spread_unless(
    model: &RayModel,
    field: FieldPoint,
    (light, points): (ImageLight, &[[f64; 2]]),
    accuracy: Accuracy,
    interrupted: &Interruption<'_>,
) -> Result<PointSpread, AnalysisError> {
    let all = std::iter::once([0.0; 2]).chain(points.iter().copied());
    let all: Vec<[f64; 3]> = all.map(|[x, y]| [x, y, 0.0]).collect();
    let origin = light.origin(model, field)?;
    let image = spread_at((model, field), (light, origin), &all, accuracy, interrupted)?;
    let (strehl, intensities) = image.intensities.split_first().ok_or(AnalysisError::NoLight)?;
    Ok(PointSpread {
        intensities: intensities.to_vec(),
        strehl: *strehl,
        center: origin.map_or(image.center, |origin| [origin.x, origin.y]),
        reached: image.reached,
        reference: image.reference,
        dark_share: image.dark_share,
    })
}

/// Intensities over the peak of a perfect image.
#[derive(Debug)]
pub(super) struct SpreadValues {
    pub(super) intensities: Vec<Estimate>,
    pub(super) reached: bool,
    /// The sphere and the image point of the chief ray of the first wavelength.
    reference: ReferenceForm,
    center: [f64; 2],
    dark_share: f64,
}

/// The intensities at points about an origin, x and y in mm and z along the light.
///
/// # Errors
/// As of [`point_spread_unless`].
pub(super) fn spread_at(
    (model, field): (&RayModel, FieldPoint),
    (light, origin): (ImageLight, Option<Vec3<f64>>),
    points: &[[f64; 3]],
    accuracy: Accuracy,
    interrupted: &Interruption<'_>,
) -> Result<SpreadValues, AnalysisError> {
    let parts = light.parts(model, |wavelength| {
        color_intensities((model, field, wavelength), (origin, points), accuracy, interrupted)
    })?;
    Ok(sum_of_colors(&parts, accuracy.tolerance))
}

/// The sum of the intensities of all wavelengths: each in proportion to the peak that it has without aberrations.
fn sum_of_colors(colors: &ColorParts<ColorIntensities>, tolerance: f64) -> SpreadValues {
    let ColorParts { parts, dark_share, refused_share } = colors;
    let peaks: Vec<f64> = parts.iter().map(|part| part.share * part.found.peak).collect();
    let whole: f64 = peaks.iter().sum();
    let several = parts.len() > 1;
    let rays = parts.iter().map(|part| part.found.found.rays).sum();
    let count = parts.first().map_or(0, |part| part.found.found.values.len());
    let intensity = |k: usize| {
        let (mut value, mut error) = (0.0, *refused_share);
        for (part, peak) in parts.iter().zip(&peaks) {
            let ColorIntensities { found, peak_error, .. } = &part.found;
            value += peak / whole * found.values[k];
            // The peak of one wavelength cancels.
            let of_share = if several { 2.0 * peak_error * found.values[k].abs() } else { 0.0 };
            error += peak / whole * (found.errors[k] + of_share);
        }
        Estimate::new(value, error, rays)
    };
    let intensities: Vec<Estimate> = (0..count).map(intensity).collect();
    let is_within = intensities.iter().all(|intensity| intensity.error <= tolerance);
    let all_reached = parts.iter().all(|part| part.found.found.converged);
    SpreadValues {
        reached: if several || *refused_share > 0.0 { is_within } else { all_reached },
        reference: parts.first().map_or(ReferenceForm::Infinite, |part| part.found.form),
        center: parts.first().map_or([0.0; 2], |part| part.found.center),
        dark_share: *dark_share,
        intensities,
    }
}
