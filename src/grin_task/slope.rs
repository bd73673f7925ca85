//! How steep a field is at its steepest place, and a field made flatter so that a maker can make it.
//!
//! A field is linear in its numbers and a constant one has all numbers alike. Drawing all of them
//! towards one index by the same factor therefore draws the gradient everywhere by that factor: the
//! limit holds exactly, and a field within the range of the index stays there.

use super::medium::Medium;
use super::space::length;
use super::task::Space;
use crate::grin::Field as _;
use crate::grin::field::{Coordinate, Trilinear};
use crate::math::Vec3;
use rayon::prelude::*;

/// Points in a cell along each axis, and along a radius, at which a smooth field is looked at.
const POINTS: usize = 2;
const SPOKE: usize = 1000;
/// How many of the steepest places are climbed from, how often the step is halved there, and how
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
/// How far below its limit a field is put: a trilinear one for rounding, a smooth one for what a climb
/// may miss.
const MARGINS: [f64; 2] = [1e-9, 1e-3];

impl Medium {
    /// Its steepest slope in the space, in 1/mm: of a trilinear field exactly, over all voxels that
    /// the space touches; of a smooth one to about a thousandth.
    pub fn steepest(&self, space: Space) -> f64 {
        match self {
            Self::Trilinear(field) => steepest_voxel(field, space),
            Self::Tricubic(field) => {
                let [cells, ..] = field.grid().counts().map(|count| count - 3);
                self.climb(space, &lattice(space, POINTS * cells))
            }
            Self::Radial(field, _) => {
                // Towards a corner of the box around the space: the farthest place.
                let [low, high] = space.corners();
                let z = (low.z + high.z) * 0.5;
                let (to, z) = match field.coordinate {
                    Coordinate::Sphere => (high, 0.0),
                    _ => (Vec3::new(high.x, high.y, 0.0), z),
                };
                let at = |i: usize| to * (i as f64 / SPOKE as f64) + Vec3::new(0.0, 0.0, z);
                self.climb(space, &(0..=SPOKE).map(at).collect::<Vec<_>>())
            }
        }
    }

    /// The same field, drawn towards an index until it is nowhere steeper than the limit.
    #[must_use]
    pub(super) fn flattened(&self, space: Space, limit: f64, towards: f64) -> Self {
        let steepest = self.steepest(space);
        let mut flat = self.clone();
        if steepest > limit {
            let margin = MARGINS[usize::from(!matches!(self, Self::Trilinear(_)))];
            let factor = (1.0 - margin) * limit / steepest;
            let draw = |value: &mut f64| *value = towards + factor * (*value - towards);
            flat.parameters_mut().iter_mut().for_each(draw);
        }
        flat
    }

    /// The steepest slope near the steepest of some places.
    fn climb(&self, space: Space, places: &[Vec3<f64>]) -> f64 {
        let field = self.field();
        let region = space.region();
        let slope = |p: Vec3<f64>| length(field.sample(p).gradient);
        let inside = places.par_iter().filter(|p| region.height(**p) <= 0.0);
        let mut found: Vec<(f64, Vec3<f64>)> = inside.map(|p| (slope(*p), *p)).collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let [low, high] = space.corners();
        let gap = match self {
            Self::Radial(..) => (high.x - low.x) / SPOKE as f64,
            _ => (high.x - low.x) / (POINTS * self.nodes().saturating_sub(1).max(1)) as f64,
        };
        let up = |(mut best, mut at): (f64, Vec3<f64>)| {
            for taken in 0..HALVINGS * MOVES {
                let step = gap * 0.5_f64.powi(1 + taken / MOVES);
                let there = AXES.map(|to| at + to * step).into_iter();
                let inside = there.filter(|p| region.height(*p) <= 0.0).map(|p| (slope(p), p));
                let higher =
                    |a: (f64, Vec3<f64>), b: (f64, Vec3<f64>)| if b.0 > a.0 { b } else { a };
                (best, at) = inside.fold((best, at), higher);
            }
            best
        };
        found.into_iter().take(PEAKS).map(up).fold(0.0, f64::max)
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

/// The square of the slope within a voxel is convex along each axis: it is largest in a corner,
/// where it is made of the three edges that meet there.
fn steepest_voxel(field: &Trilinear<f64>, space: Space) -> f64 {
    let grid = field.grid();
    let (region, [nx, ny, nz]) = (space.region(), grid.counts());
    let (values, h) = (field.parameters(), grid.spacing());
    let strides = [1, nx, nx * ny];
    let of_voxel = |n: usize| {
        let (i, j, k) = (n % (nx - 1), n / (nx - 1) % (ny - 1), n / (nx - 1) / (ny - 1));
        let corner = |c: usize| i + (c & 1) + nx * (j + (c >> 1 & 1)) + nx * ny * (k + (c >> 2));
        let middle = (grid.node(corner(0)) + grid.node(corner(7))) * 0.5;
        let touches = |p: Vec3<f64>| region.height(p) < 0.0;
        if !touches(middle) && !(0..8).any(|c| touches(grid.node(corner(c)))) {
            return 0.0;
        }
        let edge = |c: usize, axis: usize| {
            let from = corner(c & !(1 << axis));
            values[from + strides[axis]] - values[from]
        };
        let slope =
            |c: usize| length(Vec3::new(edge(c, 0) / h.x, edge(c, 1) / h.y, edge(c, 2) / h.z));
        (0..8).map(slope).fold(0.0, f64::max)
    };
    (0..(nx - 1) * (ny - 1) * (nz - 1)).into_par_iter().map(of_voxel).reduce(|| 0.0, f64::max)
}
