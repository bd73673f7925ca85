//! Planes across an axis of space, as a person looks at them.

use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// An axis of space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SpatialAxis {
    /// To the side.
    X,
    /// Upwards.
    Y,
    /// The way of light, in most tasks.
    Z,
}

impl SpatialAxis {
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
    pub const fn component(self, v: Vec3<f64>) -> f64 {
        match self {
            Self::X => v.x,
            Self::Y => v.y,
            Self::Z => v.z,
        }
    }

    /// A vector of this length along it.
    const fn vector(self, length: f64) -> Vec3<f64> {
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
pub struct SlicePlane {
    /// The axis.
    pub axis: SpatialAxis,
    /// Where it crosses the axis, in mm.
    pub depth: f64,
}

impl SlicePlane {
    /// The point of the plane at a place of its picture: right and up, in mm.
    pub fn point(self, [right, up]: [f64; 2]) -> Vec3<f64> {
        let [across, above] = self.axis.across();
        self.axis.vector(self.depth) + across.vector(right) + above.vector(up)
    }

    /// Where a point is seen in the picture of the plane: it is projected along the axis.
    pub fn project(self, point: Vec3<f64>) -> [f64; 2] {
        self.axis.across().map(|axis| axis.component(point))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_of_a_plane_is_seen_where_it_is() {
        for axis in SpatialAxis::ALL {
            let plane = SlicePlane { axis, depth: 0.5 };
            let point = plane.point([2.0, 3.0]);
            assert_eq!((axis.component(point), plane.project(point)), (0.5, [2.0, 3.0]));
        }
    }
}
