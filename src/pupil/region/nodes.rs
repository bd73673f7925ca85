//! Quadrature nodes of the pupil.

use super::boundary::{BoundaryArc, EdgePoint, PolarFrame};
use crate::pupil::gauss_rules::{legendre, radial};
use crate::pupil::patterns::{SplitMix, additive_sequence};
use std::f64::consts::PI;

/// Quadrature nodes: points of the pupil with their weights.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Nodes {
    /// The points, in pupil coordinates.
    pub points: Vec<[f64; 2]>,
    /// The weight of each, an area in pupil coordinates: π in sum for the whole disc.
    pub weights: Vec<f64>,
    /// True if every point stands for its mirror image `(−px, py)` as well; the weights then count
    /// both.
    pub mirrored: bool,
    /// The number of rays traced to find them.
    pub rays: usize,
}

/// A radius of a pupil with a boundary, from the centre of its frame to its edge.
#[derive(Debug, Clone, Copy)]
pub(super) struct RadialLine {
    pub(super) azimuth: f64,
    pub(super) edge: EdgePoint,
    /// Its share of the full turn, times the area of the frame.
    pub(super) share: f64,
    /// The distance from the centre at which a cosine vanishes beyond the edge, in lengths of the
    /// radius; infinite if none does nearby.
    pub(super) grazing_distance: f64,
}

/// A cosine that vanishes beyond this, in lengths of the radius, does not matter.
const FAR: f64 = 1.5;

/// The nodes on some radii, as many as `radii` says of the azimuth of each. If a cosine vanishes at the edge or
/// close behind it, the image point varies with the square root of the distance from there: Gauss nodes are then
/// taken in a variable that makes it smooth.
pub(super) fn line_nodes(
    lines: &[RadialLine],
    frame: &PolarFrame,
    radii: impl Fn(f64) -> usize,
) -> Nodes {
    let mut nodes = Nodes::default();
    for line in lines {
        let (radius, radii) = (line.edge.radius, radii(line.azimuth));
        let direction = frame.direction(line.azimuth);
        let place = |r: f64| [0, 1].map(|i| frame.center[i] + r * radius * direction[i]);
        let sector = line.share * radius * radius;
        let mut add = |r: f64, weight: f64| {
            nodes.points.push(place(r));
            nodes.weights.push(sector * weight);
        };
        let beyond = line.grazing_distance - 1.0;
        match (line.edge.limit.is_grazing(), line.grazing_distance < FAR) {
            (false, false) => radial(radii).iter().for_each(|(r, weight)| add(*r, *weight)),
            // r = 1 − s²
            (true, false) => legendre(2 * radii).iter().for_each(|(s, w)| {
                let r = 1.0 - s * s;
                add(r, 2.0 * s * r * w);
            }),
            // r = 1 + beyond − s²
            (false, true) => {
                let [first, last] = [beyond.sqrt(), line.grazing_distance.sqrt()];
                legendre(2 * radii).iter().for_each(|(t, w)| {
                    let s = first + t * (last - first);
                    let r = line.grazing_distance - s * s;
                    add(r, 2.0 * s * (last - first) * r * w);
                });
            }
            // r = 1 − beyond sinh² v, for both roots at once
            (true, true) => {
                let beyond = beyond.max(f64::EPSILON);
                let last = (1.0 / beyond).sqrt().asinh();
                legendre(3 * radii).iter().for_each(|(t, w)| {
                    let v = t * last;
                    let r = 1.0 - beyond * v.sinh().powi(2);
                    add(r, beyond * (2.0 * v).sinh() * last * r * w);
                });
            }
        }
    }
    nodes
}

/// The concentration of nodes at the ends of an arc: next to an arc along which a cosine vanishes,
/// integrals along the radius vary with the square root of the distance from the corner.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grading {
    from: bool,
    to: bool,
}

impl Grading {
    pub(super) fn of(arcs: &[BoundaryArc], i: usize, whole: bool) -> Self {
        let count = arcs.len();
        let differs =
            |other: &BoundaryArc| other.limit.is_grazing() && other.limit != arcs[i].limit;
        let before = if i > 0 || whole { arcs.get((i + count - 1) % count) } else { None };
        let after = if i + 1 < count || whole { arcs.get((i + 1) % count) } else { None };
        Self { from: before.is_some_and(differs), to: after.is_some_and(differs) }
    }

    /// The position of a node between 0 and 1, and the derivative of that map.
    pub(super) fn map(self, t: f64) -> (f64, f64) {
        match (self.from, self.to) {
            (false, false) => (t, 1.0),
            (true, false) => (t * t, 2.0 * t),
            (false, true) => (t * (2.0 - t), 2.0 * (1.0 - t)),
            (true, true) => (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t)),
        }
    }
}

/// The nodes of the clear disc: so many along a radius and at so many azimuths of half a turn.
pub(super) fn clear_nodes(radii: usize, half: usize, mirrored: bool) -> Nodes {
    let azimuths = if mirrored { half } else { 2 * half };
    let turn = if mirrored { PI } else { 2.0 * PI };
    let step = turn / azimuths as f64;
    let mut nodes = Nodes { mirrored, ..Nodes::default() };
    for (square, share) in legendre(radii) {
        for j in 0..azimuths {
            let (sin, cos) = (step * (j as f64 + 0.5)).sin_cos();
            let r = square.sqrt();
            nodes.points.push([r * sin, r * cos]);
            nodes.weights.push(PI * share / azimuths as f64);
        }
    }
    nodes
}

/// Evenly distributed points of a square. Points outside the beam, farther out than `reach`, are
/// omitted.
pub(super) fn irregular_nodes((center, half): ([f64; 2], f64), count: usize, reach: f64) -> Nodes {
    let point = |i: usize| {
        let u = additive_sequence([0.5; 2], i);
        [0, 1].map(|k| center[k] + half * (2.0 * u[k] - 1.0))
    };
    let weight = 4.0 * half * half / count as f64;
    let points: Vec<_> = (0..count).map(point).filter(|p| p[0].hypot(p[1]) <= reach).collect();
    Nodes { weights: vec![weight; points.len()], points, ..Nodes::default() }
}

/// The number of independent parts that a pupil behind apertures is sampled in.
pub(super) const PARTS: usize = 8;

/// Points of a square, one at random in each of `cells` × `cells` equal cells, by a seed. Unlike those of a
/// sequence they have no pattern that a thin straight aperture could be in step with, so that independent parts
/// scatter as much as each of them errs. Points farther out than `reach` are omitted.
pub(super) fn jittered_nodes(
    (center, half): ([f64; 2], f64),
    (cells, seed): (usize, usize),
    reach: f64,
) -> Nodes {
    let mut random = SplitMix((cells * PARTS + seed) as u64);
    let size = 2.0 * half / cells as f64;
    let mut point = |i: usize| {
        [i % cells, i / cells].map(|cell| size * (cell as f64 + random.uniform()) - half)
    };
    let all: Vec<_> = (0..cells * cells).map(&mut point).collect();
    let placed = all.into_iter().map(|[x, y]| [center[0] + x, center[1] + y]);
    let points: Vec<_> = placed.filter(|p| p[0].hypot(p[1]) <= reach).collect();
    let weights = vec![size * size; points.len()];
    Nodes { points, weights, ..Nodes::default() }
}

/// The points of independent parts together.
pub(super) fn joined_nodes(parts: &[Nodes]) -> Nodes {
    let share = 1.0 / parts.len() as f64;
    let weights = parts.iter().flat_map(|part| &part.weights).map(|weight| share * weight);
    let points = parts.iter().flat_map(|part| &part.points).copied();
    Nodes { points: points.collect(), weights: weights.collect(), ..Nodes::default() }
}
