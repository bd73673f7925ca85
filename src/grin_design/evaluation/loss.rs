//! The evaluation of a field for a task: loss, gradient, residuals, and the outcome of every ray.

use super::outcome::{RayCounts, count_rays, is_valid};
use super::penalties::FieldPenalties;
use super::screen::Screen;
use super::targets::RingTarget;
use super::views::ViewRays;
use crate::grin::{GrinRay, GrinTracer, IndexField, RayAdjoint, RayExit};
use crate::grin_design::GrinTaskError;
use crate::math::Vec3;
use rayon::prelude::*;

/// The result of a view.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewResult {
    /// The loss of this view without its weight, in mm².
    pub loss: f64,
    /// The root mean square distance from the target, in mm, over the valid rays; NaN for an image.
    pub spot: f64,
    /// The peak signal-to-noise ratio of an image, in dB.
    pub psnr: Option<f64>,
    /// The outcomes of the rays.
    pub counts: RayCounts,
    /// The largest distance between a start and the end of its retraced ray, in steps.
    pub retrace_error: f64,
}

/// The loss of a field with its gradient.
#[derive(Debug, Clone)]
pub(in crate::grin_design) struct LossEvaluation {
    pub(in crate::grin_design) loss: f64,
    pub(in crate::grin_design) gradient: Vec<f64>,
    pub(super) views: Vec<ViewResult>,
}

impl LossEvaluation {
    /// The outcomes of the rays of all views.
    pub(in crate::grin_design) fn counts(&self) -> RayCounts {
        self.views.iter().fold(RayCounts::default(), |sum, view| sum.merge(view.counts))
    }
}

impl ViewRays {
    /// True if the view contributes to the loss.
    pub(in crate::grin_design) fn has_weight(&self) -> bool {
        self.weight > 0.0
    }

    /// The number of rays.
    pub(in crate::grin_design) fn ray_count(&self) -> usize {
        self.rays.len()
    }

    /// The contribution of a loss of this view to that of the task.
    pub(in crate::grin_design) fn weighted(&self, loss: f64) -> f64 {
        self.weight * loss
    }

    /// The loss of one ray and its derivative.
    fn ray_loss(&self, ray: usize, exit: &RayExit<f64>) -> (f64, RayAdjoint<f64>) {
        if !is_valid(exit) {
            return (self.lost_penalty, RayAdjoint::default());
        }
        let (dx, dv) = self.residuals(ray, exit);
        let direction = self.direction_weight(ray);
        let seed = self.adjoint(exit, dx * 2.0, dv * (2.0 * direction));
        (dx.dot(dx) + direction * dv.dot(dv), seed)
    }

    /// The residuals of a ray in position and direction.
    fn residuals(&self, ray: usize, exit: &RayExit<f64>) -> (Vec3<f64>, Vec3<f64>) {
        if let Some(ring) = &self.ring {
            return ring.residuals(exit);
        }
        let target = self.targets[ray];
        (exit.x - target.x, exit.v - target.v)
    }

    /// The weight of a squared residual in direction.
    fn direction_weight(&self, ray: usize) -> f64 {
        self.ring.as_ref().map_or_else(|| self.targets[ray].direction, |ring| ring.direction_weight)
    }

    /// The derivative with respect to the exit of a ray, from those with respect to its residuals.
    fn adjoint(
        &self,
        exit: &RayExit<f64>,
        x: Vec3<f64>,
        by_direction: Vec3<f64>,
    ) -> RayAdjoint<f64> {
        let v = match self.ring {
            Some(_) => RingTarget::by_velocity(exit.v, by_direction),
            None => by_direction,
        };
        RayAdjoint { x, v, path: 0.0 }
    }

    /// Traces the rays without a gradient.
    pub(in crate::grin_design) fn trace_result(
        &self,
        field: &dyn IndexField<f64>,
    ) -> Result<ViewResult, GrinTaskError> {
        let exits = GrinTracer::new(field, self.setup.clone())?.trace_batch(&self.rays);
        Ok(self.result(&exits, 0.0))
    }

    /// The image formed by the valid rays.
    pub(in crate::grin_design) fn image(screen: &Screen, exits: &[RayExit<f64>]) -> Vec<f64> {
        screen.image(exits.iter().filter(|exit| is_valid(exit)), exits.len())
    }

    /// The derivative of the loss with respect to every exit, times the number of rays.
    fn adjoints(&self, exits: &[RayExit<f64>]) -> Vec<RayAdjoint<f64>> {
        let rays = exits.len();
        let Some(screen) = &self.screen else {
            return exits.iter().enumerate().map(|(i, exit)| self.ray_loss(i, exit).1).collect();
        };
        let image = Self::image(screen, exits);
        let seed = |exit: &RayExit<f64>| {
            if !is_valid(exit) {
                return RayAdjoint::default();
            }
            let seed = screen.adjoint(&image, exit, rays);
            RayAdjoint { x: seed.x * rays as f64, v: seed.v * rays as f64, ..seed }
        };
        exits.iter().map(seed).collect()
    }

    pub(in crate::grin_design) fn result(
        &self,
        exits: &[RayExit<f64>],
        retrace_error: f64,
    ) -> ViewResult {
        match &self.screen {
            Some(screen) => self.image_result(screen, exits, retrace_error),
            None => self.spot_result(exits, retrace_error),
        }
    }

    /// The outcomes of its rays.
    fn ray_counts(&self, exits: &[RayExit<f64>]) -> RayCounts {
        RayCounts { unmeasured: self.unmeasured, ..count_rays(exits) }
    }

    fn image_result(
        &self,
        screen: &Screen,
        exits: &[RayExit<f64>],
        retrace_error: f64,
    ) -> ViewResult {
        let difference = screen.difference(&Self::image(screen, exits));
        let counts = self.ray_counts(exits);
        let lost = exits.len() - counts.valid();
        let loss = difference + self.lost_penalty * lost as f64 / exits.len() as f64;
        let quality = Some(screen.psnr(difference));
        ViewResult { loss, spot: f64::NAN, psnr: quality, counts, retrace_error }
    }

    fn spot_result(&self, exits: &[RayExit<f64>], retrace_error: f64) -> ViewResult {
        let (mut loss, mut square) = (0.0, 0.0);
        for (i, exit) in exits.iter().enumerate() {
            loss += self.ray_loss(i, exit).0;
            if is_valid(exit) {
                let dx = self.residuals(i, exit).0;
                square += dx.dot(dx);
            }
        }
        let counts = self.ray_counts(exits);
        let spot = (square / counts.valid() as f64).sqrt();
        let loss = loss / exits.len() as f64;
        ViewResult { loss, spot, psnr: None, counts, retrace_error }
    }

    /// The loss; its gradient is added with the weight of the view.
    pub(in crate::grin_design) fn add_gradient(
        &self,
        field: &dyn IndexField<f64>,
        gradient: &mut [f64],
    ) -> Result<ViewResult, GrinTaskError> {
        let tracer = GrinTracer::new(field, self.setup.clone())?;
        let mut exits = tracer.trace_batch(&self.rays);
        let seeds = self.adjoints(&exits);
        let found = tracer.gradient(&self.rays, &mut exits, &seeds);
        let share = self.weight / self.rays.len() as f64;
        gradient.iter_mut().zip(&found.parameters).for_each(|(sum, g)| *sum += share * g);
        Ok(self.result(&exits, found.retrace_error))
    }

    /// The residuals of each ray with their derivatives, as rows of a least-squares problem.
    fn residual_rows(
        &self,
        field: &dyn IndexField<f64>,
    ) -> Result<Vec<(f64, Vec<f64>)>, GrinTaskError> {
        let tracer = GrinTracer::new(field, self.setup.clone())?;
        let scale = (self.weight / self.rays.len() as f64).sqrt();
        let parameters = field.parameters().len();
        let of_ray = |(i, ray): (usize, &GrinRay<f64>)| {
            let exit = tracer.trace(ray);
            if !is_valid(&exit) {
                return vec![(scale * self.lost_penalty.sqrt(), vec![0.0; parameters])];
            }
            let (dx, dv) = self.residuals(i, &exit);
            let row = |miss: f64, seed: RayAdjoint<f64>| {
                let taped = tracer.tape_gradient(&[*ray], &[exit], &[seed]);
                (miss, taped.parameters)
            };
            let root = scale * self.direction_weight(i).sqrt();
            let axes = |scale: f64| {
                [Vec3::new(scale, 0.0, 0.0), Vec3::new(0.0, scale, 0.0), Vec3::new(0.0, 0.0, scale)]
            };
            let none = Vec3::default();
            let at = axes(scale).map(|x| row(x.dot(dx), self.adjoint(&exit, x, none)));
            let mut rows = at.to_vec();
            if root > 0.0 {
                rows.extend(axes(root).map(|v| row(v.dot(dv), self.adjoint(&exit, none, v))));
            }
            rows
        };
        Ok(self.rays.par_iter().enumerate().flat_map_iter(of_ray).collect())
    }
}

/// The loss of a field with its gradient; views of weight 0 are skipped.
pub(in crate::grin_design) fn evaluate(
    field: &dyn IndexField<f64>,
    views: &[ViewRays],
    penalties: &FieldPenalties,
) -> Result<LossEvaluation, GrinTaskError> {
    let mut gradient = vec![0.0; field.parameters().len()];
    let (mut loss, mut results) = (penalties.add_gradient(field, &mut gradient), Vec::new());
    for view in views.iter().filter(|view| view.has_weight()) {
        let result = view.add_gradient(field, &mut gradient)?;
        loss += view.weight * result.loss;
        results.push(result);
    }
    Ok(LossEvaluation { loss, gradient, views: results })
}

/// The same as rows of a least-squares problem: the loss is the sum of their squares.
pub(in crate::grin_design) fn evaluate_rows(
    field: &dyn IndexField<f64>,
    views: &[ViewRays],
    penalties: &FieldPenalties,
) -> Result<Vec<(f64, Vec<f64>)>, GrinTaskError> {
    let mut all = penalties.residual_rows(field);
    for view in views.iter().filter(|view| view.has_weight()) {
        all.extend(view.residual_rows(field)?);
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::{evaluate, evaluate_rows};
    use crate::grin_design::evaluation::penalties::FieldPenalties;
    use crate::grin_design::evaluation::targets::measure_targets;
    use crate::grin_design::evaluation::views::{plan_views, view_rays};
    use crate::grin_design::task::source::RaySet;
    use crate::grin_design::{GrinField, GrinTask, LightGoal, LightSource, find_builtin};
    use crate::math::Vec3;

    /// A task with few rays, traced so accurately that its loss is smooth.
    fn smooth(name: &str) -> Option<GrinTask> {
        let mut task = find_builtin(name)?.task().ok()?;
        (task.tracing, task.tolerance) = (None, 1e-6);
        for view in &mut task.views {
            if let LightSource::Beam { rays, .. } = &mut view.source {
                *rays = 20;
            }
            if let LightGoal::Image { pixels, .. } | LightGoal::Far { pixels, .. } = &mut view.goal
            {
                *pixels = 8;
            }
        }
        Some(task)
    }

    /// The directional derivative of the loss along a change of the field, by the adjoint and by
    /// differences.
    fn slopes(task: &GrinTask) -> Option<[f64; 2]> {
        let wave = |p: Vec3<f64>| 1.1 + 0.02 * (2.0 * p.x + p.y).sin() * (p.z - 0.4 * p.x).cos();
        let field = GrinField::from_function(task.field, 6, wave).ok()?;
        let setups = plan_views(task, field.index_field(), RaySet::Scoring).ok()?;
        let views = view_rays(task, &measure_targets(task).ok()?, &setups, RaySet::Scoring).ok()?;
        let penalties = FieldPenalties::new(task);
        let count = field.index_field().parameters().len();
        let change: Vec<f64> = (0..count).map(|i| (0.7 * i as f64).sin()).collect();
        let moved = |by: f64| {
            let mut other = field.clone();
            let numbers = other.parameters_mut().iter_mut().zip(&change);
            numbers.for_each(|(value, change)| *value += by * change);
            Some(evaluate(other.index_field(), &views, &penalties).ok()?.loss)
        };
        let found = evaluate(field.index_field(), &views, &penalties).ok()?;
        let adjoint = found.gradient.iter().zip(&change).map(|(g, c)| g * c).sum();
        let step = 1e-6;
        Some([adjoint, (moved(step)? - moved(-step)?) / (2.0 * step)])
    }

    #[test]
    fn gradients_of_what_a_beam_shows_are_those_of_differences() {
        for name in ["display", "multifocal", "caustic-near", "caustic-far", "caustic"] {
            let Some([adjoint, difference]) = smooth(name).as_ref().and_then(slopes) else {
                panic!("{name} cannot be evaluated")
            };
            let off = (adjoint - difference).abs() / difference.abs();
            assert!(off < 1e-5, "{name}: {adjoint} {difference}");
        }
    }

    /// Least squares see the same loss, and the same gradient.
    #[test]
    fn the_squares_of_the_rows_add_up_to_the_loss() {
        let mut compared = 0;
        for name in ["luneburg-radial", "fibre", "plume"] {
            let Some(mut task) = smooth(name) else { panic!("{name} is no task") };
            for view in &mut task.views {
                if let LightSource::Parallel { rays, .. } = &mut view.source {
                    *rays = 2;
                }
            }
            let wave = |p: Vec3<f64>| 1.1 + 0.02 * (2.0 * p.x + p.y).sin() * (p.z - 0.4).cos();
            let field = GrinField::from_function(task.field, 4, wave).unwrap();
            let setups = plan_views(&task, field.index_field(), RaySet::Scoring).unwrap();
            let targets = measure_targets(&task).unwrap();
            let views = view_rays(&task, &targets, &setups, RaySet::Scoring).unwrap();
            if views.iter().any(|view| view.screen.is_some()) {
                continue;
            }
            let penalties = FieldPenalties::new(&task);
            let rows = evaluate_rows(field.index_field(), &views, &penalties).unwrap();
            let whole = evaluate(field.index_field(), &views, &penalties).unwrap();
            let sum: f64 = rows.iter().map(|(residual, _)| residual * residual).sum();
            assert!((sum / whole.loss - 1.0).abs() < 1e-9, "{name}: {sum} {}", whole.loss);
            let largest = whole.gradient.iter().fold(0.0, |most: f64, g| most.max(g.abs()));
            for (i, exact) in whole.gradient.iter().enumerate() {
                let slope: f64 = rows.iter().map(|(residual, row)| 2.0 * residual * row[i]).sum();
                assert!((slope - exact).abs() < 1e-4 * largest, "{name} {i}: {slope} {exact}");
            }
            compared += 1;
        }
        assert!(compared >= 3, "{compared}");
    }
}
