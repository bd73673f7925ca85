//! Maxwell's fish-eye: `η = n₀/(1 + r²/R²)` images every point onto its antipode by circles.
//!
//! Maxwell (1854); Born and Wolf, *Principles of Optics*, section 4.2.2. Without a boundary every
//! ray is a closed orbit.

use super::{ProfileFunction, ProfileSample};
use crate::math::Real;

/// `f = n₀/(1 + s/R²)`; its parameters are `n₀` and `R`.
#[derive(Debug, Clone, PartialEq)]
pub struct Maxwell<R> {
    parameters: [R; 2],
}

impl<R: Real> Maxwell<R> {
    /// The fish-eye of index `centre` at its centre and half of that at `radius`.
    pub fn new(centre: R, radius: R) -> Self {
        Self { parameters: [centre, radius] }
    }
}

impl<R: Real> ProfileFunction<R> for Maxwell<R> {
    fn parameters(&self) -> &[R] {
        &self.parameters
    }

    fn parameters_mut(&mut self) -> &mut [R] {
        &mut self.parameters
    }

    #[inline(always)]
    fn evaluate(&self, s: R) -> ProfileSample<R> {
        let [centre, radius] = self.parameters;
        let square = R::ONE / (radius * radius);
        let part = R::ONE / (R::ONE + s * square);
        let value = centre * part;
        let slope = -(value * part * square);
        ProfileSample { value, slope, curvature: -(R::TWO * slope * part * square) }
    }

    /// With `p = 1/(1 + s/R²)`: `∂f/∂R = 2 n₀ p² s/R³`, `∂f'/∂R = 2 n₀ p²/R³ (1 - 2 p s/R²)`.
    #[inline(always)]
    fn accumulate(&self, s: R, weight: R, pull: R, gradient: &mut [R]) {
        let [centre, radius] = self.parameters;
        let square = R::ONE / (radius * radius);
        let part = R::ONE / (R::ONE + s * square);
        gradient[0] += weight * part - pull * part * part * square;
        let common = R::TWO * centre * part * part * square / radius;
        gradient[1] += common * (weight * s + pull * (R::ONE - R::TWO * part * s * square));
    }
}
