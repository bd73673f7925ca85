//! The figures and tables of the thesis as reproducible studies: data, plots, and checked claims.
//!
//! An [`Experiment`] is a file of this folder and a line in [`ALL`]; it reads no clock, draws its
//! own plots and can be stopped between two steps. Its claims are numbers with limits: an
//! [`ExperimentOutcome`] with a claim that does not hold is a failed experiment. After Teh,
//! *Computational Lens Design* (thesis, Carnegie Mellon University), whose figure numbers name the
//! experiments.

mod adjoint_memory;
mod aperture_stop;
mod camera;
mod candle_light;
mod entrance_pupil;
mod fibre;
mod gradient_image;
mod grin_displays;
mod histogram;
mod known_lenses;
mod motion;
mod outcome;
mod pareto_front;
mod plume;
mod report;
mod sampling;
mod section;
mod sharpness_vs_light;
mod structure;
mod vignetting;
mod zoom;

pub use outcome::{Claim, ClaimRelation, ClaimVerdict, DataTable, ExperimentOutcome, TableCell};
pub use report::{ExperimentReport, PhaseTiming};

use crate::files::{self, FileError};
use crate::grin::GrinSetupError;
use crate::grin::field::GridError;
use crate::grin_design::{self, GrinOptimizer, GrinTask, GrinTaskError, ReferenceFieldError};
use crate::lens::{Lens, LensError};
use crate::merit::MeritError;
use crate::optimize::pareto::ParetoError;
use crate::picture::{PictureError, ProjectionError};
use crate::plot::NamedPlot;
use crate::pupil::{LaunchError, RayModelError};
use crate::search::MutationError;
use crate::search::lens_landscape::SearchSetupError;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// Every experiment, in the order of the thesis. A new one is a file and a line here.
pub const ALL: &[Experiment] = &[
    aperture_stop::EXPERIMENT,
    entrance_pupil::EXPERIMENT,
    gradient_image::EXPERIMENT,
    pareto_front::EXPERIMENT,
    candle_light::EXPERIMENT,
    motion::EXPERIMENT,
    vignetting::EXPERIMENT,
    zoom::EXPERIMENT,
    sampling::EXPERIMENT,
    structure::baselines::METROPOLIS,
    structure::baselines::BRUTE_FORCE,
    structure::projection::EXPERIMENT,
    structure::front_with_mutations::EXPERIMENT,
    structure::overview_figure::EXPERIMENT,
    adjoint_memory::EXPERIMENT,
    grin_displays::display::EXPERIMENT,
    grin_displays::resolution::EXPERIMENT,
    grin_displays::multifocal::EXPERIMENT,
    grin_displays::caustic::EXPERIMENT,
    known_lenses::EXPERIMENT,
    fibre::EXPERIMENT,
    plume::EXPERIMENT,
];

/// A figure or table of the thesis.
#[derive(Debug, Clone, Copy)]
pub struct Experiment {
    /// The number of the figure or table.
    pub id: &'static str,
    /// The title.
    pub title: &'static str,
    /// The claim, in one sentence.
    pub claim: &'static str,
    /// The parts of the figure that the study leaves out, and what replaces them.
    pub omits: &'static str,
    /// The approximate time at full effort on two cores, in seconds.
    pub seconds: f64,
    /// Runs the experiment.
    ///
    /// # Errors
    /// The progress callback asked it to stop, or its lens or task cannot be evaluated.
    pub run: fn(Effort, &mut ProgressFn<'_>) -> ExperimentResult,
}

/// Returns the experiment of a figure or table.
pub fn find(id: &str) -> Option<&'static Experiment> {
    ALL.iter().find(|experiment| experiment.id == id)
}

/// A callback that receives the progress of an experiment and returns `Break` to stop it.
pub type ProgressFn<'a> = dyn FnMut(ExperimentProgress<'_>) -> ControlFlow<()> + 'a;

/// The progress of an experiment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExperimentProgress<'a> {
    /// The completed fraction, 0 to 1.
    pub done: f64,
    /// The current phase.
    pub doing: &'a str,
}

/// The effort of an experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Effort {
    /// The full sizes of the figure.
    Full,
    /// The smallest sizes for which the claims hold, for a test.
    Small,
}

impl Effort {
    /// Returns the value for full or for small effort.
    fn select<T>(self, full: T, small: T) -> T {
        match self {
            Self::Full => full,
            Self::Small => small,
        }
    }
}

/// The result of an experiment or of one of its steps.
pub type ExperimentResult<T = ExperimentOutcome> = Result<T, ExperimentError>;

/// The error of an experiment without an outcome.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ExperimentError {
    /// The caller stopped it.
    #[error("stopped")]
    Stopped,
    /// Its lens or task cannot be evaluated.
    #[error("{0}")]
    Failed(String),
}

/// Lets `?` end an experiment with the text of an error of another module.
macro_rules! fail_on {
    ($($error:ident),+ $(,)?) => {
        $(impl From<$error> for ExperimentError {
            fn from(error: $error) -> Self {
                Self::Failed(error.to_string())
            }
        })+
    };
}

fail_on!(
    FileError,
    GridError,
    GrinSetupError,
    GrinTaskError,
    LaunchError,
    LensError,
    MeritError,
    MutationError,
    ParetoError,
    PictureError,
    ProjectionError,
    RayModelError,
    ReferenceFieldError,
    SearchSetupError,
);

/// Reports the progress; an error if the caller stops the experiment.
fn report_progress(progress: &mut ProgressFn<'_>, done: f64, doing: &str) -> ExperimentResult<()> {
    match progress(ExperimentProgress { done, doing }) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(ExperimentError::Stopped),
    }
}

/// A built-in task of field design.
fn builtin_task(name: &str) -> ExperimentResult<GrinTask> {
    let builtin = grin_design::find_builtin(name);
    Ok(builtin.ok_or_else(|| ExperimentError::Failed(format!("no task `{name}`")))?.task()?)
}

/// Loads a lens of the bundled library.
fn lens(name: &str) -> ExperimentResult<Lens> {
    let bundled = files::bundled_lenses().iter().find(|bundled| bundled.name == name);
    let bundled =
        bundled.ok_or_else(|| ExperimentError::Failed(format!("no lens `{name}` is bundled")))?;
    Ok(files::json::read(bundled.text, name)?)
}

/// Solves a task; it is the part `from` to `to` of the whole work.
fn solve(
    task: &GrinTask,
    [from, to]: [f64; 2],
    progress: &mut ProgressFn<'_>,
) -> ExperimentResult<GrinOptimizer> {
    report_progress(progress, from, &task.name)?;
    let optimizer = GrinOptimizer::new(task)?;
    solve_from(optimizer, [from, to], progress)
}

/// Continues an optimizer to its end; it is the part `from` to `to` of the whole work.
fn solve_from(
    mut optimizer: GrinOptimizer,
    [from, to]: [f64; 2],
    progress: &mut ProgressFn<'_>,
) -> ExperimentResult<GrinOptimizer> {
    let name = optimizer.task().name.clone();
    let mut done = from;
    loop {
        let step = optimizer.step()?;
        let share = step.step as f64 / step.max_steps.max(1) as f64;
        done = if step.finished { to } else { done.max(from + share.min(1.0) * (to - from)) };
        report_progress(progress, done, &name)?;
        if step.finished {
            return Ok(optimizer);
        }
    }
}
