//! The rays of a pupil at one order of quadrature, traced once: from them come its moments and the
//! derivatives of any integral over it.

use super::boundary::PupilLimit;
use super::dark_pupil::DarkPupil;
use super::kind::{Region, RegionKind};
use super::limit_edge::LimitEdge;
use super::moments::PupilMoments;
use super::nodes::{Nodes, RadialLine};
use super::quadrature::TracedNodes;
use crate::trace::{ImagePoints, Ray, Rays, TraceSink};
use std::sync::OnceLock;

/// The traced rays of a pupil.
#[derive(Debug, Clone)]
pub struct TracedPupil<'a> {
    /// The pupil.
    pub(in crate::pupil) region: Region<'a>,
    /// The radii that the rays lie on, if the boundary of the pupil is known; else empty.
    pub(super) radial_lines: Vec<RadialLine>,
    /// The rays on its edge, by the limits that make it, once they have been asked for; `None` if the
    /// edge is unknown.
    pub(super) edges: OnceLock<Option<Vec<LimitEdge>>>,
    /// The traced rays.
    pub rays: Rays<f64>,
    /// Their image points, each with its weight in pupil coordinates.
    pub landed: TracedNodes<ImagePoints<f64>>,
    /// Area, centroid and spread.
    pub moments: PupilMoments,
    /// The blocked rays of a dark pupil, which tell how far it is from light.
    pub dark: Option<DarkPupil>,
    /// The number of traced rays, those that searched for the edge included.
    pub rays_traced: usize,
}

impl<'a> Region<'a> {
    /// Traces the rays of an order of quadrature, counted from 0. For a round pupil on the axis these
    /// lie on one radius: enough for integrands that depend on the distance from the axis alone, and
    /// for those that averaging over azimuth makes such, as squares of distances from a point.
    pub fn trace_pupil(&self, order: usize) -> TracedPupil<'a> {
        self.trace_lines(order, true)
    }

    /// The same with rays at all azimuths, for any integrand.
    pub fn trace_whole_pupil(&self, order: usize) -> TracedPupil<'a> {
        self.trace_lines(order, false)
    }

    fn trace_lines(&self, order: usize, alike: bool) -> TracedPupil<'a> {
        let (nodes, radial_lines) = self.nodes_and_lines(order, alike);
        TracedPupil { radial_lines, dark: self.dark_pupil(), ..self.trace_nodes(&nodes) }
    }

    /// Traces the rays of some nodes. The motion of the edge is not known from them.
    pub fn trace_nodes(&self, nodes: &Nodes) -> TracedPupil<'a> {
        let (rays, landed) = self.launch_and_trace(nodes);
        TracedPupil {
            region: self.clone(),
            radial_lines: Vec::new(),
            edges: OnceLock::new(),
            moments: PupilMoments::of_image_points(&landed, self.launch.area()),
            landed,
            dark: None,
            rays_traced: nodes.rays + rays.len(),
            rays,
        }
    }
}

impl<'a> TracedPupil<'a> {
    /// The pupil.
    pub fn region(&self) -> &Region<'a> {
        &self.region
    }
}

impl TracedPupil<'_> {
    /// The form of the pupil.
    pub fn form(&self) -> &RegionKind {
        &self.region.kind
    }

    /// True if the pupil is neither star-shaped nor an annulus: its edge is then unknown.
    pub fn is_irregular(&self) -> bool {
        matches!(self.region.kind, RegionKind::Irregular { annulus: None, .. })
    }

    /// The limits at the ends of the radial lines, each once.
    pub(super) fn limits(&self) -> Vec<PupilLimit> {
        let mut found: Vec<PupilLimit> = Vec::new();
        for line in &self.radial_lines {
            if !found.contains(&line.edge.limit) {
                found.push(line.edge.limit);
            }
        }
        found
    }

    /// The area of the pupil, in mm² of the first vertex plane. For a dark pupil the negative of an
    /// area that grows with the distance from light, so that a search that maximizes the area finds
    /// the way back.
    pub fn signed_area(&self) -> f64 {
        self.dark.as_ref().map_or(self.moments.area, DarkPupil::area)
    }

    /// The optical path from the object point or plane wave to the start of a ray of this pupil, in mm.
    pub fn path_to(&self, ray: Ray<f64>) -> f64 {
        self.region.launch.optical_path_to(ray)
    }

    /// True if some ray arrives.
    pub fn has_light(&self) -> bool {
        (0..self.rays.len()).any(|i| self.landed.sink.fate(i).is_imaged())
    }
}
