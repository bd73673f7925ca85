//! Directions in space, and points spread uniformly over spheres and squares.

use crate::math::Vec3;
use std::f64::consts::{PI, TAU};

/// The golden angle, between successive points of a sunflower pattern.
pub(super) const GOLDEN_ANGLE: f64 = 2.399963229728653;

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
pub(in crate::grin_design) fn orthogonal_axes(d: Vec3<f64>) -> [Vec3<f64>; 2] {
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
pub(in crate::grin_design) fn unit(v: Vec3<f64>) -> Vec3<f64> {
    v * (1.0 / length(v))
}

pub(in crate::grin_design) fn length(v: Vec3<f64>) -> f64 {
    v.dot(v).sqrt()
}

/// Degrees to radians.
pub(in crate::grin_design) fn radians(degrees: f64) -> f64 {
    degrees * PI / 180.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_spread_over_the_unit_sphere() {
        let mean = |points: &[Vec3<f64>], of: fn(Vec3<f64>) -> f64| {
            points.iter().map(|p| of(*p)).sum::<f64>() / points.len() as f64
        };
        let members = (0..2000).map(sphere_sequence).collect();
        for points in [sphere_points(2000), members] {
            assert!(points.iter().all(|p| (length(*p) - 1.0).abs() < 1e-12));
            // The means of x² and of z⁴ over a sphere are 1/3 and 1/5.
            for (of, exact) in [
                ((|p| p.x) as fn(Vec3<f64>) -> f64, 0.0),
                (|p| p.z, 0.0),
                (|p| p.x * p.x, 1.0 / 3.0),
                (|p| p.y * p.y, 1.0 / 3.0),
                (|p| p.z.powi(4), 0.2),
            ] {
                assert!((mean(&points, of) - exact).abs() < 5e-3, "{}", mean(&points, of));
            }
        }
    }
}
