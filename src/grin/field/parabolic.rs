//! The parabolic fibre: `η² = n₀² (1 - g² s)`, in which every ray is an exact sinusoid.
//!
//! With `v_z` constant along a ray, `x(σ) = x₀ cos(n₀ g σ) + v₀ sin(n₀ g σ)/(n₀ g)` across the axis
//! (Marchand, *Gradient Index Optics*, 1978).

use super::layered::clamp_coordinate;
use super::{ProfileFunction, ProfileSample};
use crate::math::Real;

/// Beyond this `g² s` the profile is constant: the root must stay real.
const CUT: f64 = 0.9;

/// `f = n₀ √(1 - g² s)`; its parameters are `n₀` and `g`, per length where `s` is a squared radius.
#[derive(Debug, Clone, PartialEq)]
pub struct Parabolic<R> {
    parameters: [R; 2],
}

impl<R: Real> Parabolic<R> {
    /// The fibre of index `axis` on its axis and constant `g`.
    pub fn new(axis: R, g: R) -> Self {
        Self { parameters: [axis, g] }
    }

    /// `g² s` clamped to the cut, and the factor 1 before the cut, 0 beyond it.
    #[inline(always)]
    fn clamped_square(&self, s: R) -> (R, R) {
        let [_, g] = self.parameters;
        clamp_coordinate(g * g * s, CUT)
    }
}

impl<R: Real> ProfileFunction<R> for Parabolic<R> {
    fn parameters(&self) -> &[R] {
        &self.parameters
    }

    fn parameters_mut(&mut self) -> &mut [R] {
        &mut self.parameters
    }

    #[inline(always)]
    fn evaluate(&self, s: R) -> ProfileSample<R> {
        let [axis, g] = self.parameters;
        let (q, on) = self.clamped_square(s);
        let value = axis * (R::ONE - q).sqrt();
        let slope = -(on * axis * axis * g * g / (R::TWO * value));
        ProfileSample { value, slope, curvature: -(slope * slope / value) }
    }

    /// With `w = √(1 - g² s)`: `∂f/∂g = -n₀ g s/w`, `∂f'/∂g = -n₀ g (1 + g² s/(2 w²))/w`.
    #[inline(always)]
    fn accumulate(&self, s: R, weight: R, pull: R, gradient: &mut [R]) {
        let [axis, g] = self.parameters;
        let (q, on) = self.clamped_square(s);
        let root = (R::ONE - q).sqrt();
        gradient[0] += weight * root - on * pull * g * g / (R::TWO * root);
        let bracket = R::ONE + q / (R::TWO * root * root);
        gradient[1] -= on * axis * g / root * (weight * s + pull * bracket);
    }
}
