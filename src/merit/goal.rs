//! Goals that apply to a lens: its focal length, its light, its fields.

use super::MeritError;
use crate::lens::{
    Goal, Lens, LimitTreatment, Object, OperandKind, PupilEdge, Term, TermScope, TermSelection,
    ToleranceGrade, WeightedTerm, last_index,
};
use crate::paraxial::{Beam, first_order};

impl Term {
    /// True for the term of spots, as designed or as built.
    pub fn is_of_spots(self) -> bool {
        matches!(self, Self::Spot | Self::AsBuilt { .. })
    }

    /// True if the term depends on the areas of the pupils.
    pub fn concerns_light(self) -> bool {
        matches!(
            self,
            Self::Throughput
                | Self::ThroughputLoss(_)
                | Self::Light(_)
                | Self::MeanLight(_)
                | Self::RelativeIllumination { .. }
                | Self::FNumber(_)
        )
    }

    /// True if the term depends on the rims of the surfaces, fixed or not.
    pub(super) const fn concerns_rims(self) -> bool {
        matches!(self, Self::GlassEdge(_) | Self::AirEdge(_) | Self::Steepness(_))
    }

    /// True if the term is computed from all rays of the pupils.
    pub(super) const fn is_of_rays(self) -> bool {
        matches!(
            self,
            Self::Spot
                | Self::AsBuilt { .. }
                | Self::SpotIntegral
                | Self::Wavefront
                | Self::Strehl
                | Self::GeometricMtf { .. }
                | Self::Mtf { .. }
        )
    }

    /// True if the term limits numbers of the lens that follow without rays.
    pub(super) fn is_without_rays(self) -> bool {
        self.is_limit() && !self.concerns_light() && !matches!(self, Self::Operand { .. })
    }

    /// True if the term limits the lens and says nothing about one that keeps the limit.
    pub fn is_limit(self) -> bool {
        !matches!(
            self,
            Self::Spot
                | Self::AsBuilt { .. }
                | Self::SpotIntegral
                | Self::Wavefront
                | Self::Strehl
                | Self::GeometricMtf { .. }
                | Self::Mtf { .. }
                | Self::Ghosts { .. }
                | Self::Throughput
                | Self::ThroughputLoss(_)
                | Self::Distortion
        )
    }

    /// Returns an error if its numbers contradict each other.
    fn check_bounds(self) -> Result<(), MeritError> {
        let refuse = |why| Err(MeritError::DoesNotApply { term: self.name(), why });
        match (self, &self.numbers()[..]) {
            (Self::GeometricMtf { frequency, min } | Self::Mtf { frequency, min }, _) => {
                if frequency > 0.0 && min > 0.0 && min <= 1.0 {
                    return Ok(());
                }
                refuse("its frequency is not positive, or its minimum is not between 0 and 1")
            }
            (Self::Ghosts { irradiance, reflectance }, _) => {
                let is_share = |share: f64| share > 0.0 && share < 1.0;
                if irradiance > 0.0 && reflectance.is_none_or(is_share) {
                    return Ok(());
                }
                refuse("its irradiance is not positive, or its reflectance is not between 0 and 1")
            }
            (_, [min, max]) if min > max => refuse("its minimum is larger than its maximum"),
            _ => Ok(()),
        }
    }

    /// Returns an error if the term asks for light that is undefined for the lens.
    fn check_light(self, lens: &Lens) -> Result<(), MeritError> {
        let refuse = |why| Err(MeritError::DoesNotApply { term: self.name(), why });
        if let Self::ThroughputLoss(v)
        | Self::Light(v)
        | Self::MeanLight(v)
        | Self::FNumber(v)
        | Self::Steepness(v) = self
            && !(v > 0.0)
        {
            return refuse("its target is not positive");
        }
        let axial = |zoom| lens.fields_at(zoom).values.iter().any(|f| f.x == 0.0 && f.y == 0.0);
        let needs_axis = matches!(self, Self::FNumber(_) | Self::RelativeIllumination { .. });
        if needs_axis && !(0..lens.zoom_positions()).all(axial) {
            return refuse("the lens has no field on the axis as a reference");
        }
        if let Self::RelativeIllumination { field, .. } = self {
            if lens.object != Object::Infinity {
                return refuse("the object is not at infinity");
            }
            if (0..lens.zoom_positions()).any(|z| field >= lens.fields_at(z).values.len()) {
                return refuse("the lens has no field of that number");
            }
        }
        Ok(())
    }
}

impl Term {
    /// True if the image plane counts as a surface of its scope.
    pub const fn may_be_at_image(self) -> bool {
        matches!(self, Self::Operand { kind: OperandKind::ChiefRayHeight, .. })
    }
}

impl Goal {
    /// Returns an error if a term or target does not apply to the lens.
    pub fn check(&self, lens: &Lens) -> Result<(), MeritError> {
        let refuse = |why| Err(MeritError::DoesNotApply { term: "goal", why });
        if self.terms.is_empty() {
            return refuse("it has no terms");
        }
        if !self.zoom_ratios.is_empty() && self.zoom_ratios.len() != lens.zoom_positions() {
            return refuse("the number of `zoom_ratios` differs from the number of zoom positions");
        }
        for WeightedTerm { term, weight, scope } in &self.terms {
            let refuse = |why| Err(MeritError::DoesNotApply { term: term.name(), why });
            if !(weight.is_finite() && *weight >= 0.0) {
                return refuse("its weight is negative or not finite");
            }
            if !term.numbers().iter().all(|v| v.is_finite()) {
                return refuse("its target is not finite");
            }
            term.check_bounds()?;
            let focal = matches!(
                term,
                Term::FocalLength(_)
                    | Term::FNumber(_)
                    | Term::Wavefront
                    | Term::Strehl
                    | Term::Mtf { .. }
            );
            if matches!(term, Term::Mtf { .. }) && self.pupil == PupilEdge::Frozen {
                return refuse(
                    "it needs the edges of the pupils; expected a goal with moving pupils",
                );
            }
            if focal && focal_lengths(lens)?.contains(&None) {
                return refuse("the lens is afocal");
            }
            if *term == (Term::AsBuilt { grade: None }) && lens.tolerances.is_none() {
                return refuse("the lens has no tolerances; expected some, or a grade of the term");
            }
            term.check_light(lens)?;
            check_scope(lens, *term, *scope)?;
        }
        Ok(())
    }

    /// The same goal with the spots of lenses that are made in place of spots as designed; with the
    /// tolerances of the lens, or those of a class.
    #[must_use]
    pub fn as_built(mut self, grade: Option<ToleranceGrade>) -> Self {
        for weighted in self.terms.iter_mut().filter(|weighted| weighted.term.is_of_spots()) {
            weighted.term = Term::AsBuilt { grade };
        }
        self
    }

    /// True if a term is kept as a constraint. With frozen pupils the light has no derivative, and a
    /// limit of it can only be a penalty.
    pub(super) fn is_constraint(&self, term: Term) -> bool {
        let derivable = self.pupil == PupilEdge::Moving || !term.concerns_light();
        self.limits == LimitTreatment::Constraints && term.is_limit() && derivable
    }

    /// The target focal length at a zoom position in mm, from that of the first one.
    pub(super) fn target(&self, zoom: usize, first: f64) -> f64 {
        first * self.zoom_ratios.get(zoom).copied().unwrap_or(1.0)
    }
}

/// Returns an error if a scope selects what the term does not have, or what the lens has not.
fn check_scope(lens: &Lens, term: Term, scope: TermScope) -> Result<(), MeritError> {
    let refuse = |why| Err(MeritError::DoesNotApply { term: term.name(), why });
    for selection in TermSelection::ALL {
        let Some([_, last]) = scope.range(selection) else { continue };
        if !term.selections().contains(&selection) {
            return refuse(match selection {
                TermSelection::Surfaces => "it cannot be restricted to surfaces",
                TermSelection::Fields => "it cannot be restricted to fields",
                TermSelection::Wavelengths => "it cannot be restricted to wavelengths",
                TermSelection::Zooms => "it cannot be restricted to zoom positions",
            });
        }
        if last > last_index(lens, selection, term.may_be_at_image()) {
            return refuse(match selection {
                TermSelection::Surfaces => "the lens has no surface of that number",
                TermSelection::Fields => "the lens has no field of that number",
                TermSelection::Wavelengths => "the lens has no wavelength of that number",
                TermSelection::Zooms => "the lens has no zoom position of that number",
            });
        }
    }
    Ok(())
}

/// The focal length at every zoom position; `None` for an afocal lens.
pub(super) fn focal_lengths(lens: &Lens) -> Result<Vec<Option<f64>>, MeritError> {
    let um = lens.wavelengths[lens.primary()].um;
    let focal_length = |zoom| {
        let system = lens.resolve(zoom, um)?;
        let first = first_order(&system, &Beam::for_lens(lens, zoom));
        let first = first.map_err(crate::pupil::RayModelError::from)?;
        match first.efl {
            Some(efl) if !efl.is_finite() => Err(MeritError::NotFinite { term: "focal_length" }),
            efl => Ok(efl),
        }
    };
    (0..lens.zoom_positions()).map(focal_length).collect()
}
