//! Integrals over the rays that get through, of an order that is raised until two orders agree.
//!
//! The clear disc has Gauss nodes in `ρ²` and equal steps of azimuth: odd powers of `ρ` cancel
//! there, and the rule converges spectrally (Forbes 1988). A clipped pupil has Gauss nodes in
//! azimuth along every arc, and in the radius with weight `r` up to the edge. A pupil that is its
//! own mirror image is integrated over one half.

use super::boundary::{Boundary, PolarFrame};
use super::edge_search::{EdgeSearch, INSIDE};
use super::kind::{Region, RegionKind};
use super::light_grid::AZIMUTHS;
use super::nodes::{
    Grading, Nodes, PARTS, RadialLine, clear_nodes, irregular_nodes, jittered_nodes, joined_nodes,
    line_nodes,
};
use crate::math::quadrature::chebyshev_points;
use crate::pupil::gauss_rules::{LARGEST, legendre};
use crate::pupil::patterns::{PupilPattern, pattern_points};
use crate::trace::{Rays, TraceSink};
use std::f64::consts::{PI, SQRT_2, TAU};

/// The accuracy that is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accuracy {
    /// The tolerance: the largest error, relative to a scale that each analysis names.
    pub tolerance: f64,
    /// The largest number of rays for one field and wavelength.
    pub max_rays: usize,
}

impl Default for Accuracy {
    fn default() -> Self {
        Self { tolerance: 1e-3, max_rays: 100_000 }
    }
}

/// Converged numbers with their errors and their cost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConvergedValues<const K: usize> {
    /// The numbers at the highest order used.
    pub values: [f64; K],
    /// The change of each by the last raising of the order, and at least a part of the one before.
    pub errors: [f64; K],
    /// The number of rays traced.
    pub rays: usize,
    /// The number of orders that were traced.
    pub orders: usize,
    /// True if the errors are within the tolerance; otherwise the orders or the rays ran out.
    pub converged: bool,
}

/// The numbers of nodes along the radius and along half a turn, for the clear disc.
const CLEAR_ORDERS: [usize; 19] =
    [3, 4, 5, 6, 7, 8, 10, 12, 16, 20, 24, 32, 40, 48, 64, 80, 112, 144, 192];
/// The numbers of nodes along an arc and along the radius, for a pupil with a boundary.
const STAR_ORDERS: [(usize, usize); 15] = [
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
    (112, 80),
    (144, 112),
    (192, 144),
];
/// The orders of these that are compared with each other. Where a spot is much aberrated, the lowest one and
/// a next one with a single node more along the radius agree by chance while both are wrong: their change was
/// up to 11 times below their error in spots of published lenses, that of these is never below it.
const COMPARED_STAR_ORDERS: [usize; 13] = [1, 2, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14];
/// The radii over half a turn that phases are looked at on, and the points of each.
const RADII: usize = 8;
const RADIUS_POINTS: usize = 9;
/// The number of points of the lowest order for an irregular pupil, sampled by a low-discrepancy
/// sequence.
const IRREGULAR_POINTS: usize = 1024;
const IRREGULAR_ORDERS: usize = 8;
/// The cells along a side of each independent part of the lowest order for a pupil behind apertures.
const PART_CELLS: usize = 12;
/// The lowest order for a pupil with a known edge that was sampled before: 20 by 12 nodes of an arc.
const KNOWN_START: usize = 6;
/// The highest order that such a pupil is begun with: the next one takes 65,536 points.
const SAMPLED_START: usize = 2;

impl Region<'_> {
    /// The number of orders of quadrature.
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

    /// The order to use in place of one that was found for a pupil of another kind: each order of a sampled
    /// pupil takes four times the points of the one before, so that a high order of an edge that is known would
    /// be billions of points.
    pub fn order_like(&self, found_for: &RegionKind, order: usize) -> usize {
        let was_sampled = matches!(found_for, RegionKind::Irregular { annulus: None, .. });
        match (was_sampled, self.is_sampled()) {
            (false, true) => order.min(SAMPLED_START),
            // The same number is few nodes where the edge is known.
            (true, false) => order.max(KNOWN_START),
            _ => order,
        }
    }

    /// The orders that [`converge`] compares with each other, ascending.
    fn compared_orders(&self) -> Vec<usize> {
        match self.kind {
            RegionKind::StarShaped(_) => COMPARED_STAR_ORDERS.to_vec(),
            _ => (0..self.orders()).collect(),
        }
    }

    /// The number of nodes along a radius of an order.
    pub fn radial_nodes(&self, order: usize) -> usize {
        match self.kind {
            RegionKind::Clear => CLEAR_ORDERS[order.min(CLEAR_ORDERS.len() - 1)],
            // Half of a side of the square.
            RegionKind::Irregular { annulus: None, .. } => 16 << order.min(IRREGULAR_ORDERS - 1),
            _ => STAR_ORDERS[order.min(STAR_ORDERS.len() - 1)].1,
        }
    }

    /// True if the pupil has no known boundary and is sampled by a sequence of points.
    pub fn is_sampled(&self) -> bool {
        matches!(self.kind, RegionKind::Irregular { annulus: None, .. })
    }

    /// Points on radii about a sixteenth of a turn apart, each with its azimuth in the frame of the edge, at the
    /// nine Chebyshev points of the way from the centre, or from the edge of a central shadow, to the edge; none
    /// if that is not known.
    pub fn radii(&self) -> Vec<(f64, Vec<[f64; 2]>)> {
        let radius = |frame: &PolarFrame, azimuth: f64, [from, to]: [f64; 2]| {
            let place = |u: f64| frame.point(azimuth, from + u * (1.0 - INSIDE) * (to - from));
            (azimuth, chebyshev_points(RADIUS_POINTS).map(place).collect())
        };
        match &self.kind {
            RegionKind::Clear => {
                let count = if self.launch.is_symmetric() { RADII + 1 } else { 2 * RADII };
                let azimuth = |i: usize| PI * i as f64 / RADII as f64;
                (0..count).map(|i| radius(&PolarFrame::UNIT, azimuth(i), [0.0, 1.0])).collect()
            }
            RegionKind::StarShaped(edge) => {
                let samples = edge.samples.iter().step_by(AZIMUTHS / RADII);
                samples.map(|(a, end)| radius(&edge.frame, *a, [0.0, end.radius])).collect()
            }
            RegionKind::Irregular { annulus: Some(ring), .. } => {
                let samples = ring.outer.samples.iter().step_by(AZIMUTHS / RADII);
                let ends = |a: f64, end: f64| [ring.inner.radius_guess(a), end];
                let frame = &ring.outer.frame;
                samples.map(|(a, end)| radius(frame, *a, ends(*a, end.radius))).collect()
            }
            RegionKind::Dark | RegionKind::Unbounded | RegionKind::Irregular { .. } => Vec::new(),
        }
    }

    /// Nodes along radii, as many on each as `radii` says of its azimuth, or of any where the rule is the same for
    /// all, at as many azimuths for each smooth arc of the edge as `azimuths` says of its length in radians;
    /// `None` if the edge is not known or rules have not so many nodes.
    pub fn nodes_along(
        &self,
        azimuths: impl Fn(f64) -> usize,
        radii: impl Fn(f64) -> usize,
    ) -> Option<Nodes> {
        let mirrored = self.launch.is_symmetric();
        let most = azimuths(if mirrored { PI } else { TAU });
        let longest = self.radii().iter().map(|(azimuth, _)| radii(*azimuth)).max().unwrap_or(0);
        if most.max(longest) > LARGEST {
            return None;
        }
        match &self.kind {
            RegionKind::Clear => Some(clear_nodes(longest, azimuths(PI), mirrored)),
            RegionKind::StarShaped(boundary) => {
                let (lines, rays) = self.radial_lines(boundary, azimuths);
                let nodes = line_nodes(&lines, &boundary.frame, radii);
                Some(Nodes { mirrored, rays, ..nodes })
            }
            RegionKind::Irregular { annulus: Some(annulus), .. } => {
                let (lines, rays) = annulus.radial_lines(&self.launch, most);
                Some(Nodes { mirrored, rays, ..annulus.nodes(&lines, longest) })
            }
            RegionKind::Dark | RegionKind::Unbounded | RegionKind::Irregular { .. } => None,
        }
    }

    /// The nodes of an order with twice the azimuths on each arc: as fine as those of the half of a pupil that
    /// was its own mirror image, where arcs end on the line of symmetry.
    pub fn nodes_of_both_halves(&self, order: usize) -> Nodes {
        let (azimuths, radii) = STAR_ORDERS[order.min(STAR_ORDERS.len() - 1)];
        match &self.kind {
            RegionKind::StarShaped(boundary) => {
                let (lines, rays) = self.radial_lines(boundary, |_| 2 * azimuths);
                let nodes = line_nodes(&lines, &boundary.frame, |_| radii);
                Nodes { mirrored: self.launch.is_symmetric(), rays, ..nodes }
            }
            _ => self.nodes(order),
        }
    }

    /// The nodes of an order, counted from 0; none if there is no light.
    pub fn nodes(&self, order: usize) -> Nodes {
        self.nodes_and_lines(order, false).0
    }

    /// The nodes of an order, and the radii that they lie on if the boundary is known. A single
    /// radius is used if all azimuths give the same and the caller allows it (`alike`).
    pub(super) fn nodes_and_lines(&self, order: usize, alike: bool) -> (Nodes, Vec<RadialLine>) {
        let mirrored = self.launch.is_symmetric();
        let (azimuths, radii) = STAR_ORDERS[order.min(STAR_ORDERS.len() - 1)];
        match &self.kind {
            RegionKind::Dark | RegionKind::Unbounded => Default::default(),
            RegionKind::Clear => {
                let count = CLEAR_ORDERS[order.min(CLEAR_ORDERS.len() - 1)];
                (clear_nodes(count, count, mirrored), Vec::new())
            }
            RegionKind::StarShaped(boundary) => {
                let alike = alike && self.launch.is_axial() && boundary.arcs.len() == 1;
                let azimuths = if alike { 1 } else { azimuths };
                let (lines, rays) = self.radial_lines(boundary, |_| azimuths);
                let nodes = line_nodes(&lines, &boundary.frame, |_| radii);
                (Nodes { mirrored, rays, ..nodes }, lines)
            }
            RegionKind::Irregular { annulus: Some(annulus), .. } => {
                let (lines, rays) = annulus.radial_lines(&self.launch, azimuths);
                let nodes = annulus.nodes(&lines, radii);
                (Nodes { mirrored, rays, ..nodes }, lines.into_iter().flatten().collect())
            }
            RegionKind::Irregular { square, .. } => {
                if let Some(parts) = self.parts(order) {
                    return (joined_nodes(&parts), Vec::new());
                }
                let reach = if self.launch.model.ends_at_disc() { 1.0 } else { f64::INFINITY };
                let points = IRREGULAR_POINTS << (2 * order.min(IRREGULAR_ORDERS - 1));
                (irregular_nodes(*square, points, reach), Vec::new())
            }
        }
    }

    /// The independent parts of the points of an order, where a pupil behind apertures is sampled; `None` for
    /// any other pupil.
    fn parts(&self, order: usize) -> Option<Vec<Nodes>> {
        let RegionKind::Irregular { square, annulus: None, .. } = &self.kind else { return None };
        if self.launch.channel().tracer.aperture_sides() == 0 {
            return None;
        }
        let reach = if self.launch.model.ends_at_disc() { 1.0 } else { f64::INFINITY };
        let cells = PART_CELLS << order.min(IRREGULAR_ORDERS - 1);
        Some((0..PARTS).map(|part| jittered_nodes(*square, (cells, part), reach)).collect())
    }

    /// The radii at the Gauss nodes in azimuth of every arc, as many as `azimuths` says of its length, and the
    /// number of rays traced to find their ends.
    pub(super) fn radial_lines(
        &self,
        boundary: &Boundary,
        azimuths: impl Fn(f64) -> usize,
    ) -> (Vec<RadialLine>, usize) {
        let mut search = EdgeSearch::new(&self.launch, boundary.frame);
        let halves = if self.launch.is_symmetric() { 2.0 } else { 1.0 };
        let factor = halves * boundary.frame.area();
        let mut lines = Vec::new();
        for (i, arc) in boundary.arcs.iter().enumerate() {
            let length = arc.to - arc.from;
            let grading = Grading::of(&boundary.arcs, i, !self.launch.is_symmetric());
            let guess = |(t, _): &(f64, f64)| {
                let azimuth = arc.from + grading.map(*t).0 * length;
                (azimuth, boundary.radius_guess(azimuth))
            };
            let rule = legendre(azimuths(length));
            let guesses: Vec<_> = rule.iter().map(guess).collect();
            let edges = search.edges_along_arc(arc.limit, &guesses);
            let nodes = rule.iter().zip(guesses);
            for (((t, share), (azimuth, _)), edge) in nodes.zip(edges) {
                let Some(edge) = edge else { continue };
                let grazing_distance =
                    search.grazing_distance(&boundary.grazing_limits, azimuth, edge);
                let share = factor * share * grading.map(*t).1 * length;
                lines.push(RadialLine { azimuth, edge, share, grazing_distance });
            }
        }
        (lines, search.rays)
    }

    /// The points of a pattern over a disc, or an ellipse, that holds all of the light: a sum over
    /// those that arrive is what clipped patterns give in other programs.
    pub fn pattern_nodes(&self, chosen: PupilPattern) -> Nodes {
        let frame = match &self.kind {
            RegionKind::Clear => PolarFrame::UNIT,
            RegionKind::StarShaped(_) | RegionKind::Irregular { .. }
                if self.launch.model.ends_at_disc() =>
            {
                PolarFrame::UNIT
            }
            RegionKind::StarShaped(boundary) => boundary.enclosing_disc(),
            RegionKind::Irregular { square: (center, half), .. } => {
                let reach = half * SQRT_2;
                PolarFrame { center: *center, axes: [[reach, 0.0], [0.0, reach]] }
            }
            RegionKind::Dark | RegionKind::Unbounded => return Nodes::default(),
        };
        let place = |p: &[f64; 2]| {
            let [a, b] = frame.axes;
            [0, 1].map(|i| frame.center[i] + p[0] * a[i] + p[1] * b[i])
        };
        let points: Vec<_> = pattern_points(chosen).iter().map(place).collect();
        let weight = PI * frame.area() / points.len() as f64;
        Nodes { weights: vec![weight; points.len()], points, ..Nodes::default() }
    }

    /// Traces nodes into a sink.
    pub fn trace<S: TraceSink<f64> + Default>(&self, nodes: &Nodes) -> TracedNodes<S> {
        self.launch_and_trace(nodes).1
    }

    /// Traces nodes into a sink; also returns the rays as they were launched.
    pub(super) fn launch_and_trace<S: TraceSink<f64> + Default>(
        &self,
        nodes: &Nodes,
    ) -> (Rays<f64>, TracedNodes<S>) {
        let mut landed = TracedNodes {
            sink: S::default(),
            weights: Vec::new(),
            lost: 0,
            mirrored: nodes.mirrored,
        };
        if let Some(rays) = self.launch.mapped_rays(&nodes.points) {
            landed.weights.clone_from(&nodes.weights);
            self.launch.channel().tracer.trace_batch(&rays, &mut landed.sink);
            return (rays, landed);
        }
        let mut rays = Rays::with_capacity(nodes.points.len());
        for (p, weight) in nodes.points.iter().zip(&nodes.weights) {
            match self.launch.ray(*p) {
                Some(ray) => {
                    rays.push(ray);
                    landed.weights.push(*weight * self.launch.beam_share(*p));
                }
                None => landed.lost += 1,
            }
        }
        self.launch.channel().tracer.trace_batch(&rays, &mut landed.sink);
        (rays, landed)
    }
}

/// The traced rays of a quadrature.
#[derive(Debug, Clone)]
pub struct TracedNodes<S> {
    /// The recorded ends of the rays.
    pub sink: S,
    /// The weight of each ray.
    pub weights: Vec<f64>,
    /// The number of nodes from which no ray could be launched.
    pub lost: usize,
    /// True if every ray stands for its mirror image as well; the weights count both.
    pub mirrored: bool,
}

impl<S: TraceSink<f64>> TracedNodes<S> {
    /// The index and the weight of every ray that arrived.
    pub fn arrivals(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        let all = self.weights.iter().copied().enumerate();
        all.filter(|(i, _)| self.sink.fate(*i).is_imaged())
    }
}

/// The error of clipped points from the last change: four times as many points are at most four
/// times as accurate, even if two results agree by chance.
fn sampling_error(change: f64, error_before: f64) -> f64 {
    let least = if error_before.is_finite() { 0.25 * error_before } else { 0.0 };
    (2.0 * change).max(least)
}

/// A list of converged numbers with their errors and their cost.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvergedList {
    /// The numbers at the highest order used.
    pub values: Vec<f64>,
    /// The change of each by the last raising of the order, and at least a part of the one before.
    pub errors: Vec<f64>,
    /// The number of rays traced.
    pub rays: usize,
    /// The number of orders that were traced.
    pub orders: usize,
    /// True if the errors are within the tolerance; otherwise the orders or the rays ran out.
    pub converged: bool,
}

/// The part of the error before the last raising of the order that is left at least. Two orders may
/// agree by chance; where the light of a field grazes a surface, or its spot is much aberrated, an
/// order leaves a sixth of the error of the one before.
const LEAST_FALL: f64 = 1.0 / 6.0;

/// The error of an order of Gauss rules from the last change.
pub(in crate::pupil) fn order_error(change: f64, error_before: f64) -> f64 {
    let least = if error_before.is_finite() { LEAST_FALL * error_before } else { 0.0 };
    change.max(least)
}

/// Raises the order until each of some numbers changes by less than the tolerance times its scale,
/// and did not change by much more the time before; `None` if no light gets through. `numbers`
/// computes them from nodes, `scales` gives the scale of each.
pub fn converge<const K: usize>(
    region: &Region<'_>,
    accuracy: Accuracy,
    mut numbers: impl FnMut(&Nodes) -> Option<[f64; K]>,
    scales: impl Fn(&[f64; K]) -> [f64; K],
) -> Option<ConvergedValues<K>> {
    let array = |list: &[f64]| -> [f64; K] { std::array::from_fn(|k| list[k]) };
    let numbers = |nodes: &Nodes| numbers(nodes).map(|values| values.to_vec());
    let found = converge_list(region, accuracy, numbers, |list| scales(&array(list)).to_vec())?;
    let ConvergedList { values, errors, rays, orders, converged } = found;
    let (values, errors) = (array(&values), array(&errors));
    Some(ConvergedValues { values, errors, rays, orders, converged })
}

/// The same for a list of numbers, all from the same rays.
pub fn converge_list(
    region: &Region<'_>,
    accuracy: Accuracy,
    numbers: impl FnMut(&Nodes) -> Option<Vec<f64>>,
    scales: impl Fn(&[f64]) -> Vec<f64>,
) -> Option<ConvergedList> {
    converge_resolved(region, accuracy, 0, numbers, scales)
}

/// The same for an integrand that oscillates, from the first order with so many nodes along a radius that they
/// resolve it. Where none has so many, the numbers themselves are errors, and do not converge.
pub fn converge_resolved(
    region: &Region<'_>,
    accuracy: Accuracy,
    least: usize,
    numbers: impl FnMut(&Nodes) -> Option<Vec<f64>>,
    scales: impl Fn(&[f64]) -> Vec<f64>,
) -> Option<ConvergedList> {
    let orders = region.compared_orders();
    let coarse = orders.iter().take_while(|order| region.radial_nodes(**order) < least).count();
    let most = if region.is_sampled() { SAMPLED_START } else { orders.len().saturating_sub(2) };
    converge_orders(region, accuracy, &orders[coarse.min(most)..], least, numbers, scales)
}

/// The same with every order in turn, of which the derivatives of the numbers need the last: from the coarse
/// ones on, whose changes leave a larger part in the errors of those that follow. It ends at an order that
/// [`converge`] compares too, and its errors are at least those.
pub fn converge_every_order(
    region: &Region<'_>,
    accuracy: Accuracy,
    numbers: impl FnMut(&Nodes) -> Option<Vec<f64>>,
    scales: impl Fn(&[f64]) -> Vec<f64>,
) -> Option<ConvergedList> {
    let orders: Vec<usize> = (0..region.orders()).collect();
    converge_orders(region, accuracy, &orders, 0, numbers, scales)
}

fn converge_orders(
    region: &Region<'_>,
    accuracy: Accuracy,
    orders: &[usize],
    least: usize,
    mut numbers: impl FnMut(&Nodes) -> Option<Vec<f64>>,
    scales: impl Fn(&[f64]) -> Vec<f64>,
) -> Option<ConvergedList> {
    let mut rays = region.rays;
    let mut before: Option<ConvergedList> = None;
    let (mut every, mut compared) = (OrderChanges::new(region), OrderChanges::new(region));
    let compared_orders = region.compared_orders();
    for (traced, &order) in (1..).zip(orders) {
        let parts = region.parts(order).unwrap_or_default();
        let nodes = if parts.is_empty() { region.nodes(order) } else { joined_nodes(&parts) };
        // The numbers of the parts are computed beside those of all together.
        let passes = if parts.is_empty() { 1 } else { 2 };
        let cost = passes * nodes.points.len() + nodes.rays;
        // A sample without light tells nothing, however many points it has.
        let may_end = compared.is_told() || (region.is_sampled() && traced > 1);
        if may_end && rays + cost > accuracy.max_rays {
            break;
        }
        rays += cost;
        let scatter = PartScatter::new(parts.iter().map(&mut numbers));
        let Some(values) = numbers(&nodes) else { continue };
        let is_resolved = region.radial_nodes(order) >= least;
        let unresolved = |k: usize| if is_resolved { 0.0 } else { values[k].abs() };
        every.add(&values, unresolved);
        let is_compared = compared_orders.contains(&order);
        if is_compared {
            compared.add(&values, unresolved);
        }
        let changes = |k: usize| every.error_of(k).max(compared.error_of(k));
        let error = |k: usize| scatter.error_of(k).unwrap_or_else(|| changes(k));
        let errors: Vec<f64> = (0..values.len()).map(error).collect();
        let allowed = scales(&values).into_iter().map(|scale| accuracy.tolerance * scale.abs());
        let small = errors.iter().zip(allowed).all(|(error, allowed)| *error <= allowed);
        let converged = small && is_resolved && is_compared && compared.is_told();
        let now = ConvergedList { values, errors, rays, orders: traced, converged };
        if converged {
            return Some(now);
        }
        before = Some(now);
    }
    before
}

/// The numbers of independent parts of the points of an order; of none where they are not sampled so.
struct PartScatter(Vec<Option<Vec<f64>>>);

/// The two-sided 99 % quantile of Student's distribution for one part less than there are.
const STUDENT: f64 = 3.5;

impl PartScatter {
    fn new(parts: impl Iterator<Item = Option<Vec<f64>>>) -> Self {
        Self(parts.collect())
    }

    /// The error of number `k` of all parts together, at 99 % confidence; `None` without parts.
    fn error_of(&self, k: usize) -> Option<f64> {
        if self.0.is_empty() {
            return None;
        }
        let of_part = |part: &Option<Vec<f64>>| part.as_ref().and_then(|all| all.get(k)).copied();
        let Some(values) = self.0.iter().map(of_part).collect::<Option<Vec<f64>>>() else {
            return Some(f64::INFINITY);
        };
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        Some(STUDENT * (square / (count * (count - 1.0))).sqrt())
    }
}

/// The changes of some numbers from order to order, and the errors that follow from them.
struct OrderChanges {
    /// The error of an order from its change and the error before.
    error: fn(f64, f64) -> f64,
    /// The changes that are needed: a first one alone does not tell an agreement by chance.
    needed: usize,
    orders: usize,
    values: Vec<f64>,
    errors: Vec<f64>,
}

impl OrderChanges {
    fn new(region: &Region<'_>) -> Self {
        let error = if region.is_sampled() { sampling_error } else { order_error };
        let needed = if region.is_sampled() { 1 } else { 2 };
        Self { error, needed, orders: 0, values: Vec::new(), errors: Vec::new() }
    }

    /// Adds the numbers of the next order; the error of number `k` is at least `least(k)`.
    fn add(&mut self, values: &[f64], least: impl Fn(usize) -> f64) {
        let error = |k: usize| match self.values.get(k) {
            Some(last) => (self.error)((values[k] - last).abs(), self.errors[k]).max(least(k)),
            None => f64::INFINITY,
        };
        self.errors = (0..values.len()).map(error).collect();
        self.values = values.to_vec();
        self.orders += 1;
    }

    /// The error of number `k`; infinite before there is any.
    fn error_of(&self, k: usize) -> f64 {
        self.errors.get(k).copied().unwrap_or(f64::INFINITY)
    }

    /// True if there are as many changes as are needed.
    fn is_told(&self) -> bool {
        self.orders > self.needed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{FieldPoint, blank};
    use crate::pupil::RayModel;

    /// A sample of a square beside the light, which no order finds: it once took 22 million points, which with
    /// the derivatives of their rays filled the memory of the machine.
    #[test]
    fn a_sample_without_light_keeps_to_its_budget() {
        let model = RayModel::from_lens(&blank(), 0).unwrap();
        let field = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
        let launch = model.launch(field, 0).unwrap();
        let kind = RegionKind::Irregular { pieces: 2, square: ([5.0, 5.0], 0.1), annulus: None };
        let region = Region { launch, kind, rays: 0 };
        let (mut points, accuracy) = (0, Accuracy::default());
        let found = converge(
            &region,
            accuracy,
            |nodes| {
                points += nodes.points.len();
                let area = region.moments(nodes).area;
                (area > 0.0).then_some([area])
            },
            |values| *values,
        );
        assert!(found.is_none() && points > 0 && points <= accuracy.max_rays, "{points}");
    }

    /// A pupil that falls into pieces while a lens changes keeps the order that its edge needed: of samples that
    /// would be up to 2.7e11 points.
    #[test]
    fn an_order_of_a_known_edge_is_not_that_of_a_sample() {
        let model = RayModel::from_lens(&blank(), 0).unwrap();
        let field = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
        let launch = model.launch(field, 0).unwrap();
        let sampled = RegionKind::Irregular { pieces: 2, square: ([0.0; 2], 0.5), annulus: None };
        let region = Region { launch, kind: sampled.clone(), rays: 0 };
        let order = region.order_like(&RegionKind::Clear, 14);
        assert!(region.nodes(order).points.len() <= 16_384, "{order}");
        assert_eq!(region.order_like(&sampled, 5), 5);
        let clear = Region { kind: RegionKind::Clear, ..region };
        assert_eq!(clear.order_like(&sampled, 1), 6);
        assert_eq!(clear.order_like(&RegionKind::Clear, 1), 1);
    }

    #[test]
    fn an_error_of_clipped_points_falls_to_a_quarter_at_most() {
        assert_eq!(sampling_error(1e-6, f64::INFINITY), 2e-6);
        assert_eq!(sampling_error(1e-6, 4e-4), 1e-4);
        assert_eq!(sampling_error(3e-4, 4e-4), 6e-4);
    }
}
