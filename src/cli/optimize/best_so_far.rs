//! The best lens of the steps before one that does not end, saved and printed in place of the result.

use super::report::OptimizeEnd;
use super::{OptimizeArgs, write_history};
use crate::cli::error::CliError;
use crate::cli::failures::Failures;
use crate::cli::output::{Output, ShortNumber, print_note, write_saved};
use crate::files;
use crate::lens::Lens;
use crate::optimize::OptimizationProgress;
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::PathBuf;

/// The best lens and the steps of a run until now, and the files for them.
#[derive(Debug)]
pub(super) struct BestSoFar {
    json: bool,
    out: PathBuf,
    history: Option<PathBuf>,
    steps: Vec<OptimizationProgress>,
    best: Option<Lens>,
}

impl BestSoFar {
    pub(super) fn new(args: &OptimizeArgs, output: &Output) -> Self {
        Self {
            json: output.is_json(),
            out: args.out.clone(),
            history: args.history.clone(),
            steps: Vec::new(),
            best: None,
        }
    }

    /// Adds a step; `best` gives the best lens as it is written, and is asked if there is a better one.
    pub(super) fn add(&mut self, step: OptimizationProgress, best: impl FnOnce() -> Lens) {
        if self.steps.last().is_none_or(|last| step.best < last.best) {
            self.best = Some(best());
        }
        self.steps.push(step);
    }

    /// Another lens, after the last step.
    pub(super) fn replace(&mut self, best: Lens) {
        self.best = Some(best);
    }

    /// Saves and prints what there is.
    pub(super) fn save_and_print(self) -> Result<(), CliError> {
        let Some(best) = self.best else {
            return Err(CliError::Failed("stopped before the first step has ended".to_owned()));
        };
        print_note(
            "note: stopped within a step; the lens of the steps before is not evaluated anew",
        );
        let mut failures = Failures::default();
        let saved = failures.note(files::save(&best, &self.out)).is_some();
        let kept = failures.note(write_history(self.history.as_deref(), &self.steps)).is_some();
        let report = StoppedReport {
            ended: OptimizeEnd::Stopped,
            steps: self.steps.len(),
            merit_after: self.steps.last().map(|step| step.best),
            out: saved.then(|| self.out.display().to_string()),
            lens: (!saved).then_some(best),
            history: (!kept).then_some(self.steps),
        };
        failures.note(Output::new(self.json).print(&report));
        failures.into_result()
    }
}

/// The printed result of a run whose last step has not ended.
#[derive(Serialize)]
struct StoppedReport {
    ended: OptimizeEnd,
    steps: usize,
    /// The merit of the best lens by the rays of its steps, in mm².
    merit_after: Option<f64>,
    out: Option<String>,
    /// The lens, if it could not be saved.
    #[serde(skip_serializing_if = "Option::is_none")]
    lens: Option<Lens>,
    /// The steps of the history, if they could not be saved.
    #[serde(skip_serializing_if = "Option::is_none")]
    history: Option<Vec<OptimizationProgress>>,
}

impl Display for StoppedReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} steps: stopped", self.steps)?;
        self.merit_after.map_or(Ok(()), |merit| write!(f, ", merit {}", ShortNumber(merit)))?;
        writeln!(f)?;
        write_saved(f, self.out.as_deref(), self.lens.as_ref())
    }
}
