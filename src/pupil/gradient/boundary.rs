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

use super::{Cost, Derivative};
use crate::pupil::boundary::Limit;
use crate::pupil::quadrature::{Nodes, SPLIT, Spoke, nodes_of};
use crate::pupil::region::{Kind, Region};
use crate::trace::{Gradient, Hurdle, Points, Rays, Seed};

impl Region<'_> {
    /// The derivative of an integral with the motion of the edge, at an order of quadrature
    /// counted from 0; its error is left at zero. `None` where the pupil is not one star-shaped
    /// piece or has no light.
    pub fn boundary_derivative(&self, cost: &Cost, order: usize) -> Option<Derivative> {
        let Kind::Split(boundary) = &self.kind else {
            let kept = matches!(self.kind, Kind::Clear);
            return kept.then(|| self.biased_derivative(cost, &self.nodes(order)));
        };
        let (azimuths, radii) = SPLIT[order.min(SPLIT.len() - 1)];
        let (spokes, rays) = self.spokes(boundary, azimuths);
        let mut nodes = nodes_of(&spokes, &boundary.frame, radii);
        nodes.mirrored = self.launch.is_symmetric();
        let mut found = self.biased_derivative(cost, &nodes);
        found.by.add(&self.edge_motion(cost, &spokes), 1.0);
        found.rays += rays + 3 * spokes.len();
        Some(found)
    }

    /// The integral of `dC/dt` over fixed nodes: the derivative without the motion of the edge,
    /// biased wherever something clips. Its error is left at zero.
    pub fn biased_derivative(&self, cost: &Cost, nodes: &Nodes) -> Derivative {
        let scale = self.launch.area();
        let started = nodes.points.iter().zip(&nodes.weights);
        let started = started.filter_map(|(p, w)| Some((self.launch.ray(*p)?, *w)));
        let (rays, weights): (Vec<_>, Vec<f64>) = started.unzip();
        let rays: Rays<f64> = rays.into_iter().collect();
        let mut points = Points::default();
        let tracer = &self.launch.color().tracer;
        tracer.batch(&rays, &mut points);
        let seed = |i: usize| {
            let [x, y] = cost.slope([points.x[i], points.y[i]]);
            let weight = scale * weights[i];
            let point = crate::math::Vec3::new(weight * x, weight * y, 0.0);
            Seed { point, ..Seed::default() }
        };
        let by = tracer.gradient(&rays, seed);
        let error = Gradient::zero(tracer.surfaces());
        Derivative { by, error, rays: 2 * rays.len() + nodes.rays }
    }

    /// What the motion of the edge contributes.
    fn edge_motion(&self, cost: &Cost, spokes: &[Spoke]) -> Gradient<f64> {
        let tracer = &self.launch.color().tracer;
        let mut total = Gradient::zero(tracer.surfaces());
        for limit in limits(spokes) {
            let Limit::Surface(surface, hurdle) = limit else { continue };
            let on_limit = spokes.iter().filter(|spoke| spoke.edge.limit == limit);
            let moved = on_limit.filter_map(|spoke| self.edge_ray(cost, spoke, surface, hurdle));
            let (rays, weights): (Vec<_>, Vec<f64>) = moved.unzip();
            let rays: Rays<f64> = rays.into_iter().collect();
            total.add(&tracer.margin_gradient(surface, hurdle, &rays, &weights), 1.0);
        }
        total
    }

    /// The ray at the end of a spoke, and what a change of its margin adds to the integral.
    fn edge_ray(
        &self,
        cost: &Cost,
        spoke: &Spoke,
        surface: usize,
        hurdle: Hurdle,
    ) -> Option<(crate::trace::Ray<f64>, f64)> {
        let Kind::Split(boundary) = &self.kind else { return None };
        let frame = &boundary.frame;
        let p = frame.point(spoke.azimuth, spoke.edge.radius);
        let ray = self.launch.ray(p)?;
        let color = self.launch.color();
        let landed = color.tracer.land_at_edge(ray, surface, hurdle)?;
        let slope = color.open.margin(self.launch.dual_ray(p)?, surface, hurdle)?.slope;
        let direction = frame.direction(spoke.azimuth);
        let outwards = slope[0] * direction[0] + slope[1] * direction[1];
        let measure = self.launch.area() * spoke.share * spoke.edge.radius;
        let weight = -measure * cost.of([landed.x, landed.y]) / outwards;
        weight.is_finite().then_some((ray, weight))
    }
}

/// The limits of some spokes, each once.
fn limits(spokes: &[Spoke]) -> Vec<Limit> {
    let mut found: Vec<Limit> = Vec::new();
    for spoke in spokes {
        if !found.contains(&spoke.edge.limit) {
            found.push(spoke.edge.limit);
        }
    }
    found
}
