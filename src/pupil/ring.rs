//! A pupil with a shadow in it: the ring between the edge of the shadow and that of the light.
//!
//! No point sees all of a ring, but from the middle of the shadow both of its edges are functions
//! of azimuth. Gauss nodes between them converge as fast as those of a pupil that one point sees.

use super::boundary::{Boundary, Frame, Limit, NEAR, Search, Seen};
use super::launch::Launch;
use super::quadrature::Nodes;
use super::rules::legendre;
use crate::trace::Hurdle;
use std::f64::consts::PI;

/// The two edges of a ring, both from the same point inside the shadow.
#[derive(Debug, Clone, PartialEq)]
pub struct Ring {
    /// Where the light ends.
    pub outer: Boundary,
    /// Where the shadow of the obstructions ends.
    pub inner: Boundary,
}

impl Ring {
    /// The ring about the middle of a frame, over azimuths from 0 to `end`; `None` where the light
    /// does not go all around the shadow.
    pub(super) fn around(
        launch: &Launch<'_>,
        frame: Frame,
        end: f64,
        azimuths: usize,
    ) -> Option<Self> {
        let edge = |seen| Search::new(launch, frame).seeing(seen).boundary(end, azimuths);
        let ring = Self { outer: edge(Seen::Rims)?, inner: edge(Seen::Shadow)? };
        let shadow = |limit| matches!(limit, Limit::Surface(_, Hurdle::Obstruction));
        let closed = ring.inner.arcs.iter().all(|arc| shadow(arc.limit)) && ring.is_open();
        closed.then_some(ring)
    }

    /// Whether there is light between the edges wherever they were looked at.
    fn is_open(&self) -> bool {
        let Self { outer, inner } = self;
        inner.samples.iter().all(|(azimuth, edge)| edge.radius < outer.near(*azimuth))
            && outer.samples.iter().all(|(azimuth, edge)| edge.radius > inner.near(*azimuth))
    }

    /// Rays traced to find both edges.
    pub(super) fn rays(&self) -> usize {
        self.outer.rays + self.inner.rays
    }

    /// Gauss nodes in azimuth between corners of either edge, and in the radius between the two.
    pub(super) fn nodes(&self, launch: &Launch<'_>, azimuths: usize, radii: usize) -> Nodes {
        let frame = self.outer.frame;
        let mut outer = Search::new(launch, frame).seeing(Seen::Rims);
        let mut inner = Search::new(launch, frame).seeing(Seen::Shadow);
        let mirrored = launch.is_symmetric();
        let factor = frame.area() * if mirrored { 2.0 } else { 1.0 };
        let mut nodes = Nodes { mirrored, ..Nodes::default() };
        for (from, to) in self.stretches() {
            for (t, share) in legendre(azimuths) {
                let azimuth = from + t * (to - from);
                let ends = [(&mut outer, &self.outer), (&mut inner, &self.inner)];
                let [far, near] = ends.map(|(search, edge)| {
                    search.edge(azimuth, edge.near(azimuth), NEAR).map(|edge| edge.radius)
                });
                let (Some(far), Some(near)) = (far, near) else { continue };
                let width = (far - near).max(0.0);
                for (u, weight) in legendre(radii) {
                    let r = near + u * width;
                    nodes.points.push(frame.point(azimuth, r));
                    nodes.weights.push(factor * share * (to - from) * weight * width * r);
                }
            }
        }
        nodes.rays = outer.rays + inner.rays;
        nodes
    }

    /// The azimuths between one corner and the next, of whichever edge.
    fn stretches(&self) -> Vec<(f64, f64)> {
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
