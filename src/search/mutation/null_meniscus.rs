//! A meniscus without thickness in contact with a surface and with its curvature: it changes no ray, so
//! that the merit of the lens is unchanged.
//!
//! At a minimum of the old lens the merit over the two new curvatures has a saddle point there: along equal
//! curvatures it is constant, and a quadratic form that vanishes in one direction is indefinite. Descents
//! on either side of equal curvatures lead to different lenses (Bociort, van Turnhout, "Looking for order
//! in the optical design landscape", Proc. SPIE 6288, 2006).

use super::MutatedLens;
use super::add::{SingletSite, insert, sites};
use super::distributions::{choose, usable_glasses};
use super::draft::{MutationContext, MutationDraft};
use super::kind::MutationKind;
use super::record::StructureChange;
use super::refusal::{MutationError, Refusal};
use super::singlet::SingletParameters;
use super::spacing::keep_probability;
use crate::lens::Lens;
use crate::lens::glass::{self, Glass};
use crate::search::projection::ProjectionMap;
use crate::search::{Random, SearchRules};

/// A lens with a meniscus without thickness.
#[derive(Debug, Clone)]
pub(in crate::search) struct NullMeniscus {
    site: SingletSite,
    glass: &'static Glass,
    /// The lens.
    pub(in crate::search) lens: Lens,
    /// The first surface of the meniscus.
    pub(in crate::search) first: usize,
    /// The curvature of both of its surfaces, in 1/mm.
    pub(in crate::search) curvature: f64,
}

const KIND: MutationKind = MutationKind::AddSinglet;

impl NullMeniscus {
    /// A meniscus of a random glass at a random place.
    pub(in crate::search) fn draw(
        lens: &Lens,
        rules: &SearchRules,
        random: &mut Random,
    ) -> Result<Self, MutationError> {
        let refuse = |refusal| MutationError::new(KIND, refusal);
        let context = super::context_of(KIND, lens, rules)?;
        let sites = sites(&context.lens, rules).map_err(refuse)?;
        let glasses = glass::distinct(usable_glasses(&context.lens, rules));
        let site = choose(&sites, random).copied().ok_or_else(|| refuse(Refusal::NoAirGap))?;
        let glass = choose(&glasses, random).copied().ok_or_else(|| refuse(Refusal::NoGlass))?;
        Self::at(&context, site, glass).map_err(refuse)
    }

    /// A meniscus of this glass behind a surface, or in front of it.
    pub(in crate::search) fn beside(
        lens: &Lens,
        rules: &SearchRules,
        (surface, behind): (usize, bool),
        glass: &'static Glass,
    ) -> Result<Self, MutationError> {
        let refuse = |refusal| MutationError::new(KIND, refusal);
        let context = super::context_of(KIND, lens, rules)?;
        let gap = if behind { Some(surface) } else { surface.checked_sub(1) };
        let site = SingletSite { gap, behind };
        let is_one = sites(&context.lens, rules).map_err(refuse)?.contains(&site);
        let site = is_one.then_some(site).ok_or_else(|| refuse(Refusal::NoAirGap))?;
        Self::at(&context, site, glass).map_err(refuse)
    }

    fn at(
        context: &MutationContext<'_>,
        site: SingletSite,
        glass: &'static Glass,
    ) -> Result<Self, Refusal> {
        let beside = &context.lens.surfaces[site.neighbour().row];
        let (curvature, rim) = (beside.curvature, beside.semi_diameter);
        let mut draft = context.start_draft(1);
        let none = SingletParameters { curvatures: [curvature; 2], thickness: 0.0, air: 0.0 };
        let first = insert(&mut draft, site, glass, none, true)?;
        draft.lens.surfaces[first..=first + 1].iter_mut().for_each(|row| row.semi_diameter = rim);
        draft.lens.check().map_err(Refusal::from)?;
        Ok(Self { site, glass, lens: draft.lens, first, curvature })
    }

    /// The lens with the meniscus as thick, and as far from its neighbour, as the rules ask for, with these
    /// curvatures; the rest of the lens keeps its focus.
    pub(in crate::search) fn thickened(
        &self,
        lens: &Lens,
        rules: &SearchRules,
        curvatures: [f64; 2],
    ) -> Result<MutatedLens, MutationError> {
        let refuse = |refusal| MutationError::new(KIND, refusal);
        let context = super::context_of(KIND, lens, rules)?;
        let draft = self.thick_draft(&context, curvatures).map_err(refuse)?;
        super::complete(&context, KIND, draft).map_err(refuse)
    }

    fn thick_draft(
        &self,
        context: &MutationContext<'_>,
        curvatures: [f64; 2],
    ) -> Result<MutationDraft, Refusal> {
        let (lens, rules, neighbour) = (&context.lens, context.rules, self.site.neighbour());
        let singlet =
            SingletParameters::thinnest(lens, neighbour, rules, context.scale, curvatures);
        let keeps_rest = keep_probability(lens, self.site.gap, rules, singlet.length()) > 0.0;
        let mut draft = context.start_draft(1);
        let first = insert(&mut draft, self.site, self.glass, singlet, keeps_rest)?;
        draft.map = ProjectionMap::AlongNormals;
        draft.new_glass = vec![first];
        draft.rimless = vec![first, first + 1];
        let glass = self.glass.full_name();
        draft.change = StructureChange::AddSinglet { glass, first: first.into() };
        Ok(draft)
    }
}
