//! The hyperbolic-secant fibre, the only one that refocuses all meridional rays.
//!
//! `η = n₀ / cosh(a r)` (Mikaelian 1951; Marchand, *Gradient Index Optics*, 1978): parallel light
//! meets the axis at `π/2a`, `3π/2a`, …

use super::layered::clamp_coordinate;
use super::{ProfileFunction, ProfileSample};
use crate::math::Real;

/// Beyond this `(a r)²` the profile is constant, so that the series stays short.
const CUT: f64 = 100.0;

/// `f = n₀ / cosh(a √s)` for `s ≥ 0`; its parameters are `n₀` and `a`.
#[derive(Debug, Clone, PartialEq)]
pub struct Sech<R> {
    parameters: [R; 2],
}

impl<R: Real> Sech<R> {
    /// The fibre of index `axis` on its axis and constant `a`.
    pub fn new(axis: R, a: R) -> Self {
        Self { parameters: [axis, a] }
    }
}

/// `cosh √q = Σ qᵏ/(2k)!` and its first two derivatives with respect to `q`. All terms are
/// positive, so nothing cancels, and the axis needs no special case.
fn cosh_root<R: Real>(q: R) -> [R; 3] {
    // The sum so far of each derivative. Terms of the m-th: qᵏ (k+m)!/(k! (2k+2m)!).
    let (half, twelfth) = (R::from_f64(0.5), R::from_f64(1.0 / 12.0));
    let mut terms = [R::ONE, half, twelfth];
    let mut sums = terms;
    for k in 1..60_u32 {
        for (m, (term, sum)) in (0_u32..).zip(terms.iter_mut().zip(&mut sums)) {
            let (k, n) = (f64::from(k), f64::from(k + m));
            let ratio = n / (k * (2.0 * n) * (2.0 * n - 1.0));
            *term = *term * q * R::from_f64(ratio);
            *sum += *term;
        }
        if terms[2].value().abs() < R::EPSILON * 1e-2 * sums[2].value().abs() {
            break;
        }
    }
    sums
}

impl<R: Real> Sech<R> {
    /// `a² s` clamped to the cut, the factor 1 before the cut and 0 beyond it, and `cosh √q` with
    /// its derivatives.
    fn cosh_parts(&self, s: R) -> (R, R, [R; 3]) {
        let [_, a] = self.parameters;
        let (q, inside) = clamp_coordinate(a * a * s, CUT);
        (q, inside, cosh_root(q))
    }
}

impl<R: Real> ProfileFunction<R> for Sech<R> {
    fn parameters(&self) -> &[R] {
        &self.parameters
    }

    fn parameters_mut(&mut self) -> &mut [R] {
        &mut self.parameters
    }

    fn evaluate(&self, s: R) -> ProfileSample<R> {
        let [axis, a] = self.parameters;
        let (_, on, [c, c1, c2]) = self.cosh_parts(s);
        let (value, square) = (axis / c, on * a * a);
        let slope = -(value * c1 / c * square);
        let curvature = value * square * square * (R::TWO * c1 * c1 / c - c2) / c;
        ProfileSample { value, slope, curvature }
    }

    /// With respect to `q = a² s`: `df/dq = -n₀ c'/c²`, and `f' = a² df/dq`.
    fn accumulate(&self, s: R, weight: R, pull: R, gradient: &mut [R]) {
        let [axis, a] = self.parameters;
        let (_, on, [c, c1, c2]) = self.cosh_parts(s);
        let by_q = -(c1 / (c * c));
        let by_q2 = (R::TWO * c1 * c1 / c - c2) / (c * c);
        gradient[0] += weight / c + on * pull * by_q * a * a;
        let slope_by_a = R::TWO * a * (by_q + a * a * s * by_q2);
        gradient[1] += on * axis * (weight * by_q * R::TWO * a * s + pull * slope_by_a);
    }
}
