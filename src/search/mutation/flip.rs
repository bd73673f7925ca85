//! An element is turned around.

use super::Kind;
use super::bend::either;
use super::chance::pick;
use super::draft::{Back, Draft, Scene};
use crate::lens::Lens;
use crate::search::element::{Element, Make, elements};
use crate::search::projection::Origin;
use crate::search::{Random, Rules};

/// Which elements may be turned.
pub(super) fn places(lens: &Lens, rules: &Rules) -> Result<Vec<Element>, String> {
    let rows = lens.surfaces.len();
    let may = |e: &Element| {
        let free = (e.first..=e.last).all(|row| rules.allow(row, rows));
        matches!(e.make, Make::Glass(_)) && free
    };
    let found: Vec<_> = elements(lens).into_iter().filter(may).collect();
    if found.is_empty() { Err("no element that may be turned".to_owned()) } else { Ok(found) }
}

/// Turns an element around.
pub(super) fn draw(scene: &Scene<'_>, random: &mut Random) -> Result<Draft, String> {
    let places = places(&scene.lens, scene.rules)?;
    let Element { first, last, .. } = pick(&places, random).copied().ok_or("no place")?;
    let mut draft = scene.draft(places.len());
    draft.lens.turn_rows(first, last);
    for row in first..=last {
        let gap = if row < last { first + last - 1 - row } else { last };
        let curvature = Some((first + last - row, -1.0));
        draft.origins[row] = Origin { curvature, gap: Some(gap) };
    }
    draft.map = either(random);
    draft.back = Some(Back { kind: Kind::Flip, log: 0.0, room: None });
    draft.what = format!("turned the element of surfaces {first} to {last} around");
    Ok(draft)
}
