//! The rays on the edge of a traced pupil, found once for all integrals over it.

use super::boundary::{PolarFrame, PupilLimit};
use super::kind::RegionKind;
use super::nodes::RadialLine;
use super::traced_pupil::TracedPupil;
use crate::pupil::ray_model::Dual2;
use crate::trace::{Ray, RayLimit, Rays};

/// The rays on the part of the edge of a pupil that a limit makes.
#[derive(Debug, Clone)]
pub(in crate::pupil) struct LimitEdge {
    pub(in crate::pupil) surface: usize,
    pub(in crate::pupil) limit: RayLimit,
    pub(in crate::pupil) rays: Rays<f64>,
    /// The derivative of the area of the pupil, in mm², by the margin of each ray.
    pub(in crate::pupil) by_margin: Vec<f64>,
    /// The image point of each ray.
    pub(in crate::pupil) landings: Vec<[f64; 2]>,
}

/// A ray on the edge of a pupil.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeRay {
    /// The surface that ends the light there, counted from 0.
    pub surface: usize,
    /// Its limit.
    pub limit: RayLimit,
    /// The ray.
    pub ray: Ray<f64>,
    /// The derivative of the area of the pupil, in mm² of the first vertex plane, by the margin of the ray: a
    /// number of the lens that changes margins by `dM` adds the sum of these times `dM` to the area.
    pub by_margin: f64,
}

impl LimitEdge {
    fn new(surface: usize, limit: RayLimit) -> Self {
        let (by_margin, landings) = (Vec::new(), Vec::new());
        Self { surface, limit, rays: Rays::default(), by_margin, landings }
    }
}

impl TracedPupil<'_> {
    /// The rays on the edge, by the limits that make it; `None` if the edge is unknown.
    pub(in crate::pupil) fn edges(&self) -> Option<&[LimitEdge]> {
        self.edges.get_or_init(|| self.find_edges()).as_deref()
    }

    /// The same as one list, half of it with twice the weight for a pupil that is its own mirror image.
    pub fn edge_rays(&self) -> Option<Vec<EdgeRay>> {
        let of_limit = |edge: &LimitEdge| {
            let LimitEdge { surface, limit, .. } = *edge;
            let rays = (0..edge.rays.len()).map(|i| edge.rays.get(i));
            let rays = rays.zip(edge.by_margin.clone());
            rays.map(move |(ray, by_margin)| EdgeRay { surface, limit, ray, by_margin })
                .collect::<Vec<_>>()
        };
        Some(self.edges()?.iter().flat_map(of_limit).collect())
    }

    fn find_edges(&self) -> Option<Vec<LimitEdge>> {
        let frame = match &self.region.kind {
            RegionKind::StarShaped(boundary) => boundary.frame,
            RegionKind::Irregular { annulus: Some(annulus), .. } => annulus.outer.frame,
            RegionKind::Irregular { annulus: None, .. }
            | RegionKind::Clear
            | RegionKind::Dark
            | RegionKind::Unbounded => return None,
        };
        let surface = |limit| match limit {
            PupilLimit::Surface(surface, limit) => Some(self.edge_at(&frame, surface, limit)),
            PupilLimit::Disc | PupilLimit::Unaimed => None,
        };
        let known = !self.radial_lines.is_empty();
        known.then(|| self.limits().into_iter().filter_map(surface).collect())
    }

    /// The rays at the ends of the radial lines that a limit makes.
    fn edge_at(&self, frame: &PolarFrame, surface: usize, limit: RayLimit) -> LimitEdge {
        let launch = &self.region.launch;
        let wanted = PupilLimit::Surface(surface, limit);
        let at_edge = |line: &RadialLine| {
            let p = frame.point(line.azimuth, line.edge.radius);
            Some((*line, launch.ray(p)?, launch.dual_ray(p)?))
        };
        let on_limit = self.radial_lines.iter().filter(|line| line.edge.limit == wanted);
        let ends: Vec<_> = on_limit.filter_map(at_edge).collect();
        let rays: Rays<f64> = ends.iter().map(|(_, ray, _)| *ray).collect();
        let dual: Rays<Dual2> = ends.iter().map(|(_, _, ray)| *ray).collect();
        let channel = launch.channel();
        let landings = channel.tracer.landings_at_edge(&rays, surface, limit);
        let margins = channel.unclipped.margins_at(&dual, surface, limit);
        let mut edge = LimitEdge::new(surface, limit);
        for (i, (margin, landing)) in margins.into_iter().zip(landings).enumerate() {
            let (line, ray, _) = ends[i];
            let direction = frame.direction(line.azimuth);
            let outwards = margin.slope[0] * direction[0] + margin.slope[1] * direction[1];
            let by_margin = -launch.area() * line.share * line.edge.radius / outwards;
            if by_margin.is_finite() && landing.iter().all(|v| v.is_finite()) {
                edge.rays.push(ray);
                edge.by_margin.push(by_margin);
                edge.landings.push(landing);
            }
        }
        edge
    }
}
