//! Clear semi-diameters: how far from the axis the light of all fields, wavelengths and zoom
//! positions meets each surface. They are the size of a surface whose semi-diameter nobody fixed.

use crate::lens::FieldPoint;
use crate::pupil::{Launch, RayModel, Region};
use crate::trace::{ImagePoints, Ray, Rays, TraceSink as _};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// The azimuths at which the edge of a pupil is traced, over half of it.
const AZIMUTHS: u32 = 6;
/// The halvings of the distance between a ray that is lost and one that is not.
const HALVINGS: usize = 12;
/// The azimuths at which the edge of a pupil with corners is found.
const EDGE_AZIMUTHS: u32 = 720;
/// The part of the radius that rays stay inside that edge, so that rounding does not block them.
const ROUNDED_EDGE: f64 = 1e-9;
/// The order at which a pupil in pieces is sampled.
const SAMPLE_ORDER: usize = 3;

/// The largest distance from the axis at which the light meets each surface, the image plane last,
/// in mm. `models` are those of all zoom positions. Rays that some fixed semi-diameter clips do not
/// count. The edge of the light is found to 1e-9 of its radius; behind apertures that are no circles about the
/// vertex it is that of the pupil at 720 azimuths, so that a corner may lack 0.3 %, or of a sample.
pub fn clear_semi_diameters<'a>(models: impl IntoIterator<Item = &'a RayModel>) -> Vec<f64> {
    let beams = models.into_iter().flat_map(|model| {
        let fields = model.fields.iter();
        fields.flat_map(move |field| (0..model.channels.len()).map(move |w| (model, *field, w)))
    });
    let beams: Vec<(&RayModel, FieldPoint, usize)> = beams.collect();
    let of_beam = |(model, field, wavelength): &(&RayModel, FieldPoint, usize)| {
        let mut heights = vec![0.0; model.channels[model.primary].tracer.surfaces()];
        if let Ok(launch) = model.launch(*field, *wavelength) {
            raise_to_edge(&mut heights, &launch);
        }
        heights
    };
    beams.par_iter().map(of_beam).reduce(Vec::new, higher)
}

/// The larger of the heights at each surface.
fn higher(mut a: Vec<f64>, b: Vec<f64>) -> Vec<f64> {
    a.resize(a.len().max(b.len()), 0.0);
    a.iter_mut().zip(b).for_each(|(height, own)| *height = height.max(own));
    a
}

/// Raises heights to those of the edge of a pupil.
fn raise_to_edge(heights: &mut [f64], launch: &Launch<'_>) {
    let mut raise = |ray: Ray<f64>| {
        launch.channel().tracer.visit(ray, |surface, p| {
            heights[surface] = heights[surface].max(p.x.hypot(p.y));
        });
    };
    if !launch.channel().system.has_round_apertures() {
        edge_of_light(launch).into_iter().for_each(raise);
        return;
    }
    let halves: &[f64] = if launch.is_symmetric() { &[1.0] } else { &[1.0, -1.0] };
    let angle = |i: u32| PI * (f64::from(i) / f64::from(AZIMUTHS) - 0.5);
    let direction = |side: f64, i: u32| [side * angle(i).cos(), angle(i).sin()];
    let outward = halves.iter().flat_map(|side| (0..=AZIMUTHS).map(|i| direction(*side, i)));
    outermost(launch, &outward.collect::<Vec<_>>()).into_iter().flatten().for_each(&mut raise);
}

/// Rays at the edge of a pupil of any form, or all of a sample where it is in pieces.
fn edge_of_light(launch: &Launch<'_>) -> Vec<Ray<f64>> {
    let region = Region::new(launch.clone());
    let azimuths = (0..EDGE_AZIMUTHS).map(|i| TAU * f64::from(i) / f64::from(EDGE_AZIMUTHS));
    let edges = azimuths.filter_map(|azimuth| region.pupil_radius(azimuth));
    let mut points: Vec<_> = edges.map(|edge| edge.point(1.0 - ROUNDED_EDGE)).collect();
    if points.is_empty() {
        points = region.nodes(SAMPLE_ORDER).points;
    }
    let tracer = &launch.channel().tracer;
    let rays = points.into_iter().filter_map(|p| launch.ray(p));
    rays.filter(|ray| tracer.trace(*ray).fate.is_imaged()).collect()
}

/// The outermost ray in each direction of the pupil that reaches the image; `None` if not even the ray
/// through the centre of the pupil does.
fn outermost(launch: &Launch<'_>, outward: &[[f64; 2]]) -> Vec<Option<Ray<f64>>> {
    let mut found = passing(launch, outward);
    let cut: Vec<usize> = (0..outward.len()).filter(|i| found[*i].is_none()).collect();
    let Some(center) = passing(launch, &[[0.0; 2]])[0].filter(|_| !cut.is_empty()) else {
        return found;
    };
    cut.iter().for_each(|i| found[*i] = Some(center));
    let mut between = vec![(0.0, 1.0); cut.len()];
    for _ in 0..HALVINGS {
        let middle = |(inside, outside): &(f64, f64)| 0.5 * (inside + outside);
        let shares = between.iter().map(middle);
        let points: Vec<_> =
            cut.iter().zip(shares).map(|(i, share)| outward[*i].map(|c| share * c)).collect();
        for ((ray, i), between) in passing(launch, &points).into_iter().zip(&cut).zip(&mut between)
        {
            match ray {
                None => between.1 = middle(between),
                ray => (between.0, found[*i]) = (middle(between), ray),
            }
        }
    }
    found
}

/// The rays through some points of the stop that reach the image.
fn passing(launch: &Launch<'_>, points: &[[f64; 2]]) -> Vec<Option<Ray<f64>>> {
    let mut rays = launch.rays_through_stop(points);
    let launched: Rays<f64> = rays.iter().flatten().copied().collect();
    let mut landed = ImagePoints::default();
    launch.channel().tracer.trace_batch(&launched, &mut landed);
    for (i, ray) in rays.iter_mut().filter(|ray| ray.is_some()).enumerate() {
        *ray = ray.filter(|_| landed.fate(i).is_imaged());
    }
    rays
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Aperture, Lens, blank};

    /// Rays at the rim are launched by 1e-9 of its radius inside it, so that rounding does not decide
    /// whether they pass.
    const ROUNDED_RIM: f64 = 1.001e-9;

    fn heights(lens: &Lens) -> Vec<f64> {
        clear_semi_diameters([&RayModel::from_lens(lens, 0).unwrap()])
    }

    /// A plate of 5 mm in a beam of 10 mm, without fixed semi-diameters.
    fn plate() -> Lens {
        let mut lens = blank();
        lens.surfaces.iter_mut().for_each(|row| row.semi_diameter = None);
        lens.aperture = Aperture::EntrancePupilDiameter(10.0);
        lens
    }

    #[test]
    fn surfaces_are_as_large_as_the_beam_and_grow_with_the_field() {
        let mut lens = plate();
        let found = heights(&lens);
        assert!(found.iter().all(|height| (height / 5.0 - 1.0).abs() < ROUNDED_RIM), "{found:?}");
        lens.fields.values = vec![FieldPoint { x: 0.0, y: 10.0, weight: 1.0 }];
        let found = heights(&lens);
        let index = lens.resolve(0, lens.wavelengths[0].um).unwrap().surfaces[0].index;
        let inside = (10f64.to_radians().sin() / index).asin().tan();
        assert!((found[0] / 5.0 - 1.0).abs() < ROUNDED_RIM);
        assert!((found[1] / (5.0 + 5.0 * inside) - 1.0).abs() < ROUNDED_RIM, "{found:?}");
    }

    #[test]
    fn only_light_that_gets_through_counts() {
        let mut lens = plate();
        lens.surfaces[1].semi_diameter = Some(3.0);
        let found = heights(&lens);
        assert!((found[0] - 3.0).abs() < 2e-3 && found[0] <= 3.0, "{found:?}");
    }
}
