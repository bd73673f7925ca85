//! Rays: their start, their state, and its adjoint.

use crate::math::{Real, Vec3};

/// The start of a ray.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GrinRay<R> {
    /// Position.
    pub x: Vec3<R>,
    /// Velocity `dx/dσ`: the direction times the index, unless [`LaunchMode`](super::LaunchMode)
    /// says otherwise.
    pub v: Vec3<R>,
}

impl<R: Real> GrinRay<R> {
    /// The same ray in another number type.
    pub fn cast<S: Real>(&self) -> GrinRay<S> {
        GrinRay { x: Vec3::from_f64(self.x.value()), v: Vec3::from_f64(self.v.value()) }
    }
}

/// The state of a ray.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RayState<R> {
    /// Position.
    pub x: Vec3<R>,
    /// Velocity `dx/dσ`.
    pub v: Vec3<R>,
    /// Optical path since the start.
    pub path: R,
}

impl<R: Real> RayState<R> {
    pub(super) fn is_finite(&self) -> bool {
        self.x.is_finite() && self.v.is_finite() && self.path.is_finite()
    }
}

/// The adjoint of a ray: the derivatives of a loss with respect to its position, velocity and
/// optical path.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RayAdjoint<R> {
    /// With respect to the position.
    pub x: Vec3<R>,
    /// With respect to the velocity.
    pub v: Vec3<R>,
    /// With respect to the optical path.
    pub path: R,
}

impl<R: Real> RayAdjoint<R> {
    pub(super) fn is_finite(&self) -> bool {
        self.x.is_finite() && self.v.is_finite() && self.path.is_finite()
    }
}
