//! The common part of two shifted pupils: its edge, and quadrature over it.
//!
//! Its shape and position follow from polygons through points of both edges; from their centroid the
//! common part is star-shaped, and in a frame stretched with it the edge is the nearer of the two at
//! each azimuth. Gauss nodes lie between the azimuths of corners and of the crossings of both edges.

use super::outline::{PupilCurve, Segment};
use crate::math::quadrature::gauss_legendre;
use std::f64::consts::TAU;
use std::sync::OnceLock;

/// A node of quadrature.
#[derive(Debug, Clone, Copy)]
pub(super) struct OverlapNode {
    pub(super) at: [f64; 2],
    pub(super) weight: f64,
}

/// The nodes along an arc and along the radius, for each order.
const ORDERS: [(usize, usize); 10] = [
    (6, 5),
    (8, 7),
    (12, 10),
    (16, 14),
    (24, 20),
    (34, 28),
    (48, 40),
    (68, 56),
    (96, 80),
    (136, 112),
];
/// The number of orders of quadrature.
pub(super) const OVERLAP_ORDERS: usize = ORDERS.len();

/// A Gauss rule on the interval from 0 to 1.
type Rule = Vec<(f64, f64)>;

/// The rules in azimuth and radius of an order.
fn rules(order: usize) -> &'static (Rule, Rule) {
    static RULES: [OnceLock<(Rule, Rule)>; OVERLAP_ORDERS] =
        [const { OnceLock::new() }; OVERLAP_ORDERS];
    let (azimuths, radii) = ORDERS[order];
    RULES[order]
        .get_or_init(|| (gauss_legendre(azimuths, 0.0, 1.0), gauss_legendre(radii, 0.0, 1.0)))
}

/// The common part of two pupils, ready for quadrature of any order.
pub(super) struct Overlap {
    center: [f64; 2],
    /// The columns of the map from the stretched frame.
    axes: [[f64; 2]; 2],
    edges: [Edge; 2],
    /// The azimuths between which the edge is smooth, ascending over a full turn.
    breaks: Vec<f64>,
}

/// The two pupils have common points, but their common part cannot be integrated over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct NotStarShaped;

/// The number of points of the polygons that show the position of a common part.
const COARSE: usize = 64;

impl Overlap {
    /// The points that lie in the first pupil moved by `shift` and in the second moved by `−shift`;
    /// `None` if there are none.
    pub(super) fn new(
        pupils: [&PupilCurve; 2],
        shift: [f64; 2],
    ) -> Result<Option<Self>, NotStarShaped> {
        let moved = [shift, shift.map(|v| -v)];
        let polygon = |k: usize, most: usize| -> Vec<[f64; 2]> {
            let every = pupils[k].segments.len().div_ceil(most);
            let points = pupils[k].points().step_by(every);
            points.map(|p| [p[0] + moved[k][0], p[1] + moved[k][1]]).collect()
        };
        let least = TOUCHING * pupils[0].area().min(pupils[1].area());
        // A sliver may slip between coarse polygons.
        let common = |most| frame(&common_part(polygon(0, most), &polygon(1, most)), least);
        let Some((center, axes)) = common(COARSE).or_else(|| common(usize::MAX)) else {
            return Ok(None);
        };
        let inverse = inverse(axes);
        let edge = |k: usize| {
            let by = [0, 1].map(|i| moved[k][i] - center[i]);
            let map = |segment: &Segment| segment.mapped(by, inverse);
            Edge::new(pupils[k].segments.iter().map(map).collect())
        };
        let (Some(first), Some(second)) = (edge(0), edge(1)) else { return Err(NotStarShaped) };
        let edges = [first, second];
        let breaks = breaks(&edges);
        Ok(Some(Self { center, axes, edges, breaks }))
    }

    /// The nodes of an order.
    pub(super) fn nodes(&self, order: usize) -> Vec<OverlapNode> {
        let (azimuths, radii) = rules(order);
        let [[a, b], [c, d]] = self.axes;
        let area = (a * d - b * c).abs();
        let mut nodes = Vec::with_capacity(self.breaks.len() * azimuths.len() * radii.len());
        let mut cursors = [0, 0];
        for pair in self.breaks.windows(2) {
            for (t, share) in azimuths {
                let azimuth = pair[0] + t * (pair[1] - pair[0]);
                let (sin, cos) = azimuth.sin_cos();
                let [first, second] =
                    [0, 1].map(|k| self.edges[k].radius([sin, cos], &mut cursors[k]));
                let reach = first.min(second);
                let sector = area * share * (pair[1] - pair[0]) * reach * reach;
                let along = [a * sin + c * cos, b * sin + d * cos].map(|v| v * reach);
                nodes.extend(radii.iter().map(|(u, w)| OverlapNode {
                    at: [self.center[0] + u * along[0], self.center[1] + u * along[1]],
                    weight: sector * w * u,
                }));
            }
        }
        nodes
    }
}

/// The edge of a pupil about a point inside, star-shaped.
struct Edge {
    segments: Vec<Segment>,
}

/// The cross product, positive if `b` lies at a larger azimuth from +y towards +x.
#[inline(always)]
fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[1] * b[0] - a[0] * b[1]
}

/// The steps of a secant that find a point of a segment, which is almost straight.
const SECANTS: usize = 12;

impl Edge {
    /// An edge about the origin; `None` if it is not star-shaped about it.
    fn new(segments: Vec<Segment>) -> Option<Self> {
        let size = segments.iter().map(|s| cross(s.ends[0], s.ends[1]).abs()).fold(0.0, f64::max);
        let forwards = |s: &Segment| cross(s.ends[0], s.ends[1]) >= -1e-9 * size;
        segments.iter().all(forwards).then_some(Self { segments })
    }

    /// The distance of the edge in a direction; the search begins at the segment of the cursor and
    /// leaves it at the one found.
    fn radius(&self, direction: [f64; 2], cursor: &mut usize) -> f64 {
        let count = self.segments.len();
        let holds = |s: &Segment| {
            let [a, b] = s.ends;
            cross(a, direction) >= 0.0 && cross(b, direction) < 0.0
        };
        for _ in 0..=count {
            let segment = &self.segments[*cursor];
            if holds(segment) {
                return segment_distance(segment, direction);
            }
            *cursor = (*cursor + 1) % count;
        }
        // Rounding at the joint of two segments: the nearest end.
        let along = |p: [f64; 2]| p[0] * direction[0] + p[1] * direction[1];
        let off = |s: &&Segment| cross(s.ends[0], direction).abs() - along(s.ends[0]).min(0.0);
        let nearest = self.segments.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
        nearest.map_or(0.0, |s| along(s.ends[0]))
    }

    /// The azimuths of the corners.
    fn corners(&self) -> impl Iterator<Item = f64> + '_ {
        let corners = self.segments.iter().filter(|s| s.begins_at_corner);
        corners.map(|s| s.ends[0][0].atan2(s.ends[0][1]).rem_euclid(TAU))
    }
}

/// The distance along a direction at which a segment is met that lies on both sides of it.
fn segment_distance(segment: &Segment, direction: [f64; 2]) -> f64 {
    let [a, b] = segment.ends;
    let (mut left, mut right) = ((0.0, cross(a, direction)), (1.0, cross(b, direction)));
    let mut at = a;
    for _ in 0..SECANTS {
        let t = left.0 + (right.0 - left.0) * left.1 / (left.1 - right.1);
        at = segment.at(t);
        let value = cross(at, direction);
        let close = value.abs() <= 1e-16 * (at[0].abs() + at[1].abs());
        if close || right.0 - left.0 < 1e-15 {
            break;
        }
        if value > 0.0 {
            left = (t, value);
        } else {
            right = (t, value);
        }
    }
    at[0] * direction[0] + at[1] * direction[1]
}

/// The directions in which the two edges are compared first.
const COMPARED: usize = 96;
/// Edges closer than this, relatively, do not cross but coincide.
const COINCIDENT: f64 = 1e-11;
/// Two breaks closer than this, in radians, are one.
const CLOSE: f64 = 1e-12;

/// The azimuths over a full turn at which the nearer edge has a corner or changes.
fn breaks(edges: &[Edge; 2]) -> Vec<f64> {
    let mut cursors = [0, 0];
    let mut difference = |azimuth: f64| {
        let (sin, cos) = azimuth.sin_cos();
        let [a, b] = [0, 1].map(|k| edges[k].radius([sin, cos], &mut cursors[k]));
        let scale = a.max(b);
        if (a - b).abs() < COINCIDENT * scale { 0.0 } else { a - b }
    };
    let mut found: Vec<f64> = Vec::new();
    for (k, edge) in edges.iter().enumerate() {
        for corner in edge.corners() {
            let nearer = difference(corner) * if k == 0 { 1.0 } else { -1.0 };
            // A corner of the farther edge lies outside.
            if nearer <= 1e-9 {
                found.push(corner);
            }
        }
    }
    let mut grid: Vec<f64> = (0..=COMPARED).map(|i| TAU * i as f64 / COMPARED as f64).collect();
    grid.extend(&found);
    grid.sort_by(f64::total_cmp);
    let values: Vec<f64> = grid.iter().map(|azimuth| difference(*azimuth)).collect();
    for i in 1..grid.len() {
        if values[i - 1] * values[i] < 0.0 {
            found.push(crossing(&mut difference, [grid[i - 1], grid[i]], values[i]));
        }
    }
    for i in (0..grid.len() - 1).filter(|i| values[*i] == 0.0) {
        // A crossing at a place of the grid, as on the plane of symmetry; the first place is the last too.
        let before = values[i.checked_sub(1).unwrap_or(grid.len() - 2)];
        if before * values[i + 1] < 0.0 {
            found.push(grid[i]);
        }
    }
    if found.is_empty() {
        // A smooth closed edge: four parts are enough for Gauss nodes.
        found.extend((0..4).map(|i| 0.25 * TAU * f64::from(i)));
    }
    found.sort_by(f64::total_cmp);
    found.dedup_by(|a, b| (*a - *b).abs() < CLOSE);
    let first = found[0];
    found.push(first + TAU);
    divide(&found)
}

/// The azimuth between two others at which a difference changes its sign.
fn crossing(
    difference: &mut impl FnMut(f64) -> f64,
    [mut left, mut right]: [f64; 2],
    end: f64,
) -> f64 {
    for _ in 0..52 {
        let middle = 0.5 * (left + right);
        if difference(middle) * end > 0.0 {
            right = middle;
        } else {
            left = middle;
        }
    }
    0.5 * (left + right)
}

/// The widest interval of azimuth that is not divided.
const WIDEST: f64 = 0.26 * TAU;

/// Wide intervals divided evenly.
fn divide(breaks: &[f64]) -> Vec<f64> {
    let mut all = vec![breaks[0]];
    for pair in breaks.windows(2) {
        let parts = ((pair[1] - pair[0]) / WIDEST).ceil().max(1.0);
        let step = (pair[1] - pair[0]) / parts;
        all.extend((1..=parts as usize).map(|i| pair[0] + step * i as f64));
    }
    all
}

/// The part of a polygon inside a convex one (Sutherland and Hodgman, CACM 17, 1974); both have
/// growing azimuth from +y towards +x.
fn common_part(mut subject: Vec<[f64; 2]>, clip: &[[f64; 2]]) -> Vec<[f64; 2]> {
    for (i, a) in clip.iter().enumerate() {
        let b = clip[(i + 1) % clip.len()];
        let side = |p: [f64; 2]| cross([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
        if *a == b || subject.iter().all(|p| side(*p) >= 0.0) {
            continue;
        }
        let mut kept = Vec::with_capacity(subject.len() + 1);
        for (j, p) in subject.iter().enumerate() {
            let q = subject[(j + 1) % subject.len()];
            let (here, there) = (side(*p), side(q));
            if here >= 0.0 {
                kept.push(*p);
            }
            if (here >= 0.0) != (there >= 0.0) {
                let t = here / (here - there);
                kept.push([0, 1].map(|k| p[k] + t * (q[k] - p[k])));
            }
        }
        subject = kept;
        if subject.len() < 3 {
            return Vec::new();
        }
    }
    subject
}

/// A common part below this part of the smaller pupil is a point that the two touch in.
const TOUCHING: f64 = 1e-20;

/// The centroid of a polygon and the axes of the ellipse with its second moments; `None` if its area
/// is not above `least`.
fn frame(polygon: &[[f64; 2]], least: f64) -> Option<([f64; 2], [[f64; 2]; 2])> {
    let origin = *polygon.first()?;
    let (mut area, mut first, mut second) = (0.0, [0.0; 2], [0.0; 3]);
    for (i, p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (p, q) = ([p[0] - origin[0], p[1] - origin[1]], [q[0] - origin[0], q[1] - origin[1]]);
        let twice = cross(p, q);
        area += 0.5 * twice;
        first = [0, 1].map(|k| first[k] + twice * (p[k] + q[k]) / 6.0);
        let product = |a: usize, b: usize| {
            let both = 2.0 * p[a] * p[b] + 2.0 * q[a] * q[b] + p[a] * q[b] + q[a] * p[b];
            twice * both / 24.0
        };
        second = [second[0] + product(0, 0), second[1] + product(0, 1), second[2] + product(1, 1)];
    }
    let mean = first.map(|v| v / area);
    let xx = second[0] / area - mean[0] * mean[0];
    let xy = second[1] / area - mean[0] * mean[1];
    let yy = second[2] / area - mean[1] * mean[1];
    if !(area > least && xx > 0.0 && yy > 0.0) {
        return None;
    }
    let y = yy.sqrt();
    let slant = xy / y;
    let x = (xx - slant * slant).max(1e-6 * xx).sqrt();
    let center = [origin[0] + mean[0], origin[1] + mean[1]];
    // The map (u, v) → (2 x u + 2 slant v, 2 y v), by columns.
    Some((center, [[2.0 * x, 0.0], [2.0 * slant, 2.0 * y]]))
}

/// The rows of the inverse of a map given by its columns.
fn inverse([[a, b], [c, d]]: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
    let determinant = a * d - b * c;
    [[d / determinant, -c / determinant], [-b / determinant, a / determinant]]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two kites moved apart across their axis by a part of their half width: their edges cross on that axis,
    /// and their common part is a smaller kite.
    #[test]
    fn edges_that_cross_on_the_plane_of_symmetry_divide_the_common_part() {
        let kite = PupilCurve::polygon(&[[0.0, 0.1], [0.1, 0.03], [0.0, -0.1], [-0.1, 0.03]]);
        for part in [0.1, 0.37, 0.8] {
            let common = Overlap::new([&kite, &kite], [0.1 * part, 0.0]).unwrap().unwrap();
            let area: f64 = common.nodes(5).iter().map(|node| node.weight).sum();
            let exact = 0.02 * (1.0 - part) * (1.0 - part);
            assert!((area / exact - 1.0).abs() < 1e-11, "{part}: {area} {exact}");
        }
    }
}
