//! Bends an element: all its curvatures change by the same amount, which preserves the power of a
//! thin one.

use super::distributions::{bernoulli, choose, sample_normal};
use super::draft::{MutationContext, MutationDraft, ReverseMove, has_pickup};
use super::kind::MutationKind;
use crate::lens::{Lens, Parameter, Quantity};
use crate::search::element::{Element, ElementKind, elements};
use crate::search::projection::ProjectionMap;
use crate::search::{Random, SearchRules};

/// The elements that may be bent.
pub(super) fn places(lens: &Lens, rules: &SearchRules) -> Result<Vec<Element>, String> {
    let rows = lens.surfaces.len();
    let may = |e: &Element| {
        let glass = matches!(e.kind, ElementKind::Glass(_));
        let free = (e.first..=e.last).all(|row| rules.may_change(row, rows));
        let bends = |row| !has_pickup(lens, row, |q| q == Quantity::Curvature);
        glass && free && (e.first..=e.last).all(bends)
    };
    let found: Vec<_> = elements(lens).into_iter().filter(may).collect();
    if found.is_empty() {
        Err("no element whose curvatures are free".to_owned())
    } else {
        Ok(found)
    }
}

/// Bends an element.
pub(super) fn draw(
    scene: &MutationContext<'_>,
    random: &mut Random,
) -> Result<MutationDraft, String> {
    let places = places(&scene.lens, scene.rules)?;
    let element = choose(&places, random).copied().ok_or("no place")?;
    let by = sample_normal(scene.curvature_deviation(), random);
    let mut draft = scene.start_draft(places.len());
    for row in element.first..=element.last {
        draft.lens.surfaces[row].curvature += by;
        draft.origins[row].curvature = None;
        check_bounds(&draft.lens, row)?;
    }
    draft.map = random_projection_map(random);
    draft.back = Some(ReverseMove::new(MutationKind::Bend, 0.0));
    let Element { first, last, .. } = element;
    draft.what = format!("bent the element of surfaces {first} to {last} by {by:.5}/mm");
    Ok(draft)
}

/// Refuses a curvature outside the bounds of its variable.
fn check_bounds(lens: &Lens, row: usize) -> Result<(), String> {
    let curvature = lens.surfaces[row].curvature;
    let Some(variable) = lens.variable(Parameter::new(row, Quantity::Curvature)) else {
        return Ok(());
    };
    let low = variable.min.is_none_or(|min| curvature >= min);
    let high = variable.max.is_none_or(|max| curvature <= max);
    if low && high {
        return Ok(());
    }
    Err(format!("the curvature of surface {row} would leave the bounds of its variable"))
}

/// A random projection for a mutation that is its own reverse, so that each of the two undoes the
/// other.
pub(super) fn random_projection_map(random: &mut Random) -> ProjectionMap {
    if bernoulli(0.5, random) { ProjectionMap::Nearest } else { ProjectionMap::AlongNormals }
}
