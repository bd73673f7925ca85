//! Uniform cubic B-splines, and a profile made of them.

use super::grid::{floor_cell, to_index};
use super::{ProfileFunction, ProfileSample, ProfileSamples};
use crate::grin::lanes::{LANES, LaneScalars};
use crate::math::Real;

/// The four cubic B-splines that are nonzero in a cell, at `0 ≤ t < 1`; the same polynomials
/// outside that range.
#[inline(always)]
pub(super) fn basis<R: Real>(t: R) -> [R; 4] {
    let c = R::from_f64;
    let (u, sixth) = (R::ONE - t, c(1.0 / 6.0));
    let (t2, u2) = (t * t, u * u);
    [
        u2 * u * sixth,
        (c(3.0) * t2 * t - c(6.0) * t2 + c(4.0)) * sixth,
        (c(3.0) * u2 * u - c(6.0) * u2 + c(4.0)) * sixth,
        t2 * t * sixth,
    ]
}

/// Their derivatives by `t`.
#[inline(always)]
pub(super) fn basis_slopes<R: Real>(t: R) -> [R; 4] {
    let c = R::from_f64;
    let (u, half) = (R::ONE - t, c(0.5));
    [
        -(u * u * half),
        (c(3.0) * t - c(4.0)) * t * half,
        -((c(3.0) * u - c(4.0)) * u * half),
        t * t * half,
    ]
}

/// Their second derivatives.
#[inline(always)]
pub(super) fn basis_curvatures<R: Real>(t: R) -> [R; 4] {
    let c = R::from_f64;
    let u = R::ONE - t;
    [u, c(3.0) * t - R::TWO, c(3.0) * u - R::TWO, t]
}

/// A cubic B-spline in `s` with uniform knots; the parameters are its coefficients. Beyond its ends
/// the polynomials of the outer cells continue.
#[derive(Debug, Clone, PartialEq)]
pub struct BSpline<R> {
    start: R,
    spacing: R,
    coefficients: Vec<R>,
}

impl<R: Real> BSpline<R> {
    /// The spline over `start ≤ s ≤ end`; `None` with fewer than four coefficients or an empty
    /// range.
    pub fn new(start: R, end: R, coefficients: Vec<R>) -> Option<Self> {
        let cells = coefficients.len().checked_sub(3).filter(|cells| *cells > 0)?;
        let spacing = (end - start) / R::from_f64(cells as f64);
        (spacing > R::ZERO && spacing.is_finite() && start.is_finite()).then_some(Self {
            start,
            spacing,
            coefficients,
        })
    }

    /// The first coefficient of the support at `s`, and the position within its cell.
    #[inline(always)]
    fn locate(&self, s: R) -> (usize, R) {
        let u = (s - self.start) / self.spacing;
        let first = floor_cell(u.value(), (self.coefficients.len() - 4) as f64);
        (to_index(first), u - R::from_f64(first))
    }
}

#[inline(always)]
fn sum<R: Real>(weights: [R; 4], values: &[R]) -> R {
    weights[0] * values[0]
        + weights[1] * values[1]
        + weights[2] * values[2]
        + weights[3] * values[3]
}

impl<R: Real> ProfileFunction<R> for BSpline<R> {
    fn parameters(&self) -> &[R] {
        &self.coefficients
    }

    fn parameters_mut(&mut self) -> &mut [R] {
        &mut self.coefficients
    }

    #[inline(always)]
    fn evaluate(&self, s: R) -> ProfileSample<R> {
        let (first, t) = self.locate(s);
        let values = &self.coefficients[first..first + 4];
        let scale = R::ONE / self.spacing;
        ProfileSample {
            value: sum(basis(t), values),
            slope: sum(basis_slopes(t), values) * scale,
            curvature: sum(basis_curvatures(t), values) * scale * scale,
        }
    }

    /// Locates the cells, gathers the coefficients, sums: SIMD lanes do all but the gathering.
    #[inline(always)]
    fn evaluate_block(&self, s: &LaneScalars<R>, out: &mut ProfileSamples<R>) {
        let (mut first, mut t) = ([0; LANES], [R::ZERO; LANES]);
        for lane in 0..LANES {
            (first[lane], t[lane]) = self.locate(s[lane]);
        }
        let mut four = [[R::ZERO; LANES]; 4];
        for (lane, first) in first.into_iter().enumerate() {
            let values = &self.coefficients[first..first + 4];
            for (column, value) in four.iter_mut().zip(values) {
                column[lane] = *value;
            }
        }
        let scale = R::ONE / self.spacing;
        for (lane, &t) in t.iter().enumerate() {
            let values = [four[0][lane], four[1][lane], four[2][lane], four[3][lane]];
            out.value[lane] = sum(basis(t), &values);
            out.slope[lane] = sum(basis_slopes(t), &values) * scale;
            out.curvature[lane] = sum(basis_curvatures(t), &values) * scale * scale;
        }
    }

    #[inline(always)]
    fn accumulate(&self, s: R, weight: R, pull: R, gradient: &mut [R]) {
        let (first, t) = self.locate(s);
        let pull = pull / self.spacing;
        let (values, slopes) = (basis(t), basis_slopes(t));
        for (q, g) in gradient[first..first + 4].iter_mut().enumerate() {
            *g += weight * values[q] + pull * slopes[q];
        }
    }

    fn knot_spacing(&self) -> Option<R> {
        Some(self.spacing)
    }
}
