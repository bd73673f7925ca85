//! Area, centroid and spread of the light of a pupil.

use super::quadrature::{Nodes, TracedNodes};
use super::region::Region;
use crate::trace::ImagePoints;

/// Integrals over the rays of a pupil, in the measure of [`Launch::area`](super::Launch::area).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PupilMoments {
    /// `A = ∫ dw`, in mm² of the first vertex plane.
    pub area: f64,
    /// `∫ p dw / A`, in mm on the image plane; zero where there is no light.
    pub centroid: [f64; 2],
    /// `∫ |p − centroid|² dw`, in mm⁴.
    pub spread: f64,
}

impl Region<'_> {
    /// The moments of the light at some nodes.
    pub fn moments(&self, nodes: &Nodes) -> PupilMoments {
        moments(&self.trace(nodes), nodes.mirrored, self.launch.area())
    }
}

/// The moments of rays where they landed; `scale` is the area of one unit of weight.
pub(super) fn moments(
    landed: &TracedNodes<ImagePoints<f64>>,
    mirrored: bool,
    scale: f64,
) -> PupilMoments {
    let at = |i: usize| [landed.sink.x[i], landed.sink.y[i]];
    // About the first ray, so that a small spot far from the axis keeps its digits.
    let Some(first) = landed.arrivals().next().map(|(i, _)| at(i)) else {
        return PupilMoments::default();
    };
    let origin = [if mirrored { 0.0 } else { first[0] }, first[1]];
    let (mut weight, mut sum, mut square) = (0.0, [0.0; 2], 0.0);
    for (i, w) in landed.arrivals() {
        let [x, y] = [0, 1].map(|k| at(i)[k] - origin[k]);
        weight += w;
        sum[0] += if mirrored { 0.0 } else { w * x };
        sum[1] += w * y;
        square += w * (x * x + y * y);
    }
    let mean = sum.map(|s| s / weight);
    let spread = square - weight * (mean[0] * mean[0] + mean[1] * mean[1]);
    PupilMoments {
        area: scale * weight,
        centroid: [0, 1].map(|k| origin[k] + mean[k]),
        spread: scale * spread.max(0.0),
    }
}
