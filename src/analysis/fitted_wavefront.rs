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
use std::f64::consts::TAU;

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

/// The number of a wavefront that is made small.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WavefrontCost {
    /// The mean square, in squared waves.
    MeanSquare,
    /// One minus the Strehl ratio `|mean exp(2πi W)|²`.
    StrehlLoss,
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
    /// The mean of exp(2πi W), its real and imaginary part; known about the brightest image point.
    phasor: [f64; 2],
}

/// The corrections of the image point; each leaves the square of the error of the one before.
const CORRECTIONS: usize = 6;
/// A correction is the last one if it changes the mean square by less than this share: the tilt that
/// it leaves is as small as the square of the one that it has removed.
const SETTLED: f64 = 1e-12;
/// The steps to the brightest image point, and the shorter ones that are tried in place of each.
const BRIGHTENINGS: usize = 20;
const HALVINGS: usize = 6;
/// The largest RMS tilt of the phases by such a step, in rad.
const LONGEST: f64 = 1.0;
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
        Some(Self { reference, center, piston, waves, mean_square, phasor: [0.0; 2] })
    }

    /// The same with its phasor.
    fn with_phasor(mut self, weights: &[f64]) -> Self {
        let total: f64 = weights.iter().sum();
        let phasors = self.waves.iter().zip(weights).map(|(wave, w)| {
            let (sin, cos) = (TAU * wave.value).sin_cos();
            [w * cos / total, w * sin / total]
        });
        self.phasor = phasors.fold([0.0; 2], |sum, p| [sum[0] + p[0], sum[1] + p[1]]);
        self
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

    /// The same wavefront about the image point nearby where the Strehl ratio is largest.
    #[must_use]
    pub fn brightest(self, rays: &[ImageRay], weights: &[f64], mirrored: bool) -> Self {
        let mut best = self.with_phasor(weights);
        for _ in 0..BRIGHTENINGS {
            let mut step = best.brighter(weights, mirrored);
            let mut next = None;
            for _ in 0..HALVINGS {
                let center = [best.center[0] + step[0], best.center[1] + step[1]];
                let tried = Self::about(best.reference, rays, weights, center);
                let tried = tried.map(|tried| tried.with_phasor(weights));
                next = tried.filter(|tried| tried.strehl() > best.strehl());
                if next.is_some() {
                    break;
                }
                step = step.map(|v| 0.25 * v);
            }
            let Some(next) = next else { break };
            best = next;
        }
        best
    }

    /// The displacement of the image point to where the Strehl ratio is largest by its derivatives, in mm; uphill, by
    /// the sizes of its curvatures, where these do not describe a maximum.
    fn brighter(&self, weights: &[f64], mirrored: bool) -> [f64; 2] {
        let (gradient, curvatures, squares) = self.strehl_slopes(weights);
        // A half pupil, or one radius of a round one, cannot tell the tilt across it.
        let told = [0, 1].map(|k| squares[(k, k)] > TILTED * squares[(0, 0)].max(squares[(1, 1)]));
        let free = [told[0] && !mirrored, told[1]];
        let held = |i: usize, j: usize| if free[i] && free[j] { curvatures[(i, j)] } else { 0.0 };
        let eigen = Matrix2::from_fn(held).symmetric_eigen();
        let rise = Vector2::from_fn(|i, _| if free[i] { gradient[i] } else { 0.0 });
        let mut step = Vector2::zeros();
        for (direction, curvature) in eigen.eigenvectors.column_iter().zip(&eigen.eigenvalues) {
            let along = direction.dot(&rise);
            if along != 0.0 {
                step += direction * (along / curvature.abs().max(f64::MIN_POSITIVE));
            }
        }
        let tilt = step.dot(&(squares * step)).sqrt();
        let shorter = if tilt > LONGEST { LONGEST / tilt } else { 1.0 };
        (step * shorter).into()
    }

    /// The derivatives of the Strehl ratio by the image point, the second ones, and the mean products of those of the
    /// phases.
    fn strehl_slopes(&self, weights: &[f64]) -> (Vector2<f64>, Matrix2<f64>, Matrix2<f64>) {
        let total: f64 = weights.iter().sum();
        let slope = |wave: &WaveDual| Vector2::new(TAU * wave.slope[0], TAU * wave.slope[1]);
        let shares = weights.iter().map(|weight| weight / total);
        let rays = || self.waves.iter().zip(shares.clone());
        let mean = rays().fold(Vector2::zeros(), |sum, (wave, share)| sum + slope(wave) * share);
        let [re, im] = self.phasor;
        let (mut gradient, mut first) = (Vector2::zeros(), [Vector2::zeros(); 2]);
        let (mut second, mut squares) = (Matrix2::zeros(), Matrix2::zeros());
        for (wave, share) in rays() {
            let (sin, cos) = (TAU * wave.value).sin_cos();
            // What all phases have in common changes nothing.
            let slope = slope(wave) - mean;
            // exp(2πi W) turned by the phase of the mean: U* exp(2πi W).
            let (along, across) = (re * cos + im * sin, re * sin - im * cos);
            gradient -= slope * (2.0 * share * across);
            first[0] -= slope * (share * sin);
            first[1] += slope * (share * cos);
            let product = slope * slope.transpose() * share;
            squares += product;
            second -= product * along;
        }
        let products = first.map(|part| part * part.transpose());
        (gradient, (products[0] + products[1] + second) * 2.0, squares)
    }

    /// The Strehl ratio about the brightest image point: the intensity at the image point over that without path differences.
    pub fn strehl(&self) -> f64 {
        self.phasor[0].powi(2) + self.phasor[1].powi(2)
    }

    /// The number that is made small.
    pub fn cost(&self, cost: WavefrontCost) -> f64 {
        match cost {
            WavefrontCost::MeanSquare => self.mean_square,
            WavefrontCost::StrehlLoss => 1.0 - self.strehl(),
        }
    }

    /// The derivative of a cost by the path difference of a ray, over the ray's share of the light.
    pub fn cost_slope(&self, cost: WavefrontCost, ray: usize) -> f64 {
        let wave = self.waves[ray].value;
        match cost {
            WavefrontCost::MeanSquare => 2.0 * wave,
            WavefrontCost::StrehlLoss => {
                let (sin, cos) = (TAU * wave).sin_cos();
                2.0 * TAU * (self.phasor[0] * sin - self.phasor[1] * cos)
            }
        }
    }

    /// The change of a cost by the share of the light that comes with a ray; 0 if it misses the sphere.
    pub fn cost_excess(&self, cost: WavefrontCost, at: &ImageRay) -> f64 {
        match cost {
            WavefrontCost::MeanSquare => self.square(at) - self.mean_square,
            WavefrontCost::StrehlLoss => self.reference.wave(at, self.center).map_or(0.0, |wave| {
                let (sin, cos) = (TAU * (wave.value - self.piston)).sin_cos();
                2.0 * (self.strehl() - self.phasor[0] * cos - self.phasor[1] * sin)
            }),
        }
    }

    /// The factor between half of the second derivatives of a cost and those of the mean square, near a
    /// good image.
    pub fn cost_curvature(&self, cost: WavefrontCost) -> f64 {
        match cost {
            WavefrontCost::MeanSquare => 1.0,
            WavefrontCost::StrehlLoss => TAU * TAU * self.strehl(),
        }
    }

    /// The square of a ray's path difference against the mean; 0 if it misses the sphere.
    fn square(&self, at: &ImageRay) -> f64 {
        let wave = self.reference.wave(at, self.center);
        wave.map_or(0.0, |wave| (wave.value - self.piston).powi(2))
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
    let (fitted, _, _) = fitted_at(region, nodes, form)?;
    Some(fitted.mean_square.sqrt())
}

/// The Strehl ratio about the brightest image point at some nodes of a pupil, as of
/// [`FittedWavefront::strehl`]; `None` if no ray arrives or one misses the sphere.
pub fn brightest_strehl(region: &Region<'_>, nodes: &Nodes, form: ReferenceForm) -> Option<f64> {
    let (fitted, rays, weights) = fitted_at(region, nodes, form)?;
    Some(fitted.brightest(&rays, &weights, nodes.mirrored).strehl())
}

/// The wavefront at some nodes of a pupil, with its rays and their weights.
fn fitted_at(
    region: &Region<'_>,
    nodes: &Nodes,
    form: ReferenceForm,
) -> Option<(FittedWavefront, Vec<ImageRay>, Vec<f64>)> {
    let traced = region.trace_nodes(nodes);
    let channel = region.launch.channel();
    let reference = WavefrontReference::new(&channel.system, channel.um, form);
    let ends = image_rays(&channel.tracer, &traced.rays, |i| traced.path_to(traced.rays.get(i)));
    let arrived = traced.landed.arrivals().filter_map(|(i, weight)| Some((ends[i]?, weight)));
    let (rays, weights): (Vec<_>, Vec<_>) = arrived.unzip();
    let fitted = FittedWavefront::new(reference, &rays, &weights, nodes.mirrored)?;
    Some((fitted, rays, weights))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The slope of a sphere is the tangent of the angle whose sine is the height over the radius.
    #[test]
    fn a_point_of_a_curved_image_moves_along_it() {
        let (radius, [x, y]) = (40.0_f64, [6.0, -11.0]);
        let reference = WavefrontReference {
            form: ReferenceForm::Infinite,
            image: Shape::Sphere { curvature: 1.0 / radius },
            index: 1.0,
            wavelength: 5e-4,
        };
        let point = reference.image_point([x, y]).unwrap();
        let height = (radius * radius - x * x - y * y).sqrt();
        assert!((point.z.value - (radius - height)).abs() < 1e-12, "{:?}", point.z);
        for (axis, off) in [x, y].into_iter().enumerate() {
            let slope = point.z.slope[axis];
            assert!((slope - off / height).abs() < 1e-12, "{slope} {}", off / height);
        }
    }

    /// Rays to one point from a round pupil, with a path difference in waves at each place of the unit disc.
    fn aberrated(waves: impl Fn(f64, f64) -> f64) -> (WavefrontReference, Vec<ImageRay>) {
        let wavelength = 5e-4;
        let (form, image) = (ReferenceForm::Infinite, Shape::Plane);
        let reference = WavefrontReference { form, image, index: 1.0, wavelength };
        let ray = |i: usize| {
            // Of equal area each, those of one radius around it.
            let (radius, azimuth) =
                ((0.05 * ((i / 40) as f64 + 0.5)).sqrt(), 0.05 * (i % 40) as f64);
            let (sin, cos) = (std::f64::consts::PI * azimuth).sin_cos();
            let (x, y) = (radius * sin, radius * cos);
            let [l, m] = [-0.1 * x, -0.1 * y];
            let direction = Vec3::new(l, m, (1.0 - l * l - m * m).sqrt());
            let ray = Ray { point: Vec3::default(), direction };
            ImageRay { ray, path: -wavelength * waves(x, y) }
        };
        (reference, (0..800).map(ray).collect())
    }

    /// In an image that is a ring, as with waves of defocus, the point of the least mean square is darker than those
    /// around it; the way from there to the brightest one is uphill, and leads to a maximum.
    #[test]
    fn the_brightest_point_is_a_maximum_where_the_best_one_by_squares_is_none() {
        for defocus in [1.0, 2.2, 3.0] {
            let (reference, rays) = aberrated(|x, y| {
                let square = x * x + y * y;
                defocus * square + 0.8 * (square - 2.0 / 3.0) * y + 0.1 * x * y
            });
            let weights = vec![1.0; rays.len()];
            let start = FittedWavefront::new(reference, &rays, &weights, false).unwrap();
            let start = start.with_phasor(&weights);
            let (_, curvatures, _) = start.strehl_slopes(&weights);
            assert!(curvatures.symmetric_eigenvalues().max() > 0.0, "a maximum from the start");
            let found = start.clone().brightest(&rays, &weights, false);
            let (gradient, curvatures, _) = found.strehl_slopes(&weights);
            // By a displacement of the radius of the image without aberrations, 0.61 λ/NA.
            let slope = 0.61 * 5e-4 / 0.1 * gradient.norm();
            let strehl = found.strehl();
            assert!(slope < 1e-6 * strehl, "{defocus}: {slope:e} of {strehl}");
            assert!(strehl > start.strehl() && curvatures.symmetric_eigenvalues().max() < 0.0);
        }
    }
}
