//! The rays by which the wavefront of a lens is judged, and that at any position of its image plane.
//!
//! Rays behind the lens are straight: their points, slopes and optical paths at the image plane tell the
//! wavefront at every other plane near it, so that a lens is traced once however it is refocused.

use super::merits::open_tracers;
use super::wavefront::{PathRay, path_differences};
use super::{FieldBeam, MeritOptions, ToleranceError, ToleranceScene, WavefrontVariance};
use crate::lens::{Lens, System};
use crate::math::{Real, Vec3, dot};
use crate::pupil::RayModel;
use crate::trace::Ray;

/// A ray at the image plane: x and y in mm, the slopes, and the optical path in mm.
pub(super) type WaveRay<R> = [R; 5];

/// The rays of a field at the primary wavelength.
#[derive(Debug, Clone)]
pub(super) struct WaveField {
    /// The weight of the field among all.
    pub(super) weight: f64,
    /// The rays and, last, the chief ray, with their paths up to their start in mm.
    pub(super) rays: Vec<(Ray<f64>, f64)>,
    /// The weights of the rays but the chief ray; they add up to 1.
    pub(super) weights: Vec<f64>,
    pupil: Vec<[f64; 2]>,
    tilts: Vec<Vec<f64>>,
}

/// The rays of all fields and the reference spheres.
#[derive(Debug, Clone)]
pub(super) struct WaveBeam {
    pub(super) fields: Vec<WaveField>,
    pub(super) primary: usize,
    /// The position of the exit pupil on the axis from the first vertex, in mm.
    exit_pupil: f64,
    /// The primary wavelength in mm.
    wavelength: f64,
}

/// The rays of a field as they arrive.
#[derive(Debug, Clone)]
pub(super) struct ArrivedField<R> {
    /// The rays and, last, the chief ray.
    pub(super) rays: Vec<WaveRay<R>>,
    /// 1 for light that runs along the axis at the image, −1 for light that runs against it.
    pub(super) sense: f64,
    pub(super) index: R,
    /// The position of the image plane from the first vertex, in mm.
    pub(super) image: R,
}

impl<R: Real> ArrivedField<R> {
    /// The same over other numbers.
    pub(super) fn map<S: Real>(&self, of: impl Fn(R) -> S) -> ArrivedField<S> {
        ArrivedField {
            rays: self.rays.iter().map(|ray| ray.map(&of)).collect(),
            sense: self.sense,
            index: of(self.index),
            image: of(self.image),
        }
    }

    /// The chief ray.
    pub(super) fn chief(&self) -> WaveRay<R> {
        self.rays.last().copied().unwrap_or_default()
    }
}

impl WaveField {
    /// The rays of a field at a wavelength; `None` if there are none.
    fn new(field: &FieldBeam, wavelength: usize) -> Option<Self> {
        let colour = field.colours.iter().find(|colour| colour.wavelength == wavelength)?;
        let total: f64 = colour.weights.iter().sum();
        let weights: Vec<f64> = colour.weights.iter().map(|weight| weight / total).collect();
        let rays = colour.rays.iter().copied().zip(colour.paths.iter().copied());
        let rays = rays.chain(std::iter::once(field.chief)).collect();
        let pupil = colour.pupil.clone();
        let tilts = tilts(&pupil, &weights);
        (total > 0.0).then_some(Self { weight: field.weight, rays, weights, pupil, tilts })
    }

    /// The number of a ray in messages: the chief ray is the first one of a field.
    fn number_of(&self, place: usize) -> usize {
        if place + 1 == self.rays.len() { 0 } else { place }
    }

    /// Takes piston and tilt across the pupil from values of all rays.
    pub(super) fn remove_tilt(&self, values: &mut [f64]) {
        for tilt in &self.tilts {
            let products = values.iter().zip(tilt).map(|(value, tilt)| value * tilt);
            let part: f64 = products.zip(&self.weights).map(|(product, w)| product * w).sum();
            values.iter_mut().zip(tilt).for_each(|(value, tilt)| *value -= part * tilt);
        }
    }
}

/// The share of the square of a coordinate of the pupil below which that is no tilt of its own.
const DEGENERATE: f64 = 1e-20;

/// Piston and both tilts across the pupil, orthogonal in the weights and with a mean square of 1.
fn tilts(pupil: &[[f64; 2]], weights: &[f64]) -> Vec<Vec<f64>> {
    let coordinate = |axis: usize| pupil.iter().map(|point| point[axis]).collect::<Vec<f64>>();
    let mut found: Vec<Vec<f64>> = vec![vec![1.0; weights.len()]];
    for mut tilt in [coordinate(0), coordinate(1)] {
        let square = |of: &[f64]| of.iter().zip(weights).map(|(v, w)| w * v * v).sum::<f64>();
        let before = square(&tilt);
        for other in &found {
            let weighted: Vec<f64> = other.iter().zip(weights).map(|(v, w)| w * v).collect();
            let part = dot(&weighted, &tilt);
            tilt.iter_mut().zip(other).for_each(|(value, other)| *value -= part * other);
        }
        let after = square(&tilt);
        if after > DEGENERATE * before {
            let unit = 1.0 / after.sqrt();
            tilt.iter_mut().for_each(|value| *value *= unit);
            found.push(tilt);
        }
    }
    found
}

/// The distance of an exit pupil at infinity in mm.
const FAR: f64 = 1e6;

impl WaveBeam {
    /// The rays of a lens at a zoom position at its primary wavelength; the reference spheres go through the
    /// centre of its paraxial exit pupil.
    ///
    /// # Errors
    /// A lens that focuses nothing, and a field without light at the primary wavelength.
    pub(super) fn new(
        (lens, zoom): (&Lens, usize),
        scene: &ToleranceScene,
    ) -> Result<Self, ToleranceError> {
        let primary = scene.lens.primary;
        let dark = |number: usize| {
            let text = format!("no light of field {} at the primary wavelength", number + 1);
            ToleranceError::Other(text)
        };
        let fields = scene.beam.fields.iter().enumerate();
        let fields = fields.map(|(i, field)| WaveField::new(field, primary).ok_or_else(|| dark(i)));
        Ok(Self {
            fields: fields.collect::<Result<_, _>>()?,
            primary,
            exit_pupil: exit_pupil((lens, zoom), scene)?,
            wavelength: 1e-3 * scene.lens.wavelengths[primary],
        })
    }

    /// The same as options of [`super::merits()`].
    pub(super) fn options(&self) -> MeritOptions {
        let wavefront = Some((self.exit_pupil, self.wavelength));
        MeritOptions { primary: self.primary, wavefront }
    }

    /// Traces a lens.
    ///
    /// # Errors
    /// The first ray that does not arrive.
    pub(super) fn trace<R: Real>(
        &self,
        systems: &[System<R>],
    ) -> Result<Vec<ArrivedField<R>>, ToleranceError> {
        let system = &systems[self.primary];
        let tracer = &open_tracers(std::slice::from_ref(system))?[0];
        let image = system.vertex_positions().last().copied().unwrap_or_default();
        let index = system.surfaces.last().map_or(R::ONE, |surface| surface.index);
        let field = |(number, field): (usize, &WaveField)| {
            let (mut rays, mut sense) = (Vec::with_capacity(field.rays.len()), 1.0);
            for (place, (ray, start)) in field.rays.iter().enumerate() {
                let traced = tracer.trace(ray.cast());
                if !traced.fate.is_imaged() {
                    let ray = field.number_of(place);
                    return Err(ToleranceError::RayLost { field: number, ray, fate: traced.fate });
                }
                let (point, to) = (traced.ray.point, traced.ray.direction);
                sense = to.z.value().signum();
                let path = traced.opl + R::from_f64(*start);
                rays.push([point.x, point.y, to.x / to.z, to.y / to.z, path]);
            }
            Ok(ArrivedField { rays, sense, index, image })
        };
        self.fields.iter().enumerate().map(field).collect()
    }

    /// The wavefront of a field in waves at an image plane that is displaced by `shift` mm.
    pub(super) fn waves<R: Real>(&self, arrived: &ArrivedField<R>, shift: R) -> Vec<R> {
        let sense = R::from_f64(arrived.sense);
        let ray = |[x, y, u, v, path]: &WaveRay<R>| {
            let z = sense / (R::ONE + *u * *u + *v * *v).sqrt();
            let point = Vec3::new(*x + shift * *u, *y + shift * *v, R::ZERO);
            let path = *path + arrived.index * (shift / z);
            PathRay { point, direction: Vec3::new(*u * z, *v * z, z), path }
        };
        let mut rays: Vec<PathRay<R>> = arrived.rays.iter().map(ray).collect();
        let Some(chief) = rays.pop() else { return Vec::new() };
        let pupil = R::from_f64(self.exit_pupil) - arrived.image - shift;
        let unit = R::from_f64(1.0 / self.wavelength);
        let waves = path_differences(&rays, &chief, pupil, arrived.index);
        waves.into_iter().map(|difference| difference * unit).collect()
    }

    /// The mean variance over all fields, less piston and tilt, in squared waves, with a displacement of the
    /// image plane in mm for each field.
    pub(super) fn variance<R: Real>(&self, arrived: &[ArrivedField<R>], shifts: &[R]) -> R {
        let mut sum = R::ZERO;
        for ((field, arrived), shift) in self.fields.iter().zip(arrived).zip(shifts) {
            let waves = self.waves(arrived, *shift);
            let variance = WavefrontVariance::new(&waves, &field.weights, &field.pupil);
            sum += variance.tilt_removed * R::from_f64(field.weight);
        }
        sum
    }
}

/// The centre of the paraxial exit pupil from the first vertex, in mm.
fn exit_pupil((lens, zoom): (&Lens, usize), scene: &ToleranceScene) -> Result<f64, ToleranceError> {
    let model =
        RayModel::from_lens(lens, zoom).map_err(|why| ToleranceError::Other(why.to_string()))?;
    let first_order = &model.first_order;
    if first_order.efl.is_none() {
        let text = "the lens focuses nothing, so that its wavefront has no reference sphere; \
                    expected a lens with a focal length";
        return Err(ToleranceError::Other(text.to_owned()));
    }
    let vertices = scene.lens.systems[scene.lens.primary].vertex_positions();
    let last = vertices.get(vertices.len().saturating_sub(2)).copied().unwrap_or_default();
    Ok(first_order.exit_pupil.position.map_or(-FAR, |position| last + position))
}
