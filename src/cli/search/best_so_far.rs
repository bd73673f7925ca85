//! The best lens of the rounds before one that does not end, saved and printed in place of the result.

use super::{SearchEnd, lens_to_write};
use crate::cli::error::CliError;
use crate::cli::failures::Failures;
use crate::cli::output::{Output, ShortNumber, print_note, write_saved};
use crate::cli::overdue::FoundSoFar;
use crate::files;
use crate::lens::Lens;
use crate::search::SearchRunOn;
use crate::search::lens_landscape::LensLandscape;
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The best lens of a search until now, and the file for it.
#[derive(Debug)]
pub(super) struct BestSoFar {
    json: bool,
    out: Option<PathBuf>,
    /// The best lens as it is written, with its merit in mm².
    best: Option<(Lens, f64)>,
    gradients: u64,
}

impl BestSoFar {
    /// Begins to watch a search that `stop` asks to end, without any lens yet.
    pub(super) fn watch(
        out: Option<&Path>,
        output: &Output,
        stop: &Arc<AtomicBool>,
    ) -> FoundSoFar<Self> {
        let (json, out) = (output.is_json(), out.map(Path::to_path_buf));
        let none = Self { json, out, best: None, gradients: 0 };
        FoundSoFar::watch(stop, none, Self::save_and_print)
    }

    /// Adds what the rounds of a run have found until now.
    pub(super) fn add(&mut self, run: &SearchRunOn<LensLandscape>, original: &Lens) {
        self.gradients = run.statistics().gradients;
        let found = run.best();
        if self.best.as_ref().is_none_or(|(_, merit)| found.loss < *merit) {
            self.best = Some((lens_to_write(&found.point, original), found.loss));
        }
    }

    /// Saves and prints what there is.
    pub(super) fn save_and_print(self) -> Result<(), CliError> {
        let Some((best, merit)) = self.best else {
            return Err(CliError::Failed("stopped before the first round has ended".to_owned()));
        };
        print_note("note: stopped within a round; its lenses are lost, those before are not");
        let mut failures = Failures::default();
        let saved = self.out.filter(|out| failures.note(files::save(&best, out)).is_some());
        let report = StoppedReport {
            ended: SearchEnd::Interrupted,
            gradients: self.gradients,
            merit,
            unsaved: saved.is_none().then_some(best),
            out: saved.map(|out| out.display().to_string()),
        };
        failures.note(Output::new(self.json).print(&report));
        failures.into_result()
    }
}

/// The printed result of a search whose last round has not ended.
#[derive(Serialize)]
struct StoppedReport {
    ended: SearchEnd,
    /// The gradients of the rounds that have ended.
    gradients: u64,
    /// The merit of the best lens, in mm².
    merit: f64,
    out: Option<String>,
    /// The best lens, if it is in no file.
    #[serde(rename = "lens", skip_serializing_if = "Option::is_none")]
    unsaved: Option<Lens>,
}

impl Display for StoppedReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let merit = ShortNumber(self.merit);
        writeln!(f, "{} gradients, stopped: merit {merit}", self.gradients)?;
        write_saved(f, self.out.as_deref(), self.unsaved.as_ref())
    }
}
