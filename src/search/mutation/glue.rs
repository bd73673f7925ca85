//! Two neighbours become one cemented group: their facing surfaces become one of the mean curvature,
//! and the air between them goes.

use super::Kind;
use super::chance::pick;
use super::draft::{Back, Draft, Scene, hangs, is_gap, is_of_medium, is_plain, sense, zooms};
use super::split::Cut;
use crate::lens::{Lens, Parameter};
use crate::search::element::{Make, elements};
use crate::search::{Random, Rules};

/// More pieces than this are not cemented together.
pub(super) const PIECES: usize = 3;

/// The last surfaces of elements that may be glued to the next one.
pub(super) fn places(lens: &Lens, rules: &Rules) -> Result<Vec<usize>, String> {
    let elements = elements(lens);
    let neighbours = elements.windows(2).filter(|pair| pair[0].last + 1 == pair[1].first);
    let small = neighbours.filter(|pair| match (pair[0].make, pair[1].make) {
        (Make::Glass(a), Make::Glass(b)) => a + b <= PIECES,
        _ => false,
    });
    let found: Vec<usize> =
        small.map(|pair| pair[0].last).filter(|row| may_join(lens, *row, rules)).collect();
    if found.is_empty() {
        return Err("no two elements of different glass whose plain surfaces face each other \
                    across a gap that does not move"
            .to_owned());
    }
    Ok(found)
}

fn may_join(lens: &Lens, row: usize, rules: &Rules) -> bool {
    let rows = lens.surfaces.len();
    let facing = [row, row + 1];
    let free = facing.iter().all(|r| rules.allow(*r, rows) && is_plain(&lens.surfaces[*r]));
    let followed = hangs(lens, row, |_| true) || hangs(lens, row + 1, |q| !is_gap(q));
    let moves = zooms(lens, row) || zooms(lens, row + 1);
    let differ = lens.surfaces[row - 1].medium != lens.surfaces[row + 1].medium;
    free && !followed && !moves && differ
}

/// Glues two neighbours.
pub(super) fn draw(scene: &Scene<'_>, random: &mut Random) -> Result<Draft, String> {
    let places = places(&scene.lens, scene.rules)?;
    let row = pick(&places, random).copied().ok_or("no place")?;
    let [front, rear] = [row, row + 1].map(|r| scene.lens.surfaces[r].curvature);
    let cut = Cut {
        difference: 0.5 * (front - rear),
        air: scene.lens.surfaces[row].thickness * sense(&scene.lens, row),
    };
    let mut draft = scene.draft(places.len());
    join(&mut draft, row, 0.5 * (front + rear));
    let scale = scene.scale_of(&draft.lens);
    let there = scale.and_then(|scale| cut.log_density(scene.rules, scale));
    // Mean and half difference of two numbers: the determinant is 1/2.
    draft.back = there.map(|draws| Back::by(Kind::Split, draws - 2f64.ln()));
    draft.what = format!("glued surfaces {row} and {} together", row + 1);
    Ok(draft)
}

/// Makes one surface of two.
fn join(draft: &mut Draft, row: usize, curvature: f64) {
    let next = draft.lens.surfaces[row + 1].clone();
    draft.forget(row + 1, |q| !is_gap(q) && !is_of_medium(q));
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
    draft.settle(&[]);
}

/// Whether the surfaces on both sides of the gap behind a row may be glued.
pub(super) fn can(lens: &Lens, row: usize, rules: &Rules) -> bool {
    places(lens, rules).is_ok_and(|places| places.contains(&row))
}
