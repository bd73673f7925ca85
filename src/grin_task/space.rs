//! The geometry of a domain: its region for the tracer, and point sets in it and on its surface.

use super::task::Domain;
use crate::grin::{Face, GrinRegion};
use crate::math::Vec3;
use std::f64::consts::{PI, TAU};

/// The golden angle, between successive points of a sunflower pattern.
pub(super) const GOLDEN_ANGLE: f64 = 2.399963229728653;

impl Domain {
    /// The region for the tracer.
    pub fn region(self) -> GrinRegion<f64> {
        match self {
            Self::Ball { radius } => GrinRegion::ball(radius),
            Self::Rod { radius, from, to } => GrinRegion::rod(radius, from, to),
            Self::Cube { half } => GrinRegion::cube(half),
        }
    }

    /// The corners of the bounding box.
    pub fn corners(self) -> [Vec3<f64>; 2] {
        let cube = |half: f64| [Vec3::new(-half, -half, -half), Vec3::new(half, half, half)];
        match self {
            Self::Ball { radius } => cube(radius),
            Self::Rod { radius, from, to } => {
                [Vec3::new(-radius, -radius, from), Vec3::new(radius, radius, to)]
            }
            Self::Cube { half } => cube(half),
        }
    }

    /// The diameter: the largest distance between two of its points.
    pub fn diameter(self) -> f64 {
        match self {
            Self::Ball { radius } => 2.0 * radius,
            Self::Rod { radius, from, to } => (2.0 * radius).hypot(to - from),
            Self::Cube { half } => 12.0_f64.sqrt() * half,
        }
    }

    /// The points inside of a lattice with `count` points along each side of the bounding box.
    pub(super) fn lattice(self, count: usize) -> Vec<Vec3<f64>> {
        let region = self.region();
        let [low, high] = self.corners();
        let part =
            |low: f64, high: f64, i: usize| low + (high - low) * (i as f64 + 0.5) / count as f64;
        let at = |n: usize| {
            Vec3::new(
                part(low.x, high.x, n % count),
                part(low.y, high.y, n / count % count),
                part(low.z, high.z, n / count / count),
            )
        };
        (0..count.pow(3)).map(at).filter(|p| region.level(*p) < 0.0).collect()
    }

    /// The plane perpendicular to a direction, `distance` behind the domain.
    pub(super) fn plane_behind(self, direction: Vec3<f64>, distance: f64) -> Face<f64> {
        let [low, high] = self.corners();
        let far = |d: f64, low: f64, high: f64| if d < 0.0 { d * low } else { d * high };
        let reach = far(direction.x, low.x, high.x)
            + far(direction.y, low.y, high.y)
            + far(direction.z, low.z, high.z);
        Face::plane(direction, reach + distance)
    }

    /// About `count` points spread over its surface; of a rod, over its lateral surface.
    pub(super) fn surface_points(self, count: usize) -> Vec<Vec3<f64>> {
        let share = |i: usize| (i as f64 + 0.5) / count as f64;
        match self {
            Self::Ball { radius } => sphere_points(count).into_iter().map(|p| p * radius).collect(),
            Self::Rod { radius, from, to } => {
                let at = |i: usize| {
                    let (sin, cos) = (GOLDEN_ANGLE * i as f64).sin_cos();
                    Vec3::new(radius * cos, radius * sin, from + (to - from) * share(i))
                };
                (0..count).map(at).collect()
            }
            Self::Cube { half } => {
                let at = |i: usize| {
                    let (u, v) = square_sequence(i);
                    let (a, b) = (half * (2.0 * u - 1.0), half * (2.0 * v - 1.0));
                    let c = if i.is_multiple_of(2) { half } else { -half };
                    match i / 2 % 3 {
                        0 => Vec3::new(c, a, b),
                        1 => Vec3::new(a, c, b),
                        _ => Vec3::new(a, b, c),
                    }
                };
                (0..count).map(at).collect()
            }
        }
    }
}

/// `count` points spread uniformly over the unit sphere: a sunflower pattern.
pub(super) fn sphere_points(count: usize) -> Vec<Vec3<f64>> {
    let at = |i: usize| on_sphere((i as f64 + 0.5) / count as f64, GOLDEN_ANGLE * i as f64);
    (0..count).map(at).collect()
}

/// `count` directions perpendicular to the z axis, uniform over half a turn; the opposite
/// directions are equivalent.
pub(super) fn half_circle(count: usize) -> Vec<Vec3<f64>> {
    let at = |i: usize| {
        let (sin, cos) = (PI * (i as f64 + 0.5) / count as f64).sin_cos();
        Vec3::new(cos, sin, 0.0)
    };
    (0..count).map(at).collect()
}

/// A point of the unit sphere from its share of the area and an angle about z.
fn on_sphere(share: f64, angle: f64) -> Vec3<f64> {
    let z = 1.0 - 2.0 * share;
    let r = (1.0 - z * z).max(0.0).sqrt();
    Vec3::new(r * angle.cos(), r * angle.sin(), z)
}

/// Member `i` of a low-discrepancy sequence of directions on the sphere.
pub(super) fn sphere_sequence(i: usize) -> Vec3<f64> {
    let (u, v) = square_sequence(i);
    on_sphere(u, TAU * v)
}

/// Member `i` of the additive low-discrepancy sequence in the unit square (Roberts 2018).
pub(super) fn square_sequence(i: usize) -> (f64, f64) {
    let at = |step: f64| (0.5 + step * i as f64).fract();
    (at(0.7548776662466927), at(0.5698402909980532))
}

/// Two unit vectors perpendicular to a unit vector and to each other.
pub(super) fn orthogonal_axes(d: Vec3<f64>) -> [Vec3<f64>; 2] {
    let (x, y, z) = (d.x.abs(), d.y.abs(), d.z.abs());
    let axis = if x <= y && x <= z {
        Vec3::new(1.0, 0.0, 0.0)
    } else if y <= z {
        Vec3::new(0.0, 1.0, 0.0)
    } else {
        Vec3::new(0.0, 0.0, 1.0)
    };
    let u = unit(cross(d, axis));
    [u, cross(d, u)]
}

fn cross(a: Vec3<f64>, b: Vec3<f64>) -> Vec3<f64> {
    Vec3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

/// The unit vector in this direction.
pub(super) fn unit(v: Vec3<f64>) -> Vec3<f64> {
    v * (1.0 / length(v))
}

pub(super) fn length(v: Vec3<f64>) -> f64 {
    v.dot(v).sqrt()
}

/// Degrees to radians.
pub(super) fn radians(degrees: f64) -> f64 {
    degrees * PI / 180.0
}
