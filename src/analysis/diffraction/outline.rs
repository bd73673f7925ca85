//! The closed curve around a pupil, in direction cosines.

use crate::math::quadrature::{chebyshev_points, chebyshev_weights};

/// A closed curve of smooth arcs in direction cosines, without crossings.
#[derive(Debug, Clone)]
pub struct PupilCurve {
    /// Short cubics, each beginning where the one before ends; azimuth from +y towards +x grows along
    /// them.
    pub(super) segments: Vec<Segment>,
}

/// A short part of a curve: the cubic with these ends and derivatives by a parameter from 0 to 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segment {
    pub(super) ends: [[f64; 2]; 2],
    slopes: [[f64; 2]; 2],
    /// True if another arc begins here at a corner.
    pub(super) begins_at_corner: bool,
}

/// The number of cubics that stand for each smooth arc of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ArcSteps {
    /// Those of half a circle are wrong by 1.5e-8 of the radius.
    Coarse,
    /// Those of half a circle are wrong by 6e-11 of the radius.
    Fine,
}

impl ArcSteps {
    fn count(self) -> usize {
        match self {
            Self::Coarse => 64,
            Self::Fine => 256,
        }
    }
}

impl PupilCurve {
    /// The curve of arcs given at their Chebyshev points, ends included; each begins where the one
    /// before ends, with true at a corner.
    pub fn from_arcs(arcs: &[(Vec<[f64; 2]>, bool)]) -> Self {
        Self::in_steps(arcs, ArcSteps::Fine)
    }

    /// The same with the number of cubics of an arc.
    pub(super) fn in_steps(arcs: &[(Vec<[f64; 2]>, bool)], steps: ArcSteps) -> Self {
        let mut curve = Self {
            segments: arcs.iter().flat_map(|(nodes, corner)| arc(nodes, *corner, steps)).collect(),
        };
        if curve.signed_area() < 0.0 {
            curve.reverse();
        }
        curve
    }

    /// A circle.
    pub fn circle(center: [f64; 2], radius: f64) -> Self {
        let half = |from: f64| {
            let point = |t: f64| {
                let (sin, cos) = (std::f64::consts::PI * (from + t)).sin_cos();
                [center[0] + radius * sin, center[1] + radius * cos]
            };
            (chebyshev_points(40).map(point).collect(), false)
        };
        Self::from_arcs(&[half(0.0), half(1.0)])
    }

    /// The edge of the common part of two discs, each given by its centre and its radius; `None` if they
    /// are apart or one contains the other.
    pub fn common_part_of_discs(discs: [[f64; 3]; 2]) -> Option<Self> {
        let arc = |own: [f64; 3], other: [f64; 3]| {
            let [x, y] = [other[0] - own[0], other[1] - own[1]];
            let distance = x.hypot(y);
            let half = (distance * distance + own[2] * own[2] - other[2] * other[2])
                / (2.0 * distance * own[2]);
            if !(half.abs() < 1.0) {
                return None;
            }
            let (middle, half) = (x.atan2(y), half.acos());
            let point = |t: f64| {
                let (sin, cos) = (middle + half * (2.0 * t - 1.0)).sin_cos();
                [own[0] + own[2] * sin, own[1] + own[2] * cos]
            };
            Some((chebyshev_points(40).map(point).collect(), true))
        };
        let [a, b] = discs;
        Some(Self::from_arcs(&[arc(a, b)?, arc(b, a)?]))
    }

    /// A regular polygon about the origin, by the radius and the angle of its first corner, in radians from +x to +y.
    pub fn regular_polygon(sides: usize, radius: f64, first: f64) -> Self {
        let corner = |i: usize| {
            let (sin, cos) = (first + std::f64::consts::TAU * i as f64 / sides as f64).sin_cos();
            [radius * cos, radius * sin]
        };
        Self::polygon(&(0..sides).map(corner).collect::<Vec<_>>())
    }

    /// A polygon with these corners.
    pub fn polygon(corners: &[[f64; 2]]) -> Self {
        let side = |i: usize| (vec![corners[i], corners[(i + 1) % corners.len()]], true);
        Self::from_arcs(&(0..corners.len()).map(side).collect::<Vec<_>>())
    }

    /// Points along the curve.
    pub(super) fn points(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        self.segments.iter().map(|segment| segment.ends[0])
    }

    /// Twice the area inside, positive if azimuth from +y towards +x grows along the curve.
    fn signed_area(&self) -> f64 {
        self.segments.iter().map(|Segment { ends: [a, b], .. }| a[1] * b[0] - a[0] * b[1]).sum()
    }

    fn reverse(&mut self) {
        let corners: Vec<bool> = self.segments.iter().map(|s| s.begins_at_corner).collect();
        let count = self.segments.len();
        let turned = |(i, s): (usize, &Segment)| Segment {
            ends: [s.ends[1], s.ends[0]],
            slopes: [s.slopes[1], s.slopes[0]].map(|slope| slope.map(|v| -v)),
            begins_at_corner: corners[(i + 1) % count],
        };
        self.segments = self.segments.iter().enumerate().rev().map(turned).collect();
    }
}

/// A part of a curve along which one coordinate t grows, so that the other one, v, is a function of it.
#[derive(Debug, Clone)]
pub(super) struct Chain {
    cubics: Vec<Cubic>,
    /// The largest t of each cubic.
    ends: Vec<f64>,
    /// The first cubic that reaches into each of some equal parts of the range of t, and how many of these there
    /// are to a unit of t.
    firsts: Vec<u32>,
    parts: f64,
    /// The least and the largest of either coordinate, t first.
    pub(super) range: [[f64; 2]; 2],
}

/// A cubic in both coordinates, by the powers of a parameter, and the parameters between which t grows.
#[derive(Debug, Clone, Copy)]
struct Cubic {
    powers: [[f64; 4]; 2],
    between: [f64; 2],
    /// The values of t there.
    ends: [f64; 2],
}

impl PupilCurve {
    /// The parts of the curve along which the coordinate of an axis, x (0) or y (1), grows or falls.
    pub(super) fn chains(&self, axis: usize) -> Vec<Chain> {
        // Each cubic with the sense of t along the curve; none where t stands still.
        let mut parts: Vec<Option<(Cubic, bool, bool)>> = Vec::new();
        for segment in &self.segments {
            let mut corner = segment.begins_at_corner;
            for cubic in segment.growing(axis) {
                let [from, to] = cubic.ends;
                parts.push((from != to).then_some((cubic, to > from, corner)));
                corner = false;
            }
        }
        let begins = |i: usize| {
            let before = parts[(i + parts.len() - 1) % parts.len()];
            let (before, here) = (before.map(|p| p.1), parts[i].map(|p| (p.1, p.2)));
            here.is_some_and(|(sense, corner)| corner || before != Some(sense))
        };
        let firsts: Vec<usize> = (0..parts.len()).filter(|i| begins(*i)).collect();
        let chain = |(k, first): (usize, &usize)| {
            let next = firsts[(k + 1) % firsts.len()];
            let count = (next + parts.len() - first - 1) % parts.len() + 1;
            let members = (0..count).map_while(|i| parts[(first + i) % parts.len()]);
            let mut cubics: Vec<Cubic> = members.map(|(cubic, ..)| cubic).collect();
            if cubics[0].ends[0] > cubics[0].ends[1] {
                cubics.reverse();
                cubics.iter_mut().for_each(Cubic::reverse);
            }
            Chain::new(cubics)
        };
        firsts.iter().enumerate().map(chain).collect()
    }
}

impl Segment {
    /// The parts of the segment along which the coordinate of an axis grows or falls.
    fn growing(&self, axis: usize) -> impl Iterator<Item = Cubic> {
        let powers = [axis, 1 - axis].map(|k| {
            let ([a, b], [c, d]) = (self.ends.map(|p| p[k]), self.slopes.map(|p| p[k]));
            [a, c, 3.0 * (b - a) - 2.0 * c - d, 2.0 * (a - b) + c + d]
        });
        let [_, b, c, d] = powers[0];
        // The zeros of b + 2 c s + 3 d s², without cancellation; one that is none lies at the end.
        let q = -(c + c.signum() * (c * c - 3.0 * b * d).max(0.0).sqrt());
        let is_turn = c * c > 3.0 * b * d;
        let turn = |s: f64| if is_turn && s > 0.0 && s < 1.0 { s } else { 1.0 };
        let (first, second) = (turn(q / (3.0 * d)), turn(b / q));
        let ends = [0.0, first.min(second), first.max(second), 1.0];
        let part = move |i: usize| {
            let between = [ends[i], ends[i + 1]];
            let cubic = Cubic { powers, between, ends: [0.0; 2] };
            (between[1] > between[0])
                .then(|| Cubic { ends: between.map(|s| cubic.at(0, s)[0]), ..cubic })
        };
        (0..3).filter_map(part)
    }
}

/// An edge rises more steeply than this towards a square root.
const STEEP: f64 = 1.5;
/// The largest number of steps that find the parameter of a cubic at a value of t, and the last one: the error
/// behind it is of the order of its square, or where the curve turns back of its size.
const STEPS: usize = 40;
const LAST_STEP: f64 = 1e-12;

impl Cubic {
    /// A coordinate, t (0) or v (1), and its derivative by the parameter.
    #[inline(always)]
    fn at(&self, coordinate: usize, s: f64) -> [f64; 2] {
        let [a, b, c, d] = self.powers[coordinate];
        [a + s * (b + s * (c + s * d)), b + s * (2.0 * c + s * 3.0 * d)]
    }

    fn reverse(&mut self) {
        self.between.reverse();
        self.ends.reverse();
    }

    /// The parameter at a value of t, by Newton's method between ever closer bounds.
    fn parameter(&self, t: f64) -> f64 {
        let [mut low, mut high] = self.between;
        let [first, last] = self.ends;
        let share = ((t - first) / (last - first)).clamp(0.0, 1.0);
        let mut s = low + share * (high - low);
        for _ in 0..STEPS {
            let [value, slope] = self.at(0, s);
            let off = value - t;
            if off == 0.0 {
                return s;
            }
            if off < 0.0 {
                low = s;
            } else {
                high = s;
            }
            let next = s - off / slope;
            // Before the bounds: rounding may put the last step beyond one of them.
            if (next - s).abs() <= LAST_STEP {
                return next;
            }
            let is_between = (next - low) * (next - high) < 0.0;
            s = if is_between { next } else { 0.5 * (low + high) };
        }
        s
    }
}

impl Chain {
    fn new(cubics: Vec<Cubic>) -> Self {
        let (first, last) = (cubics[0], cubics[cubics.len() - 1]);
        let values = || cubics.iter().flat_map(|c| c.between.map(|s| c.at(1, s)[0]));
        let low = values().fold(f64::INFINITY, f64::min);
        let high = values().fold(f64::NEG_INFINITY, f64::max);
        let ends: Vec<f64> = cubics.iter().map(|cubic| cubic.ends[1]).collect();
        let (from, to) = (first.ends[0], last.ends[1]);
        let count = cubics.len();
        let begin = |i: usize| from + (to - from) * i as f64 / count as f64;
        let first = |i: usize| ends.partition_point(|end| *end < begin(i)) as u32;
        let firsts = (0..count).map(first).collect();
        let parts = count as f64 / (to - from);
        Self { range: [[from, to], [low, high]], cubics, ends, firsts, parts }
    }

    /// The cubic at a value of t, and its parameter there.
    fn find(&self, t: f64) -> (&Cubic, f64) {
        // Where the parts of t are no numbers, the first one.
        let part = ((t - self.range[0][0]) * self.parts) as usize;
        let mut at = self.firsts[part.min(self.firsts.len() - 1)] as usize;
        while at + 1 < self.ends.len() && self.ends[at] < t {
            at += 1;
        }
        let cubic = &self.cubics[at.min(self.cubics.len() - 1)];
        (cubic, cubic.parameter(t))
    }

    /// True if it runs below a point, t first.
    pub(super) fn is_below(&self, [t, v]: [f64; 2]) -> bool {
        let [[from, to], [low, high]] = self.range;
        // Most points are told by the range.
        from <= t && t < to && v > low && (v > high || self.value(t) < v)
    }

    /// The value of v at a value of t.
    pub(super) fn value(&self, t: f64) -> f64 {
        let (cubic, s) = self.find(t);
        cubic.at(1, s)[0]
    }

    /// The distance in t, in the sense of 1 or −1, at which v has the end of a square root, as it has where the
    /// curve turns back; `None` if v is not steep, or grows less so. The slope of `c √x` over its
    /// curvature is `−2x`.
    pub(super) fn root_beyond(&self, t: f64, sense: f64) -> Option<f64> {
        let (cubic, s) = self.find(t);
        let [[_, dt], [_, dv]] = [0, 1].map(|k| cubic.at(k, s));
        let [ddt, ddv] = cubic.powers.map(|[_, _, c, d]| 2.0 * c + 6.0 * d * s);
        let distance = 0.5 * sense * dv * dt * dt / (ddv * dt - dv * ddt);
        (dv.abs() > STEEP * dt.abs() && distance >= 0.0).then_some(distance)
    }
}

/// The segments of an arc.
fn arc(nodes: &[[f64; 2]], corner: bool, steps: ArcSteps) -> Vec<Segment> {
    let steps = if nodes.len() == 2 { 1 } else { steps.count() };
    let axes = [0, 1].map(|k| nodes.iter().map(|node| node[k]).collect::<Vec<_>>());
    let slopes = axes.each_ref().map(|axis| derivative(axis));
    let places: Vec<f64> = chebyshev_points(nodes.len()).collect();
    let at = |i: usize| {
        let shares = chebyshev_weights(&places, i as f64 / steps as f64);
        let value =
            |values: &Vec<f64>| -> f64 { values.iter().zip(&shares).map(|(v, w)| v * w).sum() };
        (axes.each_ref().map(value), slopes.each_ref().map(|slope| value(slope) / steps as f64))
    };
    let points: Vec<_> = (0..=steps).map(at).collect();
    let pairs = points.windows(2).enumerate();
    let segments = pairs.map(|(i, pair)| Segment {
        ends: [pair[0].0, pair[1].0],
        slopes: [pair[0].1, pair[1].1],
        begins_at_corner: corner && i == 0,
    });
    segments.collect()
}

/// The derivatives at the Chebyshev points from 0 to 1 of the polynomial through values there
/// (Trefethen, *Spectral Methods in MATLAB*, 2000, chapter 6).
pub(super) fn derivative(values: &[f64]) -> Vec<f64> {
    let nodes: Vec<f64> = chebyshev_points(values.len()).collect();
    let last = values.len() - 1;
    let end = |i: usize| {
        let size = if i == 0 || i == last { 2.0 } else { 1.0 };
        if i.is_multiple_of(2) { size } else { -size }
    };
    let at = |i: usize| {
        let others = (0..=last).filter(|j| *j != i);
        // The diagonal is minus the sum of the row: a constant has no derivative.
        others
            .map(|j| end(i) / end(j) / (nodes[i] - nodes[j]) * (values[j] - values[i]))
            .sum::<f64>()
    };
    (0..=last).map(at).collect()
}
