//! The name of one number of a resolved system, and access to the number by it.

use super::adjoint::{SurfaceGradient, SystemGradient};
use crate::lens::{
    APERTURE_NUMBERS, ASPHERE_TERMS, FREEFORM_NUMBERS, MAX_APERTURES, PROFILE_TERMS,
    ProfileCoefficients, ProfileLaw, RADIAL_TERMS, Shape, Surface, System,
};
use crate::math::Real;

/// A number of a surface, or of the gap behind it, on which rays depend.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SurfaceParameter {
    /// The curvature.
    Curvature,
    /// The conic constant.
    Conic,
    /// An asphere coefficient.
    AsphereTerm(usize),
    /// The thickness of the gap behind the surface.
    Thickness,
    /// The index behind the surface.
    Index,
    /// The semi-diameter, on which the edge of a pupil depends, though no ray does.
    SemiDiameter,
    /// A coefficient of the GRIN medium behind the surface.
    GrinTerm(usize),
    /// A number of a freeform.
    Freeform(usize),
    /// A number of an aperture that is no circle about the vertex, five for each
    /// ([`crate::lens::SurfaceAperture::numbers`]): the edge of a pupil depends on it, though no ray does.
    Aperture(usize),
}

impl SurfaceParameter {
    /// All kinds of numbers.
    pub fn all() -> impl Iterator<Item = Self> {
        let plain =
            [Self::Curvature, Self::Conic, Self::Thickness, Self::Index, Self::SemiDiameter];
        let figured = plain.into_iter().chain((0..ASPHERE_TERMS).map(Self::AsphereTerm));
        let graded = figured.chain((0..PROFILE_TERMS).map(Self::GrinTerm));
        let formed = graded.chain((0..FREEFORM_NUMBERS).map(Self::Freeform));
        formed.chain((0..MAX_APERTURES * APERTURE_NUMBERS).map(Self::Aperture))
    }

    /// True if a surface has such a number; a plane has the curvature zero.
    pub fn exists_on<R>(self, surface: &Surface<R>) -> bool {
        let shape = &surface.shape;
        match self {
            Self::GrinTerm(k) => match &surface.grin {
                Some(grin) => grin.law != ProfileLaw::Sech || k == 0 || k >= RADIAL_TERMS,
                None => false,
            },
            Self::Curvature | Self::Thickness | Self::Index | Self::SemiDiameter => true,
            Self::Conic => matches!(shape, Shape::Conic { .. } | Shape::Asphere { .. }),
            Self::AsphereTerm(_) => matches!(shape, Shape::Asphere { .. }),
            Self::Freeform(k) => {
                surface.freeform.as_ref().is_some_and(|form| k < form.numbers.len())
            }
            Self::Aperture(k) => {
                let own = surface.apertures.get(k / APERTURE_NUMBERS);
                own.is_some_and(|own| own.clone().number_mut(k % APERTURE_NUMBERS).is_some())
            }
        }
    }

    /// Changes the form of a surface to one that has this number, even if it is zero.
    pub fn promote_shape<R: Real>(self, system: &mut System<R>, surface: usize) {
        if let Self::GrinTerm(k) = self {
            let plain = ProfileCoefficients::new(ProfileLaw::Index, [R::ZERO; PROFILE_TERMS]);
            let grin = &mut system.surfaces[surface].grin;
            *grin = Some(grin.unwrap_or(plain).with_term(k));
        }
        let shape = &mut system.surfaces[surface].shape;
        *shape = match (self, *shape) {
            (Self::Curvature, Shape::Plane) => Shape::Sphere { curvature: R::ZERO },
            (Self::Conic, shape) => shape.as_conic(),
            (Self::AsphereTerm(_), shape) => shape.as_asphere(),
            (_, shape) => shape,
        };
    }

    /// The number itself, of a surface in a form that has it (see
    /// [`SurfaceParameter::promote_shape`]). The numbers of apertures are plain ones in every system, which
    /// [`SurfaceParameter::shift`] changes.
    pub fn value_mut<R: Real>(self, system: &mut System<R>, surface: usize) -> &mut R {
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
            (Self::AsphereTerm(term), Shape::Asphere { terms, .. }) => &mut terms[term],
            (Self::GrinTerm(k), _) => match &mut surface.grin {
                Some(grin) => &mut grin.terms[k],
                None => &mut surface.index,
            },
            (Self::Freeform(k), _) => match &mut surface.freeform {
                Some(form) if k < form.numbers.len() => &mut form.numbers[k],
                _ => &mut surface.index,
            },
            // An index is always there.
            _ => &mut surface.index,
        }
    }
}

impl SurfaceParameter {
    /// Adds to the number, of a surface in a form that has it (see [`SurfaceParameter::promote_shape`]).
    pub fn shift<R: Real>(self, system: &mut System<R>, surface: usize, by: R) {
        let Self::Aperture(k) = self else {
            *self.value_mut(system, surface) += by;
            return;
        };
        let own = system.surfaces[surface].apertures.get_mut(k / APERTURE_NUMBERS);
        if let Some(number) = own.and_then(|own| own.number_mut(k % APERTURE_NUMBERS)) {
            *number += by.value();
        }
    }
}

impl<R: Real> SurfaceGradient<R> {
    /// The derivative by one number.
    pub fn by(&self, parameter: SurfaceParameter) -> R {
        match parameter {
            SurfaceParameter::Curvature => self.curvature,
            SurfaceParameter::Conic => self.conic,
            SurfaceParameter::AsphereTerm(term) => self.terms[term],
            SurfaceParameter::Thickness => self.thickness,
            SurfaceParameter::Index => self.index,
            SurfaceParameter::SemiDiameter => self.semi_diameter,
            SurfaceParameter::GrinTerm(k) => self.grin_terms[k],
            SurfaceParameter::Freeform(k) => self.freeform.get(k).copied().unwrap_or_default(),
            SurfaceParameter::Aperture(k) => self.apertures.get(k).copied().unwrap_or_default(),
        }
    }

    /// Sets the derivative by one number. Zero for a number of a freeform that is missing changes
    /// nothing.
    pub fn set(&mut self, parameter: SurfaceParameter, by: R) {
        let number = match parameter {
            SurfaceParameter::Curvature => &mut self.curvature,
            SurfaceParameter::Conic => &mut self.conic,
            SurfaceParameter::AsphereTerm(term) => &mut self.terms[term],
            SurfaceParameter::Thickness => &mut self.thickness,
            SurfaceParameter::Index => &mut self.index,
            SurfaceParameter::SemiDiameter => &mut self.semi_diameter,
            SurfaceParameter::GrinTerm(k) => &mut self.grin_terms[k],
            SurfaceParameter::Freeform(k) if k >= self.freeform.len() && by == R::ZERO => return,
            SurfaceParameter::Freeform(k) => self.freeform_mut(k),
            SurfaceParameter::Aperture(k) if k >= self.apertures.len() && by == R::ZERO => return,
            SurfaceParameter::Aperture(k) => self.aperture_mut(k),
        };
        *number = by;
    }
}

impl<R: Real> SystemGradient<R> {
    /// Combines each number of this gradient with that of another one with as many surfaces.
    #[must_use]
    pub fn zip_with(&self, other: &Self, combine: impl Fn(R, R) -> R) -> Self {
        let fixed = |gradient: &Self| {
            let mut fixed = gradient.clone();
            for surface in &mut fixed.surfaces {
                surface.freeform.clear();
                surface.apertures.clear();
            }
            fixed
        };
        let (a, b) = (fixed(self), fixed(other));
        let pairs = a.numbers().zip(b.numbers());
        let mut all = Self::from_numbers(self.surfaces.len(), pairs.map(|(a, b)| combine(a, b)));
        for ((to, a), b) in all.surfaces.iter_mut().zip(&self.surfaces).zip(&other.surfaces) {
            let numbers =
                (0..a.freeform.len().max(b.freeform.len())).map(SurfaceParameter::Freeform);
            to.freeform = numbers.map(|number| combine(a.by(number), b.by(number))).collect();
            let count = a.apertures.len().max(b.apertures.len());
            let numbers = (0..count).map(SurfaceParameter::Aperture);
            to.apertures = numbers.map(|number| combine(a.by(number), b.by(number))).collect();
        }
        all
    }

    /// Combines each number of some gradients of the same system, which has no freeform.
    #[must_use]
    pub fn combine<S: Real>(
        all: &[Self],
        combine: impl Fn(&mut dyn Iterator<Item = R>) -> S,
    ) -> SystemGradient<S> {
        let surfaces = all.first().map_or(0, |gradient| gradient.surfaces.len());
        let fixed: Vec<Vec<R>> = all.iter().map(Self::fixed_numbers).collect();
        let count = fixed.first().map_or(0, Vec::len);
        let numbers = (0..count).map(|i| combine(&mut fixed.iter().map(|row| row[i])));
        let mut found = SystemGradient::from_numbers(surfaces, numbers);
        for (i, to) in found.surfaces.iter_mut().enumerate() {
            let own = || all.iter().map(|gradient| &gradient.surfaces[i]);
            let count = own().map(|own| own.apertures.len()).max().unwrap_or(0);
            let by =
                |k: usize| combine(&mut own().map(|own| own.by(SurfaceParameter::Aperture(k))));
            to.apertures = (0..count).map(by).collect();
        }
        found
    }

    /// The numbers of [`SystemGradient::from_numbers`].
    fn fixed_numbers(&self) -> Vec<R> {
        let mut fixed = self.clone();
        for surface in &mut fixed.surfaces {
            surface.freeform.clear();
            surface.apertures.clear();
        }
        fixed.numbers().collect()
    }

    /// The kinds of numbers by which there are derivatives.
    pub fn kinds(&self) -> impl Iterator<Item = SurfaceParameter> + use<R> {
        let apertures = self.surfaces.iter().map(|own| own.apertures.len()).max().unwrap_or(0);
        // Those of apertures come last.
        SurfaceParameter::all().take_while(
            move |kind| !matches!(kind, SurfaceParameter::Aperture(k) if *k >= apertures),
        )
    }

    /// The derivatives by the numbers of one kind, surface by surface; the index of object space is
    /// the first of the indices.
    pub fn of_kind(&self, parameter: SurfaceParameter) -> impl Iterator<Item = R> {
        let front = (parameter == SurfaceParameter::Index).then_some(self.index_before);
        front.into_iter().chain(self.surfaces.iter().map(move |surface| surface.by(parameter)))
    }
}

impl SystemGradient<f64> {
    /// The largest absolute derivative by a number of one kind.
    pub fn largest(&self, parameter: SurfaceParameter) -> f64 {
        self.of_kind(parameter).fold(0.0, |largest, by| largest.max(by.abs()))
    }
}
