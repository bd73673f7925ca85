//! The rays of a pupil at one order of quadrature, traced once: its moments, and from the same
//! rays the derivatives of any integral over it.

use super::boundary::{Frame, Limit};
use super::launch::Launch;
use super::moments::{Moments, moments};
use super::quadrature::{Landed, Nodes, SPLIT, Spoke, nodes_of};
use super::region::{Kind, Region};
use crate::trace::{Points, Rays, Sink};

/// How the edge of a pupil is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Rim {
    /// It is the disc of the pupil, which does not move.
    Still,
    /// It ends the spokes in this frame.
    Spokes(Frame),
    /// It is not.
    Unknown,
}

/// The light of a pupil.
#[derive(Debug, Clone)]
pub struct Lit<'a> {
    /// From where its rays start.
    pub launch: Launch<'a>,
    pub(super) rim: Rim,
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
    /// Rays traced for them, those that looked for the edge included.
    pub traced: usize,
}

impl<'a> Region<'a> {
    /// Traces the rays of an order of quadrature, counted from 0. Of a round pupil on the axis that
    /// is one radius: for integrands that depend on the distance from the axis alone, and for those
    /// that a mirror image makes such, as squares of distances from a point do.
    pub fn lit(&self, order: usize) -> Lit<'a> {
        let (nodes, spokes) = match &self.kind {
            Kind::Split(boundary) => {
                let (azimuths, radii) = SPLIT[order.min(SPLIT.len() - 1)];
                let alike = self.launch.is_axial() && boundary.arcs.len() == 1;
                let (spokes, rays) = self.spokes(boundary, if alike { 1 } else { azimuths });
                let mut nodes = nodes_of(&spokes, &boundary.frame, radii);
                (nodes.mirrored, nodes.rays) = (self.launch.is_symmetric(), rays);
                (nodes, spokes)
            }
            Kind::Ragged { ring: Some(ring), .. } => {
                let (azimuths, radii) = SPLIT[order.min(SPLIT.len() - 1)];
                let (spokes, rays) = ring.spokes(&self.launch, azimuths);
                let mut nodes = ring.nodes_of(&spokes, radii);
                (nodes.mirrored, nodes.rays) = (self.launch.is_symmetric(), rays);
                (nodes, spokes.into_iter().flatten().collect())
            }
            Kind::Clear | Kind::Ragged { .. } | Kind::Dark | Kind::Endless => {
                (self.nodes(order), Vec::new())
            }
        };
        self.traced(&nodes, spokes)
    }

    /// Traces some nodes; what moves the edge is not known then.
    pub fn at(&self, nodes: &Nodes) -> Lit<'a> {
        Lit { rim: Rim::Unknown, ..self.traced(nodes, Vec::new()) }
    }

    fn traced(&self, nodes: &Nodes, spokes: Vec<Spoke>) -> Lit<'a> {
        let started = nodes.points.iter().zip(&nodes.weights);
        let started = started.filter_map(|(p, w)| Some((self.launch.ray(*p)?, *w)));
        let (rays, weights): (Vec<_>, Vec<f64>) = started.unzip();
        let rays: Rays<f64> = rays.into_iter().collect();
        let lost = nodes.points.len() - rays.len();
        let mut sink = Points::default();
        self.launch.color().tracer.batch(&rays, &mut sink);
        let landed = Landed { sink, weights, lost };
        let mirrored = nodes.mirrored;
        let moments = moments(&landed, mirrored, self.launch.area());
        let traced = nodes.rays + rays.len();
        let rim = match &self.kind {
            Kind::Clear => Rim::Still,
            Kind::Split(boundary) => Rim::Spokes(boundary.frame),
            Kind::Ragged { ring: Some(ring), .. } => Rim::Spokes(ring.outer.frame),
            Kind::Dark | Kind::Ragged { .. } | Kind::Endless => Rim::Unknown,
        };
        let launch = self.launch.clone();
        Lit { launch, rim, spokes, rays, landed, mirrored, moments, traced }
    }
}

impl Lit<'_> {
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

    /// Whether some ray arrives.
    pub fn has_light(&self) -> bool {
        (0..self.rays.len()).any(|i| self.landed.sink.fate(i).is_imaged())
    }
}
