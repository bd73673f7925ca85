//! Adds a singlet in an air gap: close to the surface in front of it or behind it, bent like that
//! surface, of random glass, with little power.
//!
//! So it changes the rays little and clips none: its thickness and the air beside it follow from
//! the semi-diameter of that surface. (The thesis draws curvatures around 0 and puts the singlet in
//! contact, where it would intersect every surface that is bent towards it.)

use super::distributions::{bernoulli, choose, usable_glasses};
use super::draft::{MutationContext, MutationDraft, ReverseMove};
use super::kind::MutationKind;
use super::queries::{has_pickup, is_gap, medium_after};
use super::record::StructureChange;
use super::refusal::Refusal;
use super::remove;
use super::singlet::{Neighbour, SingletParameters};
use super::spacing::keep_probability;
use crate::lens::glass::Glass;
use crate::lens::{Lens, Medium, Object, Row};
use crate::search::element::{glass_gaps, piece_count};
use crate::search::projection::ProjectionMap;
use crate::search::{Random, SearchRules};

/// The deviation of the curvatures of a meniscus relative to that of the singlets of the thesis.
const MENISCUS_SPREAD: f64 = 0.2;

/// A place for a new singlet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SingletSite {
    /// The surface in front of the air gap; `None` for the space in front of the lens.
    pub(super) gap: Option<usize>,
    /// True if the singlet is close to that surface, false if it is close to the next one.
    pub(super) behind: bool,
}

/// The places for a new singlet.
pub(super) fn sites(lens: &Lens, rules: &SearchRules) -> Result<Vec<SingletSite>, Refusal> {
    let most = rules.elements[1];
    if piece_count(lens) + 1 > most {
        return Err(Refusal::TooManyElements);
    }
    let glass = glass_gaps(lens);
    let rows = lens.surfaces.len();
    let mut found = Vec::new();
    if rules.fixed_ends[0] == 0 && !glass[0] {
        found.push(SingletSite { gap: None, behind: false });
    }
    for row in (0..rows).filter(|row| !glass[row + 1] && rules.may_change(*row, rows)) {
        let last = row + 1 == rows;
        if !(last || rules.may_change(row + 1, rows)) || has_pickup(lens, row, is_gap) {
            continue;
        }
        found.push(SingletSite { gap: Some(row), behind: true });
        if !last {
            found.push(SingletSite { gap: Some(row), behind: false });
        }
    }
    if found.is_empty() { Err(Refusal::NoAirGap) } else { Ok(found) }
}

impl SingletSite {
    pub(super) fn neighbour(self) -> Neighbour {
        let row = match self.gap {
            Some(gap) if self.behind => gap,
            Some(gap) => gap + 1,
            None => 0,
        };
        Neighbour { row, behind: self.behind }
    }
}

/// Adds a singlet.
pub(super) fn draw(
    context: &MutationContext<'_>,
    random: &mut Random,
) -> Result<MutationDraft, Refusal> {
    draw_with(context, 1.0, random)
}

/// Adds a thin meniscus, both of whose surfaces have nearly the curvature of the surface beside it; it
/// has no reverse.
///
/// In contact with that surface and without a thickness it would change no ray. For curvatures on
/// either side of the common one two descents lead to different lenses: the old lens is a saddle point
/// of the merit over those two curvatures (Bociort, van Turnhout, "Looking for order in the optical
/// design landscape", Proc. SPIE 6288, 2006). The limits leave it a small power.
pub(super) fn draw_meniscus(
    context: &MutationContext<'_>,
    random: &mut Random,
) -> Result<MutationDraft, Refusal> {
    let draft = draw_with(context, MENISCUS_SPREAD, random)?;
    Ok(MutationDraft { reverse: None, ..draft })
}

fn draw_with(
    context: &MutationContext<'_>,
    spread: f64,
    random: &mut Random,
) -> Result<MutationDraft, Refusal> {
    let sites = sites(&context.lens, context.rules)?;
    let glasses = usable_glasses(&context.lens, context.rules);
    let site = choose(&sites, random).copied().ok_or(Refusal::NoAirGap)?;
    let glass = choose(&glasses, random).copied().ok_or(Refusal::NoGlass)?;
    let singlet = SingletParameters::draw(
        &context.lens,
        site.neighbour(),
        context.rules,
        context.scale,
        spread,
        random,
    );
    let keeping = keep_probability(&context.lens, site.gap, context.rules, singlet.length());
    let keeps_rest = bernoulli(keeping, random);
    let mut draft = context.start_draft(sites.len());
    let first = insert(&mut draft, site, glass, singlet, keeps_rest)?;
    draft.map = ProjectionMap::AlongNormals;
    draft.new_glass = vec![first];
    draft.rimless = vec![first, first + 1];
    draft.change = StructureChange::AddSinglet { glass: glass.full_name(), first: first.into() };
    let chosen = if keeps_rest { keeping } else { 1.0 - keeping };
    let there = singlet
        .log_density(&context.lens, site.neighbour(), context.rules, context.scale)
        .map(|log| log - (glasses.len() as f64).ln() + chosen.ln());
    let finite = site.gap.is_none() && context.lens.object != Object::Infinity;
    draft.reverse = there.filter(|_| !finite).map(|there| {
        ReverseMove::new(
            MutationKind::RemoveSinglet,
            remove::log_chance(&draft.lens, first, keeps_rest) - there,
        )
    });
    Ok(draft)
}

/// Inserts the rows of a singlet and returns the first one.
pub(super) fn insert(
    draft: &mut MutationDraft,
    site: SingletSite,
    glass: &Glass,
    singlet: SingletParameters,
    keeps_rest: bool,
) -> Result<usize, Refusal> {
    let first = site.gap.map_or(0, |gap| gap + 1);
    let (sense, air) = match site.gap {
        Some(gap) => (draft.lens.light_direction(gap), medium_after(&draft.lens, gap)),
        None => (1.0, draft.lens.object_medium.clone()),
    };
    let front = Row {
        curvature: singlet.curvatures[0],
        thickness: sense * singlet.thickness,
        medium: Medium::Glass(glass.full_name()),
        ..Row::default()
    };
    let rear = Row {
        curvature: singlet.curvatures[1],
        thickness: sense * singlet.air,
        medium: air,
        ..Row::default()
    };
    draft.insert(first, front);
    draft.insert(first + 1, rear);
    let mut new = vec![first, first + 1];
    match site.gap {
        None => shorten_object_distance(&mut draft.lens.object, singlet.length())?,
        Some(gap) => {
            let rest = if site.behind { first + 1 } else { gap };
            if site.behind {
                draft.move_gap(gap, rest);
                draft.lens.surfaces[gap].thickness = sense * singlet.air;
                new.push(gap);
            }
            if keeps_rest {
                draft.lengthen(rest, -singlet.length());
            }
        }
    }
    draft.inherit_variables(&new);
    Ok(first)
}

/// Moves the first vertex towards an object at a fixed position.
fn shorten_object_distance(object: &mut Object, length: f64) -> Result<(), Refusal> {
    if let Object::Finite(distance) = object {
        let left = *distance - length;
        if *distance > 0.0 && left <= 0.0 {
            return Err(Refusal::NoRoomAtObject);
        }
        *distance = left;
    }
    Ok(())
}
