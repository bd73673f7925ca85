//! Derivatives of integrals over a pupil whose edge moves with the lens.
//!
//! `L = ∫ C(p) dw` over the rays that get through, each named by the point `w` where it crosses
//! the plane through the first vertex, `p` where it lands. When a number `t` of the lens changes,
//! the integrand changes and so does the set. With `g` the limit that ends it somewhere, negative
//! inside, Reynolds' transport theorem gives
//!
//! ```text
//! dL/dt = ∫ dC/dt dw − ∮ C ∂g/∂t / |∇g| dl
//! ```
//!
//! (Teh, *Computational Lens Design*, eq. 3.16, with the factor 1/|∇g| that is missing there.)
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

/// What each ray of a pupil contributes by where it lands. Where a pupil is its own mirror image, so
/// must be the contribution.
pub trait Integrand: Sync {
    /// The contribution of a ray that lands at a point, in mm on the image plane.
    fn value<R: Real>(&self, p: [R; 2]) -> R;
    /// Its derivative by the point.
    fn slope<R: Real>(&self, p: [R; 2]) -> [R; 2];
}

/// What each ray of a pupil contributes: `square |p − center|² + constant`, `p` its image point.
///
/// The spot (3.24) has `square = 1` about the centroid, which may be held fixed: moving it changes
/// the integral by nothing in first order. The throughput (3.25) has `constant = −1`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuadraticIntegrand {
    /// From where distances count, in mm on the image plane.
    pub center: [f64; 2],
    /// The factor of the square of the distance.
    pub square: f64,
    /// What every ray contributes.
    pub constant: f64,
}

impl QuadraticIntegrand {
    /// The square of the distance from a point: the spot (3.24) where that is the centroid.
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
    /// Its integral over the light of a pupil.
    pub fn integrate(&self, light: &PupilMoments) -> f64 {
        let [x, y] = [0, 1].map(|i| light.centroid[i] - self.center[i]);
        let about_center = light.spread + light.area * (x * x + y * y);
        self.square * about_center + self.constant * light.area
    }
}

/// The derivative of an integral over a pupil.
#[derive(Debug, Clone, PartialEq)]
pub struct PupilDerivative {
    /// By every number of the system; the integral is in mm² of the first vertex plane.
    pub gradient: SystemGradient<f64>,
    /// How far each may be wrong: a standard error, or the difference of two orders.
    pub error: SystemGradient<f64>,
    /// Rays traced.
    pub rays: usize,
}

impl PupilDerivative {
    /// Whether every number is known within a tolerance of the largest of its kind: curvatures,
    /// conic constants, coefficients of each power, thicknesses, indices, semi-diameters.
    pub fn reaches(&self, tolerance: f64) -> bool {
        self.excess(tolerance, |_| 0.0) <= 1.0
    }

    /// By how much the largest error of a kind exceeds what a tolerance allows there, of the
    /// largest number of the kind or of a floor.
    fn excess(&self, tolerance: f64, floor: impl Fn(SurfaceParameter) -> f64) -> f64 {
        let excess = |slot| {
            let error = self.error.largest(slot);
            let scale = self.gradient.largest(slot).max(floor(slot));
            if error == 0.0 { 0.0 } else { error / (tolerance * scale) }
        };
        SurfaceParameter::all().map(excess).fold(0.0, f64::max)
    }
}
