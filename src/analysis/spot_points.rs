//! The points of a spot diagram.
//!
//! They illustrate a spot; its RMS radius comes from a quadrature over the pupil (see
//! [`spot`](super::spot())) and not from these rays.

use crate::pupil::{Launch, PupilPattern, RayModel, pattern_points};
use crate::trace::{Fates, ImagePoints, Rays, TraceSink};
use rayon::prelude::*;

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
    let beams: Vec<(usize, usize)> = (0..model.fields.len())
        .flat_map(|field| (0..model.channels.len()).map(move |wavelength| (field, wavelength)))
        .collect();
    let of_beam = |(field, wavelength): (usize, usize)| {
        let launch = model.launch(model.fields[field], wavelength).ok();
        let dots = launch.map(|launch| points_of(&launch, &points));
        SpotPoints { field, wavelength, ..dots.unwrap_or_default() }
    };
    beams.into_par_iter().map(of_beam).collect()
}

fn points_of(launch: &Launch<'_>, points: &[[f64; 2]]) -> SpotPoints {
    let rays: Rays<f64> = launch.rays_through_stop(points).into_iter().flatten().collect();
    let mut landed = ImagePoints::default();
    launch.channel().tracer.trace_batch(&rays, &mut landed);
    let arrived = (0..rays.len()).filter(|i| landed.fate(*i).is_imaged());
    SpotPoints {
        points: arrived.map(|i| [landed.x[i], landed.y[i]]).collect(),
        fates: landed.fates(),
        ..SpotPoints::default()
    }
}
