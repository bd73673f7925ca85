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
use crate::pupil::region::{LimitEdge, RegionKind, TracedPupil};
use crate::trace::{AdjointSeed, Rays, SystemGradient};

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
        self.edge_motion_of_points(|p| cost.value(p))
    }

    /// The same for a contribution that is given by the image point alone.
    pub fn edge_motion_of_points(
        &self,
        cost: impl Fn([f64; 2]) -> f64,
    ) -> Option<SystemGradient<f64>> {
        self.sum_over_edges(|edge| edge.landings.iter().map(|p| cost(*p)).collect())
    }

    /// The same for a contribution that depends on the whole ray: `costs` gives those of some rays, in
    /// the unit of the integral over mm² of the first vertex plane.
    pub fn edge_motion_of_rays(
        &self,
        costs: impl Fn(&Rays<f64>) -> Vec<f64>,
    ) -> Option<SystemGradient<f64>> {
        self.sum_over_edges(|edge| costs(&edge.rays))
    }

    fn sum_over_edges(
        &self,
        costs: impl Fn(&LimitEdge) -> Vec<f64>,
    ) -> Option<SystemGradient<f64>> {
        let tracer = &self.region.launch.channel().tracer;
        let mut total = SystemGradient::zero(tracer.surfaces());
        if self.region.kind == RegionKind::Clear {
            return Some(total);
        }
        for edge in self.edges()? {
            let weights: Vec<f64> =
                edge.by_margin.iter().zip(costs(edge)).map(|(by, cost)| by * cost).collect();
            let moved = tracer.margin_gradient(edge.surface, edge.limit, &edge.rays, &weights);
            total.add(&moved, 1.0);
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
}
