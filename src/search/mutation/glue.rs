//! Cements two neighbouring elements: their facing surfaces are replaced by one of the mean
//! curvature, and the air gap is removed.

use super::distributions::choose;
use super::draft::{MutationContext, MutationDraft, ReverseMove};
use super::kind::MutationKind;
use super::queries::{has_pickup, is_gap, is_of_medium, is_plain, is_zoomed};
use super::record::StructureChange;
use super::refusal::Refusal;
use super::split::SplitDraw;
use crate::lens::{Lens, Parameter};
use crate::search::element::{ElementKind, elements};
use crate::search::{Random, SearchRules};

/// The maximum number of pieces of a cemented group.
pub(super) const MAX_PIECES: usize = 3;

/// The last surfaces of elements that may be cemented to the next one.
pub(super) fn sites(lens: &Lens, rules: &SearchRules) -> Result<Vec<usize>, Refusal> {
    let elements = elements(lens);
    let neighbours = elements.windows(2).filter(|pair| pair[0].last + 1 == pair[1].first);
    let small = neighbours.filter(|pair| match (pair[0].kind, pair[1].kind) {
        (ElementKind::Glass(a), ElementKind::Glass(b)) => a + b <= MAX_PIECES,
        _ => false,
    });
    let found: Vec<usize> =
        small.map(|pair| pair[0].last).filter(|row| may_join(lens, *row, rules)).collect();
    if found.is_empty() {
        return Err(Refusal::NoNeighbours);
    }
    Ok(found)
}

fn may_join(lens: &Lens, row: usize, rules: &SearchRules) -> bool {
    let rows = lens.surfaces.len();
    let facing = [row, row + 1];
    let free = facing.iter().all(|r| rules.may_change(*r, rows) && is_plain(&lens.surfaces[*r]));
    let followed = has_pickup(lens, row, |_| true) || has_pickup(lens, row + 1, |q| !is_gap(q));
    let moves = is_zoomed(lens, row) || is_zoomed(lens, row + 1);
    let differ = lens.surfaces[row - 1].medium != lens.surfaces[row + 1].medium;
    free && !followed && !moves && differ
}

/// Cements two elements.
pub(super) fn draw(
    context: &MutationContext<'_>,
    random: &mut Random,
) -> Result<MutationDraft, Refusal> {
    let sites = sites(&context.lens, context.rules)?;
    let row = choose(&sites, random).copied().ok_or(Refusal::NoNeighbours)?;
    let [front, rear] = [row, row + 1].map(|r| context.lens.surfaces[r].curvature);
    let cut = SplitDraw {
        difference: 0.5 * (front - rear),
        air: context.lens.surfaces[row].thickness * context.lens.light_direction(row),
    };
    let mut draft = context.start_draft(sites.len());
    merge_surfaces(&mut draft, row, 0.5 * (front + rear));
    let scale = context.scale_after(&draft.lens);
    let there = scale.and_then(|scale| cut.log_density(context.rules, scale));
    // The map to mean and half difference has the determinant 1/2.
    draft.reverse = there.map(|draws| ReverseMove::new(MutationKind::Split, draws - 2f64.ln()));
    draft.change = StructureChange::Glue { first: row.into() };
    Ok(draft)
}

/// Merges two surfaces.
fn merge_surfaces(draft: &mut MutationDraft, row: usize, curvature: f64) {
    let next = draft.lens.surfaces[row + 1].clone();
    draft.drop_parameters(row + 1, |q| !is_gap(q) && !is_of_medium(q));
    draft.move_gap(row + 1, row);
    draft.lens.map_parameters(|p| {
        let of_glass = p.surface == row + 1 && is_of_medium(p.quantity);
        Some(if of_glass { Parameter { surface: row, ..p } } else { p })
    });
    let surface = &mut draft.lens.surfaces[row];
    surface.curvature = curvature;
    surface.medium = next.medium;
    surface.semi_diameter = match (surface.semi_diameter, next.semi_diameter) {
        (Some(a), Some(b)) if !surface.stop && !next.stop => Some(a.min(b)),
        (_, rim) if next.stop => rim,
        (rim, _) if surface.stop => rim,
        (a, b) => a.or(b),
    };
    surface.stop |= next.stop;
    draft.origins[row].curvature = None;
    draft.remove(row + 1);
    draft.inherit_variables(&[]);
}

/// True if the surfaces on both sides of the gap behind a row may be cemented.
pub(super) fn can_glue(lens: &Lens, row: usize, rules: &SearchRules) -> bool {
    sites(lens, rules).is_ok_and(|sites| sites.contains(&row))
}
