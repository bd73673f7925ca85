//! The boundary of a pupil: the arcs of its edge, each made by one limit.
//!
//! About a point inside, the edge of the pupil is a function `R(ψ)` of azimuth, both in a frame
//! that is stretched with the pupil so that a narrow sliver looks round. Where the limit changes,
//! `R` has a corner, and there the azimuths are split into arcs.

use crate::trace::RayLimit;
use std::f64::consts::PI;

/// A limit of the pupil.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum PupilLimit {
    /// The disc of the entrance pupil, or of the stop if every ray is aimed at it.
    Disc,
    /// A surface, given by its index, that clips, is missed or reflects totally.
    Surface(usize, RayLimit),
    /// No ray was found that crosses the stop there.
    Unaimed,
}

impl PupilLimit {
    /// True if the limit ends a shadow, beyond which there may be light again.
    pub fn is_shadow(self) -> bool {
        matches!(self, Self::Surface(_, limit) if limit.is_shadow())
    }

    /// True if a cosine vanishes at the limit, so that the ray direction varies without bound
    /// towards it.
    pub fn is_grazing(self) -> bool {
        matches!(self, Self::Surface(_, RayLimit::Miss | RayLimit::TotalReflection))
    }
}

/// Polar coordinates about a point of the pupil, stretched with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PolarFrame {
    /// The centre, in pupil coordinates.
    pub center: [f64; 2],
    /// The unit vectors of the frame along its x and y, in pupil coordinates.
    pub axes: [[f64; 2]; 2],
}

impl PolarFrame {
    /// The frame of the pupil coordinates themselves.
    pub const UNIT: Self = Self { center: [0.0; 2], axes: [[1.0, 0.0], [0.0, 1.0]] };

    /// The derivative of the pupil coordinates by the radius, at an azimuth measured from +y
    /// towards +x.
    pub fn direction(&self, azimuth: f64) -> [f64; 2] {
        let (sin, cos) = azimuth.sin_cos();
        [0, 1].map(|i| sin * self.axes[0][i] + cos * self.axes[1][i])
    }

    /// The pupil point at an azimuth and a radius.
    pub fn point(&self, azimuth: f64, radius: f64) -> [f64; 2] {
        let direction = self.direction(azimuth);
        [0, 1].map(|i| self.center[i] + radius * direction[i])
    }

    /// The area of the frame's unit square, in pupil coordinates.
    pub fn area(&self) -> f64 {
        let [[a, b], [c, d]] = self.axes;
        (a * d - b * c).abs()
    }

    /// The azimuth from 0 to 2π and the radius of a pupil point.
    pub(super) fn polar(&self, p: [f64; 2]) -> (f64, f64) {
        let [[a, b], [c, d]] = self.axes;
        let (x, y) = (p[0] - self.center[0], p[1] - self.center[1]);
        let determinant = a * d - b * c;
        let (u, v) = ((d * x - c * y) / determinant, (a * y - b * x) / determinant);
        (u.atan2(v).rem_euclid(2.0 * PI), u.hypot(v))
    }
}

/// The edge of the pupil along one radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgePoint {
    /// The distance from the centre, in the frame.
    pub radius: f64,
    /// The limit there.
    pub limit: PupilLimit,
}

/// A part of the edge that one limit makes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoundaryArc {
    /// The azimuth where it begins, in radians from the frame's +y towards its +x.
    pub from: f64,
    /// The azimuth where it ends.
    pub to: f64,
    /// The limit along it.
    pub limit: PupilLimit,
}

/// The edge of a pupil that is star-shaped about a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Boundary {
    /// The frame of its azimuths and radii.
    pub frame: PolarFrame,
    /// The arcs in order of azimuth; over a half turn if the pupil is its own mirror image.
    pub arcs: Vec<BoundaryArc>,
    /// The edge at the sampled azimuths.
    pub(super) samples: Vec<(f64, EdgePoint)>,
    /// The limits at which a cosine vanishes, on the edge or not far behind it.
    pub(super) grazing_limits: Vec<PupilLimit>,
    /// The number of rays traced to find it.
    pub rays: usize,
}

/// The factor on the largest sampled radius that covers those in between.
const COVER: f64 = 1.02;

impl Boundary {
    /// The frame scaled so that its unit disc holds all of the pupil.
    pub(super) fn enclosing_disc(&self) -> PolarFrame {
        let reach = self.samples.iter().map(|(_, edge)| edge.radius).fold(0.0, f64::max);
        let grown = COVER * reach;
        PolarFrame { axes: self.frame.axes.map(|axis| axis.map(|v| v * grown)), ..self.frame }
    }

    /// A frame with the same axes whose square from −1 to 1 holds all of the pupil.
    pub(in crate::pupil) fn enclosing_square(&self, mirrored: bool) -> PolarFrame {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for (azimuth, edge) in &self.samples {
            let (sin, cos) = azimuth.sin_cos();
            let p = [sin * edge.radius, cos * edge.radius];
            low = [0, 1].map(|i| low[i].min(p[i]));
            high = [0, 1].map(|i| high[i].max(p[i]));
        }
        if mirrored {
            low[0] = -high[0];
        }
        let middle = [0, 1].map(|i| 0.5 * (low[i] + high[i]));
        let half = [0, 1].map(|i| 0.5 * COVER * (high[i] - low[i]));
        let [a, b] = self.frame.axes;
        let center = [0, 1].map(|k| self.frame.center[k] + middle[0] * a[k] + middle[1] * b[k]);
        PolarFrame { center, axes: [a.map(|v| half[0] * v), b.map(|v| half[1] * v)] }
    }

    /// The radius at an azimuth, interpolated between samples.
    pub(super) fn radius_guess(&self, azimuth: f64) -> f64 {
        let end = self.samples.last().map_or(1.0, |s| s.0);
        let azimuth = if azimuth > end { azimuth - end } else { azimuth };
        let after = self.samples.partition_point(|(a, _)| *a < azimuth);
        let known = |i: usize| self.samples[i.min(self.samples.len() - 1)];
        let ((a, low), (b, high)) = (known(after.saturating_sub(1)), known(after));
        let share = if b > a { (azimuth - a) / (b - a) } else { 0.0 };
        low.radius + share * (high.radius - low.radius)
    }
}
