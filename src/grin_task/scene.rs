//! The evaluation of a field for a task: loss, gradient, residuals, and the outcome of every ray.

use super::check::GrinTaskError;
use super::hold::FieldPenalties;
use super::image::Screen;
use super::measured::{self, MeasuredTargets};
use super::ring::RingTarget;
use super::source::{RaySet, SourceRay};
use super::stage::{image_screen, ring_target, screen_face};
use super::task::{Domain, GrinTask, LightGoal, LightView, TracingSettings};
use crate::grin::{
    EndCondition, GrinFateCounts, GrinRay, GrinSetup, GrinTracer, IndexField, LastStep, RayAdjoint,
    RayExit, plan_tracing,
};
use crate::math::Vec3;
use rayon::prelude::*;

/// A ray with a smaller cosine at its exit is excluded: the derivative of its exit grows as the
/// inverse.
pub(super) const MIN_COSINE: f64 = 0.05;
/// Steps tied to voxels are not a simple fraction of one; without voxels they are tied to this
/// fraction of the domain; and a ray counts as trapped when it is this many times longer than the
/// domain.
const INCOMMENSURATE: f64 = 0.974;
const RELATIVE_STEP: f64 = 0.02;
const MAX_RELATIVE_LENGTH: f64 = 32.0;

/// The target of a ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct RayTarget {
    pub(super) x: Vec3<f64>,
    pub(super) v: Vec3<f64>,
    /// The weight of a squared difference in `v`.
    pub(super) direction: f64,
    /// True if the target is known.
    pub(super) measured: bool,
}

/// The rays of a view, ready to be traced.
#[derive(Debug, Clone)]
pub(super) struct ViewRays {
    pub(super) rays: Vec<GrinRay<f64>>,
    pub(super) targets: Vec<RayTarget>,
    pub(super) setup: GrinSetup<f64>,
    pub(super) weight: f64,
    /// The penalty of an excluded ray, in mm²: more than that of any valid one.
    lost_penalty: f64,
    /// The screen of an image.
    pub(super) screen: Option<Screen>,
    /// The rings that rays should pass through, anywhere on them.
    ring: Option<RingTarget>,
    /// The number of rays without a known target; they are not among the others.
    pub(super) unmeasured: usize,
}

/// The outcomes of rays: the excluded ones by reason, and the valid ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RayCounts {
    /// The number of rays with each fate.
    pub fates: GrinFateCounts,
    /// Rays that arrived at such grazing incidence that their derivative is worthless.
    pub flat: usize,
    /// Rays that are not traced: their target could not be measured.
    pub unmeasured: usize,
}

/// The fates of rays, and the number of those that left at grazing incidence.
pub(super) fn count_rays(exits: &[RayExit<f64>]) -> RayCounts {
    let fates = exits.iter().map(|exit| exit.fate).collect();
    let is_flat = |exit: &&RayExit<f64>| exit.fate.has_arrived() && !ViewRays::is_valid(exit);
    RayCounts { fates, flat: exits.iter().filter(is_flat).count(), unmeasured: 0 }
}

impl RayCounts {
    /// The number of all rays.
    pub fn total(self) -> usize {
        self.fates.total() + self.unmeasured
    }

    /// The number of valid rays.
    pub fn valid(self) -> usize {
        self.fates.arrived_count() - self.flat
    }

    /// The excluded rays, by reason.
    pub fn excluded(self) -> impl Iterator<Item = (&'static str, usize)> {
        let more = [("flat", self.flat), ("unmeasured", self.unmeasured)];
        let lost = self.fates.iter().filter(|(fate, _)| !fate.has_arrived());
        let lost = lost.map(|(fate, count)| (fate.name(), count));
        lost.chain(more.into_iter().filter(|(_, count)| *count > 0))
    }

    /// The sum of two counts.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        let mut both = self;
        for (fate, count) in other.fates.iter() {
            (0..count).for_each(|_| both.fates.add(fate));
        }
        both.flat += other.flat;
        both.unmeasured += other.unmeasured;
        both
    }
}

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
pub(super) struct LossEvaluation {
    pub(super) loss: f64,
    pub(super) gradient: Vec<f64>,
    pub(super) views: Vec<ViewResult>,
}

impl GrinTask {
    /// The domain of a view, and its scoring rays.
    pub fn scoring_rays(&self, view: &LightView) -> (Domain, Vec<GrinRay<f64>>) {
        let space = view.space.unwrap_or(self.space);
        let rays = view.source.rays(space, RaySet::Scoring);
        (space, rays.into_iter().map(|sent| sent.ray).collect())
    }
}

/// The tracing setup of each view, chosen for the current field.
pub(super) fn plan_views(
    task: &GrinTask,
    field: &dyn IndexField<f64>,
    draw: RaySet,
) -> Result<Vec<GrinSetup<f64>>, GrinTaskError> {
    let setup = |view: &LightView| {
        let space = view.space.unwrap_or(task.space);
        let rays: Vec<GrinRay<f64>> = view.source.rays(space, draw).iter().map(|s| s.ray).collect();
        let mut setup = match task.tracing {
            Some(tracing) => tie_to_voxels(task, field, space, tracing),
            None => plan_tracing(field, &space.region(), task.launch, &rays, task.tolerance)?.setup,
        };
        setup.screen = screen_face(view, space);
        Ok(setup)
    };
    task.views.iter().map(setup).collect()
}

/// A setup with steps tied to the voxels, or to the domain where the field has none.
fn tie_to_voxels(
    task: &GrinTask,
    field: &dyn IndexField<f64>,
    space: Domain,
    tracing: TracingSettings,
) -> GrinSetup<f64> {
    let voxel = field.resolution().voxel.unwrap_or(RELATIVE_STEP * space.diameter());
    let step = INCOMMENSURATE * voxel / tracing.per_voxel;
    let limit = (MAX_RELATIVE_LENGTH * space.diameter() / step).clamp(64.0, 1e9) as u32;
    let end = EndCondition::Boundary { region: space.region(), last: LastStep::BrokenLine, limit };
    let TracingSettings { integrator, .. } = tracing;
    GrinSetup { integrator, step, launch: task.launch, end, screen: None }
}

/// The rays of every view with their targets.
pub(super) fn view_rays(
    task: &GrinTask,
    known: &MeasuredTargets,
    setups: &[GrinSetup<f64>],
    draw: RaySet,
) -> Result<Vec<ViewRays>, GrinTaskError> {
    let shot =
        |((view, setup), known): ((&LightView, &GrinSetup<f64>), &Option<Vec<RayTarget>>)| {
            let space = view.space.unwrap_or(task.space);
            let RayBundle { rays, aims, unmeasured } =
                ray_bundle(task, view, known.as_deref(), draw)?;
            let lost = space.diameter() * space.diameter();
            let (setup, weight, screen) = (setup.clone(), view.weight, image_screen(view, space)?);
            // The difference of images has no unit.
            let lost = if screen.is_some() { 1.0 } else { lost };
            Ok(ViewRays {
                rays,
                targets: aims,
                setup,
                weight,
                lost_penalty: lost,
                screen,
                ring: ring_target(view),
                unmeasured,
            })
        };
    task.views.iter().zip(setups).zip(known).map(shot).collect()
}

/// Replaces the rays of the views by those of another step.
pub(super) fn resample_views(
    task: &GrinTask,
    known: &MeasuredTargets,
    shots: &mut [ViewRays],
    draw: RaySet,
) -> Result<(), GrinTaskError> {
    for ((view, shot), known) in task.views.iter().zip(shots).zip(known) {
        let beam = ray_bundle(task, view, known.as_deref(), draw)?;
        (shot.rays, shot.targets, shot.unmeasured) = (beam.rays, beam.aims, beam.unmeasured);
    }
    Ok(())
}

/// The rays of a view with a known target, and the number of others.
struct RayBundle {
    rays: Vec<GrinRay<f64>>,
    aims: Vec<RayTarget>,
    unmeasured: usize,
}

fn ray_bundle(
    task: &GrinTask,
    view: &LightView,
    known: Option<&[RayTarget]>,
    draw: RaySet,
) -> Result<RayBundle, GrinTaskError> {
    let space = view.space.unwrap_or(task.space);
    let sent = view.source.rays(space, draw);
    let mut aims = match known {
        Some(known) => known.to_vec(),
        None => ray_targets(task, view, space, &sent)?,
    };
    let is_measured = |i: usize| aims.get(i).is_none_or(|aim| aim.measured);
    let measured = sent.iter().enumerate().filter(|(i, _)| is_measured(*i));
    let rays: Vec<GrinRay<f64>> = measured.map(|(_, sent)| sent.ray).collect();
    let unmeasured = sent.len() - rays.len();
    aims.retain(|aim| aim.measured);
    Ok(RayBundle { rays, aims, unmeasured })
}

fn ray_targets(
    task: &GrinTask,
    view: &LightView,
    space: Domain,
    sent: &[SourceRay],
) -> Result<Vec<RayTarget>, GrinTaskError> {
    let at = |x| RayTarget { x, v: Vec3::default(), direction: 0.0, measured: true };
    Ok(match &view.goal {
        LightGoal::Image { .. } | LightGoal::Far { .. } | LightGoal::Ring { .. } => Vec::new(),
        LightGoal::Point([x, y, z]) => vec![at(Vec3::new(*x, *y, *z)); sent.len()],
        LightGoal::Antipode => {
            let reach = 0.5 * space.diameter();
            sent.iter().map(|sent| at(sent.antipode * reach)).collect()
        }
        LightGoal::Like { field, direction } => {
            measured::trace_targets(task, view, field, sent, *direction)?
        }
    })
}

impl LossEvaluation {
    /// The outcomes of the rays of all views.
    pub(super) fn counts(&self) -> RayCounts {
        self.views.iter().fold(RayCounts::default(), |sum, view| sum.merge(view.counts))
    }
}

impl ViewRays {
    /// True if the view contributes to the loss.
    pub(super) fn has_weight(&self) -> bool {
        self.weight > 0.0
    }

    /// The number of rays.
    pub(super) fn ray_count(&self) -> usize {
        self.rays.len()
    }

    /// The contribution of a loss of this view to that of the task.
    pub(super) fn weighted(&self, loss: f64) -> f64 {
        self.weight * loss
    }

    /// True if a ray contributes to the loss.
    pub(super) fn is_valid(exit: &RayExit<f64>) -> bool {
        exit.fate.has_arrived() && exit.cosine.abs() >= MIN_COSINE
    }

    /// The loss of one ray and its derivative.
    fn ray_loss(&self, ray: usize, exit: &RayExit<f64>) -> (f64, RayAdjoint<f64>) {
        if !Self::is_valid(exit) {
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
        let aim = self.targets[ray];
        (exit.x - aim.x, exit.v - aim.v)
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
    pub(super) fn trace_result(
        &self,
        field: &dyn IndexField<f64>,
    ) -> Result<ViewResult, GrinTaskError> {
        let exits = GrinTracer::new(field, self.setup.clone())?.trace_batch(&self.rays);
        Ok(self.result(&exits, 0.0))
    }

    /// The image formed by the valid rays.
    pub(super) fn image(screen: &Screen, exits: &[RayExit<f64>]) -> Vec<f64> {
        screen.image(exits.iter().filter(|exit| Self::is_valid(exit)), exits.len())
    }

    /// The derivative of the loss with respect to every exit, times the number of rays.
    fn adjoints(&self, exits: &[RayExit<f64>]) -> Vec<RayAdjoint<f64>> {
        let rays = exits.len();
        let Some(screen) = &self.screen else {
            return exits.iter().enumerate().map(|(i, exit)| self.ray_loss(i, exit).1).collect();
        };
        let image = Self::image(screen, exits);
        let seed = |exit: &RayExit<f64>| {
            if !Self::is_valid(exit) {
                return RayAdjoint::default();
            }
            let seed = screen.adjoint(&image, exit, rays);
            RayAdjoint { x: seed.x * rays as f64, v: seed.v * rays as f64, ..seed }
        };
        exits.iter().map(seed).collect()
    }

    pub(super) fn result(&self, exits: &[RayExit<f64>], retrace_error: f64) -> ViewResult {
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
            if Self::is_valid(exit) {
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
    pub(super) fn add_gradient(
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
            if !Self::is_valid(&exit) {
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
pub(super) fn evaluate(
    field: &dyn IndexField<f64>,
    shots: &[ViewRays],
    hold: &FieldPenalties,
) -> Result<LossEvaluation, GrinTaskError> {
    let mut gradient = vec![0.0; field.parameters().len()];
    let (mut loss, mut views) = (hold.add_gradient(field, &mut gradient), Vec::new());
    for shot in shots.iter().filter(|shot| shot.has_weight()) {
        let result = shot.add_gradient(field, &mut gradient)?;
        loss += shot.weight * result.loss;
        views.push(result);
    }
    Ok(LossEvaluation { loss, gradient, views })
}

/// The same as rows of a least-squares problem: the loss is the sum of their squares.
pub(super) fn evaluate_rows(
    field: &dyn IndexField<f64>,
    shots: &[ViewRays],
    hold: &FieldPenalties,
) -> Result<Vec<(f64, Vec<f64>)>, GrinTaskError> {
    let mut all = hold.residual_rows(field);
    for shot in shots.iter().filter(|shot| shot.has_weight()) {
        all.extend(shot.residual_rows(field)?);
    }
    Ok(all)
}
