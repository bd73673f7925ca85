//! A pupil with a central shadow: the annulus between the edge of the shadow and that of the light.
//!
//! An annulus is not star-shaped, but from the centre of the shadow both of its edges are functions
//! of azimuth. Gauss nodes between them converge as fast as those of a star-shaped pupil.

use super::boundary::{Boundary, PolarFrame};
use super::edge_search::{EdgeSearch, GUESS_SPREAD, LimitFilter};
use super::nodes::{Nodes, RadialLine};
use crate::pupil::gauss_rules::legendre;
use crate::pupil::launch::Launch;
use std::f64::consts::PI;

/// The two edges of an annulus, both about the same point inside the shadow.
#[derive(Debug, Clone, PartialEq)]
pub struct Annulus {
    /// The outer edge, where the light ends.
    pub outer: Boundary,
    /// The inner edge, where the shadow of the obstructions ends.
    pub inner: Boundary,
}

impl Annulus {
    /// The annulus about the centre of a frame, over azimuths from 0 to `end`; `None` if the light
    /// does not surround the shadow.
    pub(super) fn around(
        launch: &Launch<'_>,
        frame: PolarFrame,
        end: f64,
        azimuths: usize,
    ) -> Option<Self> {
        let edge = |limits| {
            EdgeSearch::new(launch, frame).with_limits(limits).trace_boundary(end, azimuths)
        };
        let annulus = Self {
            outer: edge(LimitFilter::WithoutObstructions)?,
            inner: edge(LimitFilter::Obstructions)?,
        };
        let closed =
            annulus.inner.arcs.iter().all(|arc| arc.limit.is_shadow()) && annulus.is_open();
        closed.then_some(annulus)
    }

    /// True if the outer edge is outside the inner one at all sampled azimuths.
    fn is_open(&self) -> bool {
        let Self { outer, inner } = self;
        inner.samples.iter().all(|(azimuth, edge)| edge.radius < outer.radius_guess(*azimuth))
            && outer
                .samples
                .iter()
                .all(|(azimuth, edge)| edge.radius > inner.radius_guess(*azimuth))
    }

    /// The number of rays traced to find both edges.
    pub(super) fn rays(&self) -> usize {
        self.outer.rays + self.inner.rays
    }

    /// The outer and inner ends of radii at Gauss nodes in azimuth between the corners of either
    /// edge, and the number of rays traced to find them. The shares of the inner ends are negative,
    /// since what lies within is dark.
    pub(super) fn radial_lines(
        &self,
        launch: &Launch<'_>,
        azimuths: usize,
    ) -> (Vec<[RadialLine; 2]>, usize) {
        let frame = self.outer.frame;
        let mut outer =
            EdgeSearch::new(launch, frame).with_limits(LimitFilter::WithoutObstructions);
        let mut inner = EdgeSearch::new(launch, frame).with_limits(LimitFilter::Obstructions);
        let factor = frame.area() * if launch.is_symmetric() { 2.0 } else { 1.0 };
        let mut lines = Vec::new();
        for (from, to) in self.azimuth_intervals() {
            for (t, share) in legendre(azimuths) {
                let azimuth = from + t * (to - from);
                let share = factor * share * (to - from);
                let ends = [(&mut outer, &self.outer, share), (&mut inner, &self.inner, -share)];
                let [far, near] = ends.map(|(search, side, share)| {
                    let edge = search.edge(azimuth, side.radius_guess(azimuth), GUESS_SPREAD)?;
                    Some(RadialLine { azimuth, edge, share, grazing_distance: f64::INFINITY })
                });
                lines.extend(far.zip(near).map(|(far, near)| [far, near]));
            }
        }
        (lines, outer.rays + inner.rays)
    }

    /// The Gauss nodes along radii from one edge to the other.
    pub(super) fn nodes(&self, lines: &[[RadialLine; 2]], radii: usize) -> Nodes {
        let mut nodes = Nodes::default();
        for [far, near] in lines {
            let from = near.edge.radius;
            let width = (far.edge.radius - from).max(0.0);
            for (u, weight) in legendre(radii) {
                let r = from + u * width;
                nodes.points.push(self.outer.frame.point(far.azimuth, r));
                nodes.weights.push(far.share * weight * width * r);
            }
        }
        nodes
    }

    /// The intervals of azimuth between consecutive corners of either edge.
    fn azimuth_intervals(&self) -> Vec<(f64, f64)> {
        let arcs = || self.outer.arcs.iter().chain(&self.inner.arcs);
        let first = self.outer.arcs.first().map_or(0.0, |arc| arc.from);
        let turn = self.outer.samples.last().map_or(2.0 * PI, |sample| sample.0);
        let mut corners: Vec<f64> = arcs()
            .flat_map(|arc| [arc.from, arc.to])
            .map(|corner| first + (corner - first).rem_euclid(turn))
            .chain([first, first + turn])
            .collect();
        corners.sort_by(f64::total_cmp);
        corners.windows(2).map(|pair| (pair[0], pair[1])).filter(|(a, b)| b > a).collect()
    }
}
