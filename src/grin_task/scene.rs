//! What a field does to the light of a task: loss, gradient, misses, and what became of every ray.

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

/// A ray that leaves flatter than this, as a cosine, is left out: the derivative of its exit grows
/// as the inverse.
pub(super) const MIN_COSINE: f64 = 0.05;
/// Steps that are tied to voxels are no simple fraction of one; without voxels they are tied to this
/// part of the space; and a ray counts as trapped when it is so many times longer than the space.
const INCOMMENSURATE: f64 = 0.974;
const RELATIVE_STEP: f64 = 0.02;
const MAX_RELATIVE_LENGTH: f64 = 32.0;

/// Where a ray shall go.
#[derive(Debug, Clone, Copy)]
pub(super) struct RayTarget {
    pub(super) x: Vec3<f64>,
    pub(super) v: Vec3<f64>,
    /// What the square of a difference in `v` counts.
    pub(super) direction: f64,
    /// Whether it is known at all.
    pub(super) measured: bool,
}

/// The rays of a view, ready to be traced.
#[derive(Debug, Clone)]
pub(super) struct ViewRays {
    pub(super) rays: Vec<GrinRay<f64>>,
    pub(super) targets: Vec<RayTarget>,
    pub(super) setup: GrinSetup<f64>,
    pub(super) weight: f64,
    /// What a ray that is left out counts, in mm²: more than any that is not.
    lost_penalty: f64,
    /// What an image is made on.
    pub(super) screen: Option<Screen>,
    /// What rays shall go through, wherever they like.
    ring: Option<RingTarget>,
    /// Rays that no aim is known for; they are not among the others.
    pub(super) unmeasured: usize,
}

/// Rays that are left out, by reason, and those that count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RayCounts {
    /// How all rays ended.
    pub fates: GrinFateCounts,
    /// Rays that arrived, but so flat to the boundary that their derivative is worth nothing.
    pub flat: usize,
    /// Rays that are not traced: what they should do could not be measured.
    pub unmeasured: usize,
}

/// How rays ended, and how many of them left too flat.
pub(super) fn count_rays(exits: &[RayExit<f64>]) -> RayCounts {
    let fates = exits.iter().map(|exit| exit.fate).collect();
    let is_flat = |exit: &&RayExit<f64>| exit.fate.has_arrived() && !ViewRays::is_valid(exit);
    RayCounts { fates, flat: exits.iter().filter(is_flat).count(), unmeasured: 0 }
}

impl RayCounts {
    /// All rays.
    pub fn total(self) -> usize {
        self.fates.total() + self.unmeasured
    }

    /// Rays that count.
    pub fn valid(self) -> usize {
        self.fates.arrived_count() - self.flat
    }

    /// Rays that are left out, by reason.
    pub fn excluded(self) -> impl Iterator<Item = (&'static str, usize)> {
        let more = [("flat", self.flat), ("unmeasured", self.unmeasured)];
        let lost = self.fates.iter().filter(|(fate, _)| !fate.has_arrived());
        let lost = lost.map(|(fate, count)| (fate.name(), count));
        lost.chain(more.into_iter().filter(|(_, count)| *count > 0))
    }

    /// Those of two sets of rays.
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

/// What became of the light of a view.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewResult {
    /// The loss of this view without its weight, in mm².
    pub loss: f64,
    /// The root of the mean square distance from the aim, in mm, of the rays that count; not a
    /// number for an image.
    pub spot: f64,
    /// Of an image: the square of the picture's peak over the mean square difference, in dB.
    pub psnr: Option<f64>,
    /// What became of the rays.
    pub counts: RayCounts,
    /// The largest distance between a start and the end of its way back, in steps.
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
    /// The space of a view, and the rays by which fields are judged in it.
    pub fn scoring_rays(&self, view: &LightView) -> (Domain, Vec<GrinRay<f64>>) {
        let space = view.space.unwrap_or(self.space);
        let rays = view.source.rays(space, RaySet::Scoring);
        (space, rays.into_iter().map(|sent| sent.ray).collect())
    }
}

/// How rays are traced, for each view: chosen anew as the field takes shape.
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

/// Steps that are tied to the voxels; to the space where the field has none.
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

/// The rays of every view with their aims.
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
            // The difference of an image has no unit.
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

/// The same views with the rays of another step.
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

/// The rays of a view that count, with their aims, and how many others there are.
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
    /// What became of the rays of all views.
    pub(super) fn counts(&self) -> RayCounts {
        self.views.iter().fold(RayCounts::default(), |sum, view| sum.merge(view.counts))
    }
}

impl ViewRays {
    /// Whether it is more than looked at.
    pub(super) fn has_weight(&self) -> bool {
        self.weight > 0.0
    }

    /// How many rays there are.
    pub(super) fn ray_count(&self) -> usize {
        self.rays.len()
    }

    /// What a loss of this view adds to that of the task.
    pub(super) fn weighted(&self, loss: f64) -> f64 {
        self.weight * loss
    }

    /// Whether a ray counts.
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

    /// By how much a ray misses its aim.
    fn residuals(&self, ray: usize, exit: &RayExit<f64>) -> (Vec3<f64>, Vec3<f64>) {
        if let Some(ring) = &self.ring {
            return ring.residuals(exit);
        }
        let aim = self.targets[ray];
        (exit.x - aim.x, exit.v - aim.v)
    }

    /// What the square of a miss in direction counts.
    fn direction_weight(&self, ray: usize) -> f64 {
        self.ring.as_ref().map_or_else(|| self.targets[ray].direction, |ring| ring.direction_weight)
    }

    /// The derivative by the end of a ray of what has these by its misses.
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

    /// What becomes of the light, without a gradient.
    pub(super) fn trace_result(
        &self,
        field: &dyn IndexField<f64>,
    ) -> Result<ViewResult, GrinTaskError> {
        let exits = GrinTracer::new(field, self.setup.clone())?.trace_batch(&self.rays);
        Ok(self.result(&exits, 0.0))
    }

    /// The image of the rays that count.
    pub(super) fn image(screen: &Screen, exits: &[RayExit<f64>]) -> Vec<f64> {
        screen.image(exits.iter().filter(|exit| Self::is_valid(exit)), exits.len())
    }

    /// The derivative of the loss by every exit, times the number of rays.
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

    /// How its rays ended.
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

    /// The loss with its gradient, added with the weight of the view.
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

    /// What each ray misses its aim by, as rows of a least-squares problem with their derivatives.
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

/// The loss of a field by some rays, with its gradient; views of weight 0 are not looked at.
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
