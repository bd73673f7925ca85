//! The light that each rim of a lens lets through by itself, on the axis.
//!
//! All azimuths of a round pupil on the axis are alike, so that a single rim ends all of it. Its area is the
//! least of those that the rims would leave one by one, and has a kink where another rim becomes the
//! narrowest one. The areas of the single rims have none.

use super::boundary::PupilLimit;
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

/// The part of the radius of the pupil between the two first rays of a search.
const FIRST_STEP: f64 = 1e-3;
/// The secant steps of a search.
const SECANT_STEPS: usize = 12;
/// The distance of a ray from a rim, relative to that, at which a search ends.
const AT_RIM: f64 = 1e-13;

impl TracedPupil<'_> {
    /// The surface whose rim alone ends the pupil, and the radius of the pupil in its own coordinates;
    /// `None` for the surface if that is the disc of the pupil. `None` for a pupil that is not on the
    /// axis, or that something else ends.
    fn axial_edge(&self) -> Option<(Option<usize>, f64)> {
        if !self.region.launch.is_axial() {
            return None;
        }
        match self.region.kind {
            RegionKind::Clear => return Some((None, 1.0)),
            RegionKind::StarShaped(_) => {}
            _ => return None,
        }
        // The arcs of a form that was followed here may be those of another rim.
        let edge = self.radial_lines.first()?.edge;
        match edge.limit {
            PupilLimit::Surface(surface, RayLimit::Rim) => Some((Some(surface), edge.radius)),
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
        let channel = self.region.launch.channel();
        let reach = (most / (PI * self.region.launch.area())).sqrt();
        let rim = |surface: usize| {
            let semi_diameter = channel.system.surfaces[surface].semi_diameter;
            let has_rim = semi_diameter.is_finite();
            let found =
                has_rim.then(|| self.radius_by_rim(surface, semi_diameter, radius, reach))??;
            self.pupil_of_rim(surface, found)
        };
        let others = (0..channel.system.surfaces.len()).filter(|i| Some(*i) != limiting);
        others.filter_map(rim).collect()
    }

    /// The radius, up to `reach` in pupil coordinates, of the ray that passes a rim; by the secant method
    /// on the height at the surface, which is almost in proportion to the radius.
    fn radius_by_rim(&self, surface: usize, rim: f64, from: f64, reach: f64) -> Option<f64> {
        let excess = |radius: f64| {
            let ray = self.region.launch.ray([0.0, radius])?;
            let margin = self.region.launch.channel().tracer.margin(ray, surface, RayLimit::Rim)?;
            Some((rim * rim - margin).max(0.0).sqrt() - rim)
        };
        let mut last = (from * (1.0 - FIRST_STEP), excess(from * (1.0 - FIRST_STEP))?);
        let mut radius = from;
        for _ in 0..SECANT_STEPS {
            let over = excess(radius)?;
            if over.abs() <= AT_RIM * rim {
                return Some(radius);
            }
            let slope = (over - last.1) / (radius - last.0);
            last = (radius, over);
            radius -= over / slope;
            // Not so near that it could end the light soon.
            if !(radius > 0.0 && radius <= reach) {
                return None;
            }
        }
        None
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
