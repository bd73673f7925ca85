//! `optimize`: local optimization, which saves the best lens however it ends.

mod best_so_far;
mod report;

use super::effects::{DesignEffects, EffectArgs};
use super::error::CliError;
use super::failures::Failures;
use super::glass_exchange::{GlassExchangeArgs, exchange, failure};
use super::input::{self, LensFile, LoadedLens, Tolerance};
use super::output::{Output, ShortNumber};
use super::output_paths::OutputPaths;
use super::overdue::FoundSoFar;
use super::progress::{progress_bar, stop_flag};
use crate::files::{self, FileError, json};
use crate::lens::{Lens, ParameterKind, ToleranceGrade, add_variables};
use crate::measure::time_ms;
use crate::merit::{Goal, Merit, MeritError};
use crate::optimize::{DescentMethod, OptimizationProgress, Optimizer, start};
use best_so_far::BestSoFar;
use report::{OptimizeEnd, OptimizeOutcome, OptimizeReport, OptimizeRun, SavedParts};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Optimizes the variables of a lens; Ctrl-C ends it and saves the best lens so far
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/optimize.txt"))]
pub(super) struct OptimizeArgs {
    #[command(flatten)]
    lens: LensFile,

    /// The file for the best lens: .json or .zmx
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// The optimization method
    #[arg(long, value_enum, default_value_t = DescentMethod::TrustRegion)]
    method: DescentMethod,

    /// Maximum number of steps; absent: 1000 for trust-region, 100 for dls,
    /// 2000 for adam
    #[arg(long, value_name = "N")]
    steps: Option<usize>,

    /// Tolerance of the radius of each spot: `0.1%` or `1e-3`
    #[arg(long, default_value = "1e-6", value_name = "TOLERANCE")]
    error: Tolerance,

    /// Kinds of parameters to vary in addition to the variables of the lens
    #[arg(long, value_enum, value_delimiter = ',', value_name = "KINDS")]
    vary: Vec<ParameterKind>,

    /// The merit function, as JSON, in place of the default one with all its terms, limits of
    /// thicknesses included; absent: that of the lens file, or else sharp spots at the present focal
    /// length within limits
    #[arg(long, value_name = "FILE")]
    goal: Option<PathBuf>,

    /// Optimizes the spots of lenses that are made with the tolerances of this class, in place of the
    /// spots as designed
    #[arg(long, value_enum, value_name = "GRADE")]
    as_built: Option<ToleranceGrade>,

    /// A file for the history of all steps, as JSON
    #[arg(long, value_name = "FILE")]
    history: Option<PathBuf>,

    #[command(flatten)]
    glasses: GlassExchangeArgs,

    #[command(flatten)]
    effects: EffectArgs,
}

/// Steps where --steps is absent.
fn default_steps(method: DescentMethod) -> usize {
    match method {
        DescentMethod::TrustRegion => 1000,
        DescentMethod::DampedLeastSquares => 100,
        DescentMethod::Adam => 2000,
    }
}

impl OptimizeArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        self.check_paths()?;
        let stop = stop_flag();
        let so_far = BestSoFar::new(self, output);
        let so_far = FoundSoFar::watch(&stop, so_far, BestSoFar::save_and_print);
        let design = DesignEffects::new(&self.effects)?;
        let opened = self.lens.open()?;
        let mut lens = design.working_lens(&opened.lens);
        add_variables(&mut lens, &self.vary);
        let refuse = |source| self.merit_error(&opened, source);
        let goal = self.goal(&lens).map_err(|e| e.or_else(refuse))?;
        let glasses = self.glasses.search(&opened, &lens, &goal, self.error.0)?;
        let started = start(self.method, &lens, &goal, self.error.0);
        let mut optimizer = started.map_err(refuse)?;
        let before = optimizer.terms().map_err(refuse)?;
        let merit = |lens: &Lens| Merit::new(lens, &goal, self.error.0).map_err(refuse);
        let at_start = merit(&lens)?;
        if at_start.is_dark() {
            return Err(CliError::no_light(&opened.file));
        }
        let effects = design.report(&opened.lens, &opened.file)?;
        let (search, ms) =
            time_ms(|| self.search(optimizer.as_mut(), &opened.lens, &stop, &so_far));
        let mut failures = Failures::default();
        let exchanged = glasses.map(|found| exchange(found, &mut optimizer, &stop)).transpose();
        let glasses = failures.note(exchanged.map_err(|why| failure(&opened.file, why))).flatten();
        // The lens is saved before anything else is computed from it.
        let best = with_own_parts(optimizer.best(), &opened.lens);
        so_far.update(|so_far| so_far.replace(best.clone()));
        let saved = failures.note(files::save(&best, &self.out)).is_some();
        let kept = failures.note(write_history(self.history.as_deref(), &search.steps)).is_some();
        let after = optimizer.terms().map_err(refuse)?;
        let light = [at_start.light(), merit(optimizer.best())?.light()];
        let limits = optimizer.binding_limits().to_vec();
        let search = &search;
        let saved = SavedParts { lens: saved, history: kept };
        let found =
            OptimizeOutcome { search, ms, light, before, after, limits, glasses, saved, effects };
        drop(so_far);
        failures.note(output.print(&OptimizeReport::new(self, &lens, &best, found)));
        failures.note(check_conflict(optimizer.as_ref()).map_err(refuse));
        failures.into_result()
    }

    fn check_paths(&self) -> Result<(), CliError> {
        let goal = self.goal.as_deref().map(|path| ("--goal", path));
        let mut paths =
            OutputPaths::reading([("the lens", self.lens.path())].into_iter().chain(goal));
        paths.file("--out", Some(&self.out), &["json", "zmx"])?;
        paths.file("--history", self.history.as_deref(), &["json"])
    }

    fn goal(&self, lens: &Lens) -> Result<Goal, GoalError> {
        let goal: Goal = match &self.goal {
            Some(path) => input::read_json(path).map_err(GoalError::Failure)?,
            None => Goal::of_lens(lens).map_err(GoalError::Merit)?,
        };
        if self.as_built.is_some() && !goal.terms.iter().any(|w| w.term.is_of_spots()) {
            let text = "--as-built: found a merit function without a term `spot`; expected one";
            return Err(GoalError::Failure(CliError::Input(text.to_owned())));
        }
        Ok(if self.as_built.is_some() { goal.as_built(self.as_built) } else { goal })
    }

    /// The error of a merit function: a wrong term is one of the file of the goal, if there is one.
    fn merit_error(&self, opened: &LoadedLens, source: MeritError) -> CliError {
        let file = match (&self.goal, &source) {
            (Some(goal), MeritError::DoesNotApply { .. }) => input::display_name(goal),
            _ => opened.file.clone(),
        };
        match source {
            MeritError::NoVariables => CliError::Input(format!(
                "{file}: found no variables; expected some in the file (`\"variables\"`), or kinds \
                 of parameters to vary: `--vary curvatures,thicknesses`"
            )),
            source => CliError::Merit { file, source },
        }
    }

    /// Steps until convergence, the maximum number of steps or Ctrl-C.
    fn search(
        &self,
        optimizer: &mut dyn Optimizer,
        opened: &Lens,
        stop: &AtomicBool,
        so_far: &FoundSoFar<BestSoFar>,
    ) -> OptimizeRun {
        let most = self.steps.unwrap_or(default_steps(self.method));
        let bar = progress_bar(most);
        let mut search = OptimizeRun { steps: Vec::new(), ended: OptimizeEnd::Steps };
        while search.steps.len() < most {
            if stop.load(Ordering::Relaxed) {
                search.ended = OptimizeEnd::Stopped;
                break;
            }
            let progress = optimizer.step();
            bar.inc(1);
            bar.set_message(format!("merit {}", ShortNumber(progress.best)));
            let finished = progress.finished;
            let best = || with_own_parts(optimizer.best(), opened);
            so_far.update(|so_far| so_far.add(progress.clone(), best));
            search.steps.push(progress);
            if finished {
                search.ended = OptimizeEnd::Finished;
                break;
            }
        }
        optimizer.verify_best();
        bar.finish_and_clear();
        search
    }
}

/// Writes the steps of a run to a file, if there is one for them.
fn write_history(path: Option<&Path>, steps: &[OptimizationProgress]) -> Result<(), FileError> {
    let Some(path) = path else { return Ok(()) };
    files::write_atomic(path, json::pretty(&StepHistory { steps }).as_bytes())
}

/// A lens with the variables and wavelengths of the file from which it comes.
fn with_own_parts(lens: &Lens, opened: &Lens) -> Lens {
    let Lens { variables, wavelengths, .. } = opened.clone();
    let mut lens = Lens { wavelengths, variables, ..lens.clone() };
    // A glass of the catalogue in place of a model glass has no index that varies.
    let values = lens.clone();
    lens.variables.retain(|variable| values.get(variable.parameter).is_some());
    lens
}

/// An error of the merit function.
enum GoalError {
    Failure(CliError),
    Merit(MeritError),
}

impl GoalError {
    fn or_else(self, refuse: impl FnOnce(MeritError) -> CliError) -> CliError {
        match self {
            Self::Failure(failure) => failure,
            Self::Merit(source) => refuse(source),
        }
    }
}

/// Returns an error if the limits contradict each other.
fn check_conflict(optimizer: &dyn Optimizer) -> Result<(), MeritError> {
    match optimizer.conflict() {
        [] => Ok(()),
        limits => Err(MeritError::ConflictingLimits { limits: limits.to_vec() }),
    }
}

#[derive(Serialize)]
struct StepHistory<'a> {
    steps: &'a [OptimizationProgress],
}
