//! The highest value of a smooth field in a space: many places are looked at, and the best of them
//! are climbed from.

use super::medium::Medium;
use super::task::Space;
use crate::grin::field::Coordinate;
use crate::math::Vec3;
use rayon::prelude::*;

/// Points in a cell along each axis, and along a radius, at which a smooth field is looked at.
pub(super) const POINTS: usize = 2;
pub(super) const SPOKE: usize = 1000;
/// How many of the highest places are climbed from, how often the step is halved there, and how
/// often one is taken before that.
const PEAKS: usize = 64;
const HALVINGS: i32 = 8;
const MOVES: i32 = 4;
/// Where a climb may lead.
const AXES: [Vec3<f64>; 6] = [
    Vec3 { x: 1.0, y: 0.0, z: 0.0 },
    Vec3 { x: -1.0, y: 0.0, z: 0.0 },
    Vec3 { x: 0.0, y: 1.0, z: 0.0 },
    Vec3 { x: 0.0, y: -1.0, z: 0.0 },
    Vec3 { x: 0.0, y: 0.0, z: 1.0 },
    Vec3 { x: 0.0, y: 0.0, z: -1.0 },
];

/// A value and where it stands.
pub(super) type Spot = (f64, Vec3<f64>);

/// The higher of two; the first of equals, so that the order alone decides.
pub(super) fn higher(a: Spot, b: Spot) -> Spot {
    if b.0 > a.0 { b } else { a }
}

/// Whether a place counts, and the value of a field there.
pub(super) struct Hill<'a> {
    pub(super) inside: &'a (dyn Fn(Vec3<f64>) -> bool + Sync),
    pub(super) value: &'a (dyn Fn(Vec3<f64>) -> f64 + Sync),
}

/// The highest value near the highest of some places, which stand `gap` apart; below all numbers
/// where none of them is inside.
pub(super) fn climb(places: &[Vec3<f64>], gap: f64, hill: &Hill<'_>) -> Spot {
    let none = (f64::NEG_INFINITY, Vec3::default());
    peaks(places, gap, hill).into_iter().fold(none, higher)
}

/// Where climbs from the highest of some places lead.
fn peaks(places: &[Vec3<f64>], gap: f64, hill: &Hill<'_>) -> Vec<Spot> {
    let Hill { inside, value } = hill;
    let looked = places.par_iter().filter(|p| inside(**p));
    let mut found: Vec<Spot> = looked.map(|p| (value(*p), *p)).collect();
    let by_height = |a: &Spot, b: &Spot| b.0.total_cmp(&a.0);
    if found.len() > PEAKS {
        found.select_nth_unstable_by(PEAKS, by_height);
        found.truncate(PEAKS);
    }
    found.sort_by(by_height);
    let up = |mut best: Spot| {
        for taken in 0..HALVINGS * MOVES {
            let step = gap * 0.5_f64.powi(1 + taken / MOVES);
            let there = AXES.map(|to| best.1 + to * step).into_iter();
            let around = there.filter(|p| inside(*p)).map(|p| (value(p), p));
            best = around.fold(best, higher);
        }
        best
    };
    found.into_iter().map(up).collect()
}

impl Medium {
    /// Where it is looked at in a space: all over it, or along a radius.
    pub(super) fn looks(&self, space: Space) -> Vec<Vec3<f64>> {
        let [low, high] = space.corners();
        match self {
            Self::Radial(field, _) => {
                // Towards a corner of the box around the space: the farthest place.
                let z = (low.z + high.z) * 0.5;
                let (to, z) = match field.coordinate {
                    Coordinate::Sphere => (high, 0.0),
                    _ => (Vec3::new(high.x, high.y, 0.0), z),
                };
                let at = |i: usize| to * (i as f64 / SPOKE as f64) + Vec3::new(0.0, 0.0, z);
                (0..=SPOKE).map(at).collect()
            }
            _ => lattice(space, POINTS * self.cells()),
        }
    }

    /// The distance between such places.
    pub(super) fn gap(&self, space: Space) -> f64 {
        let [low, high] = space.corners();
        match self {
            Self::Radial(..) => (high.x - low.x) / SPOKE as f64,
            _ => (high.x - low.x) / (POINTS * self.cells()) as f64,
        }
    }

    /// Cells along a side of its cube.
    fn cells(&self) -> usize {
        self.nodes().saturating_sub(1).max(1)
    }
}

/// Points of the box around a space, its faces included.
fn lattice(space: Space, parts: usize) -> Vec<Vec3<f64>> {
    let [low, high] = space.corners();
    let side = parts.max(1) + 1;
    let at = |low: f64, high: f64, i: usize| low + (high - low) * i as f64 / (side - 1) as f64;
    let place = |n: usize| {
        Vec3::new(
            at(low.x, high.x, n % side),
            at(low.y, high.y, n / side % side),
            at(low.z, high.z, n / side / side),
        )
    };
    (0..side.pow(3)).map(place).collect()
}
