//! How dark a pupil is that lets nothing through, and the way back to light.
//!
//! Light that is not there has no derivative. But every ray of the ideal pupil is stopped by so
//! much: by how far it passes outside of a rim, or how far it is from meeting a surface. The mean of
//! that over a coarse grid, the depth of the shadow, has a derivative, and what reduces it lets
//! light through.

use super::kind::{Region, RegionKind};
use crate::lens::System;
use crate::pupil::launch::Launch;
use crate::trace::{Ray, RayLimit, Rays, SystemGradient};
use std::f64::consts::PI;

/// Rays along a side of the grid.
const CELLS: usize = 9;

/// The rays of a dark pupil, and what stops them.
#[derive(Debug, Clone)]
pub struct DarkPupil {
    rays: Vec<BlockedRay>,
    /// The radius of the ideal pupil, in mm.
    size: f64,
}

/// A ray and where it is stopped most.
#[derive(Debug, Clone, Copy)]
struct BlockedRay {
    ray: Ray<f64>,
    surface: usize,
    constraint: RayLimit,
    /// By how much: in radii of the ideal pupil at a rim, in squares of a cosine at a surface that is
    /// missed or reflects.
    depth: f64,
    /// What its margin adds to the depth for every unit.
    by_margin: f64,
}

impl Region<'_> {
    /// How far a dark pupil is from light; `None` for one that is lit.
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

/// Where the ray from a point of the pupil is stopped most.
fn blocked_ray(launch: &Launch<'_>, p: [f64; 2], size: f64) -> Option<BlockedRay> {
    let (ray, color) = (launch.ray(p)?, launch.channel());
    let mut worst: Option<BlockedRay> = None;
    color.tracer.margins(ray, |surface, hurdle, margin| {
        let (depth, by_margin) = depth(&color.system, surface, hurdle, margin, size);
        if worst.is_none_or(|worst| depth > worst.depth) {
            worst = Some(BlockedRay { ray, surface, constraint: hurdle, depth, by_margin });
        }
    });
    worst.filter(|worst| worst.depth > 0.0)
}

/// By how much a margin is short, and its derivative.
fn depth(
    system: &System<f64>,
    surface: usize,
    hurdle: RayLimit,
    margin: f64,
    size: f64,
) -> (f64, f64) {
    let at = &system.surfaces[surface];
    // The margin at a rim is a difference of squares, the depth one of lengths.
    let length = |edge: f64, height: f64, sign: f64| {
        let slope = -0.5 / (height * size);
        (sign * (height - edge) / size, if slope.is_finite() { slope } else { 0.0 })
    };
    match hurdle {
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
        RayLimit::Miss | RayLimit::Equator | RayLimit::TotalReflection => {
            let square = system.index_before(surface).powi(2);
            (-margin / square, -1.0 / square)
        }
    }
}

impl DarkPupil {
    /// The mean by which the rays are stopped: 0 where none is.
    pub fn depth(&self) -> f64 {
        let sum: f64 = self.rays.iter().map(|stopped| stopped.depth).sum();
        sum / self.rays.len().max(1) as f64
    }

    /// Minus an area in mm² that grows with the depth.
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
        for (surface, hurdle) in self.constraints() {
            let here = self.rays.iter().filter(|s| (s.surface, s.constraint) == (surface, hurdle));
            let (rays, weights): (Vec<_>, Vec<f64>) =
                here.map(|s| (s.ray, by_depth * s.by_margin)).unzip();
            let rays: Rays<f64> = rays.into_iter().collect();
            let mut found = tracer.margin_gradient(surface, hurdle, &rays, &weights);
            if hurdle == RayLimit::Rim {
                // Not by the square of a rim, which may be 0.
                found.surfaces[surface].semi_diameter = -by_depth * rays.len() as f64 / self.size;
            }
            total.add(&found, 1.0);
        }
        total
    }

    /// What stops the rays, each once.
    fn constraints(&self) -> Vec<(usize, RayLimit)> {
        let mut found = Vec::new();
        for stopped in &self.rays {
            let hurdle = (stopped.surface, stopped.constraint);
            if !found.contains(&hurdle) {
                found.push(hurdle);
            }
        }
        found
    }
}
