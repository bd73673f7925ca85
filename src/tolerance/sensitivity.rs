//! First and second derivatives of the merits by every error of making.
//!
//! One bundle of rays is traced in plain numbers to each surface once; for each error it goes on from
//! the first surface that the error changes, over numbers that carry the first and second derivative
//! by the error. Nothing is differenced.

use super::merits::{ImageRays, Rear, merits, merits_of, open_tracers};
use super::spot::ImageRay;
use super::{
    Beam, ColourRays, FieldBeam, MeritOptions, Merits, NominalLens, SpotMoments, StopTest,
    ToleranceError, ToleranceScene, perturb, refuse_if_stopped,
};
use crate::lens::{Perturbation, System};
use crate::math::{Dual, Real, Vec3};
use crate::trace::{Ray, Tracer};
use rayon::prelude::*;

/// A number with its first and second derivative by one variable.
pub type Jet2 = Dual<Dual<f64, 1>, 1>;

/// A value and its first and second derivative by an error.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct Derivatives {
    /// The value.
    pub value: f64,
    /// The first derivative, per unit of the error.
    pub first: f64,
    /// The second derivative, per square of the unit of the error.
    pub second: f64,
}

impl Derivatives {
    /// The same, 0 where an error of this standard deviation changes the value by rounding alone; as it is for one
    /// without scatter.
    #[must_use]
    pub fn without_rounding(self, deviation: f64) -> Self {
        let above = |by: f64, deviation: f64| {
            let is_rounding = (by * deviation).abs() <= ROUNDING * self.value.abs();
            if is_rounding && deviation > 0.0 { 0.0 } else { by }
        };
        let (first, second) =
            (above(self.first, deviation), above(self.second, deviation * deviation));
        Self { first, second, ..self }
    }
}

/// A change below this share of a merit is rounding.
const ROUNDING: f64 = 1e-14;

impl From<Jet2> for Derivatives {
    fn from(jet: Jet2) -> Self {
        let first = jet.slope[0];
        Self { value: jet.value.value, first: first.value, second: first.slope[0] }
    }
}

/// The effect of an error of making on the merits of a lens.
#[derive(Debug, Clone)]
pub struct Sensitivity {
    /// The error.
    pub error: Perturbation,
    /// The merits as functions of it.
    pub merits: Merits<Jet2>,
    /// Its effect on each ray, all fields and wavelengths one after the other.
    pub rays: Vec<RaySensitivity>,
}

/// The effect of an error on a ray at the image plane, relative to the centroid of its field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RaySensitivity {
    /// The derivative of x and y by the error, in mm per unit of the error.
    pub displacement: [f64; 2],
    /// The slopes `L/N` and `M/N` without errors.
    pub slope: [f64; 2],
    /// The derivative of the slopes by the error.
    pub bend: [f64; 2],
}

/// The rays of a field relative to their centroid.
fn centred(rays: &[(ImageRay<Jet2>, f64)]) -> Vec<RaySensitivity> {
    let of = |ray: &ImageRay<Jet2>| {
        let first = |i: usize| ray[i].slope[0].value;
        [first(0), first(1), ray[2].value.value, ray[3].value.value, first(2), first(3)]
    };
    let mut center = [0.0; 6];
    for (ray, weight) in rays {
        center.iter_mut().zip(of(ray)).for_each(|(sum, number)| *sum += weight * number);
    }
    let relative = |(ray, _): &(ImageRay<Jet2>, f64)| {
        let [x, y, u, v, du, dv] = of(ray);
        let [cx, cy, cu, cv, cdu, cdv] = center;
        RaySensitivity {
            displacement: [x - cx, y - cy],
            slope: [u - cu, v - cv],
            bend: [du - cdu, dv - cdv],
        }
    };
    rays.iter().map(relative).collect()
}

impl Sensitivity {
    /// The mean square spot in mm², at the image plane.
    pub fn mean_square(&self) -> Derivatives {
        self.merits.mean_square().into()
    }

    /// The mean square spot in mm², at the best common focus.
    pub fn mean_square_focused(&self) -> Derivatives {
        self.merits.mean_square_focused().into()
    }

    /// The second derivatives of the moments of the mean spot, per squared unit.
    pub(super) fn second_moments(&self) -> SpotMoments<f64> {
        let SpotMoments { a, b, c } = self.merits.mean;
        let [a, b, c] = [a, b, c].map(|jet| jet.slope[0].slope[0]);
        SpotMoments { a, b, c }
    }

    /// The displacement of the best common focus, in mm.
    pub fn focus(&self) -> Derivatives {
        self.merits.focus.into()
    }
}

/// The derivatives by each error, all others being zero.
///
/// # Errors
/// An error that is not possible, a lens that cannot be traced, or a ray that does not arrive.
pub fn sensitivities(
    lens: &NominalLens,
    beam: &Beam,
    options: MeritOptions,
    errors: &[Perturbation],
) -> Result<Vec<Sensitivity>, ToleranceError> {
    sensitivities_until(lens, beam, options, errors, &|| false)
}

/// The same until `stop` says so.
///
/// # Errors
/// As those of [`sensitivities`], and [`ToleranceError::Stopped`].
pub(super) fn sensitivities_until(
    lens: &NominalLens,
    beam: &Beam,
    options: MeritOptions,
    errors: &[Perturbation],
    stop: StopTest<'_>,
) -> Result<Vec<Sensitivity>, ToleranceError> {
    let stages = Stages::new(lens, beam, options)?;
    let one = |error: &Perturbation| {
        refuse_if_stopped(stop)?;
        stages.sensitivity(lens, options, *error)
    };
    errors.par_iter().map(one).collect()
}

/// The second derivatives of the moments of the mean spot by each error, per squared unit, until `stop` says so.
///
/// # Errors
/// As those of [`sensitivities`], and [`ToleranceError::Stopped`].
pub(super) fn second_derivatives(
    scene: &ToleranceScene,
    errors: &[Perturbation],
    stop: StopTest<'_>,
) -> Result<Vec<SpotMoments<f64>>, ToleranceError> {
    let stages = Stages::new(&scene.lens, &scene.beam, scene.options)?;
    let one = |error: &Perturbation| {
        refuse_if_stopped(stop)?;
        Ok(stages.sensitivity(&scene.lens, scene.options, *error)?.second_moments())
    };
    errors.par_iter().map(one).collect()
}

/// The beam as it arrives at each surface of the lens as designed.
pub(super) struct Stages {
    /// The rays in the frame of each surface's vertex, in front of it.
    beams: Vec<Beam>,
}

impl Stages {
    pub(super) fn new(
        lens: &NominalLens,
        beam: &Beam,
        options: MeritOptions,
    ) -> Result<Self, ToleranceError> {
        // Every ray has to arrive.
        merits(&lens.systems, beam, options)?;
        let tracers = open_tracers(&lens.systems)?;
        let mut beams = vec![beam.clone()];
        // The rear of a lens that begins to run backwards would be another lens.
        let system = &lens.systems[lens.primary];
        let mirror = system.surfaces.iter().position(|s| s.mirror || s.grin.is_some());
        for surface in 1..mirror.unwrap_or(system.surfaces.len()) {
            let gaps = lens.systems.iter().map(|s| s.surfaces[surface - 1].thickness).collect();
            beams.push(
                Propagation { tracers: &tracers, gaps, to: surface - 1 }.beam(beam, lens.primary),
            );
        }
        Ok(Self { beams })
    }

    fn sensitivity(
        &self,
        lens: &NominalLens,
        options: MeritOptions,
        error: Perturbation,
    ) -> Result<Sensitivity, ToleranceError> {
        let variable = Jet2::variable(Dual::variable(0.0, 0), 0);
        let (merits, rays) = self.merits(lens, options, &[(error, variable)])?;
        let rays = rays.iter().flat_map(|rays| centred(rays)).collect();
        Ok(Sensitivity { error, merits, rays })
    }

    /// The merits of the lens with some errors, and its rays at the image plane.
    pub(super) fn merits<R: Real>(
        &self,
        lens: &NominalLens,
        options: MeritOptions,
        errors: &[(Perturbation, R)],
    ) -> Result<(Merits<R>, ImageRays<R>), ToleranceError> {
        let whole = perturb(lens, errors)?;
        let image = whole[lens.primary].vertex_positions().last().copied().unwrap_or_default();
        let first = errors.iter().map(|(error, _)| error.first).min().unwrap_or(0);
        let from = first.min(self.beams.len() - 1);
        let rear = |system: &System<R>| System {
            index_before: system.index_before(from),
            surfaces: system.surfaces[from..].to_vec(),
            stop: None,
        };
        let systems: Vec<_> = whole.iter().map(rear).collect();
        merits_of(&Rear { systems: &systems, image }, &self.beams[from], options)
    }
}

/// Propagation of a beam through the first surfaces, to the frame of the next vertex.
struct Propagation<'a> {
    tracers: &'a [Tracer<f64>],
    /// The gap in front of that vertex at each wavelength, in mm.
    gaps: Vec<f64>,
    to: usize,
}

impl Propagation<'_> {
    fn beam(&self, beam: &Beam, primary: usize) -> Beam {
        let field = |field: &FieldBeam| FieldBeam {
            weight: field.weight,
            colours: field.colours.iter().map(|colour| self.colour(colour)).collect(),
            chief: self.ray(primary, field.chief.0, field.chief.1),
        };
        Beam { fields: beam.fields.iter().map(field).collect() }
    }

    fn colour(&self, colour: &ColourRays) -> ColourRays {
        let mut arrived = ColourRays::new(colour.wavelength);
        for (i, ray) in colour.rays.iter().enumerate() {
            let (ray, path) = self.ray(colour.wavelength, *ray, colour.paths[i]);
            arrived.push(ray, colour.weights[i], colour.pupil[i], path);
        }
        arrived
    }

    fn ray(&self, wavelength: usize, ray: Ray<f64>, path: f64) -> (Ray<f64>, f64) {
        let traced = self.tracers[wavelength].trace_to(ray, self.to);
        let Vec3 { x, y, z } = traced.ray.point;
        let point = Vec3::new(x, y, z - self.gaps[wavelength]);
        (Ray { point, ..traced.ray }, path + traced.opl)
    }
}
