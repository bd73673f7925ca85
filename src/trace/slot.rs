//! Naming one number of a resolved system.

use super::backward::{Gradient, SurfaceGradient};
use crate::lens::{ASPHERE_TERMS, GRADE_TERMS, Grade, Law, RADIAL_TERMS, Shape, Surface, System};
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
    /// A coefficient of the gradient behind the surface.
    Grade(usize),
}

impl Slot {
    /// Every kind of number, each with a unit of its own.
    pub fn all() -> impl Iterator<Item = Self> {
        let plain =
            [Self::Curvature, Self::Conic, Self::Thickness, Self::Index, Self::SemiDiameter];
        let figured = plain.into_iter().chain((0..ASPHERE_TERMS).map(Self::Term));
        figured.chain((0..GRADE_TERMS).map(Self::Grade))
    }

    /// Whether a surface has such a number; a plane has the curvature zero.
    pub fn is_of<R>(self, surface: &Surface<R>) -> bool {
        let shape = &surface.shape;
        match self {
            Self::Grade(k) => match &surface.graded {
                Some(grade) => grade.law != Law::Sech || k == 0 || k >= RADIAL_TERMS,
                None => false,
            },
            Self::Curvature | Self::Thickness | Self::Index | Self::SemiDiameter => true,
            Self::Conic => matches!(shape, Shape::Conic { .. } | Shape::Asphere { .. }),
            Self::Term(_) => matches!(shape, Shape::Asphere { .. }),
        }
    }

    /// Writes a surface in a form that has this number, even where it is zero.
    pub fn widen<R: Real>(self, system: &mut System<R>, surface: usize) {
        if let Self::Grade(k) = self {
            let plain = Grade::new(Law::Index, [R::ZERO; GRADE_TERMS]);
            let graded = &mut system.surfaces[surface].graded;
            *graded = Some(graded.unwrap_or(plain).using(k));
        }
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
            (Self::Grade(k), _) => match &mut surface.graded {
                Some(grade) => &mut grade.terms[k],
                None => &mut surface.index,
            },
            // An index is always there.
            _ => &mut surface.index,
        }
    }
}

impl<R: Real> SurfaceGradient<R> {
    /// The derivative by one number.
    pub fn by(&self, slot: Slot) -> R {
        match slot {
            Slot::Curvature => self.curvature,
            Slot::Conic => self.conic,
            Slot::Term(term) => self.terms[term],
            Slot::Thickness => self.thickness,
            Slot::Index => self.index,
            Slot::SemiDiameter => self.semi_diameter,
            Slot::Grade(k) => self.grade[k],
        }
    }

    /// The derivative by one number, to be written.
    pub fn by_mut(&mut self, slot: Slot) -> &mut R {
        match slot {
            Slot::Curvature => &mut self.curvature,
            Slot::Conic => &mut self.conic,
            Slot::Term(term) => &mut self.terms[term],
            Slot::Thickness => &mut self.thickness,
            Slot::Index => &mut self.index,
            Slot::SemiDiameter => &mut self.semi_diameter,
            Slot::Grade(k) => &mut self.grade[k],
        }
    }
}

impl<R: Real> Gradient<R> {
    /// Each number of this gradient joined with that of another one of as many surfaces.
    #[must_use]
    pub fn joined(&self, other: &Self, join: impl Fn(R, R) -> R) -> Self {
        let pairs = self.numbers().zip(other.numbers());
        Self::from_numbers(self.surfaces.len(), pairs.map(|(a, b)| join(a, b)))
    }

    /// The derivatives by the numbers of one kind, surface by surface; the index in front of all
    /// comes before the other indices.
    pub fn group(&self, slot: Slot) -> impl Iterator<Item = R> {
        let front = (slot == Slot::Index).then_some(self.index_before);
        front.into_iter().chain(self.surfaces.iter().map(move |surface| surface.by(slot)))
    }
}

impl Gradient<f64> {
    /// The largest derivative by a number of one kind.
    pub fn largest(&self, slot: Slot) -> f64 {
        self.group(slot).fold(0.0, |largest, by| largest.max(by.abs()))
    }
}
