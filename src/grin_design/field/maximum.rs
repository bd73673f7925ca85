//! The maximum of a smooth field in a domain: the field is sampled, and the best samples are
//! improved by a pattern search.

use super::grin_field::GrinField;
use crate::grin::field::ProfileCoordinate;
use crate::grin_design::task::Domain;
use crate::math::Vec3;
use rayon::prelude::*;

/// Sample points per cell along each axis, and along a radius.
pub(super) const POINTS_PER_CELL: usize = 2;
pub(super) const RADIAL_POINTS: usize = 1000;
/// The largest number of starting points, the number of halvings of the step, and the number of
/// moves between them.
const MAX_STARTS: usize = 64;
const HALVINGS: i32 = 8;
const MOVES_PER_HALVING: i32 = 4;
/// The directions of the pattern search.
const AXES: [Vec3<f64>; 6] = [
    Vec3 { x: 1.0, y: 0.0, z: 0.0 },
    Vec3 { x: -1.0, y: 0.0, z: 0.0 },
    Vec3 { x: 0.0, y: 1.0, z: 0.0 },
    Vec3 { x: 0.0, y: -1.0, z: 0.0 },
    Vec3 { x: 0.0, y: 0.0, z: 1.0 },
    Vec3 { x: 0.0, y: 0.0, z: -1.0 },
];

/// A value and its position.
pub(super) type LocatedValue = (f64, Vec3<f64>);

/// The higher of two; the first of two equal ones, so that the result depends on the order alone.
pub(super) fn higher(a: LocatedValue, b: LocatedValue) -> LocatedValue {
    if b.0 > a.0 { b } else { a }
}

/// A function to be maximised, and the points at which it is defined.
pub(super) struct FieldObjective<'a> {
    pub(super) inside: &'a (dyn Fn(Vec3<f64>) -> bool + Sync),
    pub(super) value: &'a (dyn Fn(Vec3<f64>) -> f64 + Sync),
}

/// The highest value near the highest of these points, which are `gap` apart; minus infinity if
/// none of them is inside.
pub(super) fn find_maximum(
    places: &[Vec3<f64>],
    gap: f64,
    hill: &FieldObjective<'_>,
) -> LocatedValue {
    let none = (f64::NEG_INFINITY, Vec3::default());
    local_maxima(places, gap, hill).into_iter().fold(none, higher)
}

/// The local maxima that are reached from the highest of these points.
fn local_maxima(places: &[Vec3<f64>], gap: f64, hill: &FieldObjective<'_>) -> Vec<LocatedValue> {
    let FieldObjective { inside, value } = hill;
    let looked = places.par_iter().filter(|p| inside(**p));
    let mut found: Vec<LocatedValue> = looked.map(|p| (value(*p), *p)).collect();
    let by_height = |a: &LocatedValue, b: &LocatedValue| b.0.total_cmp(&a.0);
    if found.len() > MAX_STARTS {
        found.select_nth_unstable_by(MAX_STARTS, by_height);
        found.truncate(MAX_STARTS);
    }
    found.sort_by(by_height);
    let up = |mut best: LocatedValue| {
        for taken in 0..HALVINGS * MOVES_PER_HALVING {
            let step = gap * 0.5_f64.powi(1 + taken / MOVES_PER_HALVING);
            let there = AXES.map(|to| best.1 + to * step).into_iter();
            let around = there.filter(|p| inside(*p)).map(|p| (value(p), p));
            best = around.fold(best, higher);
        }
        best
    };
    found.into_iter().map(up).collect()
}

impl GrinField {
    /// The sample points in a domain: a lattice, or points along a radius.
    pub(super) fn sample_points(&self, space: Domain) -> Vec<Vec3<f64>> {
        let [low, high] = space.corners();
        match self {
            Self::Radial(field, _) => {
                // Towards a corner of the bounding box: the farthest point.
                let z = (low.z + high.z) * 0.5;
                let (to, z) = match field.coordinate {
                    ProfileCoordinate::Sphere => (high, 0.0),
                    _ => (Vec3::new(high.x, high.y, 0.0), z),
                };
                let at = |i: usize| to * (i as f64 / RADIAL_POINTS as f64) + Vec3::new(0.0, 0.0, z);
                (0..=RADIAL_POINTS).map(at).collect()
            }
            _ => lattice(space, POINTS_PER_CELL * self.cells()),
        }
    }

    /// The distance between sample points.
    pub(super) fn sample_spacing(&self, space: Domain) -> f64 {
        let [low, high] = space.corners();
        match self {
            Self::Radial(..) => (high.x - low.x) / RADIAL_POINTS as f64,
            _ => (high.x - low.x) / (POINTS_PER_CELL * self.cells()) as f64,
        }
    }

    /// The number of cells along a side of its cube.
    fn cells(&self) -> usize {
        self.nodes().saturating_sub(1).max(1)
    }
}

/// The lattice points of the bounding box of a domain, its faces included.
fn lattice(space: Domain, parts: usize) -> Vec<Vec3<f64>> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lattice_has_every_corner_of_its_domain_and_equal_steps() {
        let space = Domain::Rod { radius: 2.0, from: -1.0, to: 5.0 };
        let points = lattice(space, 3);
        assert_eq!(points.len(), 64);
        let [low, high] = space.corners();
        for corner in [low, high, Vec3::new(low.x, high.y, low.z), Vec3::new(high.x, low.y, high.z)]
        {
            assert!(points.iter().any(|p| (*p - corner).dot(*p - corner) < 1e-20), "{corner:?}");
        }
        let mut depths: Vec<f64> = points.iter().map(|p| p.z).collect();
        depths.sort_by(f64::total_cmp);
        depths.dedup_by(|a, b| (*a - *b).abs() < 1e-12);
        let step = (high.z - low.z) / 3.0;
        assert!(depths.len() == 4 && (depths[1] - depths[0] - step).abs() < 1e-12, "{depths:?}");
    }

    /// The ends of a rod, of a ball and of a cube that are farthest apart.
    #[test]
    fn a_domain_has_the_diameter_of_its_farthest_points() {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(Domain::Rod { radius: 1.5, from: -1.0, to: 3.0 }.diameter(), 5.0));
        assert!(near(Domain::Ball { radius: 1.5 }.diameter(), 3.0));
        assert!(near(Domain::Cube { half: 0.5 }.diameter(), 3.0_f64.sqrt()));
    }
}
