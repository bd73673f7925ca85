//! The derivative as an integral over the pupil and one along its edge.
//!
//! In polar coordinates about a point inside, `L = ∫dψ ∫₀^R(ψ) C r dr`, and the edge moves with
//! `dR/dt = −∂M/∂t / ∂M/∂r` where the margin `M` ends it, so that
//!
//! ```text
//! dL/dt = ∫ dC/dt dw + ∫ C(R) R dR/dt dψ
//! ```
//!
//! Split at its corners, the edge is smooth along every arc, and Gauss nodes converge spectrally.
//! Rays are traced backwards, so that the cost does not depend on the number of parameters.

use super::Integrand;
use crate::math::Vec3;
use crate::pupil::boundary::{Frame, Limit};
use crate::pupil::lit::{Lit, Rim};
use crate::pupil::quadrature::Spoke;
use crate::trace::{Gradient, Hurdle, Ray, Rays, Seed};

impl Lit<'_> {
    /// The integral itself, in mm² of the first vertex plane times the unit of the integrand.
    pub fn integral(&self, cost: &impl Integrand) -> f64 {
        let points = &self.landed.sink;
        let of = |(i, weight): (usize, f64)| weight * cost.of([points.x[i], points.y[i]]);
        self.launch.area() * self.landed.arrived().map(of).sum::<f64>()
    }

    /// The derivative with the motion of the edge, by every number of the system; `None` where the
    /// pupil is not one piece that a point inside sees all of.
    pub fn boundary_derivative(&self, cost: &impl Integrand) -> Option<Gradient<f64>> {
        let mut total = self.biased_derivative(cost);
        total.add(&self.edge_motion(cost)?, 1.0);
        Some(total)
    }

    /// The integral of `dC/dt` over fixed rays: the derivative without the motion of the edge,
    /// biased wherever something clips.
    pub fn biased_derivative(&self, cost: &impl Integrand) -> Gradient<f64> {
        let (scale, points) = (self.launch.area(), &self.landed.sink);
        let seed = |i: usize| {
            let [x, y] = cost.slope([points.x[i], points.y[i]]);
            let weight = scale * self.landed.weights[i];
            Seed { point: Vec3::new(weight * x, weight * y, 0.0), ..Seed::default() }
        };
        self.launch.color().tracer.gradient(&self.rays, seed)
    }

    /// What the motion of the edge contributes: nothing where it is the disc of the pupil, which
    /// does not move; `None` where the edge is not known.
    pub fn edge_motion(&self, cost: &impl Integrand) -> Option<Gradient<f64>> {
        let tracer = &self.launch.color().tracer;
        let mut total = Gradient::zero(tracer.surfaces());
        let frame = match &self.rim {
            Rim::Still => return Some(total),
            Rim::Spokes(frame) => frame,
            Rim::Unknown => return None,
        };
        for limit in self.limits() {
            let Limit::Surface(surface, hurdle) = limit else { continue };
            let on_limit = self.spokes.iter().filter(|spoke| spoke.edge.limit == limit);
            let moved = on_limit.filter_map(|s| self.edge_ray(cost, frame, s, (surface, hurdle)));
            let (rays, weights): (Vec<_>, Vec<f64>) = moved.unzip();
            let rays: Rays<f64> = rays.into_iter().collect();
            total.add(&tracer.margin_gradient(surface, hurdle, &rays, &weights), 1.0);
        }
        Some(total)
    }

    /// The ray at the end of a spoke, and what a change of its margin adds to the integral.
    fn edge_ray(
        &self,
        cost: &impl Integrand,
        frame: &Frame,
        spoke: &Spoke,
        (surface, hurdle): (usize, Hurdle),
    ) -> Option<(Ray<f64>, f64)> {
        let launch = &self.launch;
        let p = frame.point(spoke.azimuth, spoke.edge.radius);
        let ray = launch.ray(p)?;
        let color = launch.color();
        let landed = color.tracer.land_at_edge(ray, surface, hurdle)?;
        let slope = color.open.margin(launch.dual_ray(p)?, surface, hurdle)?.slope;
        let direction = frame.direction(spoke.azimuth);
        let outwards = slope[0] * direction[0] + slope[1] * direction[1];
        let measure = launch.area() * spoke.share * spoke.edge.radius;
        let weight = -measure * cost.of([landed.x, landed.y]) / outwards;
        weight.is_finite().then_some((ray, weight))
    }
}
