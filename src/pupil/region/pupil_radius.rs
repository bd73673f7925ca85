//! Radii of a pupil whose edge is known: from the centre, or the edge of a central shadow, to the
//! edge of the light.

use super::boundary::Boundary;
use super::edge_search::{EdgeSearch, GUESS_SPREAD, LimitFilter};
use super::kind::{Region, RegionKind};
use std::f64::consts::{PI, TAU};

/// A ray is this close to the edge, relative to the radius, that rounding cannot put it outside.
const INSIDE: f64 = 1e-9;

/// The part of a radius of a pupil through which light gets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PupilRadius {
    /// Its ends in pupil coordinates, the inner one first, both just inside the light.
    ends: [[f64; 2]; 2],
    /// The number of rays traced to find them.
    pub rays: usize,
}

impl PupilRadius {
    /// The pupil point at a share of the way to the edge, from 0 to 1.
    pub fn point(&self, share: f64) -> [f64; 2] {
        let [from, to] = self.ends;
        [0, 1].map(|k| from[k] + share * (to[k] - from[k]))
    }
}

impl Region<'_> {
    /// The part with light of the radius at an azimuth in radians, counted from +y towards +x of the frame
    /// of the pupil; `None` if the edge is not known there.
    pub fn pupil_radius(&self, azimuth: f64) -> Option<PupilRadius> {
        let edge = |boundary: &Boundary, filter, factor: f64| {
            let mut search = EdgeSearch::new(&self.launch, boundary.frame).with_limits(filter);
            let found = search.edge(azimuth, boundary.radius_guess(azimuth), GUESS_SPREAD)?;
            Some((boundary.frame.point(azimuth, factor * found.radius), search.rays))
        };
        match &self.kind {
            RegionKind::Clear => {
                let (sin, cos) = azimuth.sin_cos();
                let ends = [[0.0; 2], [sin, cos].map(|v| (1.0 - INSIDE) * v)];
                Some(PupilRadius { ends, rays: 0 })
            }
            RegionKind::StarShaped(boundary) => {
                let (end, rays) = edge(boundary, LimitFilter::All, 1.0 - INSIDE)?;
                Some(PupilRadius { ends: [boundary.frame.center, end], rays })
            }
            RegionKind::Irregular { annulus: Some(ring), .. } => {
                let outer = edge(&ring.outer, LimitFilter::WithoutObstructions, 1.0 - INSIDE)?;
                let inner = edge(&ring.inner, LimitFilter::Obstructions, 1.0 + INSIDE)?;
                Some(PupilRadius { ends: [inner.0, outer.0], rays: inner.1 + outer.1 })
            }
            RegionKind::Dark | RegionKind::Unbounded | RegionKind::Irregular { .. } => None,
        }
    }

    /// Equal steps of azimuth around the pupil, or, if that is its own mirror image, around one half
    /// of it, ends included; with the corners of its edge in between. A single one on the axis, where
    /// all are alike.
    pub fn azimuths(&self, count: usize) -> Vec<f64> {
        if self.launch.is_axial() {
            return vec![0.0];
        }
        let turn = if self.launch.is_symmetric() { PI } else { TAU };
        let corners = match &self.kind {
            RegionKind::StarShaped(boundary) => boundary.arcs.as_slice(),
            RegionKind::Irregular { annulus: Some(ring), .. } => ring.outer.arcs.as_slice(),
            _ => &[],
        };
        let corners = corners.iter().map(|arc| if arc.to > turn { arc.to - turn } else { arc.to });
        let steps = (0..=count).map(|i| turn * i as f64 / count as f64);
        let mut azimuths: Vec<f64> = steps.chain(corners).collect();
        azimuths.sort_by(f64::total_cmp);
        azimuths.dedup_by(|a, b| *a - *b < INSIDE);
        azimuths
    }
}
