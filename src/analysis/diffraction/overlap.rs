//! The common part of two shifted pupils, and quadrature over it by columns.
//!
//! The edges of both pupils are chains: functions `v(t)` of the coordinate t in which the pupils are shifted
//! most. Between the places where chains begin, end or cross, each column of constant t runs from one
//! chain to another, whatever the shape of the pupils: the common part is a list of strips with two smooth
//! edges. Gauss nodes lie across a strip and along its columns; where an edge is steep, as a round one
//! at its end, they lie across in the square root of the distance from where it turns back, in which it is smooth.

use super::outline::Chain;
#[cfg(test)]
use super::outline::{ArcSteps, PupilCurve};
use crate::math::quadrature::legendre_rule;

/// A node of quadrature.
#[derive(Debug, Clone, Copy)]
pub(super) struct OverlapNode {
    pub(super) at: [f64; 2],
    pub(super) weight: f64,
}

/// A part of the common part of two pupils, between two values of t and two chains.
#[derive(Debug)]
pub(super) struct Strip<'a> {
    /// The axis of the coordinate t, x (0) or y (1).
    pub(super) axis: usize,
    range: [f64; 2],
    /// The lower and the upper edge.
    edges: [MovedChain<'a>; 2],
    /// The end, 0 or 1, beyond which an edge has a square root, and the distance from there.
    root: Option<(usize, f64)>,
}

/// A chain of a pupil that has been moved; without one, the line of symmetry.
#[derive(Debug, Clone, Copy)]
struct MovedChain<'a> {
    chain: Option<&'a Chain>,
    by: [f64; 2],
}

/// The columns of a strip, each with its t, its weight and its ends.
#[derive(Debug)]
pub(super) struct Columns {
    pub(super) t: Vec<f64>,
    pub(super) weight: Vec<f64>,
    pub(super) ends: [Vec<f64>; 2],
}

/// The half that stands for its mirror image as well, for pupils that are symmetric in x.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OverlapHalf {
    /// No half: everything counts.
    None,
    /// Positive values of t.
    Across,
    /// Positive values of v.
    Along,
}

/// The largest Gauss rule; more nodes are those of several panels.
const PANEL: usize = 192;

/// Nodes from 0 to 1 with their weights, at least as many as asked for.
pub(super) fn rule(count: usize) -> Vec<(f64, f64)> {
    let panels = count.div_ceil(PANEL).max(1);
    if panels == 1 {
        return legendre_rule(count).clone();
    }
    let width = 1.0 / panels as f64;
    let panel = |i: usize| {
        let nodes = legendre_rule(count.div_ceil(panels)).iter();
        nodes.map(move |(u, weight)| (width * (i as f64 + u), width * weight))
    };
    (0..panels).flat_map(panel).collect()
}

/// A strip or an arc below this part of the size of a pupil is rounding.
const ROUNDING: f64 = 4.0 * f64::EPSILON;
/// The places at which two chains are compared first.
const COMPARED: usize = 24;
/// Edges closer than this part of the size of a pupil do not cross but coincide.
const COINCIDENT: f64 = 1e-11;

impl<'a> Strip<'a> {
    /// The strips of the points that lie in the first pupil moved by `shift` and in the second moved by
    /// `−shift`, each given by its chains along the axis.
    pub(super) fn of_overlap(
        axis: usize,
        chains: [&'a [Chain]; 2],
        shift: [f64; 2],
        half: OverlapHalf,
    ) -> Vec<Self> {
        let by = [shift[axis], shift[1 - axis]];
        let moved = |k: usize| -> Vec<MovedChain<'a>> {
            let by = if k == 0 { by } else { by.map(|v| -v) };
            chains[k].iter().map(|chain| MovedChain { chain: Some(chain), by }).collect()
        };
        let pupils = [moved(0), moved(1)];
        let size =
            pupils.iter().map(|p| extent(p)).map(|[low, high]| high - low).fold(0.0, f64::max);
        let breaks = breaks(&pupils, size, half);
        let pairs = breaks.windows(2).filter(|pair| pair[1] - pair[0] > ROUNDING * size);
        pairs.flat_map(|pair| strips(axis, [pair[0], pair[1]], &pupils, half)).collect()
    }
}

impl Strip<'_> {
    /// The nodes of so many columns with so many nodes each.
    pub(super) fn nodes(&self, counts: [usize; 2]) -> Vec<OverlapNode> {
        let columns = self.columns(&rule(counts[0]));
        let along = rule(counts[1]);
        let mut nodes = Vec::with_capacity(counts[0] * counts[1]);
        for (i, t) in columns.t.iter().enumerate() {
            let [low, high] = [columns.ends[0][i], columns.ends[1][i]];
            nodes.extend(along.iter().map(|(u, share)| {
                let v = low + u * (high - low);
                let at = if self.axis == 0 { [*t, v] } else { [v, *t] };
                OverlapNode { at, weight: columns.weight[i] * share * (high - low) }
            }));
        }
        nodes
    }

    /// The strip between two edges; two halves if either end has a root.
    fn with_roots(axis: usize, range: [f64; 2], edges: [MovedChain<'_>; 2]) -> Vec<Strip<'_>> {
        let root = |end: usize| {
            let sense = if end == 0 { -1.0 } else { 1.0 };
            let roots = edges.iter().filter_map(|edge| edge.root_beyond(range[end], sense));
            // One that is far away, as beyond a straight edge, leaves the strip smooth.
            let near = roots.filter(|beyond| *beyond < range[1] - range[0]);
            near.min_by(f64::total_cmp).map(|beyond| (end, beyond))
        };
        let strip = |range, root| Strip { axis, range, edges, root };
        match (root(0), root(1)) {
            (Some(first), Some(second)) => {
                let middle = 0.5 * (range[0] + range[1]);
                let halves = [[range[0], middle], [middle, range[1]]];
                vec![strip(halves[0], Some(first)), strip(halves[1], Some(second))]
            }
            (first, second) => vec![strip(range, first.or(second))],
        }
    }

    /// The columns at shares of the strip from 0 to 1, each with its weight.
    pub(super) fn columns(&self, shares: &[(f64, f64)]) -> Columns {
        let list = || Vec::with_capacity(shares.len());
        let mut columns = Columns { t: list(), weight: list(), ends: [list(), list()] };
        for (u, share) in shares {
            let (t, slope) = self.place(*u);
            columns.t.push(t);
            columns.weight.push(slope * share);
            let [low, high] = self.edges.map(|edge| edge.value(t));
            columns.ends[0].push(low);
            columns.ends[1].push(high.max(low));
        }
        columns
    }

    /// The value of t at a share of the strip, and its derivative by that: even in the square root of the
    /// distance from a root, in which edges are smooth.
    fn place(&self, u: f64) -> (f64, f64) {
        let [from, to] = self.range;
        let Some((end, beyond)) = self.root else { return (from + u * (to - from), to - from) };
        let [near, far] = [beyond, beyond + to - from].map(f64::sqrt);
        let share = if end == 0 { u } else { 1.0 - u };
        let root = near + share * (far - near);
        let distance = (root * root - beyond).clamp(0.0, to - from);
        let t = if end == 0 { from + distance } else { to - distance };
        (t, 2.0 * root * (far - near))
    }
}

impl MovedChain<'_> {
    fn range(&self, coordinate: usize) -> [f64; 2] {
        self.chain.map_or([0.0; 2], |c| c.range[coordinate].map(|v| v + self.by[coordinate]))
    }

    fn covers(&self, t: f64) -> bool {
        let [from, to] = self.range(0);
        from < t && t < to
    }

    fn value(&self, t: f64) -> f64 {
        self.chain.map_or(0.0, |chain| chain.value(t - self.by[0]) + self.by[1])
    }

    fn root_beyond(&self, t: f64, sense: f64) -> Option<f64> {
        self.chain?.root_beyond(t - self.by[0], sense)
    }
}

/// The least and the largest t of a pupil.
fn extent(pupil: &[MovedChain<'_>]) -> [f64; 2] {
    let ranges = pupil.iter().map(|chain| chain.range(0));
    ranges.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], [c, d]| [a.min(c), b.max(d)])
}

/// The values of t, ascending, between which columns of the common part run between the same chains.
fn breaks(pupils: &[Vec<MovedChain<'_>>; 2], size: f64, half: OverlapHalf) -> Vec<f64> {
    let [[a, b], [c, d]] = [extent(&pupils[0]), extent(&pupils[1])];
    let from = if half == OverlapHalf::Across { a.max(c).max(0.0) } else { a.max(c) };
    let to = b.min(d);
    let mut found: Vec<f64> = pupils.iter().flatten().flat_map(|chain| chain.range(0)).collect();
    for first in &pupils[0] {
        for second in &pupils[1] {
            crossings([first, second], [from, to], size, half, &mut found);
        }
    }
    found.extend([from, to]);
    found.retain(|t| (from..=to).contains(t));
    found.sort_by(f64::total_cmp);
    found
}

/// Adds the values of t at which two chains cross within a range, in the half that counts.
fn crossings(
    pair: [&MovedChain<'_>; 2],
    [first, last]: [f64; 2],
    size: f64,
    half: OverlapHalf,
    found: &mut Vec<f64>,
) {
    let [[a, b], [c, d]] = pair.map(|chain| chain.range(0));
    let (from, to) = (a.max(c).max(first), b.min(d).min(last));
    let [[a, b], [c, d]] = pair.map(|chain| chain.range(1));
    // Chains that at most touch do not cross.
    let least = if half == OverlapHalf::Along { 0.0 } else { f64::NEG_INFINITY };
    let above = |low: f64| low.max(least) + COINCIDENT * size;
    let touch = b <= above(c) || d <= above(a);
    if !(to - from > ROUNDING * size) || touch {
        return;
    }
    let difference = |t: f64| {
        let off = pair[0].value(t) - pair[1].value(t);
        if off.abs() < COINCIDENT * size { 0.0 } else { off }
    };
    // Closer at the ends, where chains are steep.
    let place = |i: usize| {
        let u = i as f64 / COMPARED as f64;
        from + (to - from) * u * u * (3.0 - 2.0 * u)
    };
    let compared: [[f64; 2]; COMPARED + 1] =
        std::array::from_fn(|i| [place(i), difference(place(i))]);
    let mut samples = compared.to_vec();
    samples.extend(compared.windows(3).filter_map(|near| dip(near, &difference)));
    if samples.len() > compared.len() {
        samples.sort_by(|a, b| a[0].total_cmp(&b[0]));
    }
    for pair in samples.windows(2).filter(|pair| pair[0][1] * pair[1][1] < 0.0) {
        let ([a, fa], [b, fb]) = (pair[0], pair[1]);
        found.push(crossing(&difference, [a, b], [fa, fb]));
    }
    for near in samples.windows(3).filter(|near| near[1][1] == 0.0 && near[0][1] * near[2][1] < 0.0)
    {
        found.push(near[1][0]);
    }
}

/// A place between three others of the same sign where a difference has another one, at the vertex of the
/// parabola through them: two chains that touch nearly cross twice.
fn dip(near: &[[f64; 2]], difference: &impl Fn(f64) -> f64) -> Option<[f64; 2]> {
    let [[a, fa], [b, fb], [c, fc]] = [near[0], near[1], near[2]];
    let is_least = fb.abs() <= fa.abs().min(fc.abs());
    if !(fa * fb > 0.0 && fb * fc > 0.0 && is_least) {
        return None;
    }
    let (left, right) = ((fb - fa) / (b - a), (fc - fb) / (c - b));
    let bend = (right - left) / (c - a);
    let vertex = 0.5 * (a + b) - 0.5 * left / bend;
    let value = difference(vertex);
    (vertex > a && vertex < c && value * fb < 0.0).then_some([vertex, value])
}

/// The place between two others at which a difference changes its sign (Anderson and Björck, BIT 13,
/// 1973).
fn crossing(
    difference: &impl Fn(f64) -> f64,
    [mut a, mut b]: [f64; 2],
    [mut fa, mut fb]: [f64; 2],
) -> f64 {
    for _ in 0..60 {
        let t = b - fb * (b - a) / (fb - fa);
        let f = difference(t);
        if f == 0.0 || (t - a).abs().min((t - b).abs()) <= f64::EPSILON * (b - a).abs() {
            return t;
        }
        if f * fb < 0.0 {
            (a, fa) = (b, fb);
        } else {
            let factor = 1.0 - f / fb;
            fa *= if factor > 0.0 { factor } else { 0.5 };
        }
        (b, fb) = (t, f);
    }
    b
}

/// The strips between two values of t.
fn strips<'a>(
    axis: usize,
    range: [f64; 2],
    pupils: &[Vec<MovedChain<'a>>; 2],
    half: OverlapHalf,
) -> Vec<Strip<'a>> {
    let middle = 0.5 * (range[0] + range[1]);
    let columns = pupils.each_ref().map(|pupil| {
        let crossed = pupil.iter().filter(|chain| chain.covers(middle));
        let mut met: Vec<(f64, MovedChain<'a>)> = crossed.map(|c| (c.value(middle), *c)).collect();
        met.sort_by(|a, b| a.0.total_cmp(&b.0));
        met
    });
    let mut found = Vec::new();
    for first in columns[0].chunks_exact(2) {
        for second in columns[1].chunks_exact(2) {
            let mut low = if first[0].0 > second[0].0 { first[0] } else { second[0] };
            let high = if first[1].0 < second[1].0 { first[1] } else { second[1] };
            if half == OverlapHalf::Along && low.0 < 0.0 {
                low = (0.0, MovedChain { chain: None, by: [0.0; 2] });
            }
            if low.0 < high.0 {
                found.extend(Strip::with_roots(axis, range, [low.1, high.1]));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn area(curves: [&PupilCurve; 2], shift: [f64; 2], axis: usize, half: OverlapHalf) -> f64 {
        let chains = curves.map(|curve| curve.chains(axis));
        let strips = Strip::of_overlap(axis, [&chains[0], &chains[1]], shift, half);
        strips.iter().flat_map(|strip| strip.nodes([24, 2])).map(|node| node.weight).sum()
    }

    /// Two kites moved apart across their axis by a part of their half width: their edges cross on that axis,
    /// and their common part is a smaller kite.
    #[test]
    fn edges_that_cross_on_the_plane_of_symmetry_divide_the_common_part() {
        let kite = PupilCurve::polygon(&[[0.0, 0.1], [0.1, 0.03], [0.0, -0.1], [-0.1, 0.03]]);
        for part in [0.1, 0.37, 0.8] {
            let exact = 0.02 * (1.0 - part) * (1.0 - part);
            for axis in [0, 1] {
                let found = area([&kite, &kite], [0.1 * part, 0.0], axis, OverlapHalf::None);
                assert!((found / exact - 1.0).abs() < 1e-11, "{part}: {found} {exact}");
            }
            let found = area([&kite, &kite], [0.1 * part, 0.0], 0, OverlapHalf::Across);
            assert!((2.0 * found / exact - 1.0).abs() < 1e-11, "{part}: {found} {exact}");
        }
    }

    /// The lens between two circles, whatever the direction of the shift against the columns.
    #[test]
    fn the_common_part_of_two_circles_is_a_lens() {
        let circle = PupilCurve::circle([0.02, -0.01], 0.25);
        for part in [0.0, 1e-6, 0.01, 0.3, 0.9, 0.999] {
            let half = f64::acos(part);
            let exact = 2.0 * 0.0625 * (half - part * half.sin());
            for shift in [[part, 0.0], [0.0, -part], [-0.6 * part, 0.8 * part]] {
                for axis in [0, 1] {
                    let shift = shift.map(|v| 0.25 * v);
                    let found = area([&circle, &circle], shift, axis, OverlapHalf::None);
                    // Cubics are wrong by 6e-11 of the radius, of a sliver by more of its width.
                    let allowed = 1e-9 + 1e-10 / (1.0 - part);
                    assert!(
                        (found / exact - 1.0).abs() < allowed,
                        "{shift:?} {axis} {found} {exact}"
                    );
                }
            }
        }
        let apart = area([&circle, &circle], [0.25, 0.0], 0, OverlapHalf::None);
        assert_eq!(apart, 0.0);
    }

    /// Coarse steps along an edge are wrong by 1.5e-8 of the radius, far below the tolerances that they are for.
    #[test]
    fn coarse_steps_of_an_edge_leave_little() {
        let half = |from: f64| {
            let point = |t: f64| {
                let (sin, cos) = (PI * (from + t)).sin_cos();
                [0.02 + 0.25 * sin, 0.25 * cos - 0.01]
            };
            (crate::math::quadrature::chebyshev_points(40).map(point).collect(), false)
        };
        let arcs: [(Vec<[f64; 2]>, bool); 2] = [half(0.0), half(1.0)];
        for (steps, allowed) in [(ArcSteps::Coarse, 1e-7), (ArcSteps::Fine, 1e-9)] {
            let circle = PupilCurve::in_steps(&arcs, steps);
            for axis in [0, 1] {
                let found = area([&circle, &circle], [0.0; 2], axis, OverlapHalf::None);
                assert!((found / (PI * 0.0625) - 1.0).abs() < allowed, "{steps:?} {found}");
            }
        }
    }

    /// Two circles of different size that hardly cross: what one cuts off from the other is a sliver.
    #[test]
    fn circles_that_nearly_touch_cross_twice() {
        let [small, large] = [0.2, 0.25].map(|radius| PupilCurve::circle([0.0; 2], radius));
        for beyond in [1e-2, 1e-4, 1e-6] {
            let apart = 0.05 + 0.2 * beyond;
            let angle = |own: f64, other: f64| {
                let cos = (apart * apart + own * own - other * other) / (2.0 * apart * own);
                2.0 * cos.acos()
            };
            let sector = |radius: f64, angle: f64| 0.5 * radius * radius * (angle - angle.sin());
            let exact = sector(0.2, angle(0.2, 0.25)) + sector(0.25, angle(0.25, 0.2));
            for axis in [0, 1] {
                let shift = [0.0, 0.5 * apart];
                let found = area([&small, &large], shift, axis, OverlapHalf::None);
                assert!((found / exact - 1.0).abs() < 1e-9, "{beyond} {axis}: {found} {exact}");
            }
        }
    }

    /// A crescent, which no point sees whole, and a square whose sides coincide with themselves.
    #[test]
    fn pupils_of_any_shape_have_an_area() {
        let arc = |radius: f64, y: f64, from: f64, to: f64| {
            let point = |j: usize| {
                let t = (0.5 * PI * j as f64 / 39.0).sin().powi(2);
                let (sin, cos) = (from + t * (to - from)).sin_cos();
                [radius * sin, y + radius * cos]
            };
            ((0..40).map(point).collect::<Vec<_>>(), true)
        };
        // Half a disc less the smaller half disc on the same diameter.
        let side = |a: f64, b: f64| (vec![[a, 0.0], [b, 0.0]], true);
        let arcs = [arc(0.2, 0.0, -PI / 2.0, PI / 2.0), side(0.2, 0.1)];
        let back = [arc(0.1, 0.0, PI / 2.0, -PI / 2.0), side(-0.1, -0.2)];
        let crescent = PupilCurve::from_arcs(&[&arcs[..], &back[..]].concat());
        let square = PupilCurve::polygon(&[[-0.1, -0.1], [-0.1, 0.1], [0.1, 0.1], [0.1, -0.1]]);
        for axis in [0, 1] {
            let found = area([&crescent, &crescent], [0.0; 2], axis, OverlapHalf::None);
            assert!((found / (0.015 * PI) - 1.0).abs() < 1e-9, "{axis} {found}");
            let found = area([&square, &square], [0.03, 0.0], axis, OverlapHalf::None);
            assert!((found / 0.028 - 1.0).abs() < 1e-11, "{axis} {found}");
        }
    }
}
