//! The points of a spot diagram.
//!
//! They illustrate a spot; its RMS radius comes from a quadrature over the pupil (see
//! [`spot`](super::spot())) and not from these rays.

use crate::pupil::{Launch, PupilPattern, RayModel, pattern_points};
use crate::trace::{Fates, ImagePoints, Rays, TraceSink};

/// The image points of one field at one wavelength.
#[derive(Debug, Clone, Default)]
pub struct SpotPoints {
    /// The index of the field.
    pub field: usize,
    /// The index of the wavelength.
    pub wavelength: usize,
    /// The points in the image plane, in mm from the axis.
    pub points: Vec<[f64; 2]>,
    /// The number of rays by their fate.
    pub fates: Fates,
}

/// The rings of the hexapolar pattern: 127 rays for each field and wavelength.
const RINGS: usize = 6;

/// The image points of every field and wavelength; a field without light has none.
pub fn spot_points(model: &RayModel) -> Vec<SpotPoints> {
    let points = pattern_points(PupilPattern::Hexapolar(RINGS));
    let mut all = Vec::new();
    for (field, point) in model.fields.iter().enumerate() {
        for wavelength in 0..model.channels.len() {
            let dots =
                model.launch(*point, wavelength).ok().map(|launch| points_of(&launch, &points));
            all.push(SpotPoints { field, wavelength, ..dots.unwrap_or_default() });
        }
    }
    all
}

fn points_of(launch: &Launch<'_>, points: &[[f64; 2]]) -> SpotPoints {
    let rays: Rays<f64> = points.iter().filter_map(|p| launch.ray_through_stop(*p)).collect();
    let mut landed = ImagePoints::default();
    launch.channel().tracer.trace_batch(&rays, &mut landed);
    let arrived = (0..rays.len()).filter(|i| landed.fate(*i).is_imaged());
    SpotPoints {
        points: arrived.map(|i| [landed.x[i], landed.y[i]]).collect(),
        fates: landed.fates(),
        ..SpotPoints::default()
    }
}
