//! An element less: what was glass becomes air, or what stood behind moves forward.

use super::Kind;
use super::add::{self, KEEPS, Singlet};
use super::chance::{allowed, coin, pick};
use super::draft::{Back, Draft, Room, Scene, hangs, is_gap, is_plain, is_solved, sense, zooms};
use crate::lens::glass;
use crate::lens::{Lens, Medium, Object};
use crate::search::element::{Element, elements, pieces};
use crate::search::{Random, Rules};

/// Which singlets may go.
pub(super) fn places(lens: &Lens, rules: &Rules) -> Result<Vec<Element>, String> {
    let least = rules.elements[0];
    if pieces(lens) < least + 1 {
        return Err(format!("the lens has {} elements, the rules ask for {least}", pieces(lens)));
    }
    let found: Vec<_> = elements(lens).into_iter().filter(|e| may_go(lens, e, rules)).collect();
    if found.is_empty() {
        return Err("no singlet that may go: without the stop, and nothing follows it".to_owned());
    }
    Ok(found)
}

fn may_go(lens: &Lens, element: &Element, rules: &Rules) -> bool {
    let rows = lens.surfaces.len();
    let Element { first, last, .. } = *element;
    let around = first.saturating_sub(1)..=(last + 1).min(rows - 1);
    let free = around.clone().all(|row| rules.allow(row, rows));
    let followed = (first..=last).any(|row| hangs(lens, row, |_| true))
        || first > 0 && hangs(lens, first - 1, is_gap);
    let stop = (first..=last).any(|row| lens.surfaces[row].stop);
    element.is_singlet() && rows > 2 && free && !followed && !stop
}

/// How a singlet is taken out.
#[derive(Debug, Clone, Copy)]
struct Way {
    /// Whether it goes with the air in front of it, else with the air behind it.
    front: bool,
    /// Whether the rest of the lens keeps its place.
    kept: bool,
}

/// The logarithm of the chance to take the singlet at row `first` out in one of its ways.
pub(super) fn log_chance(lens: &Lens, first: usize, kept: bool) -> f64 {
    let sides = sides(lens, first);
    let choice = match remaining(lens, first) {
        Some(gap) if add::has_choice(lens, gap) => {
            if kept {
                KEEPS
            } else {
                1.0 - KEEPS
            }
        }
        _ => 1.0,
    };
    choice.ln() - (sides.len() as f64).ln()
}

/// The gap whose end stays a gap when the singlet goes; none for the first element.
fn remaining(lens: &Lens, first: usize) -> Option<usize> {
    let last = first + 1;
    let behind = last + 1 == lens.surfaces.len();
    first.checked_sub(1).map(|before| if behind { last } else { before })
}

/// Whether it may go with the air in front or behind.
fn sides(lens: &Lens, first: usize) -> Vec<bool> {
    let last = first + 1 + 1 == lens.surfaces.len();
    let mut found = Vec::with_capacity(2);
    if first > 0 {
        found.push(true);
    }
    if !last {
        found.push(false);
    }
    found
}

/// Removes a singlet.
pub(super) fn draw(scene: &Scene<'_>, random: &mut Random) -> Result<Draft, String> {
    let places = places(&scene.lens, scene.rules)?;
    let element = pick(&places, random).copied().ok_or("no place")?;
    let first = element.first;
    let front = pick(&sides(&scene.lens, first), random).copied().ok_or("nothing would be left")?;
    let choice = remaining(&scene.lens, first).is_some_and(|gap| add::has_choice(&scene.lens, gap));
    let way = Way { front, kept: choice && coin(KEEPS, random) };
    let mut draft = scene.draft(places.len());
    take(&mut draft, first, way);
    let surfaces = first + 1;
    draft.what = format!("removed the singlet of surfaces {first} and {surfaces}");
    draft.back = back(scene, &draft.lens, first, way);
    Ok(draft)
}

fn take(draft: &mut Draft, first: usize, way: Way) {
    let last = first + 1;
    let length = draft.lens.surfaces[first].thickness * sense(&draft.lens, first);
    if first == 0 {
        let gone = length + draft.lens.surfaces[last].thickness;
        if let Object::Finite(distance) = &mut draft.lens.object {
            *distance += gone;
        }
    } else {
        let gap = first - 1;
        let dropped = draft.lens.surfaces[if way.front { gap } else { last }].thickness;
        let both = zooms(&draft.lens, gap) && zooms(&draft.lens, last);
        if way.kept && (both || zooms(&draft.lens, if way.front { gap } else { last })) {
            // The gap that goes has several lengths: they are added one by one.
            draft.add_gap(gap, last);
        } else {
            if way.front {
                draft.move_gap(last, gap);
            }
            if way.kept {
                draft.lengthen(gap, dropped * sense(&draft.lens, gap));
            }
        }
        if way.kept {
            draft.lengthen(gap, length);
        }
    }
    draft.remove(last);
    draft.remove(first);
    draft.settle(&[]);
}

/// The way back: to add the same singlet at the same place.
fn back(scene: &Scene<'_>, small: &Lens, first: usize, way: Way) -> Option<Back> {
    let (lens, rules, last) = (&scene.lens, scene.rules, first + 1);
    let glasses = allowed(lens, rules);
    let Medium::Glass(name) = &lens.surfaces[first].medium else { return None };
    let known = glass::find(name)?;
    let made = glasses.iter().any(|glass| std::ptr::eq(*glass, known));
    let beside = if way.front { first.checked_sub(1)? } else { last };
    let moves = [first, beside].iter().any(|row| zooms(lens, *row)) || is_solved(lens, beside);
    let plain = is_plain(&lens.surfaces[first]) && is_plain(&lens.surfaces[last]);
    let finite = first == 0 && lens.object != Object::Infinity;
    if !made || moves || !plain || finite {
        return None;
    }
    let length = |row: usize| lens.surfaces[row].thickness * sense(lens, row);
    let singlet = Singlet {
        curvatures: [first, last].map(|row| lens.surfaces[row].curvature),
        thickness: length(first),
        air: length(beside),
    };
    let scale = scene.scale_of(small)?;
    let gap = first.checked_sub(1).filter(|gap| add::has_choice(small, *gap));
    let draws = singlet.log_density(rules, scale)? - (glasses.len() as f64).ln();
    let log = draws - log_chance(lens, first, way.kept);
    let room = gap.map(|gap| Room { gap, length: singlet.length(), kept: way.kept });
    Some(Back { kind: Kind::AddSinglet, log, room })
}
