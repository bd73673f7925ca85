//! A new singlet in an air gap: close to the surface in front of it or behind it, in random glass,
//! with little power.

use super::chance::{Length, allowed, coin, log_normal, normal, pick};
use super::draft::{Back, Draft, Scene, filling, hangs, is_gap, is_solved, sense, shortest};
use super::{Kind, remove};
use crate::lens::glass::Glass;
use crate::lens::{Lens, Medium, Object, Row};
use crate::search::element::{filled, pieces};
use crate::search::projection::Map;
use crate::search::{Random, Rules};

/// How often the rest of the lens keeps its place where the gap has room; else it makes way.
pub(super) const KEEPS: f64 = 0.9;

/// Where a singlet may come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Place {
    /// The surface in front of the air gap; none for the space in front of the lens.
    pub(super) gap: Option<usize>,
    /// Whether it stands close to that surface, else close to the next one.
    pub(super) behind: bool,
}

/// The random numbers of a new singlet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Singlet {
    pub(super) curvatures: [f64; 2],
    pub(super) thickness: f64,
    /// The air between it and the surface to which it is close.
    pub(super) air: f64,
}

/// Where singlets may come.
pub(super) fn places(lens: &Lens, rules: &Rules) -> Result<Vec<Place>, String> {
    let most = rules.elements[1];
    if pieces(lens) + 1 > most {
        return Err(format!("the lens has {} elements, the rules allow {most}", pieces(lens)));
    }
    let glass = filled(lens);
    let rows = lens.surfaces.len();
    let mut found = Vec::new();
    if rules.kept[0] == 0 && !glass[0] {
        found.push(Place { gap: None, behind: false });
    }
    for row in (0..rows).filter(|row| !glass[row + 1] && rules.allow(*row, rows)) {
        let last = row + 1 == rows;
        if !(last || rules.allow(row + 1, rows)) || hangs(lens, row, is_gap) {
            continue;
        }
        found.push(Place { gap: Some(row), behind: true });
        if !last {
            found.push(Place { gap: Some(row), behind: false });
        }
    }
    if found.is_empty() {
        Err("no air gap that the rules let change".to_owned())
    } else {
        Ok(found)
    }
}

impl Singlet {
    fn draw(scene: &Scene<'_>, random: &mut Random) -> Self {
        let mut curvature = || normal(scene.bend(), random);
        let curvatures = [curvature(), curvature()];
        let (thickness, air) = lengths(scene.rules, scene.size());
        Self { curvatures, thickness: thickness.draw(random), air: air.draw(random) }
    }

    /// The logarithm of the density of these numbers for a lens of a scale; none where they cannot
    /// be drawn.
    pub(super) fn log_density(&self, rules: &Rules, scale: f64) -> Option<f64> {
        let (thickness, air) = lengths(rules, scale / 50.0);
        let bends = self.curvatures.map(|c| log_normal(c, 0.25 / scale));
        let lengths = thickness.log_density(self.thickness)? + air.log_density(self.air)?;
        Some(bends[0] + bends[1] + lengths)
    }

    pub(super) fn length(&self) -> f64 {
        self.thickness + self.air
    }
}

fn lengths(rules: &Rules, size: f64) -> (Length, Length) {
    (Length::new(rules.glass_center, 0.75 * size), Length::new(rules.air_center, 0.1 * size))
}

/// How likely the rest of the lens keeps its place: never where there is no room.
pub(super) fn keeps(lens: &Lens, gap: Option<usize>, rules: &Rules, length: f64) -> f64 {
    let room = |gap: usize| has_choice(lens, gap) && has_room(lens, gap, rules, length);
    if gap.is_some_and(room) { KEEPS } else { 0.0 }
}

/// Whether a gap could take a length in and still be one.
pub(super) fn has_room(lens: &Lens, gap: usize, rules: &Rules, length: f64) -> bool {
    let last = gap + 1 == lens.surfaces.len();
    let least = if last { rules.back_focus.unwrap_or(0.0) } else { rules.air_center[0] };
    shortest(lens, gap) - length >= least
}

/// Whether a gap has a length of its own that could become shorter.
pub(super) fn has_choice(lens: &Lens, gap: usize) -> bool {
    !is_solved(lens, gap)
}

/// Adds a singlet.
pub(super) fn draw(scene: &Scene<'_>, random: &mut Random) -> Result<Draft, String> {
    let places = places(&scene.lens, scene.rules)?;
    let glasses = allowed(&scene.lens, scene.rules);
    let place = pick(&places, random).copied().ok_or("no place")?;
    let glass = pick(&glasses, random).copied().ok_or("no glass of the rules has an index here")?;
    let singlet = Singlet::draw(scene, random);
    let keeping = keeps(&scene.lens, place.gap, scene.rules, singlet.length());
    let kept = coin(keeping, random);
    let mut draft = scene.draft(places.len());
    let first = insert(&mut draft, place, glass, singlet, kept)?;
    draft.map = Map::Along;
    draft.fresh = vec![first];
    draft.rimless = vec![first, first + 1];
    draft.what = format!("added a singlet of {} before surface {first}", glass.full_name());
    let chosen = if kept { keeping } else { 1.0 - keeping };
    let there = singlet
        .log_density(scene.rules, scene.scale)
        .map(|log| log - (glasses.len() as f64).ln() + chosen.ln());
    let finite = place.gap.is_none() && scene.lens.object != Object::Infinity;
    draft.back = there.filter(|_| !finite).map(|there| Back {
        kind: Kind::RemoveSinglet,
        log: remove::log_chance(&draft.lens, first, kept) - there,
        room: None,
    });
    Ok(draft)
}

/// Puts the rows of a singlet in, and says which is the first.
fn insert(
    draft: &mut Draft,
    place: Place,
    glass: &Glass,
    singlet: Singlet,
    kept: bool,
) -> Result<usize, String> {
    let first = place.gap.map_or(0, |gap| gap + 1);
    let (sense, air) = match place.gap {
        Some(gap) => (sense(&draft.lens, gap), filling(&draft.lens, gap)),
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
    match place.gap {
        None => away(&mut draft.lens.object, singlet.length())?,
        Some(gap) => {
            let rest = if place.behind { first + 1 } else { gap };
            if place.behind {
                draft.move_gap(gap, rest);
                draft.lens.surfaces[gap].thickness = sense * singlet.air;
                new.push(gap);
            }
            if kept {
                draft.lengthen(rest, -singlet.length());
            }
        }
    }
    draft.settle(&new);
    Ok(first)
}

/// Moves the first vertex towards an object that stays where it is.
fn away(object: &mut Object, length: f64) -> Result<(), String> {
    if let Object::Finite(distance) = object {
        let left = *distance - length;
        if *distance > 0.0 && left <= 0.0 {
            return Err("no room between the object and the lens".to_owned());
        }
        *distance = left;
    }
    Ok(())
}
