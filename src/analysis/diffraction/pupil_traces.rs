//! The rays of a pupil, traced once for every reference sphere that they are looked at on.

use super::outline::{ArcSteps, PupilCurve};
use super::pupil_samples::PupilSamples;
use crate::analysis::AnalysisError;
use crate::analysis::reference_sphere::ReferenceSphere;
use crate::math::Dual;
use crate::pupil::{Dual2, EdgeArc, Nodes, Region};
use crate::trace::{Ray, TraceSink as _};

/// The traced rays of some nodes of a pupil.
#[derive(Debug)]
pub(super) struct TracedLight {
    rays: Vec<TracedNode>,
    mirrored: bool,
    /// The number of nodes, and that of rays traced for them.
    pub(super) count: usize,
    pub(super) cost: usize,
}

/// The traced ray of a node.
#[derive(Debug)]
struct TracedNode {
    point: [f64; 2],
    /// The energy of the area around the node, and the area of the beam by that of the pupil.
    energy: f64,
    share: f64,
    ray: Ray<Dual2>,
    /// The path from the object.
    path: Dual2,
}

impl TracedLight {
    pub(super) fn new(region: &Region<'_>, nodes: &Nodes) -> Self {
        let launch = &region.launch;
        let (launched, landed) = launch.trace_points(&nodes.points);
        let lit = launched.into_iter().enumerate().filter(|(ray, _)| landed.fate(*ray).is_imaged());
        let lit: Vec<usize> = lit.map(|(_, node)| node).collect();
        let ends = launch.unclipped_landings(lit.iter().map(|node| nodes.points[*node]));
        let traced = |(node, end): (usize, Option<(Ray<Dual2>, Dual2)>)| {
            let point = nodes.points[node];
            let (start, (ray, path)) = (launch.ray(point)?, end?);
            let path = Dual::constant(launch.optical_path_to(start)) + path;
            let share = launch.beam_share(point);
            Some(TracedNode { point, energy: nodes.weights[node] * share, share, ray, path })
        };
        Self {
            rays: lit.into_iter().zip(ends).filter_map(traced).collect(),
            mirrored: nodes.mirrored,
            count: nodes.points.len(),
            cost: nodes.rays + 2 * nodes.points.len(),
        }
    }

    /// The ends of the rays of some of its nodes, given in their order, each with its path from the object.
    pub(super) fn ends_of(&self, points: &[[f64; 2]]) -> Vec<(Ray<f64>, f64)> {
        let mut wanted = points.iter().peekable();
        let value = |node: &TracedNode| {
            let Ray { point, direction } = node.ray;
            (Ray { point: point.value(), direction: direction.value() }, node.path.value)
        };
        let mut ends = Vec::with_capacity(points.len());
        for node in &self.rays {
            if wanted.next_if(|point| **point == node.point).is_some() {
                ends.push(value(node));
            }
        }
        ends
    }

    /// The light on a reference sphere.
    ///
    /// # Errors
    /// The cosines are no coordinates of the pupil, since it folds there; or no ray arrives.
    pub(super) fn on(&self, sphere: &ReferenceSphere) -> Result<PupilSamples, AnalysisError> {
        let mut samples = PupilSamples {
            mirrored: self.mirrored,
            wavelength: sphere.medium_wavelength(),
            ..PupilSamples::default()
        };
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for node in &self.rays {
            let Some(found) = sphere.project(node.ray, node.path) else { continue };
            let [a, b] = found.cosines;
            // The area of cosines by that of the beam.
            let area = (a.slope[0] * b.slope[1] - a.slope[1] * b.slope[0]) / node.share;
            (least, most) = (least.min(area), most.max(area));
            samples.cosines.push([a.value, b.value]);
            samples.points.push(node.point);
            samples.waves.push(found.waves.value);
            samples.amplitudes.push(node.energy * area.abs().sqrt());
            samples.energies.push(node.energy);
        }
        if samples.cosines.is_empty() {
            return Err(AnalysisError::NoLight);
        }
        if least < 0.0 && most > 0.0 {
            return Err(AnalysisError::FoldedPupil);
        }
        Ok(samples)
    }
}

/// The edge of a pupil with its traced rays: the arcs around the light and around its shadow.
#[derive(Debug)]
struct TracedEdge {
    count: usize,
    curves: [Vec<TracedArc>; 2],
    rays: usize,
}

/// The rays at the points of an arc; `None` if one of them does not get to the image.
#[derive(Debug)]
struct TracedArc {
    ends: Option<Vec<(Ray<Dual2>, Dual2)>>,
    begins_at_corner: bool,
}

/// The rays of a pupil, by order of quadrature and along its edge.
#[derive(Debug)]
pub(super) struct PupilTraces<'a> {
    pub(super) region: &'a Region<'a>,
    orders: Vec<Option<TracedLight>>,
    edge: Option<TracedEdge>,
}

impl<'a> PupilTraces<'a> {
    pub(super) fn new(region: &'a Region<'a>) -> Self {
        let orders = (0..region.orders()).map(|_| None).collect();
        Self { region, orders, edge: None }
    }

    /// The rays of an order that the region has.
    pub(super) fn light(&mut self, order: usize) -> &TracedLight {
        let region = self.region;
        self.orders[order].get_or_insert_with(|| TracedLight::new(region, &region.nodes(order)))
    }

    /// The curves around the light and, if there is one, around its shadow, of so many points an arc, on a sphere;
    /// and the number of rays.
    ///
    /// # Errors
    /// The edge is not known.
    pub(super) fn curves(
        &mut self,
        sphere: &ReferenceSphere,
        (count, steps): (usize, ArcSteps),
    ) -> Result<(Vec<PupilCurve>, usize), AnalysisError> {
        let edge = self.edge(count).ok_or(AnalysisError::IrregularPupil)?;
        let curve = |arcs: &Vec<TracedArc>| projected(sphere, arcs, steps);
        let curves = edge.curves.iter().filter(|arcs| !arcs.is_empty()).map(curve);
        let curves: Option<Vec<PupilCurve>> = curves.collect();
        Ok((curves.ok_or(AnalysisError::IrregularPupil)?, edge.rays))
    }

    fn edge(&mut self, count: usize) -> Option<&TracedEdge> {
        if self.edge.as_ref().is_none_or(|edge| edge.count != count) {
            let curves = self.region.edge_curves(count)?;
            let traced = |arc: &EdgeArc| {
                let ends = self.region.launch.unclipped_landings(arc.points.iter().copied());
                let begins_at_corner = arc.begins_at_corner;
                TracedArc { ends: ends.into_iter().collect(), begins_at_corner }
            };
            let both = [&curves.outer, &curves.inner].map(|arcs| arcs.iter().map(traced).collect());
            self.edge = Some(TracedEdge { count, curves: both, rays: 2 * curves.rays });
        }
        self.edge.as_ref()
    }
}

/// A curve of the pupil in cosines; `None` if a ray misses the sphere or the image.
fn projected(sphere: &ReferenceSphere, arcs: &[TracedArc], steps: ArcSteps) -> Option<PupilCurve> {
    let place = |(ray, path): &(Ray<Dual2>, Dual2)| {
        let found = sphere.project(*ray, *path)?;
        Some(found.cosines.map(|cosine| cosine.value))
    };
    let arc = |arc: &TracedArc| {
        let points: Option<Vec<_>> = arc.ends.as_ref()?.iter().map(place).collect();
        Some((points?, arc.begins_at_corner))
    };
    let arcs: Option<Vec<_>> = arcs.iter().map(arc).collect();
    Some(PupilCurve::in_steps(&arcs?, steps))
}
