//! Bends an element: all its curvatures change by the same amount, which preserves the power of a
//! thin one.

use super::distributions::{choose, curvature_deviation, random_projection_map, sample_normal};
use super::draft::{MutationContext, MutationDraft, ReverseMove};
use super::kind::MutationKind;
use super::queries::has_pickup;
use super::record::StructureChange;
use super::refusal::Refusal;
use crate::lens::{Lens, Parameter, Quantity};
use crate::search::element::{Element, ElementKind, elements};
use crate::search::{Random, SearchRules};

/// The elements that may be bent.
pub(super) fn sites(lens: &Lens, rules: &SearchRules) -> Result<Vec<Element>, Refusal> {
    let rows = lens.surfaces.len();
    let may = |e: &Element| {
        let glass = matches!(e.kind, ElementKind::Glass(_));
        let free = (e.first..=e.last).all(|row| rules.may_change(row, rows));
        let bends = |row| !has_pickup(lens, row, |q| q == Quantity::Curvature);
        glass && free && (e.first..=e.last).all(bends)
    };
    let found: Vec<_> = elements(lens).into_iter().filter(may).collect();
    if found.is_empty() { Err(Refusal::NoFreeCurvatures) } else { Ok(found) }
}

/// Bends an element.
pub(super) fn draw(
    context: &MutationContext<'_>,
    random: &mut Random,
) -> Result<MutationDraft, Refusal> {
    let sites = sites(&context.lens, context.rules)?;
    let element = choose(&sites, random).copied().ok_or(Refusal::NoFreeCurvatures)?;
    let by = sample_normal(curvature_deviation(context.scale), random);
    let mut draft = context.start_draft(sites.len());
    for row in element.first..=element.last {
        draft.lens.surfaces[row].curvature += by;
        draft.origins[row].curvature = None;
        check_bounds(&draft.lens, row)?;
    }
    draft.map = random_projection_map(random);
    draft.reverse = Some(ReverseMove::new(MutationKind::Bend, 0.0));
    let Element { first, last, .. } = element;
    draft.change = StructureChange::Bend { first: first.into(), last: last.into(), by };
    Ok(draft)
}

/// Refuses a curvature outside the bounds of its variable.
fn check_bounds(lens: &Lens, row: usize) -> Result<(), Refusal> {
    let curvature = lens.surfaces[row].curvature;
    let Some(variable) = lens.variable(Parameter::new(row, Quantity::Curvature)) else {
        return Ok(());
    };
    let low = variable.min.is_none_or(|min| curvature >= min);
    let high = variable.max.is_none_or(|max| curvature <= max);
    if low && high {
        return Ok(());
    }
    Err(Refusal::CurvatureBounds)
}
