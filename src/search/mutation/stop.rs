//! Moves the stop along its gap or to another air gap. The axial beam that passes it stays the
//! same.

use super::distributions::choose;
use super::draft::{MutationContext, MutationDraft, ReverseMove};
use super::kind::MutationKind;
use super::queries::{has_pickup, is_gap, is_zoomed, medium_after, shortest_gap};
use super::record::StructureChange;
use super::refusal::Refusal;
use crate::lens::{Aperture, Lens, Medium, Object, Row};
use crate::paraxial::{Beam, first_order};
use crate::search::element::glass_gaps;
use crate::search::{Random, SearchRules};
use rand::RngExt as _;

/// The row of a stop that is a bare plane in air.
fn plane_stop(lens: &Lens) -> Option<usize> {
    let stop = lens.stop()?;
    let glass = glass_gaps(lens);
    let row = &lens.surfaces[stop];
    let blocks = row.obstruction.is_some() || !row.apertures.is_empty();
    let bare = row.curvature == 0.0 && row.asphere.is_empty() && !blocks;
    let air = !glass[stop] && !glass[stop + 1];
    let mirror = row.medium == Medium::Mirror;
    (bare && air && !mirror).then_some(stop)
}

/// The gaps, given by the rows in front of them in a lens without its stop, to which the stop may
/// move; not the last one, where it would hide the back focal distance.
fn stop_gaps(bare: &Lens, rules: &SearchRules) -> Vec<usize> {
    let rows = bare.surfaces.len();
    let glass = glass_gaps(bare);
    let may = |row: &usize| {
        let free = rules.may_change(*row, rows) && rules.may_change(row + 1, rows);
        free && !glass[row + 1] && !has_pickup(bare, *row, is_gap) && shortest_gap(bare, *row) > 0.0
    };
    (0..rows - 1).filter(may).collect()
}

/// The lens without its stop.
fn remove_stop(context: &MutationContext<'_>) -> Result<MutationDraft, Refusal> {
    let mut draft = context.start_draft(1);
    let stop = context.lens.stop().ok_or(Refusal::NoStop)?;
    if !context.rules.may_change(stop, context.lens.surfaces.len()) {
        return Err(Refusal::FixedStop);
    }
    let Some(plane) = plane_stop(&context.lens) else {
        draft.lens.surfaces[stop].stop = false;
        return Ok(draft);
    };
    let near = [plane.checked_sub(1), Some(plane)];
    if near.into_iter().flatten().any(|row| has_pickup(&context.lens, row, is_gap)) {
        return Err(Refusal::StopHasPickup);
    }
    if plane + 1 == context.lens.surfaces.len() {
        return Err(Refusal::StopIsLast);
    }
    match (plane.checked_sub(1), &mut draft.lens.object) {
        (Some(before), _) => draft.add_gap(before, plane),
        (None, Object::Finite(distance)) => *distance += context.lens.surfaces[plane].thickness,
        (None, Object::Infinity) => {}
    }
    draft.remove(plane);
    Ok(draft)
}

/// The gaps to which the stop may move.
pub(super) fn sites(lens: &Lens, rules: &SearchRules) -> Result<Vec<usize>, Refusal> {
    let context = MutationContext::new(lens.clone(), rules, 1.0);
    remove_stop(&context).map(|bare| stop_gaps(&bare.lens, rules))
}

/// Moves the stop.
pub(super) fn draw(
    context: &MutationContext<'_>,
    random: &mut Random,
) -> Result<MutationDraft, Refusal> {
    let old = plane_stop(&context.lens);
    let mut draft = remove_stop(context)?;
    let gaps = stop_gaps(&draft.lens, context.rules);
    let gap = choose(&gaps, random).copied().ok_or(Refusal::NoGapForStop)?;
    draft.sites = gaps.len();
    let (gap_length, share) = (shortest_gap(&draft.lens, gap), random.random::<f64>());
    draft.reverse = reverse_move(context.rules, &draft.lens, old, gap);
    insert_stop(&mut draft, gap, share * gap_length);
    rescale_aperture(&context.lens, &mut draft.lens)?;
    let at = gap + 1;
    draft.rimless =
        draft.lens.surfaces[at].semi_diameter.is_none().then_some(at).into_iter().collect();
    draft.change = StructureChange::MoveStop { surface: gap.into(), distance: share * gap_length };
    Ok(draft)
}

/// The position in a gap is a share of its length, so the determinant of the map is the ratio of
/// the gaps' lengths. A stop on a glass surface has no reverse, nor has one between moving groups.
fn reverse_move(
    rules: &SearchRules,
    bare: &Lens,
    old: Option<usize>,
    gap: usize,
) -> Option<ReverseMove> {
    let before = old?.checked_sub(1)?;
    let moves = [before, gap].iter().any(|row| is_zoomed(bare, *row));
    let log = shortest_gap(bare, gap).ln() - shortest_gap(bare, before).ln();
    let possible = !moves && log.is_finite() && stop_gaps(bare, rules).contains(&before);
    possible.then_some(ReverseMove::new(MutationKind::MoveStop, log))
}

/// Inserts a stop `length` mm behind a row.
fn insert_stop(draft: &mut MutationDraft, gap: usize, length: f64) {
    let sense = draft.lens.light_direction(gap);
    let row = Row { medium: medium_after(&draft.lens, gap), stop: true, ..Row::default() };
    draft.insert(gap + 1, row);
    draft.move_gap(gap, gap + 1);
    draft.lens.surfaces[gap].thickness = sense * length;
    draft.lengthen(gap + 1, -length);
    draft.inherit_variables(&[gap]);
}

/// If the aperture is the size of the stop, sets it to the height of the axial beam at the new
/// stop.
fn rescale_aperture(before: &Lens, lens: &mut Lens) -> Result<(), Refusal> {
    let mut widest = None;
    for zoom in 0..lens.zoom_positions() {
        let Aperture::StopSemiDiameter(radius) = before.aperture_at(zoom) else { continue };
        let aperture = Aperture::StopSemiDiameter(radius * axial_height_ratio(before, lens, zoom)?);
        match lens.zoom.get_mut(zoom) {
            Some(position) => position.aperture = Some(aperture),
            None => lens.aperture = aperture,
        }
        let Aperture::StopSemiDiameter(radius) = aperture else { continue };
        widest = Some(radius.max(widest.unwrap_or(0.0)));
    }
    if let (Some(radius), Some(stop)) = (widest, lens.stop()) {
        lens.surfaces[stop].semi_diameter = Some(radius);
        if let Aperture::StopSemiDiameter(size) = &mut lens.aperture {
            *size = radius;
        }
    }
    Ok(())
}

/// The ratio of the heights of an axial ray at the new stop and at the old one.
fn axial_height_ratio(before: &Lens, lens: &Lens, zoom: usize) -> Result<f64, Refusal> {
    let um = lens.wavelengths[lens.primary()].um;
    let height = |lens: &Lens| {
        let system = lens.resolve(zoom, um)?;
        let beam = Beam { aperture: Aperture::StopSemiDiameter(1.0), ..Beam::for_lens(lens, zoom) };
        let first = first_order(&system, &beam)?;
        // With a stop of 1 mm, the start height is the inverse of the height at the stop of a ray
        // from 1 mm.
        Ok::<f64, Refusal>(first.marginal.heights[0].hypot(first.marginal.start_slope))
    };
    let (old, new) = (height(before)?, height(lens)?);
    let ratio = old / new;
    let sound = ratio.is_finite() && ratio > 0.0;
    sound.then_some(ratio).ok_or(Refusal::NoAxialHeight)
}
