//! The wavefront as a sum of Zernike polynomials.
//!
//! Over the clear disc each coefficient is a projection and does not depend on the others. Over a
//! clipped pupil the polynomials are not orthogonal: there they are a least-squares fit of all terms
//! together, which is another thing under another name, with the condition of the fit.

use super::reference_sphere::ReferenceSphere;
use super::{AnalysisError, Estimate, lit_region};
use crate::lens::FieldPoint;
use crate::math::Vec3;
use crate::pupil::{Accuracy, Nodes, RayModel, Region, RegionKind, converge_resolved};
use crate::trace::{Landings, Ray, Rays};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// The order and the normalization of Zernike polynomials.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ZernikeOrder {
    /// Noll, JOSA 66 (1976): each has an RMS of 1 over the disc; azimuth from +x, even numbers are
    /// cosines.
    Noll,
    /// Fringe (University of Arizona): each is 1 at the rim.
    Fringe,
}

/// The way in which the coefficients were found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ZernikeMethod {
    /// Projections over the clear disc, independent of each other.
    Projection,
    /// A least-squares fit over a clipped pupil, with its condition number: the ratio of the largest
    /// RMS of a normalized sum of the polynomials to the smallest.
    LeastSquares(f64),
}

/// The Zernike coefficients of the wavefront of a field at one wavelength.
#[derive(Debug, Clone, PartialEq)]
pub struct ZernikeSum {
    /// The order of the coefficients.
    pub order: ZernikeOrder,
    /// The way in which they were found.
    pub method: ZernikeMethod,
    /// The coefficients in wavelengths, the first of number 1.
    pub coefficients: Vec<Estimate>,
    /// The RMS of what the sum leaves, in wavelengths.
    pub rest: Estimate,
    /// True if the tolerance was reached.
    pub reached: bool,
}

/// The radial degree and the azimuthal frequency of a polynomial: positive for a cosine, negative for
/// a sine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ZernikeIndex {
    /// The radial degree.
    pub degree: u32,
    /// The azimuthal frequency.
    pub frequency: i32,
}

impl ZernikeOrder {
    /// The indices of the first polynomials.
    pub fn indices(self, count: usize) -> Vec<ZernikeIndex> {
        match self {
            Self::Noll => (1..=count).map(noll).collect(),
            Self::Fringe => {
                let mut all = all_indices(2 * count as u32);
                all.sort_by_key(|index| fringe_number(*index));
                all.truncate(count);
                all
            }
        }
    }

    /// The value of a polynomial of RMS 1 in units of this order.
    fn scale(self, index: ZernikeIndex) -> f64 {
        match self {
            Self::Noll => 1.0,
            Self::Fringe => index.normalization(),
        }
    }
}

/// The polynomial of a number in Noll's order, from 1.
fn noll(number: usize) -> ZernikeIndex {
    let mut degree = 0;
    let mut before = 0;
    while before + degree + 1 < number {
        before += degree + 1;
        degree += 1;
    }
    let place = number - before - 1;
    // Frequencies of a degree: 0, 2, 2, 4, 4, … or 1, 1, 3, 3, …
    let size = if degree % 2 == 0 { place.div_ceil(2) * 2 } else { place / 2 * 2 + 1 } as i32;
    let frequency = if number.is_multiple_of(2) { size } else { -size };
    ZernikeIndex { degree: degree as u32, frequency }
}

/// The number of a polynomial in the fringe order, from 1.
fn fringe_number(index: ZernikeIndex) -> u32 {
    let size = index.frequency.unsigned_abs();
    (1 + index.degree.midpoint(size)).pow(2) - 2 * size + u32::from(index.frequency < 0)
}

/// All polynomials up to a sum of degree and frequency that holds the first `count` fringe ones.
fn all_indices(count: u32) -> Vec<ZernikeIndex> {
    let reach = 2 * (f64::from(count).sqrt().ceil() as i32 + 1);
    let degree = |n: i32| {
        let frequencies = (-n..=n).step_by(2).filter(move |m| n + m.abs() <= reach);
        frequencies.map(move |frequency| ZernikeIndex { degree: n as u32, frequency })
    };
    (0..=reach).flat_map(degree).collect()
}

impl ZernikeIndex {
    /// The factor that gives the polynomial an RMS of 1 over the disc.
    fn normalization(self) -> f64 {
        let degree = f64::from(self.degree) + 1.0;
        if self.frequency == 0 { degree.sqrt() } else { (2.0 * degree).sqrt() }
    }

    /// The polynomial at a point of the disc, with an RMS of 1 over it.
    pub fn value(self, [x, y]: [f64; 2]) -> f64 {
        let size = self.frequency.unsigned_abs();
        let azimuth = f64::from(size) * y.atan2(x);
        let turn = if self.frequency < 0 { azimuth.sin() } else { azimuth.cos() };
        self.normalization() * radial_value(self.degree, size, x.hypot(y)) * turn
    }
}

/// The radial polynomial, by its sum of powers (Noll 1976, equation 3).
fn radial_value(degree: u32, frequency: u32, r: f64) -> f64 {
    let half = (degree - frequency) / 2;
    let mut sum = 0.0;
    for k in 0..=half {
        let mut term = 1.0;
        // (n − k)! / (k! ((n + m)/2 − k)! ((n − m)/2 − k)!)
        for i in 1..=degree - k {
            term *= f64::from(i);
        }
        for below in [k, degree.midpoint(frequency) - k, half - k] {
            for i in 1..=below {
                term /= f64::from(i);
            }
        }
        let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
        sum += sign * term * r.powi((degree - 2 * k) as i32);
    }
    sum
}

/// The Zernike coefficients of a field at a wavelength over the unit disc of the pupil coordinates;
/// errors are absolute, in wavelengths.
///
/// # Errors
/// The field is dark or has no reference sphere.
pub fn zernike(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    (order, count): (ZernikeOrder, usize),
    accuracy: Accuracy,
) -> Result<ZernikeSum, AnalysisError> {
    let region = lit_region(model, field, wavelength)?;
    let sphere = ReferenceSphere::for_region(&region)?;
    let indices = order.indices(count);
    let clear = region.kind == RegionKind::Clear;
    let mut condition = 1.0;
    let numbers = |nodes: &Nodes| {
        let samples = WaveSamples::new(&region, &sphere, nodes)?;
        let (mut list, found) =
            if clear { samples.project(&indices) } else { samples.fit(&indices)? };
        condition = found;
        list.push(samples.rest(&indices, &list));
        list.iter_mut().zip(&indices).for_each(|(c, index)| *c *= order.scale(*index));
        Some(list)
    };
    // With fewer nodes polynomials of the highest degree are those of lower ones, and a fit has no least.
    let least = indices.iter().map(|index| index.degree as usize + 1).max().unwrap_or(0);
    let scales = |list: &[f64]| vec![1.0; list.len()];
    let found = converge_resolved(&region, accuracy, least, numbers, scales);
    let found = found.ok_or(AnalysisError::NoLight)?;
    let rounding = sphere.rounding();
    let estimate =
        |k: usize| Estimate::new(found.values[k], found.errors[k].max(rounding), found.rays);
    let fitted = ZernikeMethod::LeastSquares(condition);
    Ok(ZernikeSum {
        order,
        method: if clear { ZernikeMethod::Projection } else { fitted },
        coefficients: (0..indices.len()).map(estimate).collect(),
        rest: estimate(indices.len()),
        reached: found.converged,
    })
}

/// The path differences of a pupil, with both halves of one that is its own mirror image.
struct WaveSamples {
    points: Vec<[f64; 2]>,
    waves: Vec<f64>,
    weights: Vec<f64>,
}

impl WaveSamples {
    fn new(region: &Region<'_>, sphere: &ReferenceSphere, nodes: &Nodes) -> Option<Self> {
        let launch = &region.launch;
        let lit = || nodes.points.iter().filter_map(|p| Some((*p, launch.ray(*p)?)));
        let points: Vec<[f64; 2]> = lit().map(|(p, _)| p).collect();
        let starts: Rays<f64> = lit().map(|(_, ray)| ray).collect();
        let landed = region.trace::<Landings<f64>>(nodes);
        let hits = &landed.sink;
        let mut samples = Self { points: Vec::new(), waves: Vec::new(), weights: Vec::new() };
        for (i, weight) in landed.arrivals() {
            let point = Vec3::new(hits.x[i], hits.y[i], hits.z[i]);
            let direction = Vec3::new(hits.l[i], hits.m[i], hits.n[i]);
            let path = launch.optical_path_to(starts.get(i)) + hits.opl[i];
            let Some(found) = sphere.project(Ray { point, direction }, path) else { continue };
            let [x, y] = points[i];
            let copies = if nodes.mirrored { vec![[x, y], [-x, y]] } else { vec![[x, y]] };
            for copy in &copies {
                samples.points.push(*copy);
                samples.waves.push(found.waves);
                samples.weights.push(weight / copies.len() as f64);
            }
        }
        (!samples.points.is_empty()).then_some(samples)
    }

    fn mean(&self, value: impl Fn(usize) -> f64) -> f64 {
        let sum: f64 = self.weights.iter().enumerate().map(|(i, w)| w * value(i)).sum();
        sum / self.weights.iter().sum::<f64>()
    }

    /// The mean of the product with each polynomial.
    fn project(&self, indices: &[ZernikeIndex]) -> (Vec<f64>, f64) {
        let one = |index: &ZernikeIndex| self.mean(|i| self.waves[i] * index.value(self.points[i]));
        (indices.iter().map(one).collect(), 1.0)
    }

    /// The coefficients of the sum nearest to the path differences, and the condition number.
    fn fit(&self, indices: &[ZernikeIndex]) -> Option<(Vec<f64>, f64)> {
        let rows = self.points.len();
        if rows < indices.len() {
            return None;
        }
        let total: f64 = self.weights.iter().sum();
        let root = |i: usize| (self.weights[i] / total).sqrt();
        let term = |i: usize, j: usize| root(i) * indices[j].value(self.points[i]);
        let matrix = DMatrix::from_fn(rows, indices.len(), term);
        let right = DVector::from_fn(rows, |i, _| root(i) * self.waves[i]);
        let qr = matrix.qr();
        let singular = qr.r().singular_values();
        let condition = singular.max() / singular.min();
        let mut projected = right;
        qr.q_tr_mul(&mut projected);
        let solution = qr.r().solve_upper_triangular(&projected.rows(0, indices.len()))?;
        Some((solution.iter().copied().collect(), condition))
    }

    /// The RMS of what a sum leaves.
    fn rest(&self, indices: &[ZernikeIndex], coefficients: &[f64]) -> f64 {
        let left = |i: usize| {
            let terms = indices.iter().zip(coefficients);
            let sum: f64 = terms.map(|(index, c)| c * index.value(self.points[i])).sum();
            (self.waves[i] - sum).powi(2)
        };
        self.mean(left).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sum that leaves a known part.
    #[test]
    fn the_rest_is_what_the_polynomials_leave() {
        let count = 400;
        let angle = |i: usize| std::f64::consts::TAU * (i as f64 + 0.5) / count as f64;
        let points: Vec<[f64; 2]> = (0..count).map(|i| [angle(i).cos(), angle(i).sin()]).collect();
        let waves: Vec<f64> = (0..count).map(|i| 0.7 + 0.2 * (9.0 * angle(i)).cos()).collect();
        let samples = WaveSamples { points, waves, weights: vec![1.0; count] };
        let piston = noll(1);
        let rest = samples.rest(&[piston], &[0.7]);
        assert!((rest - 0.2 / 2f64.sqrt()).abs() < 1e-12, "{rest}");
        assert!((samples.rest(&[piston], &[0.0]).powi(2) - 0.49 - 0.02).abs() < 1e-12);
        let (fitted, condition) = samples.fit(&[piston]).unwrap();
        assert!((fitted[0] - 0.7).abs() < 1e-12 && (condition - 1.0).abs() < 1e-12);
        let two = WaveSamples { points: vec![[0.0; 2]], waves: vec![1.0], weights: vec![1.0] };
        assert!(two.fit(&[piston, piston]).is_none());
    }
}
