//! The best lens of the rounds before one that does not end, saved and printed in place of the result.

use super::SearchEnd;
use crate::cli::error::CliError;
use crate::cli::failures::Failures;
use crate::cli::output::{Output, ShortNumber, print_note, write_saved};
use crate::files;
use crate::lens::Lens;
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::PathBuf;

/// What a search has found until now, and where it is saved.
#[derive(Debug)]
pub(super) struct BestSoFar {
    pub(super) json: bool,
    pub(super) out: Option<PathBuf>,
    /// The best lens as it is written, with its merit in mm².
    pub(super) best: Option<(Lens, f64)>,
    pub(super) gradients: u64,
}

impl BestSoFar {
    /// True if `merit` is below that of the best lens so far.
    pub(super) fn is_improved_by(&self, merit: f64) -> bool {
        self.best.as_ref().is_none_or(|(_, best)| merit < *best)
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
