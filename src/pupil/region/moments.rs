//! Area, centroid and spread of the light of a pupil.

use super::kind::Region;
use super::nodes::Nodes;
use super::quadrature::TracedNodes;
use crate::trace::{ImagePoints, TraceSink};

/// Integrals over the rays of a pupil, in the measure of [`Launch::area`](crate::pupil::Launch::area).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PupilMoments {
    /// `A = ∫ dw`, in mm² of the first vertex plane.
    pub area: f64,
    /// `∫ p dw / A`, in mm in the image plane; zero if there is no light.
    pub centroid: [f64; 2],
    /// `∫ |p − centroid|² dw`, in mm⁴.
    pub spread: f64,
}

impl PupilMoments {
    /// The moments of the image points of traced rays; `unit_area` is the area of one unit of weight.
    pub(super) fn of_image_points(traced: &TracedNodes<ImagePoints<f64>>, unit_area: f64) -> Self {
        Self::new(traced, unit_area, |i| [traced.sink.x[i], traced.sink.y[i]])
    }

    /// The moments of any two numbers of each traced ray, its `point`, in place of its image point.
    /// The first number must change its sign where a ray stands for its mirror image as well.
    pub fn new<S: TraceSink<f64>>(
        traced: &TracedNodes<S>,
        unit_area: f64,
        point: impl Fn(usize) -> [f64; 2],
    ) -> Self {
        // About the first ray, so that a small spot far from the axis keeps its digits.
        let Some(first) = traced.arrivals().next().map(|(i, _)| point(i)) else {
            return Self::default();
        };
        let mirrored = traced.mirrored;
        let origin = [if mirrored { 0.0 } else { first[0] }, first[1]];
        let (mut weight, mut sum, mut square) = (0.0, [0.0; 2], 0.0);
        for (i, w) in traced.arrivals() {
            let point = point(i);
            let [x, y] = [0, 1].map(|k| point[k] - origin[k]);
            weight += w;
            sum[0] += if mirrored { 0.0 } else { w * x };
            sum[1] += w * y;
            square += w * (x * x + y * y);
        }
        let mean = sum.map(|s| s / weight);
        let spread = square - weight * (mean[0] * mean[0] + mean[1] * mean[1]);
        Self {
            area: unit_area * weight,
            centroid: [0, 1].map(|k| origin[k] + mean[k]),
            spread: unit_area * spread.max(0.0),
        }
    }

    /// The RMS distance from the centroid, in mm; zero if there is no light.
    pub fn rms_radius(&self) -> f64 {
        if self.area > 0.0 { (self.spread / self.area).sqrt() } else { 0.0 }
    }
}

impl Region<'_> {
    /// The moments of the light that the rays of some nodes give.
    pub fn moments(&self, nodes: &Nodes) -> PupilMoments {
        PupilMoments::of_image_points(&self.trace(nodes), self.launch.area())
    }
}
