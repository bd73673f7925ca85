//! Integrals over the rays that get through, by orders that are raised until two agree.
//!
//! The clear disc has Gauss nodes in `ρ²` and equal steps of azimuth: odd powers of `ρ` cancel
//! there, and the rule converges spectrally (Forbes 1988). A clipped pupil has Gauss nodes in
//! azimuth along every arc, and in the radius with weight `r` up to the edge. What mirrors itself
//! is integrated over one half.

use super::boundary::{Boundary, BoundaryArc, EdgePoint, EdgeSearch, GUESS_SPREAD, PolarFrame};
use super::region::{Region, RegionKind};
use super::rules::{legendre, radial};
use super::sample::additive_sequence;
use crate::trace::{Rays, TraceSink};
use std::f64::consts::PI;

/// Points of the pupil with their weights.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Nodes {
    /// Pupil coordinates.
    pub points: Vec<[f64; 2]>,
    /// The share of the pupil that each stands for, in pupil coordinates: π for the whole disc.
    pub weights: Vec<f64>,
    /// Whether every point stands for its mirror image `(−px, py)` as well; the weights then count
    /// both.
    pub mirrored: bool,
    /// Rays traced to find them.
    pub rays: usize,
}

/// What is asked of a result.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accuracy {
    /// The error allowed, relative to what the analysis names as its scale.
    pub tolerance: f64,
    /// No more rays than this for one field and wavelength.
    pub max_rays: usize,
}

impl Default for Accuracy {
    fn default() -> Self {
        Self { tolerance: 1e-3, max_rays: 100_000 }
    }
}

/// Numbers with their errors, and what they cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConvergedValues<const K: usize> {
    /// The numbers at the highest order.
    pub values: [f64; K],
    /// How much the last raising of the order changed each.
    pub errors: [f64; K],
    /// Rays traced.
    pub rays: usize,
    /// Whether the errors are what was asked for; else the rays ran out.
    pub converged: bool,
}

/// A radius of a split pupil, from the centre of its frame to its edge.
#[derive(Debug, Clone, Copy)]
pub(super) struct RadialLine {
    pub(super) azimuth: f64,
    pub(super) edge: EdgePoint,
    /// Its share of the turn, in the area of the frame.
    pub(super) share: f64,
    /// Where a cosine vanishes behind its end, in parts of its length: infinite where none does
    /// nearby.
    pub(super) grazing_distance: f64,
}

/// A cosine that vanishes farther out than this, in parts of the radius, is far away.
const FAR: f64 = 1.5;

/// The nodes on some radii. Where a cosine vanishes at the edge or close behind it, the image moves
/// with the root of the distance from there: Gauss nodes in a variable that makes it smooth.
fn line_nodes(spokes: &[RadialLine], frame: &PolarFrame, radii: usize) -> Nodes {
    let mut nodes = Nodes::default();
    for spoke in spokes {
        let radius = spoke.edge.radius;
        let sector = spoke.share * radius * radius;
        let mut add = |r: f64, weight: f64| {
            nodes.points.push(frame.point(spoke.azimuth, r * radius));
            nodes.weights.push(sector * weight);
        };
        let beyond = spoke.grazing_distance - 1.0;
        match (spoke.edge.limit.is_grazing(), spoke.grazing_distance < FAR) {
            (false, false) => radial(radii).iter().for_each(|(r, weight)| add(*r, *weight)),
            // r = 1 − s²
            (true, false) => legendre(2 * radii).iter().for_each(|(s, w)| {
                let r = 1.0 - s * s;
                add(r, 2.0 * s * r * w);
            }),
            // r = 1 + beyond − s²
            (false, true) => {
                let [first, last] = [beyond.sqrt(), spoke.grazing_distance.sqrt()];
                legendre(2 * radii).iter().for_each(|(t, w)| {
                    let s = first + t * (last - first);
                    let r = spoke.grazing_distance - s * s;
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

/// How nodes are drawn to the ends of an arc: next to one along which a cosine vanishes, integrals
/// along the radius change with the root of the distance from the corner.
#[derive(Debug, Clone, Copy)]
struct Grading {
    from: bool,
    to: bool,
}

impl Grading {
    fn of(arcs: &[BoundaryArc], i: usize, whole: bool) -> Self {
        let count = arcs.len();
        let differs =
            |other: &BoundaryArc| other.limit.is_grazing() && other.limit != arcs[i].limit;
        let before = if i > 0 || whole { arcs.get((i + count - 1) % count) } else { None };
        let after = if i + 1 < count || whole { arcs.get((i + 1) % count) } else { None };
        Self { from: before.is_some_and(differs), to: after.is_some_and(differs) }
    }

    /// The place between 0 and 1 of a node, and how densely nodes lie there.
    fn map(self, t: f64) -> (f64, f64) {
        match (self.from, self.to) {
            (false, false) => (t, 1.0),
            (true, false) => (t * t, 2.0 * t),
            (false, true) => (t * (2.0 - t), 2.0 * (1.0 - t)),
            (true, true) => (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t)),
        }
    }
}

/// Nodes along the radius and along half a turn, of the clear disc.
const CLEAR_ORDERS: [usize; 16] = [3, 4, 5, 6, 7, 8, 10, 12, 16, 20, 24, 32, 40, 48, 64, 80];
/// Nodes along an arc and along the radius, of a piece.
const STAR_ORDERS: [(usize, usize); 12] = [
    (4, 3),
    (6, 4),
    (8, 5),
    (10, 6),
    (12, 8),
    (16, 10),
    (20, 12),
    (28, 16),
    (40, 20),
    (56, 28),
    (72, 40),
    (96, 56),
];
/// Points of the lowest order where nothing better is known than a clipped low-discrepancy set.
const IRREGULAR_POINTS: usize = 1024;
const IRREGULAR_ORDERS: usize = 8;

impl Region<'_> {
    /// How many orders of quadrature there are.
    pub fn orders(&self) -> usize {
        match self.kind {
            RegionKind::Dark | RegionKind::Unbounded => 0,
            RegionKind::Clear => CLEAR_ORDERS.len(),
            RegionKind::StarShaped(_) | RegionKind::Irregular { annulus: Some(_), .. } => {
                STAR_ORDERS.len()
            }
            RegionKind::Irregular { .. } => IRREGULAR_ORDERS,
        }
    }

    /// The nodes of an order, counted from 0; none where there is no light.
    pub fn nodes(&self, order: usize) -> Nodes {
        self.nodes_and_lines(order, false).0
    }

    /// The nodes of an order, and the radii that they lie on where the pupil is split; one radius
    /// where all azimuths are `alike` and that is enough.
    pub(super) fn nodes_and_lines(&self, order: usize, alike: bool) -> (Nodes, Vec<RadialLine>) {
        let mirrored = self.launch.is_symmetric();
        let (azimuths, radii) = STAR_ORDERS[order.min(STAR_ORDERS.len() - 1)];
        match &self.kind {
            RegionKind::Dark | RegionKind::Unbounded => Default::default(),
            RegionKind::Clear => {
                (clear_nodes(CLEAR_ORDERS[order.min(CLEAR_ORDERS.len() - 1)], mirrored), Vec::new())
            }
            RegionKind::StarShaped(boundary) => {
                let alike = alike && self.launch.is_axial() && boundary.arcs.len() == 1;
                let (spokes, rays) = self.radial_lines(boundary, if alike { 1 } else { azimuths });
                let nodes = line_nodes(&spokes, &boundary.frame, radii);
                (Nodes { mirrored, rays, ..nodes }, spokes)
            }
            RegionKind::Irregular { annulus: Some(ring), .. } => {
                let (spokes, rays) = ring.radial_lines(&self.launch, azimuths);
                let nodes = ring.nodes(&spokes, radii);
                (Nodes { mirrored, rays, ..nodes }, spokes.into_iter().flatten().collect())
            }
            RegionKind::Irregular { square, .. } => {
                let reach = if self.launch.bench.ends_at_disc() { 1.0 } else { f64::INFINITY };
                (irregular_nodes(*square, IRREGULAR_POINTS << (2 * order), reach), Vec::new())
            }
        }
    }

    /// Radii at the Gauss nodes of azimuth of every arc, and the rays traced to find their ends.
    pub(super) fn radial_lines(
        &self,
        boundary: &Boundary,
        azimuths: usize,
    ) -> (Vec<RadialLine>, usize) {
        let mut search = EdgeSearch::new(&self.launch, boundary.frame);
        let halves = if self.launch.is_symmetric() { 2.0 } else { 1.0 };
        let factor = halves * boundary.frame.area();
        let mut spokes = Vec::with_capacity(azimuths * boundary.arcs.len());
        for (i, arc) in boundary.arcs.iter().enumerate() {
            let length = arc.to - arc.from;
            let grading = Grading::of(&boundary.arcs, i, !self.launch.is_symmetric());
            for (t, share) in legendre(azimuths) {
                let (t, stretch) = grading.map(*t);
                let azimuth = arc.from + t * length;
                let guess = boundary.radius_guess(azimuth);
                let expected = search.edge_at_limit(arc.limit, azimuth, guess);
                if let Some(edge) = expected.or_else(|| search.edge(azimuth, guess, GUESS_SPREAD)) {
                    let grazing = search.grazing_distance(&boundary.grazing_limits, azimuth, edge);
                    let share = factor * share * stretch * length;
                    spokes.push(RadialLine { azimuth, edge, share, grazing_distance: grazing });
                }
            }
        }
        (spokes, search.rays)
    }

    /// Traces nodes; `visit` gets the weight and the number of each ray that arrives in `sink`.
    pub fn trace<S: TraceSink<f64> + Default>(&self, nodes: &Nodes) -> TracedNodes<S> {
        let mut landed = TracedNodes { sink: S::default(), weights: Vec::new(), lost: 0 };
        let mut rays = Rays::with_capacity(nodes.points.len());
        for (p, weight) in nodes.points.iter().zip(&nodes.weights) {
            match self.launch.ray(*p) {
                Some(ray) => {
                    rays.push(ray);
                    landed.weights.push(*weight);
                }
                None => landed.lost += 1,
            }
        }
        self.launch.channel().tracer.trace_batch(&rays, &mut landed.sink);
        landed
    }
}

/// Rays of a quadrature where they landed.
#[derive(Debug, Clone)]
pub struct TracedNodes<S> {
    /// Where.
    pub sink: S,
    /// The weight of each.
    pub weights: Vec<f64>,
    /// How many did not even start.
    pub lost: usize,
}

impl<S: TraceSink<f64>> TracedNodes<S> {
    /// The number and weight of every ray that arrived.
    pub fn arrivals(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let all = self.weights.iter().copied().enumerate();
        all.filter(|(i, _)| self.sink.fate(*i).is_imaged())
    }
}

fn clear_nodes(order: usize, mirrored: bool) -> Nodes {
    let azimuths = if mirrored { order } else { 2 * order };
    let turn = if mirrored { PI } else { 2.0 * PI };
    let step = turn / azimuths as f64;
    let mut nodes = Nodes { mirrored, ..Nodes::default() };
    for (square, share) in legendre(order) {
        for j in 0..azimuths {
            let (sin, cos) = (step * (j as f64 + 0.5)).sin_cos();
            let r = square.sqrt();
            nodes.points.push([r * sin, r * cos]);
            nodes.weights.push(PI * share / azimuths as f64);
        }
    }
    nodes
}

/// An even sequence over a square. Points farther out than `reach`, where no beam is, are left out.
fn irregular_nodes((center, half): ([f64; 2], f64), count: usize, reach: f64) -> Nodes {
    let point = |i: usize| {
        let u = additive_sequence([0.5; 2], i);
        [0, 1].map(|k| center[k] + half * (2.0 * u[k] - 1.0))
    };
    let weight = 4.0 * half * half / count as f64;
    let points: Vec<_> = (0..count).map(point).filter(|p| p[0].hypot(p[1]) <= reach).collect();
    Nodes { weights: vec![weight; points.len()], points, mirrored: false, rays: 0 }
}

/// The error of clipped points from their last change: four times as many are no more than four
/// times as good, even where two counts agree by chance.
fn sampling_error(change: f64, error_before: f64) -> f64 {
    let least = if error_before.is_finite() { 0.25 * error_before } else { 0.0 };
    (2.0 * change).max(least)
}

/// Raises the order until each of some numbers changes by less than the tolerance times its scale;
/// `None` where no light gets through. `numbers` computes them from nodes, `scales` says against
/// what each is measured.
pub fn converge<const K: usize>(
    region: &Region<'_>,
    accuracy: Accuracy,
    mut numbers: impl FnMut(&Nodes) -> Option<[f64; K]>,
    scales: impl Fn(&[f64; K]) -> [f64; K],
) -> Option<ConvergedValues<K>> {
    let mut rays = region.rays;
    let mut before: Option<ConvergedValues<K>> = None;
    for order in 0..region.orders() {
        let nodes = region.nodes(order);
        let cost = nodes.points.len() + nodes.rays;
        let has_error = before.is_some_and(|b| b.errors.iter().all(|e| e.is_finite()));
        if has_error && rays + cost > accuracy.max_rays {
            break;
        }
        rays += cost;
        let Some(values) = numbers(&nodes) else { continue };
        let mut now =
            ConvergedValues { values, errors: [f64::INFINITY; K], rays, converged: false };
        if let Some(before) = before {
            let scales = scales(&values);
            now.errors = std::array::from_fn(|k| (values[k] - before.values[k]).abs());
            if matches!(region.kind, RegionKind::Irregular { annulus: None, .. }) {
                now.errors =
                    std::array::from_fn(|k| sampling_error(now.errors[k], before.errors[k]));
            }
            now.converged = (0..K).all(|k| now.errors[k] <= accuracy.tolerance * scales[k].abs());
        }
        if now.converged {
            return Some(now);
        }
        before = Some(now);
    }
    before
}
