//! The geometry of a domain: its region for the tracer, and point sets in it and on its surface.

use super::Domain;
use super::geometry::{GOLDEN_ANGLE, sphere_points, square_sequence};
use crate::grin::{Face, GrinRegion};
use crate::math::Vec3;

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
    pub(in crate::grin_design) fn lattice(self, count: usize) -> Vec<Vec3<f64>> {
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
    pub(in crate::grin_design) fn plane_behind(
        self,
        direction: Vec3<f64>,
        distance: f64,
    ) -> Face<f64> {
        let [low, high] = self.corners();
        let far = |d: f64, low: f64, high: f64| if d < 0.0 { d * low } else { d * high };
        let reach = far(direction.x, low.x, high.x)
            + far(direction.y, low.y, high.y)
            + far(direction.z, low.z, high.z);
        Face::plane(direction, reach + distance)
    }

    /// About `count` points spread over its surface; of a rod, over its lateral surface.
    pub(in crate::grin_design) fn surface_points(self, count: usize) -> Vec<Vec3<f64>> {
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
