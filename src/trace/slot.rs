//! Naming one number of a resolved system.

use crate::lens::{Shape, System};
use crate::math::Real;

/// A number of a surface that a ray depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Slot {
    /// The curvature.
    Curvature,
    /// The conic constant.
    Conic,
    /// An asphere coefficient.
    Term(usize),
    /// The gap behind the surface.
    Thickness,
    /// The index behind the surface; `None` of the surfaces for the one in front of all.
    Index,
    /// The semi-diameter, on which no ray depends but the edge of a pupil does.
    SemiDiameter,
}

impl Slot {
    /// Writes a surface in a form that has this number, even where it is zero.
    pub fn widen<R: Real>(self, system: &mut System<R>, surface: usize) {
        let shape = &mut system.surfaces[surface].shape;
        *shape = match (self, *shape) {
            (Self::Curvature, Shape::Plane) => Shape::Sphere { curvature: R::ZERO },
            (Self::Conic, shape) => shape.as_conic(),
            (Self::Term(_), shape) => shape.as_asphere(),
            (_, shape) => shape,
        };
    }

    /// This number of a surface that [`Slot::widen`] has written in a form that has it.
    pub fn of<R: Real>(self, system: &mut System<R>, surface: usize) -> &mut R {
        let surface = &mut system.surfaces[surface];
        match (self, &mut surface.shape) {
            (Self::Thickness, _) => &mut surface.thickness,
            (Self::SemiDiameter, _) => &mut surface.semi_diameter,
            (
                Self::Curvature,
                Shape::Sphere { curvature }
                | Shape::Conic { curvature, .. }
                | Shape::Asphere { curvature, .. },
            ) => curvature,
            (Self::Conic, Shape::Conic { conic, .. } | Shape::Asphere { conic, .. }) => conic,
            (Self::Term(term), Shape::Asphere { terms, .. }) => &mut terms[term],
            // An index is always there.
            _ => &mut surface.index,
        }
    }
}
