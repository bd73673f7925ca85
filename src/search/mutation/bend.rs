//! Every curvature of an element changes by as much: a thin one keeps its power.

use super::Kind;
use super::chance::{coin, normal, pick};
use super::draft::{Back, Draft, Scene, hangs};
use crate::lens::{Lens, Parameter, Quantity};
use crate::search::element::{Element, Make, elements};
use crate::search::projection::Map;
use crate::search::{Random, Rules};

/// Which elements may be bent.
pub(super) fn places(lens: &Lens, rules: &Rules) -> Result<Vec<Element>, String> {
    let rows = lens.surfaces.len();
    let may = |e: &Element| {
        let glass = matches!(e.make, Make::Glass(_));
        let free = (e.first..=e.last).all(|row| rules.allow(row, rows));
        let bends = |row| !hangs(lens, row, |q| q == Quantity::Curvature);
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
pub(super) fn draw(scene: &Scene<'_>, random: &mut Random) -> Result<Draft, String> {
    let places = places(&scene.lens, scene.rules)?;
    let element = pick(&places, random).copied().ok_or("no place")?;
    let by = normal(scene.bend(), random);
    let mut draft = scene.draft(places.len());
    for row in element.first..=element.last {
        draft.lens.surfaces[row].curvature += by;
        draft.origins[row].curvature = None;
        inside(&draft.lens, row)?;
    }
    draft.map = either(random);
    draft.back = Some(Back { kind: Kind::Bend, log: 0.0, room: None });
    let Element { first, last, .. } = element;
    draft.what = format!("bent the element of surfaces {first} to {last} by {by:.5}/mm");
    Ok(draft)
}

/// Refuses a curvature that its variable does not allow.
fn inside(lens: &Lens, row: usize) -> Result<(), String> {
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

/// A mutation that is its own way back is projected one way or the other, so that each undoes the
/// other.
pub(super) fn either(random: &mut Random) -> Map {
    if coin(0.5, random) { Map::Closest } else { Map::Along }
}
