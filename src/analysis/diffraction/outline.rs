//! The closed curve around a pupil, in direction cosines.

use crate::math::quadrature::{chebyshev_points, chebyshev_value};

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

/// The segments of a smooth arc: a cubic of half a circle is wrong by 6e-11 of the radius.
const SEGMENTS: usize = 256;

impl PupilCurve {
    /// The curve of arcs given at their Chebyshev points, ends included; each begins where the one
    /// before ends, with true at a corner.
    pub fn from_arcs(arcs: &[(Vec<[f64; 2]>, bool)]) -> Self {
        let mut curve = Self {
            segments: arcs.iter().flat_map(|(nodes, corner)| arc(nodes, *corner)).collect(),
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

    /// A polygon with these corners.
    pub fn polygon(corners: &[[f64; 2]]) -> Self {
        let side = |i: usize| (vec![corners[i], corners[(i + 1) % corners.len()]], true);
        Self::from_arcs(&(0..corners.len()).map(side).collect::<Vec<_>>())
    }

    /// Points along the curve.
    pub(super) fn points(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        self.segments.iter().map(|segment| segment.ends[0])
    }

    /// The area inside.
    pub(super) fn area(&self) -> f64 {
        0.5 * self.signed_area().abs()
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

impl Segment {
    /// The point at a parameter from 0 to 1.
    #[inline(always)]
    pub(super) fn at(&self, t: f64) -> [f64; 2] {
        let s = 1.0 - t;
        let (a, b) = (s * s * (1.0 + 2.0 * t), t * t * (1.0 + 2.0 * s));
        let (c, d) = (t * s * s, -t * t * s);
        [0, 1].map(|k| {
            a * self.ends[0][k]
                + b * self.ends[1][k]
                + c * self.slopes[0][k]
                + d * self.slopes[1][k]
        })
    }

    /// The segment with its points moved and then mapped by a matrix.
    pub(super) fn mapped(&self, by: [f64; 2], matrix: [[f64; 2]; 2]) -> Self {
        let turn = |v: [f64; 2]| matrix.map(|row| row[0] * v[0] + row[1] * v[1]);
        Self {
            ends: self.ends.map(|p| turn([p[0] + by[0], p[1] + by[1]])),
            slopes: self.slopes.map(turn),
            ..*self
        }
    }
}

/// The segments of an arc.
fn arc(nodes: &[[f64; 2]], corner: bool) -> Vec<Segment> {
    let steps = if nodes.len() == 2 { 1 } else { SEGMENTS };
    let axes = [0, 1].map(|k| nodes.iter().map(|node| node[k]).collect::<Vec<_>>());
    let slopes = axes.each_ref().map(|axis| derivative(axis));
    let at = |i: usize| {
        let t = i as f64 / steps as f64;
        let point = axes.each_ref().map(|axis| chebyshev_value(axis, t));
        (point, slopes.each_ref().map(|slope| chebyshev_value(slope, t) / steps as f64))
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
fn derivative(values: &[f64]) -> Vec<f64> {
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
