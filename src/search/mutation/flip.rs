//! Reverses an element with its media: an axial index gradient is expressed from its other end.

use super::distributions::{choose, random_projection_map};
use super::draft::{MutationContext, MutationDraft, ReverseMove};
use super::kind::MutationKind;
use super::queries::{has_pickup, is_gap, is_of_medium, is_zoomed};
use super::record::StructureChange;
use super::refusal::Refusal;
use crate::lens::{GradientIndex, Lens, Medium, Quantity, RADIAL_TERMS};
use crate::search::element::{Element, ElementKind, elements};
use crate::search::projection::RowOrigin;
use crate::search::{Random, SearchRules};

/// The elements that may be reversed.
pub(super) fn sites(lens: &Lens, rules: &SearchRules) -> Result<Vec<Element>, Refusal> {
    let rows = lens.surfaces.len();
    let may = |e: &Element| {
        let free = (e.first..=e.last).all(|row| rules.may_change(row, rows));
        matches!(e.kind, ElementKind::Glass(_)) && free
    };
    let (mut found, mut obstacle) = (Vec::new(), None);
    for element in elements(lens).into_iter().filter(may) {
        match (element.first..element.last).find_map(|row| why_not_reversible(lens, row)) {
            None => found.push(element),
            why => obstacle = obstacle.or(why),
        }
    }
    if found.is_empty() { Err(obstacle.unwrap_or(Refusal::NoReversibleElement)) } else { Ok(found) }
}

/// The gradient-index medium behind a row, if its index varies along the axis.
fn axial_gradient_behind(lens: &Lens, row: usize) -> Option<&GradientIndex> {
    match &lens.surfaces[row].medium {
        Medium::Grin(gradient) if gradient.is_axial() => Some(gradient),
        _ => None,
    }
}

/// The reason that the medium behind a row cannot be reversed, if there is one.
fn why_not_reversible(lens: &Lens, row: usize) -> Option<Refusal> {
    let gradient = axial_gradient_behind(lens, row)?;
    if is_zoomed(lens, row) {
        Some(Refusal::GradientZooms)
    } else if has_pickup(lens, row, |q| is_gap(q) || is_of_medium(q)) {
        Some(Refusal::GradientHasPickup)
    } else if gradient.reversed(lens.surfaces[row].thickness).is_none() {
        Some(Refusal::GradientWithoutBase)
    } else {
        None
    }
}

/// Reverses an element.
pub(super) fn draw(
    context: &MutationContext<'_>,
    random: &mut Random,
) -> Result<MutationDraft, Refusal> {
    let sites = sites(&context.lens, context.rules)?;
    let Element { first, last, .. } =
        choose(&sites, random).copied().ok_or(Refusal::NoReversibleElement)?;
    let mut draft = context.start_draft(sites.len());
    draft.lens.reverse_rows(first, last);
    for row in first..=last {
        let gap = if row < last { first + last - 1 - row } else { last };
        let curvature = Some((first + last - row, -1.0));
        draft.origins[row] = RowOrigin { curvature, gap: Some(gap) };
    }
    let mirrored: Vec<usize> =
        (first..last).filter(|row| axial_gradient_behind(&draft.lens, *row).is_some()).collect();
    mirrored.iter().for_each(|row| reverse_axial_gradient(&mut draft.lens, *row));
    draft.map = random_projection_map(random);
    // The projection changes the length of such a gap, so that a second reversal leads elsewhere.
    draft.reverse = mirrored.is_empty().then_some(ReverseMove::new(MutationKind::Flip, 0.0));
    draft.change = StructureChange::Flip { first: first.into(), last: last.into() };
    Ok(draft)
}

/// Expresses an axial gradient from its other end. Fixed coefficients are fixed at their new
/// values, the bounds of the others are widened.
fn reverse_axial_gradient(lens: &mut Lens, row: usize) {
    let length = lens.surfaces[row].thickness;
    let turned = axial_gradient_behind(lens, row).and_then(|gradient| gradient.reversed(length));
    let Some(turned) = turned else { return };
    lens.surfaces[row].medium = Medium::Grin(Box::new(turned));
    let axial = |q| matches!(q, Quantity::Grin(k) if k >= RADIAL_TERMS);
    let values: Vec<_> = lens.variables.iter().map(|v| lens.get(v.parameter)).collect();
    for (variable, value) in lens.variables.iter_mut().zip(values) {
        let parameter = variable.parameter;
        let changed = axial(parameter.quantity) || parameter.quantity == Quantity::Index;
        let Some(value) = value.filter(|_| parameter.surface == row && changed) else { continue };
        let held = variable.min.is_some() && variable.min == variable.max;
        variable.min = variable.min.map(|min| if held { value } else { min.min(value) });
        variable.max = variable.max.map(|max| if held { value } else { max.max(value) });
    }
}
