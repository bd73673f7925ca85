//! Dark pupils: a measure of how far a pupil without light is from light.
//!
//! The area of a dark pupil is zero and has no derivative. But every ray of the ideal pupil is
//! blocked by some amount: the distance by which it passes outside of a rim, or by which it misses
//! a surface. The mean of these amounts over a coarse grid, the depth, has a derivative, and
//! reducing it lets light through.

use super::kind::{Region, RegionKind};
use crate::lens::System;
use crate::pupil::launch::Launch;
use crate::trace::{Ray, RayLimit, Rays, SystemGradient};
use std::f64::consts::PI;

/// The number of rays along a side of the grid.
const CELLS: usize = 9;

/// The blocked rays of a dark pupil.
#[derive(Debug, Clone)]
pub struct DarkPupil {
    rays: Vec<BlockedRay>,
    /// The radius of the ideal pupil, in mm.
    size: f64,
}

/// A ray with the limit that blocks it most.
#[derive(Debug, Clone, Copy)]
struct BlockedRay {
    ray: Ray<f64>,
    surface: usize,
    limit: RayLimit,
    /// The amount: in radii of the ideal pupil at a rim, in squared cosines at a surface that is
    /// missed or reflects totally.
    depth: f64,
    /// The derivative of the depth by the margin.
    by_margin: f64,
}

impl Region<'_> {
    /// The blocked rays of a dark pupil; `None` for one that is lit.
    pub(super) fn dark_pupil(&self) -> Option<DarkPupil> {
        if self.kind != RegionKind::Dark {
            return None;
        }
        let at = |i: usize| 2.0 * i as f64 / (CELLS - 1) as f64 - 1.0;
        let points = (0..CELLS * CELLS).map(|i| [at(i % CELLS), at(i / CELLS)]);
        let inside = points.filter(|p| p[0].hypot(p[1]) <= 1.0);
        let size = self.launch.area().sqrt();
        let stopped = inside.filter_map(|p| blocked_ray(&self.launch, p, size)).collect();
        Some(DarkPupil { rays: stopped, size })
    }
}

/// The limit that blocks the ray from a point of the pupil most; `None` if the ray passes.
fn blocked_ray(launch: &Launch<'_>, p: [f64; 2], size: f64) -> Option<BlockedRay> {
    let (ray, channel) = (launch.ray(p)?, launch.channel());
    let mut worst: Option<BlockedRay> = None;
    channel.tracer.margins(ray, |surface, limit, margin| {
        let (depth, by_margin) = depth(&channel.system, surface, limit, margin, size);
        if worst.is_none_or(|worst| depth > worst.depth) {
            worst = Some(BlockedRay { ray, surface, limit, depth, by_margin });
        }
    });
    worst.filter(|worst| worst.depth > 0.0)
}

/// The depth at a limit from the margin there, and its derivative by the margin.
fn depth(
    system: &System<f64>,
    surface: usize,
    limit: RayLimit,
    margin: f64,
    size: f64,
) -> (f64, f64) {
    let at = &system.surfaces[surface];
    // The margin at a rim is a difference of squares, the depth one of lengths.
    let length = |edge: f64, height: f64, sign: f64| {
        let slope = -0.5 / (height * size);
        (sign * (height - edge) / size, if slope.is_finite() { slope } else { 0.0 })
    };
    match limit {
        RayLimit::Rim => {
            length(at.semi_diameter, (at.semi_diameter.powi(2) - margin).max(0.0).sqrt(), 1.0)
        }
        RayLimit::Obstruction => {
            length(at.obstruction, (at.obstruction.powi(2) + margin).max(0.0).sqrt(), -1.0)
        }
        RayLimit::Side => {
            let before = surface.checked_sub(1).map_or(0.0, |i| system.surfaces[i].semi_diameter);
            let radius = at.semi_diameter.max(before);
            length(radius, (radius.powi(2) - margin).max(0.0).sqrt(), 1.0)
        }
        RayLimit::Aperture(_) | RayLimit::Obscuration(_) => (-margin / size, -1.0 / size),
        RayLimit::Miss | RayLimit::Equator | RayLimit::TotalReflection => {
            let square = system.index_before(surface).powi(2);
            (-margin / square, -1.0 / square)
        }
    }
}

impl DarkPupil {
    /// The mean depth of the rays; 0 if none is blocked.
    pub fn depth(&self) -> f64 {
        let sum: f64 = self.rays.iter().map(|ray| ray.depth).sum();
        sum / self.rays.len().max(1) as f64
    }

    /// The negative of an area in mm² that grows with the depth.
    pub(super) fn area(&self) -> f64 {
        -self.depth() * self.ideal_area()
    }

    /// The area of the ideal pupil, in mm².
    fn ideal_area(&self) -> f64 {
        PI * self.size * self.size
    }

    /// The derivative of `factor` times that area by every number of the system.
    pub(in crate::pupil) fn derivative(
        &self,
        region: &Region<'_>,
        factor: f64,
    ) -> SystemGradient<f64> {
        let tracer = &region.launch.channel().tracer;
        let by_depth = -factor * self.ideal_area() / self.rays.len().max(1) as f64;
        let mut total = SystemGradient::zero(tracer.surfaces());
        for (surface, limit) in self.limits() {
            let here = self.rays.iter().filter(|s| (s.surface, s.limit) == (surface, limit));
            let (rays, weights): (Vec<_>, Vec<f64>) =
                here.map(|s| (s.ray, by_depth * s.by_margin)).unzip();
            let rays: Rays<f64> = rays.into_iter().collect();
            let mut found = tracer.margin_gradient(surface, limit, &rays, &weights);
            if limit == RayLimit::Rim {
                // Directly, not by the square of a semi-diameter, which may be 0.
                found.surfaces[surface].semi_diameter = -by_depth * rays.len() as f64 / self.size;
            }
            total.add(&found, 1.0);
        }
        total
    }

    /// The limits that block rays, each once.
    fn limits(&self) -> Vec<(usize, RayLimit)> {
        let mut found = Vec::new();
        for ray in &self.rays {
            let limit = (ray.surface, ray.limit);
            if !found.contains(&limit) {
                found.push(limit);
            }
        }
        found
    }
}
