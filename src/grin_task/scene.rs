//! What a field does to the light of a task: loss, gradient, misses, and what became of every ray.

use super::check::TaskError;
use super::hold::Hold;
use super::image::Screen;
use super::measured::{self, Known};
use super::ring::Ring;
use super::source::{Draw, Sent};
use super::stage::{face, ring, screen};
use super::task::{Goal, Space, Task, Tracing, View};
use crate::grin::{End, Exit, Fates, Field, LastStep, Ray, Seed, Setup, Tracer, plan};
use crate::math::Vec3;
use rayon::prelude::*;

/// A ray that leaves flatter than this, as a cosine, is left out: the derivative of its exit grows
/// as the inverse.
pub(super) const FLATTEST: f64 = 0.05;
/// Steps that are tied to voxels are no simple fraction of one; without voxels they are tied to this
/// part of the space; and a ray counts as trapped when it is so many times longer than the space.
const INCOMMENSURATE: f64 = 0.974;
const COARSE: f64 = 0.02;
const LONGEST: f64 = 32.0;

/// Where a ray shall go.
#[derive(Debug, Clone, Copy)]
pub(super) struct Aim {
    pub(super) x: Vec3<f64>,
    pub(super) v: Vec3<f64>,
    /// What the square of a difference in `v` counts.
    pub(super) direction: f64,
    /// Whether it is known at all.
    pub(super) measured: bool,
}

/// The rays of a view, ready to be traced.
#[derive(Debug, Clone)]
pub(super) struct Shot {
    pub(super) rays: Vec<Ray<f64>>,
    pub(super) aims: Vec<Aim>,
    pub(super) setup: Setup<f64>,
    pub(super) weight: f64,
    /// What a ray that is left out counts, in mm²: more than any that is not.
    lost: f64,
    /// What an image is made on.
    pub(super) screen: Option<Screen>,
    /// What rays shall go through, wherever they like.
    ring: Option<Ring>,
    /// Rays that no aim is known for; they are not among the others.
    pub(super) unmeasured: usize,
}

/// Rays that are left out, by reason, and those that count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// How all rays ended.
    pub fates: Fates,
    /// Rays that arrived, but so flat to the boundary that their derivative is worth nothing.
    pub flat: usize,
    /// Rays that are not traced: what they should do could not be measured.
    pub unmeasured: usize,
}

/// How rays ended, and how many of them left too flat.
pub(super) fn counts(exits: &[Exit<f64>]) -> Counts {
    let fates = exits.iter().map(|exit| exit.fate).collect();
    let is_flat = |exit: &&Exit<f64>| exit.fate.arrived() && !Shot::counts(exit);
    Counts { fates, flat: exits.iter().filter(is_flat).count(), unmeasured: 0 }
}

impl Counts {
    /// All rays.
    pub fn sent(self) -> usize {
        self.fates.total() + self.unmeasured
    }

    /// Rays that count.
    pub fn counted(self) -> usize {
        self.fates.arrived() - self.flat
    }

    /// Rays that are left out, by reason.
    pub fn excluded(self) -> impl Iterator<Item = (&'static str, usize)> {
        let more = [("flat", self.flat), ("unmeasured", self.unmeasured)];
        let lost = self.fates.iter().filter(|(fate, _)| !fate.arrived());
        let lost = lost.map(|(fate, count)| (fate.name(), count));
        lost.chain(more.into_iter().filter(|(_, count)| *count > 0))
    }

    /// Those of two sets of rays.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        let mut both = self;
        for (fate, count) in other.fates.iter() {
            (0..count).for_each(|_| both.fates.count(fate));
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
    pub quality: Option<f64>,
    /// What became of the rays.
    pub counts: Counts,
    /// The largest distance between a start and the end of its way back, in steps.
    pub retrace_error: f64,
}

/// The loss of a field with its gradient.
#[derive(Debug, Clone)]
pub(super) struct Evaluation {
    pub(super) loss: f64,
    pub(super) gradient: Vec<f64>,
    pub(super) views: Vec<ViewResult>,
}

impl Task {
    /// The space of a view, and the rays by which fields are judged in it.
    pub fn judging_rays(&self, view: &View) -> (Space, Vec<Ray<f64>>) {
        let space = view.space.unwrap_or(self.space);
        let rays = view.source.rays(space, Draw::Judge);
        (space, rays.into_iter().map(|sent| sent.ray).collect())
    }
}

/// How rays are traced, for each view: chosen anew as the field takes shape.
pub(super) fn setups(
    task: &Task,
    field: &dyn Field<f64>,
    draw: Draw,
) -> Result<Vec<Setup<f64>>, TaskError> {
    let setup = |view: &View| {
        let space = view.space.unwrap_or(task.space);
        let rays: Vec<Ray<f64>> = view.source.rays(space, draw).iter().map(|s| s.ray).collect();
        let mut setup = match task.tracing {
            Some(tracing) => tied(task, field, space, tracing),
            None => plan(field, &space.region(), task.launch, &rays, task.tolerance)?.setup,
        };
        setup.screen = face(view, space);
        Ok(setup)
    };
    task.views.iter().map(setup).collect()
}

/// Steps that are tied to the voxels; to the space where the field has none.
fn tied(task: &Task, field: &dyn Field<f64>, space: Space, tracing: Tracing) -> Setup<f64> {
    let voxel = field.grain().voxel.unwrap_or(COARSE * space.diameter());
    let step = INCOMMENSURATE * voxel / tracing.per_voxel;
    let limit = (LONGEST * space.diameter() / step).clamp(64.0, 1e9) as u32;
    let end = End::Boundary { region: space.region(), last: LastStep::BrokenLine, limit };
    let Tracing { integrator, .. } = tracing;
    Setup { integrator, step, launch: task.launch, end, screen: None }
}

/// The rays of every view with their aims.
pub(super) fn shots(
    task: &Task,
    known: &Known,
    setups: &[Setup<f64>],
    draw: Draw,
) -> Result<Vec<Shot>, TaskError> {
    let shot = |((view, setup), known): ((&View, &Setup<f64>), &Option<Vec<Aim>>)| {
        let space = view.space.unwrap_or(task.space);
        let Beam { rays, aims, unmeasured } = beam(task, view, known.as_deref(), draw)?;
        let lost = space.diameter() * space.diameter();
        let (setup, weight, screen) = (setup.clone(), view.weight, screen(view, space)?);
        // The difference of an image has no unit.
        let lost = if screen.is_some() { 1.0 } else { lost };
        Ok(Shot { rays, aims, setup, weight, lost, screen, ring: ring(view), unmeasured })
    };
    task.views.iter().zip(setups).zip(known).map(shot).collect()
}

/// The same views with the rays of another step.
pub(super) fn redraw(
    task: &Task,
    known: &Known,
    shots: &mut [Shot],
    draw: Draw,
) -> Result<(), TaskError> {
    for ((view, shot), known) in task.views.iter().zip(shots).zip(known) {
        let beam = beam(task, view, known.as_deref(), draw)?;
        (shot.rays, shot.aims, shot.unmeasured) = (beam.rays, beam.aims, beam.unmeasured);
    }
    Ok(())
}

/// The rays of a view that count, with their aims, and how many others there are.
struct Beam {
    rays: Vec<Ray<f64>>,
    aims: Vec<Aim>,
    unmeasured: usize,
}

fn beam(task: &Task, view: &View, known: Option<&[Aim]>, draw: Draw) -> Result<Beam, TaskError> {
    let space = view.space.unwrap_or(task.space);
    let sent = view.source.rays(space, draw);
    let mut aims = match known {
        Some(known) => known.to_vec(),
        None => aims(task, view, space, &sent)?,
    };
    let is_measured = |i: usize| aims.get(i).is_none_or(|aim| aim.measured);
    let measured = sent.iter().enumerate().filter(|(i, _)| is_measured(*i));
    let rays: Vec<Ray<f64>> = measured.map(|(_, sent)| sent.ray).collect();
    let unmeasured = sent.len() - rays.len();
    aims.retain(|aim| aim.measured);
    Ok(Beam { rays, aims, unmeasured })
}

fn aims(task: &Task, view: &View, space: Space, sent: &[Sent]) -> Result<Vec<Aim>, TaskError> {
    let at = |x| Aim { x, v: Vec3::default(), direction: 0.0, measured: true };
    Ok(match &view.goal {
        Goal::Image { .. } | Goal::Far { .. } | Goal::Ring { .. } => Vec::new(),
        Goal::Point([x, y, z]) => vec![at(Vec3::new(*x, *y, *z)); sent.len()],
        Goal::Antipode => {
            let reach = 0.5 * space.diameter();
            sent.iter().map(|sent| at(sent.opposite * reach)).collect()
        }
        Goal::Like { field, direction } => measured::aims(task, view, field, sent, *direction)?,
    })
}

impl Evaluation {
    /// What became of the rays of all views.
    pub(super) fn counts(&self) -> Counts {
        self.views.iter().fold(Counts::default(), |sum, view| sum.and(view.counts))
    }
}

impl Shot {
    /// Whether it is more than looked at.
    pub(super) fn is_wanted(&self) -> bool {
        self.weight > 0.0
    }

    /// How many rays there are.
    pub(super) fn count(&self) -> usize {
        self.rays.len()
    }

    /// What a loss of this view adds to that of the task.
    pub(super) fn share(&self, loss: f64) -> f64 {
        self.weight * loss
    }

    /// Whether a ray counts.
    pub(super) fn counts(exit: &Exit<f64>) -> bool {
        exit.fate.arrived() && exit.cosine.abs() >= FLATTEST
    }

    /// The loss of one ray and its derivative.
    fn judge(&self, ray: usize, exit: &Exit<f64>) -> (f64, Seed<f64>) {
        if !Self::counts(exit) {
            return (self.lost, Seed::default());
        }
        let (dx, dv) = self.misses(ray, exit);
        let direction = self.direction(ray);
        let seed = self.seed(exit, dx * 2.0, dv * (2.0 * direction));
        (dx.dot(dx) + direction * dv.dot(dv), seed)
    }

    /// By how much a ray misses its aim.
    fn misses(&self, ray: usize, exit: &Exit<f64>) -> (Vec3<f64>, Vec3<f64>) {
        if let Some(ring) = &self.ring {
            return ring.misses(exit);
        }
        let aim = self.aims[ray];
        (exit.x - aim.x, exit.v - aim.v)
    }

    /// What the square of a miss in direction counts.
    fn direction(&self, ray: usize) -> f64 {
        self.ring.as_ref().map_or_else(|| self.aims[ray].direction, |ring| ring.far)
    }

    /// The derivative by the end of a ray of what has these by its misses.
    fn seed(&self, exit: &Exit<f64>, x: Vec3<f64>, by_direction: Vec3<f64>) -> Seed<f64> {
        let v = match self.ring {
            Some(_) => Ring::by_velocity(exit.v, by_direction),
            None => by_direction,
        };
        Seed { x, v, path: 0.0 }
    }

    /// What becomes of the light, without a gradient.
    pub(super) fn look(&self, field: &dyn Field<f64>) -> Result<ViewResult, TaskError> {
        let exits = Tracer::new(field, self.setup.clone())?.rays(&self.rays);
        Ok(self.result(&exits, 0.0))
    }

    /// The image of the rays that count.
    pub(super) fn image(screen: &Screen, exits: &[Exit<f64>]) -> Vec<f64> {
        screen.image(exits.iter().filter(|exit| Self::counts(exit)), exits.len())
    }

    /// The derivative of the loss by every exit, times the number of rays.
    fn seeds(&self, exits: &[Exit<f64>]) -> Vec<Seed<f64>> {
        let rays = exits.len();
        let Some(screen) = &self.screen else {
            return exits.iter().enumerate().map(|(i, exit)| self.judge(i, exit).1).collect();
        };
        let image = Self::image(screen, exits);
        let seed = |exit: &Exit<f64>| {
            if !Self::counts(exit) {
                return Seed::default();
            }
            let seed = screen.seed(&image, exit, rays);
            Seed { x: seed.x * rays as f64, v: seed.v * rays as f64, ..seed }
        };
        exits.iter().map(seed).collect()
    }

    pub(super) fn result(&self, exits: &[Exit<f64>], retrace_error: f64) -> ViewResult {
        match &self.screen {
            Some(screen) => self.image_result(screen, exits, retrace_error),
            None => self.spot_result(exits, retrace_error),
        }
    }

    /// How its rays ended.
    fn counted(&self, exits: &[Exit<f64>]) -> Counts {
        Counts { unmeasured: self.unmeasured, ..counts(exits) }
    }

    fn image_result(&self, screen: &Screen, exits: &[Exit<f64>], retrace_error: f64) -> ViewResult {
        let difference = screen.difference(&Self::image(screen, exits));
        let counts = self.counted(exits);
        let lost = exits.len() - counts.counted();
        let loss = difference + self.lost * lost as f64 / exits.len() as f64;
        let quality = Some(screen.quality(difference));
        ViewResult { loss, spot: f64::NAN, quality, counts, retrace_error }
    }

    fn spot_result(&self, exits: &[Exit<f64>], retrace_error: f64) -> ViewResult {
        let (mut loss, mut square) = (0.0, 0.0);
        for (i, exit) in exits.iter().enumerate() {
            loss += self.judge(i, exit).0;
            if Self::counts(exit) {
                let dx = self.misses(i, exit).0;
                square += dx.dot(dx);
            }
        }
        let counts = self.counted(exits);
        let spot = (square / counts.counted() as f64).sqrt();
        let loss = loss / exits.len() as f64;
        ViewResult { loss, spot, quality: None, counts, retrace_error }
    }

    /// The loss with its gradient, added with the weight of the view.
    pub(super) fn descend(
        &self,
        field: &dyn Field<f64>,
        gradient: &mut [f64],
    ) -> Result<ViewResult, TaskError> {
        let tracer = Tracer::new(field, self.setup.clone())?;
        let mut exits = tracer.rays(&self.rays);
        let seeds = self.seeds(&exits);
        let found = tracer.gradient(&self.rays, &mut exits, &seeds);
        let share = self.weight / self.rays.len() as f64;
        gradient.iter_mut().zip(&found.parameters).for_each(|(sum, g)| *sum += share * g);
        Ok(self.result(&exits, found.retrace_error))
    }

    /// What each ray misses its aim by, as rows of a least-squares problem with their derivatives.
    fn rows(&self, field: &dyn Field<f64>) -> Result<Vec<(f64, Vec<f64>)>, TaskError> {
        let tracer = Tracer::new(field, self.setup.clone())?;
        let scale = (self.weight / self.rays.len() as f64).sqrt();
        let parameters = field.parameters().len();
        let of_ray = |(i, ray): (usize, &Ray<f64>)| {
            let exit = tracer.ray(ray);
            if !Self::counts(&exit) {
                return vec![(scale * self.lost.sqrt(), vec![0.0; parameters])];
            }
            let (dx, dv) = self.misses(i, &exit);
            let row = |miss: f64, seed: Seed<f64>| {
                let taped = tracer.taped_gradient(&[*ray], &[exit], &[seed]);
                (miss, taped.parameters)
            };
            let root = scale * self.direction(i).sqrt();
            let axes = |scale: f64| {
                [Vec3::new(scale, 0.0, 0.0), Vec3::new(0.0, scale, 0.0), Vec3::new(0.0, 0.0, scale)]
            };
            let none = Vec3::default();
            let at = axes(scale).map(|x| row(x.dot(dx), self.seed(&exit, x, none)));
            let mut rows = at.to_vec();
            if root > 0.0 {
                rows.extend(axes(root).map(|v| row(v.dot(dv), self.seed(&exit, none, v))));
            }
            rows
        };
        Ok(self.rays.par_iter().enumerate().flat_map_iter(of_ray).collect())
    }
}

/// The loss of a field by some rays, with its gradient; views of weight 0 are not looked at.
pub(super) fn evaluate(
    field: &dyn Field<f64>,
    shots: &[Shot],
    hold: &Hold,
) -> Result<Evaluation, TaskError> {
    let mut gradient = vec![0.0; field.parameters().len()];
    let (mut loss, mut views) = (hold.descend(field, &mut gradient), Vec::new());
    for shot in shots.iter().filter(|shot| shot.is_wanted()) {
        let result = shot.descend(field, &mut gradient)?;
        loss += shot.weight * result.loss;
        views.push(result);
    }
    Ok(Evaluation { loss, gradient, views })
}

/// The same as rows of a least-squares problem: the loss is the sum of their squares.
pub(super) fn rows(
    field: &dyn Field<f64>,
    shots: &[Shot],
    hold: &Hold,
) -> Result<Vec<(f64, Vec<f64>)>, TaskError> {
    let mut all = hold.rows(field);
    for shot in shots.iter().filter(|shot| shot.is_wanted()) {
        all.extend(shot.rows(field)?);
    }
    Ok(all)
}
