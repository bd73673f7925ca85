//! A lens traversed by light from its other end. An axial GRIN profile is reversed about the vertex
//! where it started; derivatives by the thickness of its gap do not include that.

use super::system::{Shape, Surface, System};
use crate::math::Real;

impl<R: Real> System<R> {
    /// The same surfaces traversed by light from the image. The new first vertex is the last one
    /// before the image plane, and the new image plane lies `distance` mm behind the old first
    /// vertex. The old image plane is removed: it is now the object, at the distance of the old last
    /// thickness in front of the new first vertex.
    #[must_use]
    pub fn reversed(&self, distance: R) -> Self {
        let Some((image, surfaces)) = self.surfaces.split_last() else { return self.clone() };
        let mirrors = surfaces.iter().filter(|surface| surface.mirror).count();
        // Light that travels towards −z at the end already has the right direction.
        let turn = if mirrors % 2 == 0 { -R::ONE } else { R::ONE };
        let gap = |i: usize| i.checked_sub(1).map_or(distance, |i| -(turn * surfaces[i].thickness));
        let count = surfaces.len();
        let reversed = (0..count).rev().map(|i| Surface {
            shape: surfaces[i].shape.with_sag_sign(turn),
            thickness: gap(i),
            index: self.index_before(i),
            grin: i
                .checked_sub(1)
                .and_then(|i| surfaces[i].grin.map(|grin| grin.reversed(surfaces[i].thickness))),
            ..surfaces[i]
        });
        let plane = Surface { index: self.index_before, thickness: R::ZERO, ..*image };
        Self {
            index_before: surfaces.last().map_or(self.index_before, |surface| surface.index),
            surfaces: reversed.chain(std::iter::once(plane)).collect(),
            stop: self.stop.map(|stop| count - 1 - stop),
        }
    }
}

impl<R: Real> Shape<R> {
    /// The same form with its sag multiplied by `turn`, which is 1 or −1.
    fn with_sag_sign(self, turn: R) -> Self {
        match self {
            Self::Plane => Self::Plane,
            Self::Sphere { curvature } => Self::Sphere { curvature: turn * curvature },
            Self::Conic { curvature, conic } => Self::Conic { curvature: turn * curvature, conic },
            Self::Asphere { curvature, conic, terms } => Self::Asphere {
                curvature: turn * curvature,
                conic,
                terms: terms.map(|term| turn * term),
            },
        }
    }
}
