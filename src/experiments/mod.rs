//! The figures and tables of the thesis as studies that anyone can run: data, pictures, and what
//! the figure claims, checked.
//!
//! An [`Experiment`] is a file of this folder and a line in [`ALL`]; it reads no clock, draws its
//! own pictures and can be stopped between two steps. What it claims are numbers against limits: an
//! [`ExperimentOutcome`] in which one of them fails is a failed experiment. After Teh, *Computational Lens
//! Design* (thesis, Carnegie Mellon University), whose figure numbers name the experiments.

mod adjoint_memory;
mod aperture_stop;
mod entrance_pupil;
mod fibre;
mod gradient_image;
mod grin_displays;
mod grin_solution;
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

pub use grin_displays::plot_view;
pub use grin_solution::plot_medium;
pub use outcome::{Claim, ClaimRelation, DataTable, ExperimentOutcome, NamedPlot, TableCell};
pub use report::{ExperimentReport, PhaseTiming};

use crate::files;
use crate::lens::Lens;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// Every experiment, in the order of the thesis. A new one is a file and a line here.
pub const ALL: &[Experiment] = &[
    aperture_stop::EXPERIMENT,
    entrance_pupil::EXPERIMENT,
    gradient_image::EXPERIMENT,
    pareto_front::EXPERIMENT,
    motion::EXPERIMENT,
    vignetting::EXPERIMENT,
    zoom::EXPERIMENT,
    sampling::EXPERIMENT,
    structure::metropolis::EXPERIMENT,
    structure::brute_force::EXPERIMENT,
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
    /// What it is about.
    pub title: &'static str,
    /// What it shows, in one sentence.
    pub claim: &'static str,
    /// About how long it takes at full effort on two cores.
    pub seconds: f64,
    /// Does the work.
    ///
    /// # Errors
    /// The callback asked it to stop, or there was nothing to work with.
    pub run: fn(Effort, &mut ProgressFn<'_>) -> Result<ExperimentOutcome, ExperimentError>,
}

/// The experiment of a figure.
pub fn find(id: &str) -> Option<&'static Experiment> {
    ALL.iter().find(|experiment| experiment.id == id)
}

/// Gets to know how far an experiment is, and says whether it shall go on.
pub type ProgressFn<'a> = dyn FnMut(ExperimentProgress<'_>) -> ControlFlow<()> + 'a;

/// How far an experiment is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExperimentProgress<'a> {
    /// The part that is done, 0 to 1.
    pub done: f64,
    /// What it is doing.
    pub doing: &'a str,
}

/// How much an experiment works for its claims.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Effort {
    /// As the figure deserves.
    Full,
    /// As little as its claims need: a test.
    Small,
}

impl Effort {
    /// One of two numbers: for the figure, or for a test.
    fn select<T>(self, full: T, small: T) -> T {
        match self {
            Self::Full => full,
            Self::Small => small,
        }
    }
}

/// Why an experiment has no outcome.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ExperimentError {
    /// It was asked to stop.
    #[error("stopped")]
    Stopped,
    /// Its lens could not be worked with.
    #[error("{0}")]
    Failed(String),
}

impl ExperimentError {
    /// An error of a lower floor.
    fn from_error(error: impl std::fmt::Display) -> Self {
        Self::Failed(error.to_string())
    }
}

/// Tells how far the work is, and ends it where that is wanted.
fn report_progress(
    watch: &mut ProgressFn<'_>,
    done: f64,
    doing: &str,
) -> Result<(), ExperimentError> {
    match watch(ExperimentProgress { done, doing }) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(ExperimentError::Stopped),
    }
}

/// A lens of the library.
fn lens(name: &str) -> Result<Lens, ExperimentError> {
    let bundled = files::bundled_lenses().iter().find(|bundled| bundled.name == name);
    let bundled =
        bundled.ok_or_else(|| ExperimentError::Failed(format!("no lens `{name}` is bundled")))?;
    files::json::read(bundled.text, name).map_err(ExperimentError::from_error)
}
