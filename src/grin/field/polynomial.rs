//! A profile that is a polynomial: `f = Σ cₖ sᵏ`.

use super::{ProfileFunction, ProfileSample, ProfileSamples};
use crate::grin::lanes::{LANES, LaneScalars};
use crate::math::Real;

/// `f = Σ cₖ sᵏ`; the parameters are the coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct Polynomial<R> {
    /// `c₀, c₁, …`.
    pub coefficients: Vec<R>,
}

impl<R: Real> ProfileFunction<R> for Polynomial<R> {
    fn parameters(&self) -> &[R] {
        &self.coefficients
    }

    fn parameters_mut(&mut self) -> &mut [R] {
        &mut self.coefficients
    }

    /// Horner's rule for the value and both derivatives.
    #[inline(always)]
    fn evaluate(&self, s: R) -> ProfileSample<R> {
        let (mut value, mut slope, mut half_curvature) = (R::ZERO, R::ZERO, R::ZERO);
        for &c in self.coefficients.iter().rev() {
            half_curvature = half_curvature * s + slope;
            slope = slope * s + value;
            value = value * s + c;
        }
        ProfileSample { value, slope, curvature: half_curvature + half_curvature }
    }

    /// Applies each coefficient to all rays before the next.
    #[inline(always)]
    fn evaluate_block(&self, s: &LaneScalars<R>, out: &mut ProfileSamples<R>) {
        let ProfileSamples { value, slope, curvature } = out;
        for column in [&mut *value, &mut *slope, &mut *curvature] {
            *column = [R::ZERO; LANES];
        }
        for &c in self.coefficients.iter().rev() {
            for lane in 0..LANES {
                curvature[lane] = curvature[lane] * s[lane] + slope[lane];
                slope[lane] = slope[lane] * s[lane] + value[lane];
                value[lane] = value[lane] * s[lane] + c;
            }
        }
        for curvature in curvature {
            *curvature = *curvature + *curvature;
        }
    }

    #[inline(always)]
    fn accumulate(&self, s: R, weight: R, pull: R, gradient: &mut [R]) {
        // `power` is sᵏ and `slope` its derivative.
        let (mut power, mut slope) = (R::ONE, R::ZERO);
        for g in gradient {
            *g += weight * power + pull * slope;
            slope = slope * s + power;
            power = power * s;
        }
    }
}
