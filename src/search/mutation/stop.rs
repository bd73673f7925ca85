//! The stop goes to another place in the air: along its gap, or to another one. What passes it on
//! the axis stays what it was.

use super::Kind;
use super::chance::pick;
use super::draft::{Back, Draft, Scene, filling, hangs, is_gap, sense, shortest, zooms};
use crate::lens::{Aperture, Lens, Medium, Object, Row};
use crate::paraxial::{Beam, first_order};
use crate::search::element::filled;
use crate::search::{Random, Rules};
use rand::RngExt as _;

/// The row of a stop that is a plane in air and nothing else.
fn plane(lens: &Lens) -> Option<usize> {
    let stop = lens.stop()?;
    let glass = filled(lens);
    let row = &lens.surfaces[stop];
    let bare = row.curvature == 0.0 && row.asphere.is_empty() && row.obstruction.is_none();
    let air = !glass[stop] && !glass[stop + 1];
    let mirror = row.medium == Medium::Mirror;
    (bare && air && !mirror).then_some(stop)
}

/// The gaps, behind these rows of a lens without its stop, to which the stop may go; not the one
/// behind the last surface, where it would hide the back focus.
fn gaps(bare: &Lens, rules: &Rules) -> Vec<usize> {
    let rows = bare.surfaces.len();
    let glass = filled(bare);
    let may = |row: &usize| {
        let free = rules.allow(*row, rows) && rules.allow(row + 1, rows);
        free && !glass[row + 1] && !hangs(bare, *row, is_gap) && shortest(bare, *row) > 0.0
    };
    (0..rows - 1).filter(may).collect()
}

/// The lens without its stop.
fn without(scene: &Scene<'_>) -> Result<Draft, String> {
    let mut draft = scene.draft(1);
    let stop = scene.lens.stop().ok_or("there is no stop")?;
    if !scene.rules.allow(stop, scene.lens.surfaces.len()) {
        return Err("the rules keep the stop where it is".to_owned());
    }
    let Some(plane) = plane(&scene.lens) else {
        draft.lens.surfaces[stop].stop = false;
        return Ok(draft);
    };
    let near = [plane.checked_sub(1), Some(plane)];
    if near.into_iter().flatten().any(|row| hangs(&scene.lens, row, is_gap)) {
        return Err("a pickup has to do with a gap at the stop".to_owned());
    }
    if plane + 1 == scene.lens.surfaces.len() {
        return Err("the stop is the last surface".to_owned());
    }
    match (plane.checked_sub(1), &mut draft.lens.object) {
        (Some(before), _) => draft.add_gap(before, plane),
        (None, Object::Finite(distance)) => *distance += scene.lens.surfaces[plane].thickness,
        (None, Object::Infinity) => {}
    }
    draft.remove(plane);
    Ok(draft)
}

/// In how many places the stop may be put.
pub(super) fn places(lens: &Lens, rules: &Rules) -> Result<Vec<usize>, String> {
    let scene = Scene::new(lens.clone(), rules, 1.0);
    without(&scene).map(|bare| gaps(&bare.lens, rules))
}

/// Moves the stop.
pub(super) fn draw(scene: &Scene<'_>, random: &mut Random) -> Result<Draft, String> {
    let old = plane(&scene.lens);
    let mut draft = without(scene)?;
    let gaps = gaps(&draft.lens, scene.rules);
    let gap = pick(&gaps, random).copied().ok_or("no other air gap for the stop")?;
    draft.places = gaps.len();
    let (room, share) = (shortest(&draft.lens, gap), random.random::<f64>());
    draft.back = back(scene.rules, &draft.lens, old, gap);
    put(&mut draft, gap, share * room);
    resize(&scene.lens, &mut draft.lens)?;
    let at = gap + 1;
    draft.rimless =
        draft.lens.surfaces[at].semi_diameter.is_none().then_some(at).into_iter().collect();
    draft.what = format!("moved the stop {:.3} mm behind surface {gap}", share * room);
    Ok(draft)
}

/// The place in a gap is a share of it: the determinant of the map is what the gaps' lengths are to
/// each other. A stop on a glass surface has no way back, nor has one between moving groups.
fn back(rules: &Rules, bare: &Lens, old: Option<usize>, gap: usize) -> Option<Back> {
    let before = old?.checked_sub(1)?;
    let moves = [before, gap].iter().any(|row| zooms(bare, *row));
    let log = shortest(bare, gap).ln() - shortest(bare, before).ln();
    let possible = !moves && log.is_finite() && gaps(bare, rules).contains(&before);
    possible.then_some(Back { kind: Kind::MoveStop, log, room: None })
}

/// Puts a stop `length` behind a row.
fn put(draft: &mut Draft, gap: usize, length: f64) {
    let sense = sense(&draft.lens, gap);
    let row = Row { medium: filling(&draft.lens, gap), stop: true, ..Row::default() };
    draft.insert(gap + 1, row);
    draft.move_gap(gap, gap + 1);
    draft.lens.surfaces[gap].thickness = sense * length;
    draft.lengthen(gap + 1, -length);
    draft.settle(&[gap]);
}

/// Where the size of the stop is the aperture: as large as the axial beam is there now.
fn resize(before: &Lens, lens: &mut Lens) -> Result<(), String> {
    let mut widest = None;
    for zoom in 0..lens.zoom_positions() {
        let Aperture::StopSemiDiameter(radius) = before.aperture_at(zoom) else { continue };
        let aperture = Aperture::StopSemiDiameter(radius * ratio(before, lens, zoom)?);
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

/// The height of the same axial ray at the new stop over that at the old one.
fn ratio(before: &Lens, lens: &Lens, zoom: usize) -> Result<f64, String> {
    let um = lens.wavelengths[lens.primary()].um;
    let height = |lens: &Lens| {
        let system = lens.system(zoom, um).map_err(|error| error.to_string())?;
        let beam = Beam { aperture: Aperture::StopSemiDiameter(1.0), ..Beam::of(lens, zoom) };
        let first = first_order(&system, &beam).map_err(|error| error.to_string())?;
        // A stop of 1 mm stands for a start height of one over what a ray from 1 mm has at the stop.
        Ok::<f64, String>(first.marginal.heights[0].hypot(first.marginal.start_slope))
    };
    let (old, new) = (height(before)?, height(lens)?);
    let ratio = old / new;
    let sound = ratio.is_finite() && ratio > 0.0;
    sound.then_some(ratio).ok_or_else(|| "the axial beam has no height there".to_owned())
}
