//! Adds a singlet in an air gap: close to the surface in front of it or behind it, bent like that
//! surface, of random glass, with little power.
//!
//! So it changes the rays little and clips none: its thickness and the air beside it follow from
//! the semi-diameter of that surface. (The thesis draws curvatures around 0 and puts the singlet in
//! contact, where it would intersect every surface that is bent towards it.)

use super::distributions::{
    ShiftedExponential, bernoulli, choose, normal_log_density, sample_normal, usable_glasses,
};
use super::draft::{
    MutationContext, MutationDraft, ReverseMove, has_pickup, has_solve, is_gap, light_direction,
    medium_after, shortest_gap,
};
use super::kind::MutationKind;
use super::remove;
use crate::lens::glass::Glass;
use crate::lens::{Lens, Medium, Object, Row};
use crate::search::element::{glass_gaps, piece_count};
use crate::search::projection::ProjectionMap;
use crate::search::{Random, SearchRules};

/// The probability that the rest of the lens keeps its place if the gap has room; otherwise it is
/// shifted.
pub(super) const KEEP_PROBABILITY: f64 = 0.9;

/// A place for a new singlet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SingletSite {
    /// The surface in front of the air gap; `None` for the space in front of the lens.
    pub(super) gap: Option<usize>,
    /// True if the singlet is close to that surface, false if it is close to the next one.
    pub(super) behind: bool,
}

/// The surface next to a new singlet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Neighbour {
    /// Its row in the lens without the singlet.
    pub(super) row: usize,
    /// True if the singlet is behind it.
    pub(super) behind: bool,
}

/// The random numbers of a new singlet.
#[derive(Debug, Clone, Copy)]
pub(super) struct SingletParameters {
    pub(super) curvatures: [f64; 2],
    pub(super) thickness: f64,
    /// The air space between it and its neighbour.
    pub(super) air: f64,
}

/// The places for a new singlet.
pub(super) fn places(lens: &Lens, rules: &SearchRules) -> Result<Vec<SingletSite>, String> {
    let most = rules.elements[1];
    if piece_count(lens) + 1 > most {
        return Err(format!("the lens has {} elements, the rules allow {most}", piece_count(lens)));
    }
    let glass = glass_gaps(lens);
    let rows = lens.surfaces.len();
    let mut found = Vec::new();
    if rules.kept[0] == 0 && !glass[0] {
        found.push(SingletSite { gap: None, behind: false });
    }
    for row in (0..rows).filter(|row| !glass[row + 1] && rules.may_change(*row, rows)) {
        let last = row + 1 == rows;
        if !(last || rules.may_change(row + 1, rows)) || has_pickup(lens, row, is_gap) {
            continue;
        }
        found.push(SingletSite { gap: Some(row), behind: true });
        if !last {
            found.push(SingletSite { gap: Some(row), behind: false });
        }
    }
    if found.is_empty() {
        Err("no air gap that the rules let change".to_owned())
    } else {
        Ok(found)
    }
}

impl SingletSite {
    fn neighbour(self) -> Neighbour {
        let row = match self.gap {
            Some(gap) if self.behind => gap,
            Some(gap) => gap + 1,
            None => 0,
        };
        Neighbour { row, behind: self.behind }
    }
}

impl SingletParameters {
    fn draw(scene: &MutationContext<'_>, neighbour: Neighbour, random: &mut Random) -> Self {
        let mean = scene.lens.surfaces[neighbour.row].curvature;
        let mut curvature = || mean + sample_normal(scene.curvature_deviation(), random);
        let curvatures = [curvature(), curvature()];
        let (thickness, air) = length_distributions(
            &scene.lens,
            neighbour,
            curvatures,
            scene.rules,
            scene.size_ratio(),
        );
        Self { curvatures, thickness: thickness.draw(random), air: air.draw(random) }
    }

    /// The logarithm of the density of these numbers for a lens without the singlet and of a scale;
    /// `None` if they cannot be drawn.
    pub(super) fn log_density(
        &self,
        lens: &Lens,
        neighbour: Neighbour,
        rules: &SearchRules,
        scale: f64,
    ) -> Option<f64> {
        let mean = lens.surfaces.get(neighbour.row)?.curvature;
        let (thickness, air) =
            length_distributions(lens, neighbour, self.curvatures, rules, scale / 50.0);
        let bends = self.curvatures.map(|c| normal_log_density(c - mean, 0.25 / scale));
        let lengths = thickness.log_density(self.thickness)? + air.log_density(self.air)?;
        Some(bends[0] + bends[1] + lengths)
    }

    pub(super) fn length(&self) -> f64 {
        self.thickness + self.air
    }
}

/// The distributions of the thickness of a singlet and of the air space beside it: at least the
/// minima of the rules on the axis and, up to the semi-diameter of the neighbour, at the edge.
fn length_distributions(
    lens: &Lens,
    neighbour: Neighbour,
    [front, rear]: [f64; 2],
    rules: &SearchRules,
    size: f64,
) -> (ShiftedExponential, ShiftedExponential) {
    let Neighbour { row, behind } = neighbour;
    let beside = lens.surfaces[row].curvature;
    let rim = lens.surfaces[row].semi_diameter.unwrap_or(0.0);
    let sense = light_direction(lens, if behind { row } else { row.saturating_sub(1) });
    // The reduction of a gap at the edge compared with the axis.
    let narrower = |first: f64, second: f64| {
        let (first, second) = (sag(first, rim), sag(second, rim));
        sense * (first - second)
    };
    let (from, to) = if behind { (beside, front) } else { (rear, beside) };
    let least = |[center, most]: [f64; 2], edge: f64, narrower: f64| {
        [center.max(edge + narrower).min(most), most]
    };
    let thickness = least(rules.glass_center, rules.glass_edge, narrower(front, rear));
    let air = least(rules.air_center, rules.air_edge, narrower(from, to));
    (ShiftedExponential::new(thickness, 0.75 * size), ShiftedExponential::new(air, 0.1 * size))
}

/// The sag of a sphere at a height, or at its equator if that comes first.
fn sag(curvature: f64, height: f64) -> f64 {
    let t = (curvature * height).clamp(-1.0, 1.0);
    if t == 0.0 { 0.0 } else { t * t / (curvature * (1.0 + (1.0 - t * t).sqrt())) }
}

/// The probability that the rest of the lens keeps its place; 0 if there is no room.
pub(super) fn keep_probability(
    lens: &Lens,
    gap: Option<usize>,
    rules: &SearchRules,
    length: f64,
) -> f64 {
    let room = |gap: usize| has_choice(lens, gap) && has_room(lens, gap, rules, length);
    if gap.is_some_and(room) { KEEP_PROBABILITY } else { 0.0 }
}

/// True if a gap has room for a length, on the axis and at the edge.
pub(super) fn has_room(lens: &Lens, gap: usize, rules: &SearchRules, length: f64) -> bool {
    let left = shortest_gap(lens, gap) - length;
    if gap + 1 == lens.surfaces.len() {
        return left >= rules.back_focus.unwrap_or(0.0);
    }
    let [front, rear] = [gap, gap + 1].map(|row| &lens.surfaces[row]);
    let rims = [front, rear].map(|row| row.semi_diameter.unwrap_or(f64::INFINITY));
    let rim = rims[0].min(rims[1]);
    let narrower = if rim.is_finite() {
        light_direction(lens, gap) * (sag(front.curvature, rim) - sag(rear.curvature, rim))
    } else {
        0.0
    };
    left >= rules.air_center[0].max(rules.air_edge + narrower)
}

/// True if a gap has a length of its own that can become shorter.
pub(super) fn has_choice(lens: &Lens, gap: usize) -> bool {
    !has_solve(lens, gap)
}

/// Adds a singlet.
pub(super) fn draw(
    scene: &MutationContext<'_>,
    random: &mut Random,
) -> Result<MutationDraft, String> {
    let places = places(&scene.lens, scene.rules)?;
    let glasses = usable_glasses(&scene.lens, scene.rules);
    let place = choose(&places, random).copied().ok_or("no place")?;
    let glass =
        choose(&glasses, random).copied().ok_or("no glass of the rules has an index here")?;
    let singlet = SingletParameters::draw(scene, place.neighbour(), random);
    let keeping = keep_probability(&scene.lens, place.gap, scene.rules, singlet.length());
    let kept = bernoulli(keeping, random);
    let mut draft = scene.start_draft(places.len());
    let first = insert(&mut draft, place, glass, singlet, kept)?;
    draft.map = ProjectionMap::AlongNormals;
    draft.fresh = vec![first];
    draft.rimless = vec![first, first + 1];
    draft.what = format!("added a singlet of {} before surface {first}", glass.full_name());
    let chosen = if kept { keeping } else { 1.0 - keeping };
    let there = singlet
        .log_density(&scene.lens, place.neighbour(), scene.rules, scene.scale)
        .map(|log| log - (glasses.len() as f64).ln() + chosen.ln());
    let finite = place.gap.is_none() && scene.lens.object != Object::Infinity;
    draft.back = there.filter(|_| !finite).map(|there| {
        ReverseMove::new(
            MutationKind::RemoveSinglet,
            remove::log_chance(&draft.lens, first, kept) - there,
        )
    });
    Ok(draft)
}

/// Inserts the rows of a singlet and returns the first one.
fn insert(
    draft: &mut MutationDraft,
    place: SingletSite,
    glass: &Glass,
    singlet: SingletParameters,
    kept: bool,
) -> Result<usize, String> {
    let first = place.gap.map_or(0, |gap| gap + 1);
    let (sense, air) = match place.gap {
        Some(gap) => (light_direction(&draft.lens, gap), medium_after(&draft.lens, gap)),
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
        None => shorten_object_distance(&mut draft.lens.object, singlet.length())?,
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
    draft.inherit_variables(&new);
    Ok(first)
}

/// Moves the first vertex towards an object at a fixed position.
fn shorten_object_distance(object: &mut Object, length: f64) -> Result<(), String> {
    if let Object::Finite(distance) = object {
        let left = *distance - length;
        if *distance > 0.0 && left <= 0.0 {
            return Err("no room between the object and the lens".to_owned());
        }
        *distance = left;
    }
    Ok(())
}
