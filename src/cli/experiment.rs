//! `experiment`: the figures and tables of the thesis.

use super::error::CliError;
use super::failures::Failures;
use super::output::{Output, ShortNumber, TextTable, print_note};
use super::output_paths::{OutputPaths, stale_note};
use super::progress::stop_flag;
use crate::experiments::{
    self, Claim, Effort, Experiment as Study, ExperimentError, ExperimentProgress,
    ExperimentReport, PhaseTiming,
};
use crate::measure::{Stopwatch, processor_ms, time_ms};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::fmt::{self, Display};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// A figure or table of the thesis: its data, its pictures, and its claims checked; Ctrl-C ends the
/// study and keeps those before it
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/experiment.txt"))]
pub(super) struct ExperimentArgs {
    /// The number of the figure or table, or `all`; absent: lists all of them
    #[arg(value_name = "FIGURE")]
    id: Option<String>,

    /// Writes data (JSON, CSV) and pictures (PNG) into this folder
    #[arg(long, value_name = "FOLDER", requires = "id")]
    out: Option<PathBuf>,
}

/// Steps of the progress bar.
const STEPS: f64 = 1000.0;

impl ExperimentArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let Some(id) = &self.id else { return output.print(&ExperimentList(experiments::ALL)) };
        let studies = selected_studies(id)?;
        OutputPaths::default().folder("--out", self.out.as_deref(), |_| false)?;
        let (mut runs, mut failed) = (Vec::new(), Failures::default());
        let stop = stop_flag();
        for study in studies {
            if stop.load(Ordering::Relaxed) {
                break;
            }
            runs.push(StudyRun { study, report: self.run_study(study, &stop, &mut failed) });
        }
        if let [StudyRun { report: Ok(report), .. }] = &runs[..] {
            failed.note(output.print(report));
        } else if runs.len() > 1 {
            failed.note(output.print(&StudyRuns(&runs)));
        }
        failed.note(failures(&runs));
        failed.into_result()
    }

    /// Runs a study and writes its files; a file that cannot be written is noted.
    fn run_study(
        &self,
        study: &'static Study,
        stop: &AtomicBool,
        failed: &mut Failures,
    ) -> Result<ExperimentReport, CliError> {
        let mut parts = PhaseTimer::new();
        let mut bar = progress_display();
        let mut watch = |progress: ExperimentProgress<'_>| {
            parts.enter(progress.doing);
            bar(progress);
            if stop.load(Ordering::Relaxed) {
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        };
        let (outcome, ms) = time_ms(|| (study.run)(Effort::Full, &mut watch));
        let outcome = outcome.map_err(|ended| failure(study, &ended))?;
        let mut report = ExperimentReport::new(study, outcome, ms);
        report.parts = parts.into_phases();
        if let Some(folder) = &self.out {
            failed.note(report.write(folder));
            let stale = report.stale_files(folder);
            stale_note(&stale).iter().for_each(|note| print_note(format!("note: {note}")));
        }
        Ok(report)
    }
}

/// The study of a figure, or every study for `all`.
fn selected_studies(id: &str) -> Result<&'static [Study], CliError> {
    if id == "all" {
        return Ok(experiments::ALL);
    }
    experiments::find(id).map(std::slice::from_ref).ok_or_else(|| unknown_experiment(id))
}

/// A study with its report, or the reason why it has none.
struct StudyRun {
    study: &'static Study,
    report: Result<ExperimentReport, CliError>,
}

impl StudyRun {
    /// The number of claims that hold and that of all claims; without a report both are 0.
    fn claim_counts(&self) -> [usize; 2] {
        let Ok(report) = &self.report else { return [0, 0] };
        let all = report.outcome.claims.len();
        [all - report.outcome.failed().count(), all]
    }
}

/// Several studies, one line each.
struct StudyRuns<'a>(&'a [StudyRun]);

impl Serialize for StudyRuns<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.iter().filter_map(|run| run.report.as_ref().ok()))
    }
}

impl Display for StudyRuns<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = TextTable::new(&["figure", "title", "claims that hold", "s"]);
        for run in self.0 {
            let [hold, all] = run.claim_counts();
            let seconds = run.report.as_ref().map(|report| format!("{:.1}", 1e-3 * report.ms));
            let claims = format!("{hold} of {all}");
            table.row([
                run.study.id.into(),
                run.study.title.into(),
                claims,
                seconds.unwrap_or("-".to_owned()),
            ]);
        }
        write!(f, "{table}")
    }
}

/// Fails if a study has no result or a claim does not hold.
fn failures(runs: &[StudyRun]) -> Result<(), CliError> {
    let failed: Vec<String> = runs
        .iter()
        .filter_map(|run| match &run.report {
            Ok(report) => check_claims(report).err(),
            Err(error) => Some(CliError::Failed(error.to_string())),
        })
        .map(|error| error.to_string())
        .collect();
    if failed.is_empty() { Ok(()) } else { Err(CliError::Failed(failed.join("\n"))) }
}

fn unknown_experiment(id: &str) -> CliError {
    let known: Vec<&str> = experiments::ALL.iter().map(|study| study.id).collect();
    CliError::Input(format!("no experiment `{id}`; expected `all` or one of {}", known.join(", ")))
}

fn failure(study: &Study, ended: &ExperimentError) -> CliError {
    CliError::Failed(format!("experiment {}: {ended}", study.id))
}

/// A bar with the progress of an experiment and the name of its phase.
fn progress_display() -> impl FnMut(ExperimentProgress<'_>) {
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
    }
}

/// Times each phase of an experiment, from one progress message to the next.
struct PhaseTimer {
    clock: Stopwatch,
    /// The start of the current phase, in seconds and in milliseconds of all threads.
    since: (f64, Option<f64>),
    current: Option<String>,
    list: Vec<PhaseTiming>,
}

impl PhaseTimer {
    fn new() -> Self {
        let clock = Stopwatch::start();
        Self { clock, since: (0.0, processor_ms()), current: None, list: Vec::new() }
    }

    /// Ends the current phase and begins another one, unless it is the same.
    fn enter(&mut self, doing: &str) {
        if self.current.as_deref() != Some(doing) {
            self.close();
            self.current = Some(doing.to_owned());
        }
    }

    fn close(&mut self) {
        let now = (self.clock.seconds(), processor_ms());
        let (seconds, before) = std::mem::replace(&mut self.since, now);
        let Some(doing) = self.current.take() else { return };
        let (ms, spent) = (1e3 * (now.0 - seconds), now.1.zip(before).map(|(now, b)| now - b));
        match self.list.iter_mut().find(|part| part.doing == doing) {
            Some(part) => {
                part.ms += ms;
                part.processor_ms = part.processor_ms.zip(spent).map(|(sum, more)| sum + more);
            }
            None => self.list.push(PhaseTiming { doing, ms, processor_ms: spent }),
        }
    }

    fn into_phases(mut self) -> Vec<PhaseTiming> {
        self.close();
        self.list
    }
}

/// The list of all experiments.
struct ExperimentList(&'static [Study]);

#[derive(Serialize)]
struct ExperimentEntry {
    id: &'static str,
    title: &'static str,
    claim: &'static str,
    omits: &'static str,
    seconds: f64,
}

impl Serialize for ExperimentList {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let entry = |study: &Study| {
            let Study { id, title, claim, omits, seconds, .. } = *study;
            ExperimentEntry { id, title, claim, omits, seconds }
        };
        serializer.collect_seq(self.0.iter().map(entry))
    }
}

impl Display for ExperimentList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for study in self.0 {
            let Study { id, title, claim, seconds, .. } = study;
            writeln!(f, "{id:<5} {title} (about {} s)\n      {claim}", ShortNumber(*seconds))?;
        }
        Ok(())
    }
}

/// Fails if a claim does not hold.
fn check_claims(report: &ExperimentReport) -> Result<(), CliError> {
    let says = |claim: &Claim| format!("{} ({})", claim.says, claim.verdict());
    let failed: Vec<String> = report.outcome.failed().map(says).collect();
    if failed.is_empty() {
        return Ok(());
    }
    let (count, all) = (failed.len(), report.outcome.claims.len());
    let text = format!("experiment {}: {count} of {all} claims do not hold", report.id);
    Err(CliError::Failed(format!("{text}: {}", failed.join("; "))))
}

impl Display for ExperimentReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { id, title, claim, omits, ms, outcome, files, .. } = self;
        writeln!(f, "{id}: {title}\n{claim}.\nLeft out: {omits}.\n")?;
        let mut table = TextTable::new(&["claim", "found", "error", "expected", ""]);
        for claim in &outcome.claims {
            table.row(cells(claim));
        }
        writeln!(f, "{table}")?;
        outcome.reasons.iter().try_for_each(|reason| writeln!(f, "{reason}.\n"))?;
        writeln!(f, "{} rays, {ms:.0} ms", outcome.rays)?;
        for PhaseTiming { doing, ms, processor_ms } in &self.parts {
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
    let Claim { says, value, error, unit, rule, limit, .. } = claim;
    let error = if *error == 0.0 { String::new() } else { format!("± {error:.1e}") };
    [
        says.clone(),
        format!("{} {unit}", ShortNumber(*value)).trim_end().to_owned(),
        error,
        format!("{rule} {}", ShortNumber(*limit)),
        claim.verdict().to_string(),
    ]
}
