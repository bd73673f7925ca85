//! The rays of a pupil at one order of quadrature, traced once: its moments, and from the same
//! rays the derivatives of any integral over it.

use super::boundary::PupilLimit;
use super::moments::{PupilMoments, moments};
use super::quadrature::{Nodes, RadialLine, TracedNodes};
use super::region::{Region, RegionKind};
use super::shadow::DarkPupil;
use crate::trace::{ImagePoints, Rays, TraceSink};

/// The light of a pupil.
#[derive(Debug, Clone)]
pub struct TracedPupil<'a> {
    /// The pupil.
    pub(super) region: Region<'a>,
    /// Its radii, where it is split at its corners.
    pub(super) radial_lines: Vec<RadialLine>,
    /// The rays that were traced.
    pub rays: Rays<f64>,
    /// Where they landed, each with its weight in pupil coordinates.
    pub landed: TracedNodes<ImagePoints<f64>>,
    /// Whether every ray stands for its mirror image as well.
    pub mirrored: bool,
    /// Area, centroid, spread.
    pub moments: PupilMoments,
    /// How far a dark pupil is from light.
    pub dark: Option<DarkPupil>,
    /// Rays traced for them, those that looked for the edge included.
    pub rays_traced: usize,
}

impl<'a> Region<'a> {
    /// Traces the rays of an order of quadrature, counted from 0. Of a round pupil on the axis that
    /// is one radius: for integrands that depend on the distance from the axis alone, and for those
    /// that a mirror image makes such, as squares of distances from a point do.
    pub fn trace_pupil(&self, order: usize) -> TracedPupil<'a> {
        let (nodes, spokes) = self.nodes_and_lines(order, true);
        TracedPupil { radial_lines: spokes, dark: self.dark_pupil(), ..self.trace_nodes(&nodes) }
    }

    /// Traces some nodes; the motion of an edge is not known then.
    pub fn trace_nodes(&self, nodes: &Nodes) -> TracedPupil<'a> {
        let started = nodes.points.iter().zip(&nodes.weights);
        let started = started.filter_map(|(p, w)| Some((self.launch.ray(*p)?, *w)));
        let (rays, weights): (Vec<_>, Vec<f64>) = started.unzip();
        let rays: Rays<f64> = rays.into_iter().collect();
        let lost = nodes.points.len() - rays.len();
        let mut sink = ImagePoints::default();
        self.launch.channel().tracer.trace_batch(&rays, &mut sink);
        let landed = TracedNodes { sink, weights, lost };
        let mirrored = nodes.mirrored;
        TracedPupil {
            region: self.clone(),
            radial_lines: Vec::new(),
            moments: moments(&landed, mirrored, self.launch.area()),
            landed,
            mirrored,
            dark: None,
            rays_traced: nodes.rays + rays.len(),
            rays,
        }
    }
}

impl TracedPupil<'_> {
    /// Whether the pupil is neither star-shaped nor a ring, so that its edge has no integral along it.
    pub fn is_irregular(&self) -> bool {
        matches!(self.region.kind, RegionKind::Irregular { annulus: None, .. })
    }

    /// The limits at the ends of the spokes, each once.
    pub(super) fn limits(&self) -> Vec<PupilLimit> {
        let mut found: Vec<PupilLimit> = Vec::new();
        for spoke in &self.radial_lines {
            if !found.contains(&spoke.edge.limit) {
                found.push(spoke.edge.limit);
            }
        }
        found
    }

    /// The area of the pupil in mm² of the first vertex plane; of a dark one minus an area that
    /// grows with how far it is from light, so that what asks for light is told the way back.
    pub fn signed_area(&self) -> f64 {
        self.dark.as_ref().map_or(self.moments.area, DarkPupil::area)
    }

    /// Whether some ray arrives.
    pub fn has_light(&self) -> bool {
        (0..self.rays.len()).any(|i| self.landed.sink.fate(i).is_imaged())
    }
}
