//! Planes perpendicular to an axis, in which a field is displayed.

use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// An axis of space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SpatialAxis {
    /// The horizontal axis.
    X,
    /// The vertical axis, upwards.
    Y,
    /// The axis along which light travels in most tasks.
    Z,
}

impl SpatialAxis {
    /// All three axes.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    /// The name of the axis.
    pub const fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
        }
    }

    /// The component of a vector along the axis.
    pub const fn component(self, v: Vec3<f64>) -> f64 {
        match self {
            Self::X => v.x,
            Self::Y => v.y,
            Self::Z => v.z,
        }
    }

    /// A vector of this length along the axis.
    const fn vector(self, length: f64) -> Vec3<f64> {
        match self {
            Self::X => Vec3::new(length, 0.0, 0.0),
            Self::Y => Vec3::new(0.0, length, 0.0),
            Self::Z => Vec3::new(0.0, 0.0, length),
        }
    }

    /// The axes that point right and up in a picture of a plane perpendicular to this one: z points
    /// right where possible, the direction of light in lens drawings.
    pub const fn across(self) -> [Self; 2] {
        match self {
            Self::X => [Self::Z, Self::Y],
            Self::Y => [Self::Z, Self::X],
            Self::Z => [Self::X, Self::Y],
        }
    }
}

/// A plane perpendicular to an axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SlicePlane {
    /// The axis.
    pub axis: SpatialAxis,
    /// The coordinate of the plane along the axis, in mm.
    pub depth: f64,
}

impl SlicePlane {
    /// The point of the plane at a position of its picture: right and up, in mm.
    pub fn point(self, [right, up]: [f64; 2]) -> Vec3<f64> {
        let [across, above] = self.axis.across();
        self.axis.vector(self.depth) + across.vector(right) + above.vector(up)
    }

    /// The position in the picture of a point projected along the axis onto the plane.
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
