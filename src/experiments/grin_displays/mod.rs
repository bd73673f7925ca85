//! Figures 5.4 to 5.7: GRIN fields as displays, for one beam or for two.
//!
//! The optimization uses different rays in every step and none of those by which its result is
//! evaluated here: more rays, traced with half of its step.
//!
//! These images are not made by the renderer of pictures, and cannot be. That one follows light backwards: from a
//! pixel, through the surfaces of a lens, into a scene that radiates in all directions. Here a beam has one direction
//! at every point, which no ray that begins on the screen has but by chance, and light has to be followed forwards
//! from the beam, through a field of indices without surfaces, and counted where it lands. The image is the very sum
//! over rays that the loss is made of, so that what is shown is what was optimized; a second renderer would show
//! something else. Shared with other pictures is how images are drawn in rows and in grey levels (`plot`).

pub(super) mod caustic;
pub(super) mod display;
pub(super) mod multifocal;
pub(super) mod resolution;

use super::{
    Claim, DataTable, Effort, ExperimentOutcome, ExperimentResult, NamedPlot, ProgressFn,
    builtin_task, solve, solve_from,
};
use crate::grin_design::{GrinField, GrinOptimizer, GrinTask, LightGoal, LightSource, ViewReport};
use crate::report::{plot_grin_field, plot_grin_image};

/// The rays along a side of a beam in the evaluation, relative to the optimization.
const FINER: f64 = 1.57;
/// The largest fraction of excluded rays.
const LEFT_OUT: f64 = 1e-3;
/// The tolerance of the lowest index for rounding.
const ROUNDING: f64 = 1e-9;

/// The task reduced for a test: its first levels only, fewer rays, coarser images.
fn reduced(mut task: GrinTask, levels: usize) -> GrinTask {
    task.levels.truncate(levels);
    for view in &mut task.views {
        if let LightSource::Beam { rays, .. } = &mut view.source {
            *rays = 64;
        }
        if let LightGoal::Image { pixels, .. } | LightGoal::Far { pixels, .. } = &mut view.goal {
            *pixels = 32;
        }
    }
    task
}

/// The task with rays that its optimization does not use, and half of its step.
fn independent_task(task: &GrinTask) -> GrinTask {
    let mut other = task.clone();
    for view in &mut other.views {
        if let LightSource::Beam { rays, .. } = &mut view.source {
            *rays = (FINER * *rays as f64).round() as usize;
        }
    }
    if let Some(tracing) = &mut other.tracing {
        tracing.per_voxel *= 2.0;
    }
    other
}

/// A solved task with the images of its field by independent rays.
struct EvaluatedField {
    optimizer: GrinOptimizer,
    views: Vec<ViewReport>,
}

/// Solves a task, which is a part of the whole work, and evaluates it.
fn solve_and_evaluate(
    task: &GrinTask,
    part: [f64; 2],
    progress: &mut ProgressFn<'_>,
) -> ExperimentResult<EvaluatedField> {
    let optimizer = solve(task, part, progress)?;
    let views = evaluate(task, optimizer.best())?;
    Ok(EvaluatedField { optimizer, views })
}

/// Evaluates a field with rays that its optimization has not used.
fn evaluate(task: &GrinTask, medium: &GrinField) -> ExperimentResult<Vec<ViewReport>> {
    Ok(independent_task(task).report_views(medium)?)
}

/// The columns of the table of views.
const COLUMNS: [&str; 10] = [
    "view",
    "nodes",
    "quality_db",
    "correlation",
    "light",
    "rays",
    "left_out",
    "tracing_error_mm",
    "index_low",
    "index_high",
];

impl EvaluatedField {
    /// Adds a row for every image.
    fn rows(&self, table: &mut DataTable) {
        let task = self.optimizer.task();
        let extremes = task.extremes(self.optimizer.best());
        for (view, views) in task.views.iter().zip(&self.views) {
            let Some(image) = &views.image else { continue };
            let counts = views.result.counts;
            table.push_row([
                view.name.clone().into(),
                self.optimizer.best().nodes().into(),
                views.result.psnr.unwrap_or(f64::NAN).into(),
                image.correlation().into(),
                image.light_share().into(),
                counts.fates.total().into(),
                (counts.fates.total() - counts.valid()).into(),
                views.error.unwrap_or(f64::NAN).into(),
                extremes.low.into(),
                extremes.high.into(),
            ]);
        }
    }

    /// The claims about every image: its quality, its correlation, and few excluded rays.
    fn claims(&self, quality: f64, correlation: f64) -> Vec<Claim> {
        let mut claims = Vec::new();
        for (view, views) in self.optimizer.task().views.iter().zip(&self.views) {
            let Some(image) = &views.image else { continue };
            let name = &view.name;
            let found = views.result.psnr.unwrap_or(f64::NAN);
            let says = format!("{name}: peak signal to noise, by independent rays");
            claims.push(Claim::at_least(says, found, quality).in_unit("dB"));
            let says = format!("{name}: correlation with the target");
            claims.push(Claim::at_least(says, image.correlation(), correlation));
            let counts = views.result.counts;
            let left_out = 1.0 - counts.valid() as f64 / counts.fates.total() as f64;
            let says = format!("{name}: fraction of excluded rays");
            claims.push(Claim::at_most(says, left_out, LEFT_OUT));
        }
        claims
    }

    /// The claims that the field can be manufactured.
    fn manufacturability(&self) -> [Claim; 2] {
        let task = self.optimizer.task();
        let extremes = task.extremes(self.optimizer.best());
        let [low, high] = [task.limits.low, task.limits.high];
        [
            Claim::at_least("smallest index", extremes.low, low - ROUNDING),
            Claim::at_most("largest index", extremes.high, high),
        ]
    }

    /// The plots of its images beside the target images.
    fn pictures(&self, names: &[&'static str]) -> Vec<NamedPlot> {
        let images = self.views.iter().filter_map(|views| Some((views, views.image.as_ref()?)));
        let picture = |((views, image), name): ((&ViewReport, _), &&'static str)| {
            let quality = views.result.psnr.unwrap_or(f64::NAN);
            let canvas = plot_grin_image(name, image, quality);
            NamedPlot { name, canvas }
        };
        images.zip(names).map(picture).collect()
    }

    /// The number of rays traced forwards.
    fn rays(&self) -> usize {
        let judging: usize = self.views.iter().map(|views| views.result.counts.fates.total()).sum();
        usize::try_from(self.optimizer.rays_traced()).unwrap_or(usize::MAX).saturating_add(judging)
    }
}

/// The outcome of one field that shows images.
fn outcome_of(
    evaluated: &EvaluatedField,
    names: &[&'static str],
    [quality, correlation]: [f64; 2],
) -> ExperimentOutcome {
    let mut table = DataTable::new("views", &COLUMNS);
    evaluated.rows(&mut table);
    let mut claims = evaluated.claims(quality, correlation);
    claims.extend(evaluated.manufacturability());
    let mut pictures = evaluated.pictures(names);
    pictures.extend(plot_grin_field(evaluated.optimizer.task(), evaluated.optimizer.best()));
    ExperimentOutcome {
        claims,
        tables: vec![table],
        pictures,
        rays: evaluated.rays(),
        ..ExperimentOutcome::default()
    }
}

/// A built-in task at full effort; for a test its first levels.
fn task(name: &str, effort: Effort, levels: usize) -> ExperimentResult<GrinTask> {
    let task = builtin_task(name)?;
    Ok(if effort == Effort::Full { task } else { reduced(task, levels) })
}
