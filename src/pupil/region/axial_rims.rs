//! The light that each rim of a lens lets through by itself, on the axis.
//!
//! All azimuths of a round pupil on the axis are alike, so that a single rim ends all of it. Its area is the
//! least of those that the rims would leave one by one, and has a kink where another rim becomes the
//! narrowest one. The areas of the single rims have none.

use super::boundary::{PolarFrame, PupilLimit};
use super::edge_search::EdgeSearch;
use super::kind::RegionKind;
use super::traced_pupil::TracedPupil;
use crate::trace::{Ray, RayLimit, Rays, SystemGradient};
use std::f64::consts::PI;

/// The round pupil that a rim would leave by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxialRim {
    /// The surface of the rim, counted from 0.
    pub surface: usize,
    /// The area of the pupil, in mm² of the first vertex plane.
    pub area: f64,
    /// A ray at its edge.
    ray: Ray<f64>,
    /// The derivative of the area by the margin of the ray at the rim.
    by_margin: f64,
}

impl TracedPupil<'_> {
    /// The surface whose rim alone ends the pupil, and the radius of the pupil in its own coordinates;
    /// `None` for the surface if that is the disc of the pupil. `None` for a pupil that is not on the
    /// axis, or that something else ends.
    fn axial_edge(&self) -> Option<(Option<usize>, f64)> {
        if !self.region.launch.is_axial() {
            return None;
        }
        let frame = match &self.region.kind {
            RegionKind::Clear => return Some((None, 1.0)),
            RegionKind::StarShaped(boundary) => boundary.frame,
            _ => return None,
        };
        // The arcs of a form that was followed here may be those of another rim.
        let line = self.radial_lines.first()?;
        let [x, y] = frame.point(line.azimuth, line.edge.radius);
        match line.edge.limit {
            PupilLimit::Surface(surface, RayLimit::Rim) => Some((Some(surface), x.hypot(y))),
            _ => None,
        }
    }

    /// The surface whose rim ends the pupil, if that is on the axis and nothing else does.
    pub fn axial_rim(&self) -> Option<usize> {
        self.axial_edge()?.0
    }

    /// The pupils that the other rims would leave, those of up to an area in mm²; none if the pupil is not on
    /// the axis, or if something else than a rim ends it.
    pub fn other_axial_rims(&self, most: f64) -> Vec<AxialRim> {
        let Some((limiting, radius)) = self.axial_edge() else { return Vec::new() };
        let launch = &self.region.launch;
        let surfaces = &launch.channel().system.surfaces;
        let reach = (most / (PI * launch.area())).sqrt();
        let mut search = EdgeSearch::new(launch, PolarFrame::UNIT);
        let others = (0..surfaces.len())
            .filter(|i| Some(*i) != limiting && surfaces[*i].semi_diameter.is_finite());
        let rim = |surface: usize| {
            let limit = PupilLimit::Surface(surface, RayLimit::Rim);
            let found = search.limit_zero(limit, 0.0, radius)?;
            if found <= reach { self.pupil_of_rim(surface, found) } else { None }
        };
        others.filter_map(rim).collect()
    }

    fn pupil_of_rim(&self, surface: usize, radius: f64) -> Option<AxialRim> {
        let launch = &self.region.launch;
        let at = [0.0, radius];
        let dual: Rays<_> = std::iter::once(launch.dual_ray(at)?).collect();
        let margin = launch.channel().unclipped.margins_at(&dual, surface, RayLimit::Rim);
        let by_radius = 2.0 * PI * radius * launch.area();
        let by_margin = -by_radius / margin.first()?.slope[1];
        let (area, ray) = (0.5 * radius * by_radius, launch.ray(at)?);
        by_margin.is_finite().then_some(AxialRim { surface, area, ray, by_margin })
    }

    /// The derivative of the area of the pupil of a rim by every number of the system.
    pub fn axial_rim_motion(&self, rim: &AxialRim) -> SystemGradient<f64> {
        let rays: Rays<f64> = std::iter::once(rim.ray).collect();
        let tracer = &self.region.launch.channel().tracer;
        tracer.margin_gradient(rim.surface, RayLimit::Rim, &rays, &[rim.by_margin])
    }
}
