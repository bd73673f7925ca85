//! The Luneburg lens: `η = √(2 - r²/R²)` images infinity onto its rear surface.
//!
//! Luneburg, *Mathematical Theory of Optics* (1944). In units of its radius every ray is `x(σ) = x₀
//! cos σ + v₀ sin σ`, so at `σ = π/2` it is at `v₀`: an exact test.

use super::layered::clamp_coordinate;
use super::{ProfileFunction, ProfileSample};
use crate::math::Real;

/// Beyond this multiple of `R²` the profile is constant: a step may end outside, and the root must
/// stay real.
const CUT: f64 = 1.5;

/// `f = √(2 - s/R²)`; its parameter is the radius `R`. To be cut by a boundary at `R`: the same
/// formula continues to `1.22 R`, and the profile is constant from there.
#[derive(Debug, Clone, PartialEq)]
pub struct Luneburg<R> {
    radius: [R; 1],
}

impl<R: Real> Luneburg<R> {
    /// The lens of this radius.
    pub fn new(radius: R) -> Self {
        Self { radius: [radius] }
    }

    /// `s/R²` clamped to the cut, and the factor 1 before the cut, 0 beyond it.
    #[inline(always)]
    fn clamped_square(&self, s: R) -> (R, R) {
        let [radius] = self.radius;
        clamp_coordinate(s / (radius * radius), CUT)
    }
}

impl<R: Real> ProfileFunction<R> for Luneburg<R> {
    fn parameters(&self) -> &[R] {
        &self.radius
    }

    fn parameters_mut(&mut self) -> &mut [R] {
        &mut self.radius
    }

    #[inline(always)]
    fn evaluate(&self, s: R) -> ProfileSample<R> {
        let [radius] = self.radius;
        let (q, on) = self.clamped_square(s);
        let value = (R::TWO - q).sqrt();
        let slope = -(on / (R::TWO * value * radius * radius));
        ProfileSample { value, slope, curvature: -(slope * slope / value) }
    }

    /// `∂f/∂R = q/(f R)` and `∂f'/∂R = (2 + q/f²)/(2 f R³)` with `q = s/R²`.
    #[inline(always)]
    fn accumulate(&self, s: R, weight: R, pull: R, gradient: &mut [R]) {
        let [radius] = self.radius;
        let (q, on) = self.clamped_square(s);
        let value = (R::TWO - q).sqrt();
        let by_radius = q / (value * radius);
        let slope_by_radius =
            (R::TWO + q / (value * value)) / (R::TWO * value * radius * radius * radius);
        gradient[0] += on * (weight * by_radius + pull * slope_by_radius);
    }
}
