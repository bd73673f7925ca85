//! The figures and tables of the thesis.

use super::failure::Failure;
use super::output::{Number, Output, Table};
use crate::experiments::{self, Claim, Effort, Ended, Experiment as Study, Part, Progress, Report};
use crate::measure::{Stopwatch, processor_ms, timed};
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
        let mut parts = Parts::new();
        let mut bar = watched();
        let mut watch = |progress: Progress<'_>| {
            parts.mark(progress.doing);
            bar(progress)
        };
        let (outcome, ms) = timed(|| (study.run)(Effort::Full, &mut watch));
        let mut report = Report::new(study, outcome.map_err(|ended| failure(study, &ended))?, ms);
        report.parts = parts.end();
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

/// Shows how far the work is.
fn watched() -> impl FnMut(Progress<'_>) -> ControlFlow<()> {
    let bar = ProgressBar::new(STEPS as u64);
    let style = ProgressStyle::with_template("{wide_bar} {percent} %  {msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    let mut doing = String::new();
    move |progress| {
        if doing != progress.doing {
            progress.doing.clone_into(&mut doing);
            bar.set_message(doing.clone());
        }
        bar.set_position((STEPS * progress.done) as u64);
        ControlFlow::Continue(())
    }
}

/// How long each part of an experiment takes: from when it is named to when another one is.
struct Parts {
    clock: Stopwatch,
    /// When the current part began, in seconds and in milliseconds of all threads.
    since: (f64, Option<f64>),
    doing: Option<String>,
    list: Vec<Part>,
}

impl Parts {
    fn new() -> Self {
        let clock = Stopwatch::start();
        Self { clock, since: (0.0, processor_ms()), doing: None, list: Vec::new() }
    }

    /// From now on it does this.
    fn mark(&mut self, doing: &str) {
        if self.doing.as_deref() != Some(doing) {
            self.close();
            self.doing = Some(doing.to_owned());
        }
    }

    fn close(&mut self) {
        let now = (self.clock.seconds(), processor_ms());
        let (seconds, before) = std::mem::replace(&mut self.since, now);
        let Some(doing) = self.doing.take() else { return };
        let (ms, spent) = (1e3 * (now.0 - seconds), now.1.zip(before).map(|(now, b)| now - b));
        match self.list.iter_mut().find(|part| part.doing == doing) {
            Some(part) => {
                part.ms += ms;
                part.processor_ms = part.processor_ms.zip(spent).map(|(sum, more)| sum + more);
            }
            None => self.list.push(Part { doing, ms, processor_ms: spent }),
        }
    }

    fn end(mut self) -> Vec<Part> {
        self.close();
        self.list
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
        let Self { id, title, claim, ms, outcome, files, .. } = self;
        writeln!(f, "{id}: {title}\n{claim}.\n")?;
        let mut table = Table::new(&["claim", "found", "error", "expected", ""]);
        for claim in &outcome.claims {
            table.row(cells(claim));
        }
        writeln!(f, "{table}\n{} rays, {ms:.0} ms", outcome.rays)?;
        for Part { doing, ms, processor_ms } in &self.parts {
            write!(f, "{:9.2} s", 1e-3 * ms)?;
            if let Some(ms) = processor_ms {
                write!(f, ", {:9.2} s of all threads", 1e-3 * ms)?;
            }
            writeln!(f, ": {doing}")?;
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
