//! Planes across an axis of space, as a person looks at them.

use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// An axis of space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// To the side.
    X,
    /// Upwards.
    Y,
    /// The way of light, in most tasks.
    Z,
}

impl Axis {
    /// All three.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    /// What it is called.
    pub const fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
        }
    }

    /// The part of a vector along it.
    pub const fn of(self, v: Vec3<f64>) -> f64 {
        match self {
            Self::X => v.x,
            Self::Y => v.y,
            Self::Z => v.z,
        }
    }

    /// A vector of this length along it.
    const fn times(self, length: f64) -> Vec3<f64> {
        match self {
            Self::X => Vec3::new(length, 0.0, 0.0),
            Self::Y => Vec3::new(0.0, length, 0.0),
            Self::Z => Vec3::new(0.0, 0.0, length),
        }
    }

    /// The axes that point right and up in a picture of a plane across this one: z points right
    /// where it can, as light goes in a drawing of a lens.
    pub const fn across(self) -> [Self; 2] {
        match self {
            Self::X => [Self::Z, Self::Y],
            Self::Y => [Self::Z, Self::X],
            Self::Z => [Self::X, Self::Y],
        }
    }
}

/// A plane across an axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// The axis.
    pub axis: Axis,
    /// Where it crosses the axis, in mm.
    pub depth: f64,
}

impl Plane {
    /// The point of the plane at a place of its picture: right and up, in mm.
    pub fn at(self, [right, up]: [f64; 2]) -> Vec3<f64> {
        let [across, above] = self.axis.across();
        self.axis.times(self.depth) + across.times(right) + above.times(up)
    }

    /// Where a point is seen in the picture of the plane: it is projected along the axis.
    pub fn seen(self, point: Vec3<f64>) -> [f64; 2] {
        self.axis.across().map(|axis| axis.of(point))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_of_a_plane_is_seen_where_it_is() {
        for axis in Axis::ALL {
            let plane = Plane { axis, depth: 0.5 };
            let point = plane.at([2.0, 3.0]);
            assert_eq!((axis.of(point), plane.seen(point)), (0.5, [2.0, 3.0]));
        }
    }
}
