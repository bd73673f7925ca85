//! Sharpness and light: the two numbers that lenses are compared by.
//!
//! The sharpness of a field is the RMS radius of its spot about its centroid, its light the area of
//! its pupil, both over all wavelengths by weight. A lens has the root mean square of the one and the
//! mean of the other over its fields by weight, and over its zoom positions.

use super::spot::{Spot, combine_channels, trace_channels};
use super::{AnalysisError, Estimate};
use crate::lens::{FieldPoint, Lens};
use crate::pupil::{Accuracy, RayModel, RayModelError};
use rayon::prelude::*;

/// The sharpness and the light of a field, or of several together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageQuality {
    /// The RMS radius of the spot, in mm, over what has light; or why there is no light at all.
    pub spot: Result<Estimate, AnalysisError>,
    /// The mean area of the pupil, in mm² of the plane through the first vertex; 0 without light.
    pub light: Estimate,
    /// True if light gets through at every field and wavelength that has a weight.
    pub is_fully_lit: bool,
}

impl ImageQuality {
    /// The quality of a field without light.
    fn dark(why: AnalysisError) -> Self {
        Self { spot: Err(why), light: Estimate::new(0.0, 0.0, 0), is_fully_lit: false }
    }

    /// The quality of a field whose spot is known.
    pub fn of_spot(spot: &Result<Spot, AnalysisError>) -> Self {
        match spot {
            Ok(spot) => {
                Self { spot: Ok(spot.rms), light: spot.light, is_fully_lit: spot.is_fully_lit }
            }
            Err(why) => Self::dark(*why),
        }
    }

    /// The quality of several parts together, each with its weight: the root mean square of the
    /// radii of those that have light, and the mean of the areas of all.
    pub fn mean(parts: &[(f64, Self)]) -> Self {
        let (mut squares, mut errors, mut lit, mut total) = (0.0, 0.0, 0.0, 0.0);
        let (mut rays, mut light) = (0, Estimate::new(0.0, 0.0, 0));
        for (weight, part) in parts {
            total += weight;
            light.value += weight * part.light.value;
            light.error += weight * part.light.error;
            light.rays += part.light.rays;
            if let Ok(spot) = part.spot {
                lit += weight;
                squares += weight * spot.value * spot.value;
                errors += weight * spot.value * spot.error;
                rays += spot.rays;
            }
        }
        if total > 0.0 {
            (light.value, light.error) = (light.value / total, light.error / total);
        }
        let reason = parts.iter().find_map(|(_, part)| part.spot.err());
        let radius = (squares / lit).sqrt();
        let error = if radius > 0.0 { errors / lit / radius } else { 0.0 };
        let spot = Estimate::new(radius, error, rays);
        Self {
            spot: if lit > 0.0 { Ok(spot) } else { Err(reason.unwrap_or(AnalysisError::NoLight)) },
            light,
            is_fully_lit: parts.iter().all(|(weight, part)| *weight == 0.0 || part.is_fully_lit),
        }
    }
}

/// The quality of a field: that of its [`spot`](super::spot()), without the cost of the rest.
pub fn field_quality(model: &RayModel, field: FieldPoint, accuracy: Accuracy) -> ImageQuality {
    match combine_channels(model, &trace_channels(model, field, accuracy)) {
        Ok(spot) => {
            ImageQuality { spot: Ok(spot.rms), light: spot.light, is_fully_lit: spot.is_fully_lit }
        }
        Err(why) => ImageQuality::dark(why),
    }
}

/// The quality of every field of a model, in order; radii are accurate to the tolerance.
pub fn field_qualities(model: &RayModel, accuracy: Accuracy) -> Vec<ImageQuality> {
    model.fields.par_iter().map(|field| field_quality(model, *field, accuracy)).collect()
}

/// The quality of a lens: the mean over its fields by weight and over its zoom positions; radii are
/// accurate to a relative tolerance.
///
/// # Errors
/// A lens that cannot be resolved, or an aperture without meaning for it.
pub fn image_quality(lens: &Lens, tolerance: f64) -> Result<ImageQuality, RayModelError> {
    let accuracy = Accuracy { tolerance, ..Accuracy::default() };
    let at_zoom = |zoom| {
        let model = RayModel::from_lens(lens, zoom)?;
        let weights = model.fields.iter().map(|field| field.weight);
        let fields: Vec<_> = weights.zip(field_qualities(&model, accuracy)).collect();
        Ok((1.0, ImageQuality::mean(&fields)))
    };
    let zooms: Result<Vec<_>, RayModelError> = (0..lens.zoom_positions()).map(at_zoom).collect();
    Ok(ImageQuality::mean(&zooms?))
}
