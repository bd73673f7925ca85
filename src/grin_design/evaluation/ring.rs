//! The distance of a ray from a ring behind the field and from a ring at infinity, wherever on them
//! it arrives (5.36 and 5.37).

use crate::grin::RayExit;
use crate::grin_design::task::geometry::{length, radians, unit};
use crate::grin_design::task::{LightGoal, LightView};
use crate::math::Vec3;

/// A shorter vector has no direction.
const MIN_LENGTH: f64 = 1e-9;

/// Two rings about the direction of a beam.
#[derive(Debug, Clone)]
pub(super) struct RingTarget {
    direction: Vec3<f64>,
    radius: f64,
    /// The sine of the angular radius of the far ring.
    sine: f64,
    /// The weight of a squared difference in direction.
    pub(super) direction_weight: f64,
}

impl RingTarget {
    /// `angle` is the angular radius of the far ring in degrees.
    pub(super) fn new(direction: Vec3<f64>, radius: f64, angle: f64, far: f64) -> Self {
        Self { direction, radius, sine: radians(angle).sin(), direction_weight: far }
    }

    /// The distance vector of a ray from the nearest point of the near ring, and of its unit
    /// direction from that of the far ring. A ray on the axis has no nearest point: the centre
    /// counts instead.
    pub(super) fn residuals(&self, exit: &RayExit<f64>) -> (Vec3<f64>, Vec3<f64>) {
        let across = |v: Vec3<f64>| v - self.direction * v.dot(self.direction);
        let (x, v) = (across(exit.x), across(unit(exit.v)));
        let outwards = if length(x) > MIN_LENGTH { unit(x) } else { Vec3::default() };
        let onwards = if length(v) > MIN_LENGTH { unit(v) } else { outwards };
        (x - outwards * self.radius, v - onwards * self.sine)
    }

    /// The derivative with respect to a velocity of a quantity that depends on its direction.
    pub(super) fn by_velocity(v: Vec3<f64>, by_direction: Vec3<f64>) -> Vec3<f64> {
        let d = unit(v);
        (by_direction - d * d.dot(by_direction)) * (1.0 / length(v))
    }
}

/// The rings of a view.
pub(super) fn ring_target(view: &LightView) -> Option<RingTarget> {
    let LightGoal::Ring { radius, angle, far, .. } = view.goal else { return None };
    Some(RingTarget::new(view.source.axis()?, radius, angle, far))
}
