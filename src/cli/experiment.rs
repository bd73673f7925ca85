//! The figures and tables of the thesis.

use super::failure::Failure;
use super::output::{Number, Output, Table};
use crate::experiments::{self, Claim, Effort, Ended, Experiment as Study, Lap, Progress, Report};
use crate::measure::{Stopwatch, timed};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::fmt::{self, Display};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// A figure or table of the thesis: its data, its pictures, and its claims checked
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/experiment.txt"))]
pub(super) struct Experiment {
    /// The number of the figure or table; a list of all where it is absent
    #[arg(value_name = "FIGURE")]
    id: Option<String>,

    /// Writes data (JSON, CSV) and pictures (PNG) into this folder
    #[arg(long, value_name = "FOLDER", requires = "id")]
    out: Option<PathBuf>,
}

/// Steps of the progress bar.
const STEPS: f64 = 1000.0;

impl Experiment {
    pub(super) fn run(&self, output: &Output) -> Result<(), Failure> {
        let Some(id) = &self.id else { return output.print(&List(experiments::ALL)) };
        let study = experiments::find(id).ok_or_else(|| unknown(id))?;
        self.out.iter().try_for_each(|folder| check_folder(folder))?;
        let mut laps = Laps::default();
        let (outcome, ms) = timed(|| (study.run)(Effort::Full, &mut watched(&mut laps)));
        let mut report = Report::new(study, outcome.map_err(|ended| failure(study, &ended))?, ms);
        report.laps = laps.ended();
        if let Some(folder) = &self.out {
            report.write(folder)?;
        }
        output.print(&report)?;
        judge(&report)
    }
}

fn unknown(id: &str) -> Failure {
    let known: Vec<&str> = experiments::ALL.iter().map(|study| study.id).collect();
    Failure::Input(format!("no experiment `{id}`; expected one of {}", known.join(", ")))
}

fn failure(study: &Study, ended: &Ended) -> Failure {
    Failure::Failed(format!("experiment {}: {ended}", study.id))
}

/// Refuses a folder that cannot be made, before the work and not after it.
pub(super) fn check_folder(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|error| {
        Failure::Input(format!("{}: {error}; expected a folder", folder.display()))
    })
}

/// How long each part of the work takes.
#[derive(Default)]
struct Laps {
    ended: Vec<Lap>,
    begun: Option<(String, Stopwatch)>,
}

impl Laps {
    /// Another part begins.
    fn begin(&mut self, doing: &str) {
        let before = self.begun.replace((doing.to_owned(), Stopwatch::start()));
        self.ended.extend(before.map(lap));
    }

    /// All parts, the last one as well.
    fn ended(self) -> Vec<Lap> {
        self.ended.into_iter().chain(self.begun.map(lap)).collect()
    }
}

fn lap((doing, clock): (String, Stopwatch)) -> Lap {
    Lap { doing, seconds: clock.seconds() }
}

/// Shows how far the work is.
fn watched(laps: &mut Laps) -> impl FnMut(Progress<'_>) -> ControlFlow<()> {
    let bar = ProgressBar::new(STEPS as u64);
    let style = ProgressStyle::with_template("{wide_bar} {percent} %  {msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    let mut doing = String::new();
    move |progress| {
        if doing != progress.doing {
            progress.doing.clone_into(&mut doing);
            bar.set_message(doing.clone());
            laps.begin(&doing);
        }
        bar.set_position((STEPS * progress.done) as u64);
        ControlFlow::Continue(())
    }
}

/// Every experiment.
struct List(&'static [Study]);

#[derive(Serialize)]
struct Entry {
    id: &'static str,
    title: &'static str,
    claim: &'static str,
    seconds: f64,
}

impl Serialize for List {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let entry = |study: &Study| {
            let Study { id, title, claim, seconds, .. } = *study;
            Entry { id, title, claim, seconds }
        };
        serializer.collect_seq(self.0.iter().map(entry))
    }
}

impl Display for List {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for study in self.0 {
            let Study { id, title, claim, seconds, .. } = study;
            writeln!(f, "{id:<5} {title} (about {} s)\n      {claim}", Number(*seconds))?;
        }
        Ok(())
    }
}

/// A claim that does not hold is a failure.
fn judge(report: &Report) -> Result<(), Failure> {
    let failed: Vec<&str> = report.outcome.failed().map(|claim| claim.says.as_str()).collect();
    if failed.is_empty() {
        return Ok(());
    }
    let (count, all) = (failed.len(), report.outcome.claims.len());
    let text = format!("experiment {}: {count} of {all} claims do not hold", report.id);
    Err(Failure::Failed(format!("{text}: {}", failed.join("; "))))
}

impl Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { id, title, claim, ms, laps, outcome, files, .. } = self;
        writeln!(f, "{id}: {title}\n{claim}.\n")?;
        let mut table = Table::new(&["claim", "found", "error", "expected", ""]);
        for claim in &outcome.claims {
            table.row(cells(claim));
        }
        writeln!(f, "{table}\n{} rays, {ms:.0} ms", outcome.rays)?;
        for Lap { doing, seconds } in laps {
            writeln!(f, "{seconds:8.2} s  {doing}")?;
        }
        files.iter().try_for_each(|file| writeln!(f, "written: {file}"))
    }
}

fn cells(claim: &Claim) -> [String; 5] {
    let Claim { says, value, error, unit, rule, limit, holds } = claim;
    let error = if *error == 0.0 { String::new() } else { format!("± {error:.1e}") };
    [
        says.clone(),
        format!("{} {unit}", Number(*value)).trim_end().to_owned(),
        error,
        format!("{rule} {}", Number(*limit)),
        if *holds { "holds" } else { "FAILS" }.to_owned(),
    ]
}
