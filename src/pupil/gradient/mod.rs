//! Derivatives of integrals over a pupil whose edge moves with the lens.
//!
//! `L = ∫ C(p) dw` over the rays that get through, with `w` the point where a ray crosses the plane
//! through the first vertex, and `p` its image point. When a number `t` of the lens changes, the
//! integrand changes and so does the set of rays. With `g` the limit at an edge, negative inside,
//! Reynolds' transport theorem gives
//!
//! ```text
//! dL/dt = ∫ dC/dt dw − ∮ C ∂g/∂t / |∇g| dl
//! ```
//!
//! (Teh, *Computational Lens Design*, eq. 3.16, with the factor 1/|∇g| that is missing there.)
//! The rays of the field stay the same while the lens changes: the direction of a field that is given
//! by the height of its image does not follow the focal length.
//! Leaving out the second integral is the usual, biased derivative. All estimators differentiate
//! by every number of a system at once, semi-diameters included.

mod boundary;
mod difference;
mod estimator;
mod warp;

pub use estimator::{DerivativeError, DerivativeEstimator, choose_estimator, differentiate};
pub use warp::WarpSampling;

use crate::math::Real;
use crate::pupil::region::PupilMoments;
use crate::trace::{SurfaceParameter, SystemGradient};

/// A contribution of each ray of a pupil that depends on its image point. If a pupil is its own
/// mirror image, the contribution must be too.
pub trait Integrand: Sync {
    /// The contribution of a ray with this image point, in mm.
    fn value<R: Real>(&self, p: [R; 2]) -> R;
    /// The derivative of the contribution by the image point.
    fn slope<R: Real>(&self, p: [R; 2]) -> [R; 2];
}

/// The integrand `square |p − center|² + constant`, with `p` the image point.
///
/// The spot (3.24) has `square = 1` about the centroid, which may be held fixed: moving it does not
/// change the integral in first order. The throughput (3.25) has `constant = −1`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuadraticIntegrand {
    /// The origin of distances, in mm in the image plane.
    pub center: [f64; 2],
    /// The factor of the squared distance.
    pub square: f64,
    /// The constant contribution of every ray.
    pub constant: f64,
}

impl QuadraticIntegrand {
    /// The squared distance from a point: the spot (3.24) if that is the centroid.
    pub fn spread(center: [f64; 2]) -> Self {
        Self { center, square: 1.0, constant: 0.0 }
    }

    /// Minus one for every ray: the throughput (3.25).
    pub fn throughput() -> Self {
        Self { center: [0.0; 2], square: 0.0, constant: -1.0 }
    }
}

impl Integrand for QuadraticIntegrand {
    #[inline(always)]
    fn value<R: Real>(&self, p: [R; 2]) -> R {
        let [x, y] = [0, 1].map(|i| p[i] - R::from_f64(self.center[i]));
        R::from_f64(self.square) * (x * x + y * y) + R::from_f64(self.constant)
    }

    #[inline(always)]
    fn slope<R: Real>(&self, p: [R; 2]) -> [R; 2] {
        let factor = R::from_f64(2.0 * self.square);
        [0, 1].map(|i| factor * (p[i] - R::from_f64(self.center[i])))
    }
}

impl QuadraticIntegrand {
    /// The integral over the light of a pupil.
    pub fn integrate(&self, light: &PupilMoments) -> f64 {
        let [x, y] = [0, 1].map(|i| light.centroid[i] - self.center[i]);
        let about_center = light.spread + light.area * (x * x + y * y);
        self.square * about_center + self.constant * light.area
    }
}

/// The derivative of an integral over a pupil.
#[derive(Debug, Clone, PartialEq)]
pub struct PupilDerivative {
    /// The derivative by every number of the system; the integral is in mm² of the first vertex
    /// plane.
    pub gradient: SystemGradient<f64>,
    /// The error of each: a standard error, or the difference of two orders.
    pub error: SystemGradient<f64>,
    /// The number of rays traced.
    pub rays: usize,
    /// True if the errors are within the tolerance that was asked for.
    pub reached: bool,
}

impl PupilDerivative {
    /// True if the error of every number is within a tolerance of the largest of its kind:
    /// curvatures, conic constants, coefficients of each power, thicknesses, indices,
    /// semi-diameters.
    pub fn reaches(&self, tolerance: f64) -> bool {
        self.excess(tolerance, |_| 0.0) <= 1.0
    }

    /// The largest ratio, over the kinds of numbers, of the error to what a tolerance allows,
    /// relative to the largest number of the kind or to a floor.
    fn excess(&self, tolerance: f64, floor: impl Fn(SurfaceParameter) -> f64) -> f64 {
        let excess = |slot| {
            let error = self.error.largest(slot);
            let scale = self.gradient.largest(slot).max(floor(slot));
            if error == 0.0 { 0.0 } else { error / (tolerance * scale) }
        };
        self.error.kinds().map(excess).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a disc of radius r whose middle is d away: `∫ |p − c|² = π r² (r²/2 + d²)`.
    #[test]
    fn the_integral_about_a_point_beside_the_centroid_follows_from_the_parallel_axes() {
        let (r, [a, b]) = (1.5_f64, [0.7, -0.4]);
        let area = std::f64::consts::PI * r * r;
        let light = PupilMoments { area, centroid: [2.0, 3.0], spread: 0.5 * area * r * r };
        let cost = QuadraticIntegrand { center: [2.0 - a, 3.0 - b], square: 2.0, constant: -0.25 };
        let exact = 2.0 * area * (0.5 * r * r + a * a + b * b) - 0.25 * area;
        assert!((cost.integrate(&light) - exact).abs() < 1e-12, "{exact}");
    }
}
