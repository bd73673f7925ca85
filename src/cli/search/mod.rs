//! `search`: optimization of the structure, in a run that can be stopped, killed and resumed.

mod best_so_far;
mod limits;
mod plan_args;
mod report;
mod result;

pub(super) use plan_args::SearchPlanArgs;

use super::effects::{DesignEffects, EffectArgs};
use super::error::CliError;
use super::failures::Failures;
use super::input::{self, LensFile};
use super::output::{Output, ShortNumber, print_note};
use super::output_paths::{OutputPaths, stale_note};
use super::overdue::FoundSoFar;
use super::progress::{progress_bar, stop_flag};
use crate::files::{self, CheckpointError, FileLock};
use crate::lens::Lens;
use crate::measure::Stopwatch;
use crate::merit::MeritError;
use crate::search::lens_landscape::{
    FinalizedLens, LandscapeError, LensLandscape, SearchPlan, finalize,
};
use crate::search::{FoundPoint, RunEnd, SearchError, SearchMethod, SearchRun, SearchRunOn};
use best_so_far::BestSoFar;
use report::SearchReport;
use result::StartAgainstBest;
use serde::Serialize;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// Optimizes the structure of a lens: adds, removes, cements and splits elements; Ctrl-C ends the
/// search and saves its results
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/search.txt"))]
pub(super) struct SearchArgs {
    #[command(flatten)]
    lens: LensFile,

    /// The file for the best lens: .json or .zmx
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// The sampler; absent: iterated, or that of the checkpoint if there is one
    #[arg(long, value_enum)]
    method: Option<SearchMethod>,

    /// The seed of all random numbers
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,

    /// Maximum duration in minutes
    #[arg(long, value_name = "MINUTES", allow_negative_numbers = true)]
    minutes: Option<f64>,

    /// Maximum number of gradients of all chains, never exceeded; 12000 if --minutes is absent too
    #[arg(long, value_name = "N")]
    iterations: Option<u64>,

    /// A file in which the run is saved every few seconds; resumes the run if it exists
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,

    /// Seconds between two checkpoints
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = SAVED,
        requires = "checkpoint",
        allow_negative_numbers = true
    )]
    checkpoint_every: f64,

    /// The folder for all lenses of the reservoir, and for the best one if its descent has not ended
    #[arg(long, value_name = "FOLDER")]
    reservoir_dir: Option<PathBuf>,

    /// Finalizes the best lens: catalogue glasses, every constraint satisfied
    #[arg(long)]
    finish: bool,

    #[command(flatten)]
    plan_args: SearchPlanArgs,

    #[command(flatten)]
    effects: EffectArgs,
}

/// Maximum number of gradients if neither it nor a duration is given.
const DEFAULT_ITERATIONS: u64 = 12_000;
/// Seconds between two checkpoints.
const SAVED: f64 = 3.0;

/// The reason why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum SearchEnd {
    /// The run itself ended.
    Run(RunEnd),
    /// The time limit was reached.
    Time,
    /// It was stopped by Ctrl-C.
    Interrupted,
}

/// A run with its end and its clock, and what somebody learns of it who cannot wait.
struct WatchedRun<'a> {
    stop: &'a AtomicBool,
    watch: Stopwatch,
    so_far: &'a FoundSoFar<BestSoFar>,
    /// The lens whose wavelengths and variables the best one is written with.
    original: &'a Lens,
}

impl WatchedRun<'_> {
    fn tell(&self, run: &SearchRunOn<LensLandscape>) {
        self.so_far.update(|so_far| so_far.add(run, self.original));
    }
}

impl SearchArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        self.check()?;
        self.check_paths()?;
        let stop = stop_flag();
        let so_far = BestSoFar::watch(self.out.as_deref(), output, &stop);
        let design = self.design_effects()?;
        let opened = self.lens.open()?;
        let _lock = self.checkpoint.as_deref().map(FileLock::acquire).transpose()?;
        let (mut plan, start) =
            (self.plan(&opened.lens)?, self.plan_args.start_lens(&opened.lens)?);
        let lens = design.working_lens(&start);
        let effects = design.report(&start, &opened.file)?;
        let original = Lens { wavelengths: start.wavelengths, ..opened.lens.clone() };
        let refused = |cause: LandscapeError| self.landscape_error(&opened.file, cause);
        self.plan_args.give_goal(&mut plan, &lens).map_err(refused)?;
        let landscape = plan.landscape(&lens).map_err(refused)?;
        let start_breaks = landscape.violations(landscape.start()).map_err(refused)?;
        let (mut run, resumed) = self.start_or_resume(&landscape, &plan, &opened.file)?;
        limits::warn(&start_breaks);
        let idle = resumed.then(|| nothing_to_do(&run)).flatten();
        idle.iter().for_each(print_note);
        let (watch, before) = (Stopwatch::start(), run.statistics().gradients);
        let mut failures = Failures::default();
        let watched = WatchedRun { stop: &stop, watch, so_far: &so_far, original: &original };
        let ended = self.run_rounds(&landscape, &mut run, &watched, &mut failures);
        let (ms, best) = (1e3 * watch.seconds(), landscape.settled(&run.best().point));
        let mut unsaved = self.save_best(&best, &original, &mut failures);
        let stored = self.write_reservoir(&landscape, &run, &original, &mut failures);
        let finished = self.finish.then(|| finalize(&landscape, &best).map_err(refused));
        let finished = finished.and_then(|found| failures.note(found));
        if let Some(FinalizedLens { lens, .. }) = &finished {
            unsaved = self.save_best(lens, &original, &mut failures);
        }
        let unsaved = unsaved.or_else(|| self.unstored_best(&best, &stored, &original));
        let watch = Stopwatch::start();
        let compared = StartAgainstBest::new(&landscape, &best).map_err(refused)?;
        let report = SearchReport::new(report::SearchResults {
            landscape: &landscape,
            run: &run,
            best: &best,
            ended,
            resumed,
            idle,
            ms,
            gradients: run.statistics().gradients - before,
            start_breaks,
            compared,
            compared_ms: 1e3 * watch.seconds(),
            stale: self.stale_files(&stored),
            stored,
            out: self.out.as_deref().filter(|_| unsaved.is_none()),
            unsaved,
            finished,
            effects,
        });
        drop(so_far);
        failures.note(output.print(&report));
        failures.note(report.check_finished());
        failures.into_result()
    }

    /// The error of a landscape: a wrong term is one of the file of the goal, if there is one.
    fn landscape_error(&self, file: &str, cause: LandscapeError) -> CliError {
        let goal = self.plan_args.files().find(|(option, _)| *option == "--goal");
        match (cause, goal) {
            (cause @ LandscapeError::Setting { what: "the number of steps of a move", .. }, _) => {
                CliError::Input(format!("--steps: {cause}"))
            }
            (cause @ (LandscapeError::Setting { .. } | LandscapeError::Rule(_)), _) => {
                CliError::Input(cause.to_string())
            }
            (cause @ LandscapeError::Merit(MeritError::DoesNotApply { .. }), Some((_, goal))) => {
                CliError::Input(format!("{}: {cause}", input::display_name(goal)))
            }
            (cause, _) => CliError::Input(format!("{file}: {cause}")),
        }
    }

    fn check(&self) -> Result<(), CliError> {
        let wrong = |name: &str, found: f64, expected: &str| {
            let found = ShortNumber(found);
            Err(CliError::Input(format!("{name}: found {found}; expected {expected}")))
        };
        if let Some(minutes) = self.minutes.filter(|m| !(*m > 0.0 && m.is_finite())) {
            return wrong("--minutes", minutes, "more than 0");
        }
        if !(self.checkpoint_every >= 0.0) {
            return wrong("--checkpoint-every", self.checkpoint_every, "0 or more");
        }
        if self.iterations == Some(0) {
            return wrong("--iterations", 0.0, "1 or more");
        }
        Ok(())
    }

    fn check_paths(&self) -> Result<(), CliError> {
        let read = std::iter::once(("the lens", self.lens.path())).chain(self.plan_args.files());
        let mut paths = OutputPaths::reading(read);
        paths.file("--out", self.out.as_deref(), &["json", "zmx"])?;
        paths.file("--checkpoint", self.checkpoint.as_deref(), &["json"])?;
        paths.folder("--reservoir-dir", self.reservoir_dir.as_deref(), is_reservoir_name)
    }

    fn design_effects(&self) -> Result<DesignEffects, CliError> {
        if self.plan_args.has_wavelength() {
            let reason = "--wavelength leaves one wavelength";
            return DesignEffects::at_one_wavelength(&self.effects, reason);
        }
        DesignEffects::new(&self.effects)
    }

    fn plan(&self, lens: &Lens) -> Result<SearchPlan, CliError> {
        let mut plan = self.plan_args.plan(lens)?;
        plan.settings.seed = self.seed;
        // What is wrong with a checkpoint is said when it is resumed.
        let stored =
            self.checkpoint.as_deref().and_then(|path| SearchPlan::stored_methods(path).ok());
        let (descent, sampler) = stored.unzip();
        plan.local.method = self.plan_args.descent.or(descent).unwrap_or(plan.local.method);
        plan.settings.method = self.method.or(sampler).unwrap_or(plan.settings.method);
        let usual = if self.minutes.is_none() { Some(DEFAULT_ITERATIONS) } else { None };
        plan.settings.gradients = self.iterations.or(usual);
        plan.settings.check().map_err(search_error)?;
        Ok(plan)
    }

    /// A new run, or the one of the checkpoint.
    fn start_or_resume(
        &self,
        landscape: &LensLandscape,
        plan: &SearchPlan,
        file: &str,
    ) -> Result<(SearchRunOn<LensLandscape>, bool), CliError> {
        if let Some(path) = self.checkpoint.as_deref().filter(|path| path.exists()) {
            let run = plan.resume(landscape, path).map_err(search_error)?;
            let done = run.statistics().gradients;
            print_note(format!("{}: resumes after {done} gradients", path.display()));
            return Ok((run, true));
        }
        let start = landscape.start().clone();
        let run =
            SearchRun::new(landscape, start, &plan.settings(landscape)).map_err(
                |cause| match cause {
                    SearchError::InvalidStart { .. } => CliError::Input(format!("{file}: {cause}")),
                    cause => search_error(cause),
                },
            )?;
        Ok((run, false))
    }

    /// Runs rounds until the run ends, the time limit or Ctrl-C. A checkpoint that cannot be saved
    /// is said once and tried again; the failure of the last one is noted.
    fn run_rounds(
        &self,
        landscape: &LensLandscape,
        run: &mut SearchRunOn<LensLandscape>,
        watched: &WatchedRun<'_>,
        failures: &mut Failures,
    ) -> SearchEnd {
        let WatchedRun { stop, watch, .. } = *watched;
        watched.tell(run);
        let bar = progress_bar(run.settings().gradients.unwrap_or(0) as usize);
        let (mut saved, mut is_failing) = (0.0, false);
        let flow = run.advance(landscape, |run, _| {
            watched.tell(run);
            bar.set_position(run.statistics().gradients);
            bar.set_message(format!("merit {}", ShortNumber(run.best().loss)));
            if watch.seconds() - saved >= self.checkpoint_every {
                let failure = self.save(landscape, run).err();
                if let Some(error) = failure.as_ref().filter(|_| !is_failing) {
                    bar.suspend(|| print_note(format!("note: the search goes on: {error}")));
                }
                is_failing = failure.is_some();
                saved = watch.seconds();
            }
            let is_late = |minutes: f64| watch.seconds() >= 60.0 * minutes;
            if is_raised(stop) {
                ControlFlow::Break(SearchEnd::Interrupted)
            } else if self.minutes.is_some_and(is_late) {
                ControlFlow::Break(SearchEnd::Time)
            } else {
                ControlFlow::Continue(())
            }
        });
        let ended = match flow {
            ControlFlow::Continue(end) => SearchEnd::Run(end),
            ControlFlow::Break(end) => end,
        };
        bar.finish_and_clear();
        failures.note(self.save(landscape, run));
        ended
    }

    fn save(
        &self,
        landscape: &LensLandscape,
        run: &SearchRunOn<LensLandscape>,
    ) -> Result<(), CliError> {
        let Some(path) = &self.checkpoint else { return Ok(()) };
        run.save(landscape, path).map_err(search_error)
    }

    /// Saves the best lens, if there is a file for it; the lens if that fails.
    fn save_best(&self, best: &Lens, original: &Lens, failures: &mut Failures) -> Option<Lens> {
        let best = lens_to_write(best, original);
        let path = self.out.as_ref()?;
        failures.note(files::save(&best, path)).is_none().then_some(best)
    }

    /// The best lens, if the folder of the reservoir was the only place for it and took none.
    fn unstored_best(&self, best: &Lens, stored: &[PathBuf], original: &Lens) -> Option<Lens> {
        let lost = self.out.is_none() && self.reservoir_dir.is_some() && stored.is_empty();
        lost.then(|| lens_to_write(best, original))
    }

    /// The lenses of an earlier run in the folder of the reservoir.
    fn stale_files(&self, stored: &[PathBuf]) -> Vec<PathBuf> {
        let Some(folder) = &self.reservoir_dir else { return Vec::new() };
        let stale = files::stale_files(folder, stored, is_reservoir_name);
        stale_note(&stale).iter().for_each(|note| print_note(format!("note: {note}")));
        stale
    }

    /// Writes the lenses of the reservoir, best first, until one fails; returns the paths. Each keeps every
    /// limit if a lens near it does.
    fn write_reservoir(
        &self,
        landscape: &LensLandscape,
        run: &SearchRunOn<LensLandscape>,
        original: &Lens,
        failures: &mut Failures,
    ) -> Vec<PathBuf> {
        let Some(folder) = &self.reservoir_dir else { return Vec::new() };
        let mut files = Vec::new();
        for (i, FoundPoint { entry, running }) in run.found_points().into_iter().enumerate() {
            let running = if running { "_running" } else { "" };
            let name = format!("{:02}_generation_{}{running}.json", i + 1, entry.number);
            let path = folder.join(name);
            let lens = lens_to_write(&landscape.settled(&entry.point), original);
            let saved = files::save(&lens, &path);
            if failures.note(saved).is_none() {
                break;
            }
            files.push(path);
        }
        files
    }
}

/// True for the name of a file of a lens of the reservoir.
fn is_reservoir_name(name: &str) -> bool {
    let Some(stem) = name.strip_suffix(".json") else { return false };
    let starts_with_digit = |text: &str| text.starts_with(|c: char| c.is_ascii_digit());
    let after_place = stem.trim_start_matches(|c: char| c.is_ascii_digit());
    starts_with_digit(stem)
        && after_place.strip_prefix("_generation_").is_some_and(starts_with_digit)
}

/// A lens with the variables and wavelengths of the original one, not those of the search.
fn lens_to_write(lens: &Lens, original: &Lens) -> Lens {
    let same = lens.surfaces.len() == original.surfaces.len();
    let variables = if same { original.variables.clone() } else { Vec::new() };
    let wavelengths = original.wavelengths.clone();
    let written = Lens { wavelengths, variables, ..lens.clone() };
    if written.check().is_ok() { written } else { Lens { variables: Vec::new(), ..written } }
}

fn is_raised(flag: &AtomicBool) -> bool {
    flag.load(Ordering::Relaxed)
}

/// The reason why a resumed run has nothing to do; `None` if it continues.
fn nothing_to_do(run: &SearchRunOn<LensLandscape>) -> Option<String> {
    let (done, limit) = (run.statistics().gradients, run.settings().gradients);
    Some(match (run.end_reason()?, limit) {
        (RunEnd::Gradients, Some(limit)) => {
            format!("nothing to do: {done} of {limit} gradients are made; raise --iterations")
        }
        (RunEnd::Done, _) => "nothing to do: everything was tried".to_owned(),
        (over, _) => format!("nothing to do: {}", report::stop_reason_text(SearchEnd::Run(over))),
    })
}

/// The error of settings, which have the names of their options, or of a checkpoint.
fn search_error(cause: SearchError) -> CliError {
    match cause {
        SearchError::Setting { name, found, expected } => {
            CliError::Input(format!("--{name}: found {found}; expected {expected}"))
        }
        SearchError::Checkpoint(CheckpointError::File(error)) => CliError::File(error),
        SearchError::Checkpoint(CheckpointError::RoundTripFailed { .. }) => {
            CliError::Failed(cause.to_string())
        }
        cause => CliError::Input(cause.to_string()),
    }
}
