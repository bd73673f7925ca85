//! The rays of a pupil at one order of quadrature, traced once: its moments, and from the same
//! rays the derivatives of any integral over it.

use super::boundary::Limit;
use super::moments::{Moments, moments};
use super::quadrature::{Landed, Nodes, Spoke};
use super::region::{Kind, Region};
use super::shadow::Shadow;
use crate::trace::{Points, Rays, Sink};

/// The light of a pupil.
#[derive(Debug, Clone)]
pub struct Lit<'a> {
    /// The pupil.
    pub(super) region: Region<'a>,
    /// Its radii, where it is split at its corners.
    pub(super) spokes: Vec<Spoke>,
    /// The rays that were traced.
    pub rays: Rays<f64>,
    /// Where they landed, each with its weight in pupil coordinates.
    pub landed: Landed<Points<f64>>,
    /// Whether every ray stands for its mirror image as well.
    pub mirrored: bool,
    /// Area, centroid, spread.
    pub moments: Moments,
    /// How far a dark pupil is from light.
    pub shadow: Option<Shadow>,
    /// Rays traced for them, those that looked for the edge included.
    pub traced: usize,
}

impl<'a> Region<'a> {
    /// Traces the rays of an order of quadrature, counted from 0. Of a round pupil on the axis that
    /// is one radius: for integrands that depend on the distance from the axis alone, and for those
    /// that a mirror image makes such, as squares of distances from a point do.
    pub fn lit(&self, order: usize) -> Lit<'a> {
        let (nodes, spokes) = self.nodes_and_spokes(order, true);
        Lit { spokes, shadow: self.shadow(), ..self.at(&nodes) }
    }

    /// Traces some nodes; the motion of an edge is not known then.
    pub fn at(&self, nodes: &Nodes) -> Lit<'a> {
        let started = nodes.points.iter().zip(&nodes.weights);
        let started = started.filter_map(|(p, w)| Some((self.launch.ray(*p)?, *w)));
        let (rays, weights): (Vec<_>, Vec<f64>) = started.unzip();
        let rays: Rays<f64> = rays.into_iter().collect();
        let lost = nodes.points.len() - rays.len();
        let mut sink = Points::default();
        self.launch.color().tracer.batch(&rays, &mut sink);
        let landed = Landed { sink, weights, lost };
        let mirrored = nodes.mirrored;
        Lit {
            region: self.clone(),
            spokes: Vec::new(),
            moments: moments(&landed, mirrored, self.launch.area()),
            landed,
            mirrored,
            shadow: None,
            traced: nodes.rays + rays.len(),
            rays,
        }
    }
}

impl Lit<'_> {
    /// Whether the pupil is neither star-shaped nor a ring, so that its edge has no integral along it.
    pub fn is_ragged(&self) -> bool {
        matches!(self.region.kind, Kind::Ragged { ring: None, .. })
    }

    /// The limits at the ends of the spokes, each once.
    pub(super) fn limits(&self) -> Vec<Limit> {
        let mut found: Vec<Limit> = Vec::new();
        for spoke in &self.spokes {
            if !found.contains(&spoke.edge.limit) {
                found.push(spoke.edge.limit);
            }
        }
        found
    }

    /// The area of the pupil in mm² of the first vertex plane; of a dark one minus an area that
    /// grows with how far it is from light, so that what asks for light is told the way back.
    pub fn area(&self) -> f64 {
        self.shadow.as_ref().map_or(self.moments.area, Shadow::area)
    }

    /// Whether some ray arrives.
    pub fn has_light(&self) -> bool {
        (0..self.rays.len()).any(|i| self.landed.sink.fate(i).is_imaged())
    }
}
