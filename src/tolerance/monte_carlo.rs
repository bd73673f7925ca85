//! Real lenses: random errors of making, and rays traced through each lens.

use super::draw::draw_errors;
use super::merits::{image_ray, open_tracers};
use super::{Beam, SpotMoments, ToleranceError, ToleranceScene, best_focus, perturb};
use crate::lens::{Perturbation, System, ToleranceSheet};
use crate::trace::{ImagePoints, Landings, Rays, TraceSink as _, Tracer};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// A lens with random errors.
#[derive(Debug, Clone)]
pub struct RealLens {
    /// The errors, in their units.
    pub errors: Vec<f64>,
    /// The mean square spot radius in mm² at the image plane and at the best focus within its travel;
    /// `None` if a ray does not arrive.
    pub mean_square: Option<[f64; 2]>,
    /// The same with the rims that clip, of the rays that they leave, and the share of the light that
    /// they take; `None` if it was not asked for or no light is left.
    pub clipped: Option<([f64; 2], f64)>,
}

/// Traces lenses with random errors, in parallel; lens `i` depends on the seed and on `i` alone. The
/// first `with_rims` lenses are traced once more with rims that clip. Once `stop` is true, the first
/// lenses are returned that are traced.
///
/// # Errors
/// An error of making that is not possible.
pub fn real_lenses(
    scene: &ToleranceScene,
    sheet: &ToleranceSheet,
    seed: u64,
    count: usize,
    with_rims: usize,
    stop: &AtomicBool,
) -> Result<Vec<RealLens>, ToleranceError> {
    let columns = BeamColumns::new(&scene.beam);
    let is_stopped = || stop.load(Ordering::Relaxed);
    let lens = |i: usize| {
        (!is_stopped()).then(|| real_lens(scene, sheet, (seed, i), &columns, i < with_rims))
    };
    let mut lenses = Vec::new();
    while lenses.len() < count && !is_stopped() {
        let part = lenses.len()..count.min(lenses.len() + PART);
        let part: Vec<Option<_>> = part.into_par_iter().map(lens).collect();
        // Of a part that was broken off, the lenses in front of the first one that is missing.
        for traced in part.into_iter().map_while(|traced| traced) {
            lenses.push(traced?);
        }
    }
    Ok(lenses)
}

/// The number of lenses that are traced in parallel before they are collected.
const PART: usize = 128;

fn real_lens(
    scene: &ToleranceScene,
    sheet: &ToleranceSheet,
    (seed, number): (u64, usize),
    columns: &BeamColumns,
    with_rims: bool,
) -> Result<RealLens, ToleranceError> {
    let errors = draw_errors(&sheet.errors, seed, number as u64);
    let set: Vec<(Perturbation, f64)> =
        sheet.errors.iter().zip(&errors).map(|(t, value)| (t.error, *value)).collect();
    let systems = perturb(&scene.lens, &set)?;
    let focused = |mean: &SpotMoments<f64>| {
        let travel = sheet.focus_travel.unwrap_or(f64::INFINITY);
        [mean.a, mean.at(best_focus(mean).clamp(-travel, travel))]
    };
    let mean_square = columns.mean_spot(&systems).map(|mean| focused(&mean));
    let clipped = if with_rims { clipped_spot(scene, systems) } else { None };
    let clipped = clipped.map(|(mean, lost)| (focused(&mean), lost));
    Ok(RealLens { errors, mean_square, clipped })
}

/// The mean spot of the rays that the rims of a lens leave, and the share of the light that they take;
/// `None` if a field is dark.
fn clipped_spot(
    scene: &ToleranceScene,
    mut systems: Vec<System<f64>>,
) -> Option<(SpotMoments<f64>, f64)> {
    for system in &mut systems {
        for (surface, (rim, obstruction)) in system.surfaces.iter_mut().zip(&scene.lens.rims) {
            (surface.semi_diameter, surface.obstruction) = (*rim, *obstruction);
        }
    }
    let tracers: Result<Vec<_>, _> = systems.iter().map(Tracer::new).collect();
    let (beam, lost) = transmitted(&scene.beam, &tracers.ok()?)?;
    Some((BeamColumns::new(&beam).mean_spot(&systems)?, lost))
}

/// The rays of a beam, to be traced in blocks.
struct BeamColumns {
    fields: Vec<FieldColumns>,
}

/// The rays of one field.
struct FieldColumns {
    weight: f64,
    /// For each colour the wavelength, the rays, and the weight of each ray.
    colours: Vec<(usize, Rays<f64>, Vec<f64>)>,
}

impl BeamColumns {
    fn new(beam: &Beam) -> Self {
        let colour = |colour: &super::ColourRays| {
            (colour.wavelength, colour.rays.iter().copied().collect(), colour.weights.clone())
        };
        let field = |field: &super::FieldBeam| FieldColumns {
            weight: field.weight,
            colours: field.colours.iter().map(colour).collect(),
        };
        Self { fields: beam.fields.iter().map(field).collect() }
    }

    /// The mean spot of all fields without rims; `None` if a ray does not arrive, or if there is no
    /// best focus.
    fn mean_spot(&self, systems: &[System<f64>]) -> Option<SpotMoments<f64>> {
        let tracers = open_tracers(systems).ok()?;
        let (mut landed, mut spots) = (Landings::default(), Vec::new());
        for FieldColumns { weight, colours } in &self.fields {
            let mut image_rays = Vec::new();
            for (wavelength, rays, weights) in colours {
                tracers[*wavelength].trace_batch(rays, &mut landed);
                if (0..weights.len()).any(|i| !landed.fate(i).is_imaged()) {
                    return None;
                }
                let weighted = weights.iter().enumerate();
                image_rays.extend(weighted.map(|(i, w)| (image_ray(&landed.ray(i)), *w)));
            }
            spots.push(SpotMoments::new(&image_rays).weighted(*weight));
        }
        let mean = SpotMoments::sum(spots.into_iter());
        (mean.a.is_finite() && best_focus(&mean).is_finite()).then_some(mean)
    }
}

/// The rays of a beam that arrive, and the share of the light of those that do not; `None` if a field
/// is dark.
fn transmitted(beam: &Beam, tracers: &[Tracer<f64>]) -> Option<(Beam, f64)> {
    let (mut left, mut lost) = (beam.clone(), 0.0);
    for field in &mut left.fields {
        for colour in &mut field.colours {
            let tracer = &tracers[colour.wavelength];
            let mut arrived = super::ColourRays::new(colour.wavelength);
            let mut landed = ImagePoints::default();
            tracer.trace_batch(&colour.rays.iter().copied().collect(), &mut landed);
            for (i, ray) in colour.rays.iter().enumerate() {
                if landed.fate(i).is_imaged() {
                    arrived.push(*ray, colour.weights[i], colour.pupil[i], colour.paths[i]);
                }
            }
            *colour = arrived;
        }
        let total: f64 = field.colours.iter().flat_map(|colour| &colour.weights).sum();
        if !(total > 0.0) {
            return None;
        }
        lost += field.weight * (1.0 - total);
        let weights = field.colours.iter_mut().flat_map(|colour| &mut colour.weights);
        weights.for_each(|weight| *weight /= total);
    }
    Some((left, lost.max(0.0)))
}

/// The interval in which the share of good lenses lies with 95 % confidence, from `good` of `count`
/// lenses (Wilson, Journal of the American Statistical Association 22, 1927).
pub fn wilson_interval(good: usize, count: usize) -> [f64; 2] {
    const Z: f64 = 1.959_963_984_540_054;
    if count == 0 {
        return [0.0, 1.0];
    }
    let (k, n, z2) = (good as f64, count as f64, Z * Z);
    let center = (k + 0.5 * z2) / (n + z2);
    let half = Z * (k * (n - k) / n + 0.25 * z2).sqrt() / (n + z2);
    [(center - half).max(0.0), (center + half).min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Shape, Surface};
    use crate::math::Vec3;
    use crate::tolerance::{ColourRays, FieldBeam};
    use crate::trace::Ray;

    /// A hole of radius 1 in front of the image plane, and a field with this weight whose rays are at
    /// these heights.
    fn clipped(weight: f64, heights: &[f64]) -> Option<(Beam, f64)> {
        let mut hole = Surface::plane(1.0, 1.0);
        hole.semi_diameter = 1.0;
        let image = Surface { shape: Shape::Plane, ..Surface::plane(0.0, 1.0) };
        let system = System { index_before: 1.0, surfaces: vec![hole, image], stop: None };
        let along =
            |y: f64| Ray { point: Vec3::new(0.0, y, 0.0), direction: Vec3::new(0.0, 0.0, 1.0) };
        let mut colour = ColourRays::new(0);
        for y in heights {
            colour.push(along(*y), 1.0 / heights.len() as f64, [0.0, *y], 0.0);
        }
        let field = FieldBeam { weight, colours: vec![colour], chief: (along(0.0), 0.0) };
        transmitted(&Beam { fields: vec![field] }, &[Tracer::new(&system).unwrap()])
    }

    #[test]
    fn clipped_rays_lose_their_light_and_the_others_share_the_weight() {
        let (beam, lost) = clipped(0.8, &[0.0, 0.5, -0.5, 2.0]).unwrap();
        let colour = &beam.fields[0].colours[0];
        assert_eq!(colour.rays.len(), 3);
        assert!(colour.weights.iter().all(|w| (w - 1.0 / 3.0).abs() < 1e-15));
        assert!((lost - 0.2).abs() < 1e-15, "{lost}");
        assert!(clipped(0.8, &[3.0, 2.0]).is_none());
    }

    #[test]
    fn an_interval_without_failures_does_not_reach_certainty() {
        let [low, high] = wilson_interval(100, 100);
        assert!(high > 1.0 - 1e-12 && (low - 0.963).abs() < 1e-3, "{low} {high}");
        let [low, high] = wilson_interval(450, 500);
        assert!((low - 0.8706).abs() < 1e-4 && (high - 0.9234).abs() < 1e-4, "{low} {high}");
        assert_eq!(wilson_interval(0, 0), [0.0, 1.0]);
    }
}
