//! The search over structure: a run that can be stopped, killed and taken up again.

mod asked;
mod found;
mod limits;
mod report;

pub(super) use asked::Asked;

use super::experiment::check_folder;
use super::failure::Failure;
use super::input::{self, LensFile};
use super::optimize::{progress_bar, stop_flag};
use super::output::{Number, Output, remark};
use super::targets;
use crate::files;
use crate::lens::Lens;
use crate::measure::Stopwatch;
use crate::search::lens::{LensLandscape, NoLandscape, Plan, finish};
use crate::search::{Found, Method, Over, Run, RunOf, SearchError};
use clap::ValueEnum;
use found::Compared;
use report::Report;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// Searches over structure: adds, removes, glues and splits elements while it descends; Ctrl-C ends
/// it and saves what was found
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/search.txt"))]
pub(super) struct Search {
    #[command(flatten)]
    lens: LensFile,

    /// Where the best lens is saved: .json or .zmx
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// The sampler
    #[arg(long, value_enum, default_value_t = Sampler::Restore)]
    method: Sampler,

    /// All chance follows from it
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,

    /// Ends after so many minutes
    #[arg(long, value_name = "MINUTES", allow_negative_numbers = true)]
    minutes: Option<f64>,

    /// Ends after so many gradients of all chains, and takes no more; 12000 where --minutes is absent
    /// too
    #[arg(long, value_name = "N")]
    iterations: Option<u64>,

    /// Where the run is saved every few seconds; goes on where it was, if the file exists
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,

    /// Seconds between two savings
    #[arg(
        long,
        value_name = "SECONDS",
        default_value_t = SAVED,
        requires = "checkpoint",
        allow_negative_numbers = true
    )]
    checkpoint_every: f64,

    /// The folder into which every lens of the reservoir is written, and the best one where its
    /// descent still goes on
    #[arg(long, value_name = "FOLDER")]
    reservoir_dir: Option<PathBuf>,

    /// Makes the best lens one that can be made: glasses of the catalogue, every limit kept
    #[arg(long)]
    finish: bool,

    #[command(flatten)]
    asked: Asked,
}

/// The samplers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "snake_case")]
enum Sampler {
    /// Descents that end by chance and begin again from the reservoir
    Restore,
    /// Metropolis and Hastings, Langevin steps
    Metropolis,
    /// Each element once more and once less
    Brute,
}

impl Sampler {
    fn method(self) -> Method {
        match self {
            Self::Restore => Method::Restore,
            Self::Metropolis => Method::Metropolis,
            Self::Brute => Method::Brute,
        }
    }
}

/// Gradients of a search that nothing else ends.
const ITERATIONS: u64 = 12_000;
/// Seconds between two checkpoints.
const SAVED: f64 = 3.0;

/// What ended a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Ended {
    /// The run says so.
    Run(Over),
    /// The minutes are used up.
    Time,
    /// The person stopped it.
    Interrupted,
}

impl Search {
    pub(super) fn run(&self, output: &Output) -> Result<(), Failure> {
        self.check()?;
        let opened = self.lens.open()?;
        let plan = self.plan(&opened.lens)?;
        let lens = self.asked.start(&opened.lens)?;
        let refused = |cause: NoLandscape| refused_landscape(&opened.file, cause);
        let landscape = plan.landscape(&lens).map_err(refused)?;
        let start_breaks = landscape.broken(landscape.start()).map_err(refused)?;
        let (mut run, resumed) = self.begin(&landscape, &plan, &opened.file)?;
        self.reservoir_dir.iter().try_for_each(|folder| check_folder(folder))?;
        limits::warn(&start_breaks);
        let idle = resumed.then(|| nothing_to_do(&run)).flatten();
        idle.iter().for_each(remark);
        let watch = Stopwatch::start();
        let before = run.statistics().gradients;
        let ended = self.go_on(&landscape, &mut run, watch)?;
        let ms = 1e3 * watch.seconds();
        let best = written(&run.best().point, &opened.lens);
        if let Some(path) = &self.out {
            files::save(&best, path)?;
        }
        let stored = self.store(&run, &opened.lens)?;
        let finished = if self.finish {
            Some(finish(&landscape, &run.best().point).map_err(refused)?)
        } else {
            None
        };
        if let (Some(path), Some(finished)) = (&self.out, &finished) {
            files::save(&written(&finished.lens, &opened.lens), path)?;
        }
        let printed = Stopwatch::start();
        let compared = Compared::new(&landscape, &run.best().point).map_err(refused)?;
        let report = Report::new(report::Searched {
            landscape: &landscape,
            run: &run,
            ended,
            resumed,
            idle,
            ms,
            gradients: run.statistics().gradients - before,
            start_breaks,
            compared,
            compared_ms: 1e3 * printed.seconds(),
            stored,
            out: self.out.as_deref(),
            finished,
        });
        output.print(&report)?;
        report.verdict()
    }

    fn check(&self) -> Result<(), Failure> {
        let wrong = |name: &str, found: f64, expected: &str| {
            let found = Number(found);
            Err(Failure::Input(format!("{name}: found {found}; expected {expected}")))
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
        self.out.iter().try_for_each(|path| input::check_target(path, &["json", "zmx"]))?;
        self.checkpoint.iter().try_for_each(|path| input::check_target(path, &["json"]))?;
        self.reservoir_dir.iter().try_for_each(|folder| targets::check_folder(folder))?;
        let out = self.out.as_deref().map(|path| ("--out", path));
        let checkpoint = self.checkpoint.as_deref().map(|path| ("--checkpoint", path));
        let read = std::iter::once(("the lens", self.lens.path())).chain(self.asked.files());
        targets::check_apart(&[out, checkpoint], read)
    }

    fn plan(&self, lens: &Lens) -> Result<Plan, Failure> {
        let mut plan = self.asked.plan(lens)?;
        plan.settings.method = self.method.method();
        plan.settings.seed = self.seed;
        let usual = if self.minutes.is_none() { Some(ITERATIONS) } else { None };
        plan.settings.gradients = self.iterations.or(usual);
        plan.settings.check().map_err(refused)?;
        Ok(plan)
    }

    /// A new run, or the one of the checkpoint.
    fn begin(
        &self,
        landscape: &LensLandscape,
        plan: &Plan,
        file: &str,
    ) -> Result<(RunOf<LensLandscape>, bool), Failure> {
        let settings = plan.settings(landscape);
        if let Some(path) = self.checkpoint.as_deref().filter(|path| path.exists()) {
            let run: RunOf<LensLandscape> =
                Run::load(landscape, &settings, path).map_err(refused)?;
            let done = run.statistics().gradients;
            remark(format!("{}: goes on after {done} gradients", path.display()));
            return Ok((run, true));
        }
        let start = landscape.start().clone();
        let run = Run::new(landscape, start, &settings).map_err(|cause| match cause {
            SearchError::Start { .. } => Failure::Input(format!("{file}: {cause}")),
            cause => refused(cause),
        })?;
        Ok((run, false))
    }

    /// Rounds until the run is over, the time is used up, or the person has had enough.
    fn go_on(
        &self,
        landscape: &LensLandscape,
        run: &mut RunOf<LensLandscape>,
        watch: Stopwatch,
    ) -> Result<Ended, Failure> {
        let stop = stop_flag();
        let bar = progress_bar(run.settings().gradients.unwrap_or(0) as usize);
        let mut saved = 0.0;
        let ended = loop {
            if let Some(over) = run.over() {
                break Ended::Run(over);
            }
            if is_raised(&stop) {
                break Ended::Interrupted;
            }
            if self.minutes.is_some_and(|minutes| watch.seconds() >= 60.0 * minutes) {
                break Ended::Time;
            }
            run.round(landscape);
            bar.set_position(run.statistics().gradients);
            bar.set_message(format!("merit {}", Number(run.best().loss)));
            if watch.seconds() - saved >= self.checkpoint_every {
                self.save(landscape, run)?;
                saved = watch.seconds();
            }
        };
        bar.finish_and_clear();
        self.save(landscape, run)?;
        Ok(ended)
    }

    fn save(&self, landscape: &LensLandscape, run: &RunOf<LensLandscape>) -> Result<(), Failure> {
        let Some(path) = &self.checkpoint else { return Ok(()) };
        run.save(landscape, path).map_err(refused)
    }

    /// Writes what was found, best lens first; the files.
    fn store(&self, run: &RunOf<LensLandscape>, opened: &Lens) -> Result<Vec<String>, Failure> {
        let Some(folder) = &self.reservoir_dir else { return Ok(Vec::new()) };
        let mut files = Vec::new();
        for (i, Found { entry, running }) in run.found().into_iter().enumerate() {
            let running = if running { "_running" } else { "" };
            let name = format!("{:02}_generation_{}{running}.json", i + 1, entry.number);
            let path = folder.join(name);
            files::save(&written(&entry.point, opened), &path)?;
            files.push(path.display().to_string());
        }
        Ok(files)
    }
}

/// A lens as a file has it: what was held or free only for the search is not written.
fn written(lens: &Lens, opened: &Lens) -> Lens {
    let same = lens.surfaces.len() == opened.surfaces.len();
    let variables = if same { opened.variables.clone() } else { Vec::new() };
    let written = Lens { variables, ..lens.clone() };
    if written.check().is_ok() { written } else { Lens { variables: Vec::new(), ..written } }
}

fn is_raised(flag: &AtomicBool) -> bool {
    flag.load(Ordering::Relaxed)
}

/// What a run that was taken up again has no more to do; none where it goes on.
fn nothing_to_do(run: &RunOf<LensLandscape>) -> Option<String> {
    let (done, limit) = (run.statistics().gradients, run.settings().gradients);
    Some(match (run.over()?, limit) {
        (Over::Gradients, Some(limit)) => {
            format!("nothing to do: {done} of {limit} gradients are made; raise --iterations")
        }
        (Over::Done, _) => "nothing to do: everything was tried".to_owned(),
        (over, _) => format!("nothing to do: {}", report::why(Ended::Run(over))),
    })
}

/// What a lens, or what is asked of it, makes impossible.
fn refused_landscape(file: &str, cause: NoLandscape) -> Failure {
    match cause {
        NoLandscape::Setting { .. } | NoLandscape::Rule(_) => Failure::Input(cause.to_string()),
        cause => Failure::Input(format!("{file}: {cause}")),
    }
}

/// What the search itself refuses: its settings, or a checkpoint.
fn refused(cause: SearchError) -> Failure {
    match cause {
        SearchError::File(error) => Failure::File(error),
        SearchError::NotProven { .. } => Failure::Failed(cause.to_string()),
        cause => Failure::Input(cause.to_string()),
    }
}
