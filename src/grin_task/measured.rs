//! What a measurement of light would give: where rays leave another field, and how.
//!
//! The field is traced as its own kind wants it, and finer than the one that is sought, so that the
//! search does not find its own errors again. A ray that tells nothing, because it is trapped,
//! chaotic or too flat there, is told by its reason and left out.

use super::check::TaskError;
use super::given::{check_range, check_reach};
use super::refuse::wrong;
use super::scene::{Aim, Counts, counts};
use super::source::{Draw, Sent};
use super::space::{length, unit};
use super::task::{Exact, Goal, Space, Start, Task, View};
use crate::grin::{Exit, Ray, Seed, Tracer, plan};

/// The field from which a measurement comes is traced so much better than the one that is sought.
const FINER: f64 = 0.1;

/// The measured aims of the views whose rays are the same in every step; nothing for other views.
pub(super) type Known = Vec<Option<Vec<Aim>>>;

/// What the light of a view does in the field that it is measured in.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    /// The name of the view.
    pub view: String,
    /// The largest angle between a ray and its exit, in radians, of the rays that tell something.
    pub deflection: f64,
    /// What became of the rays.
    pub counts: Counts,
}

impl Task {
    /// The measurements that its views are compared with, by the rays that all fields are judged by.
    ///
    /// # Errors
    /// A volume that cannot be read.
    pub fn measurements(&self) -> Result<Vec<Measurement>, TaskError> {
        let measured = |view: &View| {
            let Goal::Like { field, .. } = &view.goal else { return Ok(None) };
            let space = view.space.unwrap_or(self.space);
            let sent = view.source.rays(space, Draw::Judge);
            let exits = exits(self, view, field, &sent)?;
            let told = |exit: &&Exit<f64>| super::scene::Shot::counts(exit);
            let angle = |exit: &Exit<f64>, sent: &Sent| {
                let chord = length(unit(exit.v) - unit(sent.ray.v));
                2.0 * (0.5 * chord).min(1.0).asin()
            };
            let pairs = exits.iter().zip(&sent).filter(|(exit, _)| told(exit));
            let deflection = pairs.map(|(exit, sent)| angle(exit, sent)).fold(0.0, f64::max);
            Ok(Some(Measurement { view: view.name.clone(), deflection, counts: counts(&exits) }))
        };
        self.views.iter().filter_map(|view| measured(view).transpose()).collect()
    }

    /// Refuses volumes that cannot be read or end before the space does, and one to begin with that
    /// is beyond the limits.
    pub(super) fn check_volumes(&self) -> Result<(), TaskError> {
        let check = |place: String, path: &std::path::Path, space: Space| {
            check_reach(path, space).map_err(|source| TaskError::Field { place, source })
        };
        if let Start::Volume(path) = &self.start {
            check("start".to_owned(), path, self.space)?;
            check_range(path, &self.spaces(), [self.limits.low, self.limits.high])
                .map_err(|source| TaskError::Field { place: "start".to_owned(), source })?;
        }
        if let Some(Exact::Volume(path)) = &self.exact {
            check("exact".to_owned(), path, self.space)?;
        }
        for view in &self.views {
            if let Goal::Like { field: Exact::Volume(path), .. } = &view.goal {
                check(format!("view {}", view.name), path, view.space.unwrap_or(self.space))?;
            }
        }
        Ok(())
    }
}

/// Traces the rays of a view through the field that it is measured in, and back.
fn exits(
    task: &Task,
    view: &View,
    field: &Exact,
    sent: &[Sent],
) -> Result<Vec<Exit<f64>>, TaskError> {
    let space = view.space.unwrap_or(task.space);
    let place = format!("view {}", view.name);
    let field = field.field().map_err(|source| TaskError::Field { place, source })?;
    let rays: Vec<Ray<f64>> = sent.iter().map(|sent| sent.ray).collect();
    let finer = FINER * task.tolerance;
    let setup = plan(&*field, &space.region(), task.launch, &rays, finer)?.setup;
    let tracer = Tracer::new(&*field, setup)?;
    let mut exits = tracer.rays(&rays);
    // The way back finds the chaotic ones.
    tracer.gradient(&rays, &mut exits, &vec![Seed::default(); rays.len()]);
    Ok(exits)
}

/// Where the rays of a view shall go that are measured in a field.
pub(super) fn aims(
    task: &Task,
    view: &View,
    field: &Exact,
    sent: &[Sent],
    direction: f64,
) -> Result<Vec<Aim>, TaskError> {
    let exits = exits(task, view, field, sent)?;
    if !exits.iter().any(super::scene::Shot::counts) {
        let found = "no ray that leaves the field";
        return Err(wrong(format!("view {}", view.name), found, "light that tells something"));
    }
    let aim = |exit: &Exit<f64>| {
        let measured = super::scene::Shot::counts(exit);
        Aim { x: exit.x, v: exit.v, direction, measured }
    };
    Ok(exits.iter().map(aim).collect())
}

/// Traces what is measured once and for all.
pub(super) fn known(task: &Task) -> Result<Known, TaskError> {
    let aims = |view: &View| match &view.goal {
        Goal::Like { field, direction } if !view.source.is_fresh() => {
            let sent = view.source.rays(view.space.unwrap_or(task.space), Draw::Judge);
            aims(task, view, field, &sent, *direction).map(Some)
        }
        _ => Ok(None),
    };
    task.views.iter().map(aims).collect()
}
