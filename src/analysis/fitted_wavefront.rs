//! The wavefront of some rays about the image point that makes its mean square least.
//!
//! A ray that ends at `P` with the direction `d` after the optical path `L` differs from the ray
//! through the image point `C` by `W = −(L + n' s)/λ`, up to an additive constant, where `s` is the
//! way from `P` to the sphere about `C` ([`ReferenceForm::length_beyond`]; Welford, *Aberrations of
//! Optical Systems*, 1986, section 7.2). The constant and `C` remove piston and tilt.

use super::ReferenceForm;
use crate::lens::{Shape, System};
use crate::math::{Dual, Vec3};
use crate::pupil::{Nodes, Region};
use crate::trace::{AdjointSeed, Landings, Ray, Rays, TraceSink as _, Tracer};
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

/// A path difference in waves with its derivatives by the image point across the axis (2), by the end
/// of the ray (3) and by its direction there (3).
type WaveDual = Dual<f64, 8>;
/// The first of the derivatives by the end of the ray, and the first of those by its direction.
const BY_POINT: usize = 2;
const BY_DIRECTION: usize = 5;

/// The reference of path differences, but for the image point.
#[derive(Debug, Clone, Copy)]
pub struct WavefrontReference {
    form: ReferenceForm,
    /// The image surface.
    image: Shape<f64>,
    /// The index in the image space.
    index: f64,
    /// The wavelength, in mm.
    wavelength: f64,
}

/// A ray at the image: its end, its direction and the optical path from the object.
#[derive(Debug, Clone, Copy)]
pub struct ImageRay {
    ray: Ray<f64>,
    path: f64,
}

impl WavefrontReference {
    /// From a lens at a wavelength in µm and the form of its sphere.
    pub fn new(system: &System<f64>, um: f64, form: ReferenceForm) -> Self {
        let (index, image) = match system.surfaces.as_slice() {
            [.., last, image] => (last.index, image.shape),
            _ => (system.index_before, Shape::Plane),
        };
        Self { form, image, index, wavelength: 1e-3 * um }
    }

    /// The path difference of a ray from one through an image point; `None` if the ray misses the
    /// sphere.
    fn wave(&self, at: &ImageRay, center: [f64; 2]) -> Option<WaveDual> {
        let variable = |value: f64, first: usize, axis: usize| Dual::variable(value, first + axis);
        let vector = |v: Vec3<f64>, first: usize| {
            Vec3::new(variable(v.x, first, 0), variable(v.y, first, 1), variable(v.z, first, 2))
        };
        let off = vector(at.ray.point, BY_POINT) - self.image_point(center)?;
        let direction = vector(at.ray.direction, BY_DIRECTION);
        let beyond = self.form.length_beyond(off, direction)?;
        let length = WaveDual::constant(at.path) + beyond * WaveDual::constant(self.index);
        Some(length * WaveDual::constant(-1.0 / self.wavelength))
    }

    /// A point of the image surface, with its derivatives by its place across the axis.
    fn image_point(&self, [x, y]: [f64; 2]) -> Option<Vec3<WaveDual>> {
        let (sag, slope) = self.image.sag(x * x + y * y)?;
        let mut z = WaveDual::constant(sag);
        z.slope[..BY_POINT].copy_from_slice(&[2.0 * slope * x, 2.0 * slope * y]);
        Some(Vec3::new(Dual::variable(x, 0), Dual::variable(y, 1), z))
    }
}

/// The wavefront of a pupil about its best image point.
#[derive(Debug, Clone)]
pub struct FittedWavefront {
    reference: WavefrontReference,
    center: [f64; 2],
    /// The mean path difference, in waves.
    piston: f64,
    /// The path difference of each ray without the piston.
    waves: Vec<WaveDual>,
    /// The mean square, in squared waves.
    pub mean_square: f64,
}

/// The corrections of the image point; each leaves the square of the error of the one before.
const CORRECTIONS: usize = 6;
/// A correction is the last one if it changes the mean square by less than this share: the tilt that
/// it leaves is as small as the square of the one that it has removed.
const SETTLED: f64 = 1e-12;
/// A tilt is told from the mean square slope of the waves above this share of the larger one.
const TILTED: f64 = 1e-12;

impl FittedWavefront {
    /// From the rays of a pupil and their weights; those of a half pupil if `mirrored`, whose image
    /// point lies in the plane of symmetry. `None` if a ray misses the sphere.
    pub fn new(
        reference: WavefrontReference,
        rays: &[ImageRay],
        weights: &[f64],
        mirrored: bool,
    ) -> Option<Self> {
        let total: f64 = weights.iter().sum();
        let mean = |axis: fn(&Vec3<f64>) -> f64| {
            rays.iter().zip(weights).map(|(at, w)| w * axis(&at.ray.point)).sum::<f64>() / total
        };
        let start = [if mirrored { 0.0 } else { mean(|p| p.x) }, mean(|p| p.y)];
        let mut fitted = Self::about(reference, rays, weights, start)?;
        for _ in 0..CORRECTIONS {
            let [x, y] = fitted.correction(weights, mirrored);
            let center = [fitted.center[0] + x, fitted.center[1] + y];
            let next = Self::about(reference, rays, weights, center)?;
            let gain = fitted.mean_square - next.mean_square;
            if !(gain > -SETTLED * fitted.mean_square) {
                break;
            }
            fitted = next;
            if gain.abs() < SETTLED * fitted.mean_square {
                break;
            }
        }
        Some(fitted)
    }

    fn about(
        reference: WavefrontReference,
        rays: &[ImageRay],
        weights: &[f64],
        center: [f64; 2],
    ) -> Option<Self> {
        let waves: Option<Vec<_>> = rays.iter().map(|at| reference.wave(at, center)).collect();
        let mut waves = waves?;
        let total: f64 = weights.iter().sum();
        let remove_mean = |waves: &mut [WaveDual]| {
            let sum: f64 = waves.iter().zip(weights).map(|(wave, w)| w * wave.value).sum();
            waves.iter_mut().for_each(|wave| wave.value -= sum / total);
            sum / total
        };
        // Once more for the rounding of a sum of whole paths: derivatives hold the piston.
        let piston = remove_mean(&mut waves) + remove_mean(&mut waves);
        let squares = waves.iter().zip(weights).map(|(wave, w)| w * wave.value * wave.value);
        let mean_square = squares.sum::<f64>() / total;
        Some(Self { reference, center, piston, waves, mean_square })
    }

    /// The displacement of the image point to where the mean square is least in first order, in mm.
    fn correction(&self, weights: &[f64], mirrored: bool) -> [f64; 2] {
        let total: f64 = weights.iter().sum();
        let mean = |of: &dyn Fn(&WaveDual) -> f64| {
            self.waves.iter().zip(weights).map(|(wave, w)| w * of(wave)).sum::<f64>() / total
        };
        let means = [mean(&|wave| wave.slope[0]), mean(&|wave| wave.slope[1])];
        let slope = |wave: &WaveDual, axis: usize| wave.slope[axis] - means[axis];
        let product = |i, j| mean(&|wave| slope(wave, i) * slope(wave, j));
        let falls = |axis| -mean(&|wave| slope(wave, axis) * wave.value);
        let (xx, yy) = (product(0, 0), product(1, 1));
        // A half pupil, or one radius of a round one, cannot tell the tilt across it.
        let told = |square: f64| square > TILTED * xx.max(yy);
        match (told(xx) && !mirrored, told(yy)) {
            (true, true) => {
                let xy = product(0, 1);
                let found =
                    Matrix2::new(xx, xy, xy, yy).lu().solve(&Vector2::new(falls(0), falls(1)));
                found.map_or([0.0; 2], Into::into)
            }
            (true, false) => [falls(0) / xx, 0.0],
            (false, true) => [0.0, falls(1) / yy],
            (false, false) => [0.0; 2],
        }
    }

    /// The square of a ray's path difference against the mean; 0 if it misses the sphere.
    pub fn square(&self, at: &ImageRay) -> f64 {
        let wave = self.reference.wave(at, self.center);
        wave.map_or(0.0, |wave| (wave.value - self.piston).powi(2))
    }

    /// The path difference of a ray, in waves.
    pub fn wave(&self, ray: usize) -> f64 {
        self.waves[ray].value
    }

    /// The derivatives of a path difference by the landing of its ray.
    pub fn seed(&self, ray: usize, factor: f64) -> AdjointSeed<f64> {
        let slope = self.waves[ray].slope.map(|slope| factor * slope);
        let vector = |first: usize| Vec3::new(slope[first], slope[first + 1], slope[first + 2]);
        let opl = -factor / self.reference.wavelength;
        AdjointSeed { point: vector(BY_POINT), direction: vector(BY_DIRECTION), opl }
    }

    /// Removes from a row of numbers for each ray what piston and tilt can make of them, so that their
    /// products are those of the residuals.
    pub fn without_piston_and_tilt(
        &self,
        mut rows: DMatrix<f64>,
        roots: &[f64],
        mirrored: bool,
    ) -> DMatrix<f64> {
        let column = |of: &dyn Fn(&WaveDual) -> f64| {
            let values = self.waves.iter().zip(roots).map(|(wave, root)| root * of(wave));
            DVector::from_iterator(roots.len(), values)
        };
        let tilts = [column(&|wave| wave.slope[0]), column(&|wave| wave.slope[1])];
        let largest = tilts.iter().map(DVector::norm).fold(0.0, f64::max);
        let mut basis = vec![column(&|_| 1.0).normalize()];
        for (axis, mut tilt) in tilts.into_iter().enumerate() {
            if axis == 0 && mirrored {
                continue;
            }
            basis.iter().for_each(|other| tilt -= other * other.dot(&tilt));
            if tilt.norm_squared() > TILTED * largest * largest {
                basis.push(tilt.normalize());
            }
        }
        for direction in basis {
            let along = direction.transpose() * &rows;
            rows.ger(-1.0, &direction, &along.transpose(), 1.0);
        }
        rows
    }
}

/// The rays at the image, `None` for a lost one; `path` gives the optical path to the start of each.
pub fn image_rays(
    tracer: &Tracer<f64>,
    rays: &Rays<f64>,
    path: impl Fn(usize) -> f64,
) -> Vec<Option<ImageRay>> {
    let mut landed = Landings::default();
    tracer.trace_batch(rays, &mut landed);
    let ray = |i: usize| {
        let at = ImageRay { ray: landed.ray(i), path: path(i) + landed.opl[i] };
        landed.fate(i).is_imaged().then_some(at)
    };
    (0..rays.len()).map(ray).collect()
}

/// The RMS wavefront at some nodes of a pupil, in waves; `None` if no ray arrives or one misses the
/// sphere.
pub fn rms_without_tilt(region: &Region<'_>, nodes: &Nodes, form: ReferenceForm) -> Option<f64> {
    let traced = region.trace_nodes(nodes);
    let channel = region.launch.channel();
    let reference = WavefrontReference::new(&channel.system, channel.um, form);
    let ends = image_rays(&channel.tracer, &traced.rays, |i| traced.path_to(traced.rays.get(i)));
    let arrived = traced.landed.arrivals().filter_map(|(i, weight)| Some((ends[i]?, weight)));
    let (rays, weights): (Vec<_>, Vec<_>) = arrived.unzip();
    let fitted = FittedWavefront::new(reference, &rays, &weights, nodes.mirrored)?;
    Some(fitted.mean_square.sqrt())
}
