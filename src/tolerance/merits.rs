//! The image quality of a lens over any number type: spots, refocused spots, wavefronts.

use super::spot::ImageRay;
use super::wavefront::{PathRay, path_differences};
use super::{Beam, FieldBeam, SpotMoments, ToleranceError, WavefrontVariance, best_focus};
use crate::lens::System;
use crate::math::{Real, Vec3};
use crate::trace::{Landings, Ray, Rays, TraceSink as _, TracedRay, Tracer};

/// The quantities computed besides spots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeritOptions {
    /// The index of the primary wavelength.
    pub primary: usize,
    /// The position of the exit pupil on the axis from the first vertex and the primary wavelength,
    /// both in mm: for wavefronts; `None` for spots alone.
    pub wavefront: Option<(f64, f64)>,
}

/// The merits of a lens.
#[derive(Debug, Clone)]
pub struct Merits<R> {
    /// The spot of each field.
    pub spots: Vec<SpotMoments<R>>,
    /// The wavefront of each field at the primary wavelength, if it was asked for.
    pub wavefronts: Vec<WavefrontVariance<R>>,
    /// The weighted mean of the spots of all fields.
    pub mean: SpotMoments<R>,
    /// The displacement of the image plane in mm at which the mean square of all fields is least.
    pub focus: R,
}

impl<R: Real> Merits<R> {
    /// The mean square spot radius in mm², at the image plane.
    pub fn mean_square(&self) -> R {
        self.mean.a
    }

    /// The mean square spot radius in mm² at the best common focus.
    pub fn mean_square_focused(&self) -> R {
        self.mean.at(self.focus)
    }
}

/// A lens behind a surface, and the rays as they arrive there.
pub(super) struct Rear<'a, R> {
    pub(super) systems: &'a [System<R>],
    /// The position of the image plane from the first vertex of the whole lens, in mm.
    pub(super) image: R,
}

/// Judges a lens by the rays of a beam.
///
/// # Errors
/// A lens that cannot be traced, or the first ray that does not arrive.
pub fn merits<R: Real>(
    systems: &[System<R>],
    beam: &Beam,
    options: MeritOptions,
) -> Result<Merits<R>, ToleranceError> {
    let image = systems[options.primary].vertex_positions().last().copied().unwrap_or_default();
    Ok(merits_of(&Rear { systems, image }, beam, options)?.0)
}

/// The rays of each field at the image plane, with their weights.
pub(super) type ImageRays<R> = Vec<Vec<(ImageRay<R>, f64)>>;

/// As [`merits`], for the rear of a lens and rays that start in the frame of its first vertex.
pub(super) fn merits_of<R: Real>(
    rear: &Rear<'_, R>,
    beam: &Beam,
    options: MeritOptions,
) -> Result<(Merits<R>, ImageRays<R>), ToleranceError> {
    let tracers = open_tracers(rear.systems)?;
    let (mut spots, mut wavefronts, mut rays_of_all) = (Vec::new(), Vec::new(), Vec::new());
    for (number, field) in beam.fields.iter().enumerate() {
        let landings = trace_field(&tracers, field, number)?;
        let image_rays = image_rays(field, &landings);
        spots.push(SpotMoments::new(&image_rays));
        rays_of_all.push(image_rays);
        if let Some((pupil, um)) = options.wavefront {
            let pupil = R::from_f64(pupil) - rear.image;
            let index = rear.systems[options.primary].surfaces.last().map_or(R::ONE, |s| s.index);
            let chief = land(&tracers[options.primary], field.chief.0, number, 0)?;
            let chief = path_ray(chief.ray, chief.opl, field.chief.1);
            let colour = field.colours.iter().position(|c| c.wavelength == options.primary);
            let Some(colour) = colour else { continue };
            let rays = &field.colours[colour];
            let landed = &landings[colour];
            let path = |(i, start): (usize, &f64)| path_ray(landed.ray(i), landed.opl[i], *start);
            let paths: Vec<_> = rays.paths.iter().enumerate().map(path).collect();
            let waves = path_differences(&paths, &chief, pupil, index);
            let waves: Vec<R> = waves.into_iter().map(|w| w * R::from_f64(1.0 / um)).collect();
            let total: f64 = rays.weights.iter().sum();
            let weights: Vec<f64> = rays.weights.iter().map(|w| w / total).collect();
            wavefronts.push(WavefrontVariance::new(&waves, &weights, &rays.pupil));
        }
    }
    let weighted = spots.iter().zip(&beam.fields).map(|(s, field)| s.weighted(field.weight));
    let mean = SpotMoments::sum(weighted);
    Ok((Merits { spots, wavefronts, mean, focus: best_focus(&mean) }, rays_of_all))
}

/// Tracers of systems whose rims clip nothing: the semi-diameters only tell where the crossing with an
/// asphere is sought first.
pub(super) fn open_tracers<R: Real>(
    systems: &[System<R>],
) -> Result<Vec<Tracer<R>>, ToleranceError> {
    systems.iter().map(|system| Ok(Tracer::new(system)?.without_rims())).collect()
}

/// The landings of the rays of a field, colour by colour.
fn trace_field<R: Real>(
    tracers: &[Tracer<R>],
    field: &FieldBeam,
    number: usize,
) -> Result<Vec<Landings<R>>, ToleranceError> {
    let colour = |colour: &super::ColourRays| {
        let rays: Rays<R> = colour.rays.iter().map(Ray::cast).collect();
        let mut landed = Landings::default();
        tracers[colour.wavelength].trace_batch(&rays, &mut landed);
        match (0..rays.len()).find(|ray| !landed.fate(*ray).is_imaged()) {
            Some(ray) => {
                Err(ToleranceError::RayLost { field: number, ray, fate: landed.fate(ray) })
            }
            None => Ok(landed),
        }
    };
    field.colours.iter().map(colour).collect()
}

/// The landing of a ray.
fn land<R: Real>(
    tracer: &Tracer<R>,
    ray: Ray<f64>,
    field: usize,
    number: usize,
) -> Result<TracedRay<R>, ToleranceError> {
    let traced = tracer.trace(ray.cast());
    if traced.fate.is_imaged() {
        Ok(traced)
    } else {
        Err(ToleranceError::RayLost { field, ray: number, fate: traced.fate })
    }
}

fn path_ray<R: Real>(Ray { point, direction }: Ray<R>, path: R, start: f64) -> PathRay<R> {
    PathRay { point, direction, path: path + R::from_f64(start) }
}

/// The rays of a field at the image plane, with their weights.
fn image_rays<R: Real>(field: &FieldBeam, landings: &[Landings<R>]) -> Vec<(ImageRay<R>, f64)> {
    let colours = field.colours.iter().zip(landings);
    let ray = |landed: &Landings<R>, i: usize| image_ray(&landed.ray(i));
    colours
        .flat_map(|(colour, landed)| {
            let weights = colour.weights.iter().enumerate();
            weights.map(move |(i, weight)| (ray(landed, i), *weight))
        })
        .collect()
}

/// The crossing of a ray with the image plane, on which it need not end: a sensor may be tilted.
pub(super) fn image_ray<R: Real>(ray: &Ray<R>) -> ImageRay<R> {
    let Vec3 { x, y, .. } = ray.point;
    [x, y, ray.direction.x / ray.direction.z, ray.direction.y / ray.direction.z]
}
