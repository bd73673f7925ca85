//! The derivative as an integral over the pupil and one along its edge.
//!
//! In polar coordinates about a point inside, `L = ∫dψ ∫₀^R(ψ) C r dr`, and the edge moves with
//! `dR/dt = −∂M/∂t / ∂M/∂r` for the margin `M` that ends it, so that
//!
//! ```text
//! dL/dt = ∫ dC/dt dw + ∫ C(R) R dR/dt dψ
//! ```
//!
//! Split at its corners, the edge is smooth along every arc, and Gauss nodes converge spectrally.
//! The derivatives come from adjoint rays, so that the cost does not depend on the number of
//! parameters.

use super::{Integrand, QuadraticIntegrand, WarpSampling};
use crate::math::Vec3;
use crate::pupil::region::{PolarFrame, PupilLimit, RadialLine, RegionKind, TracedPupil};
use crate::trace::{AdjointSeed, Ray, RayLimit, Rays, SystemGradient};

impl TracedPupil<'_> {
    /// The integral, in mm² of the first vertex plane times the unit of the integrand.
    pub fn integral(&self, cost: &impl Integrand) -> f64 {
        let points = &self.landed.sink;
        let of = |(i, weight): (usize, f64)| weight * cost.value([points.x[i], points.y[i]]);
        self.region.launch.area() * self.landed.arrivals().map(of).sum::<f64>()
    }

    /// The derivative with the motion of the edge, by every number of the system; `None` if the
    /// pupil is neither star-shaped nor an annulus.
    pub fn boundary_derivative(&self, cost: &impl Integrand) -> Option<SystemGradient<f64>> {
        let mut total = self.biased_derivative(cost);
        total.add(&self.edge_motion(cost)?, 1.0);
        Some(total)
    }

    /// The integral of `dC/dt` over fixed rays: the derivative without the motion of the edge,
    /// biased if anything clips.
    pub fn biased_derivative(&self, cost: &impl Integrand) -> SystemGradient<f64> {
        let (scale, points) = (self.region.launch.area(), &self.landed.sink);
        let seed = |i: usize| {
            let [x, y] = cost.slope([points.x[i], points.y[i]]);
            let weight = scale * self.landed.weights[i];
            AdjointSeed { point: Vec3::new(weight * x, weight * y, 0.0), ..AdjointSeed::default() }
        };
        self.region.launch.channel().tracer.gradient(&self.rays, seed)
    }

    /// The contribution of the motion of the edge: zero for the disc of the pupil, which does not
    /// move; `None` if the edge is unknown.
    pub fn edge_motion(&self, cost: &impl Integrand) -> Option<SystemGradient<f64>> {
        let tracer = &self.region.launch.channel().tracer;
        let mut total = SystemGradient::zero(tracer.surfaces());
        let frame = match &self.region.kind {
            RegionKind::Clear => return Some(total),
            RegionKind::StarShaped(boundary) => boundary.frame,
            RegionKind::Irregular { annulus: Some(annulus), .. } => annulus.outer.frame,
            RegionKind::Irregular { annulus: None, .. }
            | RegionKind::Dark
            | RegionKind::Unbounded => return None,
        };
        if self.radial_lines.is_empty() {
            return None;
        }
        for limit in self.limits() {
            let PupilLimit::Surface(surface, ray_limit) = limit else { continue };
            let on_limit = self.radial_lines.iter().filter(|line| line.edge.limit == limit);
            let moved =
                on_limit.filter_map(|s| self.edge_ray(cost, &frame, s, (surface, ray_limit)));
            let (rays, weights): (Vec<_>, Vec<f64>) = moved.unzip();
            let rays: Rays<f64> = rays.into_iter().collect();
            total.add(&tracer.margin_gradient(surface, ray_limit, &rays, &weights), 1.0);
        }
        Some(total)
    }

    /// The contribution of the motion of the edge for any form of the pupil: for an irregular pupil
    /// estimated by the warp field, always with the same samples; for a dark pupil the derivative
    /// of [`TracedPupil::signed_area`] times the constant of the integrand, which leads back to
    /// light.
    pub fn robust_edge_motion(&self, cost: &QuadraticIntegrand) -> SystemGradient<f64> {
        if let Some(shadow) = &self.dark {
            return shadow.derivative(&self.region, cost.constant);
        }
        self.edge_motion(cost)
            .or_else(|| self.sampled_edge_motion(cost))
            .unwrap_or_else(|| SystemGradient::zero(self.region.launch.channel().tracer.surfaces()))
    }

    /// The estimate of the warp field without the derivative of fixed rays.
    fn sampled_edge_motion(&self, cost: &QuadraticIntegrand) -> Option<SystemGradient<f64>> {
        let mut whole = self.region.warp_derivative(cost, WarpSampling::default())?.gradient;
        whole.add(&self.biased_derivative(cost), -1.0);
        Some(whole)
    }

    /// The ray at the end of a radial line, and the derivative of the integral by its margin.
    fn edge_ray(
        &self,
        cost: &impl Integrand,
        frame: &PolarFrame,
        line: &RadialLine,
        (surface, ray_limit): (usize, RayLimit),
    ) -> Option<(Ray<f64>, f64)> {
        let launch = &self.region.launch;
        let p = frame.point(line.azimuth, line.edge.radius);
        let ray = launch.ray(p)?;
        let channel = launch.channel();
        let landed = channel.tracer.land_at_edge(ray, surface, ray_limit)?;
        let slope = channel.unclipped.margin(launch.dual_ray(p)?, surface, ray_limit)?.slope;
        let direction = frame.direction(line.azimuth);
        let outwards = slope[0] * direction[0] + slope[1] * direction[1];
        let measure = launch.area() * line.share * line.edge.radius;
        let weight = -measure * cost.value([landed.x, landed.y]) / outwards;
        weight.is_finite().then_some((ray, weight))
    }
}
