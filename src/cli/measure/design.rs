//! `measure design`: lenses from specifications against known lenses.

use crate::cli::error::CliError;
use crate::cli::input::{display_name, read_json};
use crate::cli::output::{Output, TextTable, print_note};
use crate::cli::progress::{note_if_stopped, stop_flag};
use crate::measure::{Machine, SheetScore, SpecificationSheet, measure_design};
use serde::{Deserialize, Serialize};
use std::fmt::{self, Display};
use std::path::PathBuf;

/// Designs lenses from specification sheets, without the known lens of each among the starts, and
/// compares the spots
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_design.txt"))]
pub(super) struct MeasureDesignArgs {
    /// The sheets, as JSON
    sheets: PathBuf,

    /// The seconds of each design, without its finish
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0)]
    seconds: f64,

    /// The seed of all random numbers
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,

    /// The sheets with one of these names alone
    #[arg(long, value_name = "ID", value_delimiter = ',')]
    only: Vec<String>,
}

/// A file of sheets; other keys are ignored.
#[derive(Deserialize)]
struct SheetFile {
    sheets: Vec<SpecificationSheet>,
}

impl MeasureDesignArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        if !(self.seconds > 0.0 && self.seconds.is_finite()) {
            let text = format!("--seconds: found {}; expected more than 0", self.seconds);
            return Err(CliError::Input(text));
        }
        let file: SheetFile = read_json(&self.sheets)?;
        let known = |id: &&String| file.sheets.iter().all(|sheet| sheet.id != **id);
        if let Some(id) = self.only.iter().find(known) {
            let name = display_name(&self.sheets);
            return Err(CliError::Input(format!("--only: found `{id}`; expected one of {name}")));
        }
        let chosen =
            |sheet: &&SpecificationSheet| self.only.is_empty() || self.only.contains(&sheet.id);
        let stop = stop_flag();
        let mut scores = Vec::new();
        for sheet in file.sheets.iter().filter(chosen) {
            let score = measure_design(sheet, self.seconds, self.seed, &stop)
                .map_err(|error| CliError::Input(format!("{}: {error}", sheet.id)))?;
            let Some(score) = score else { break };
            print_note(line(&score).join("  "));
            scores.push(score);
        }
        note_if_stopped(&stop);
        output.print(&MeasureDesignReport { machine: Machine::detect(), scores })
    }
}

#[derive(Serialize)]
struct MeasureDesignReport {
    machine: Machine,
    scores: Vec<SheetScore>,
}

/// The cells of a sheet.
fn line(score: &SheetScore) -> [String; 7] {
    let number = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.3}"));
    [
        score.id.clone(),
        number(score.rms_um),
        number(score.score),
        number(score.against_reference),
        score.failures.len().to_string(),
        score.gradients.to_string(),
        format!("{:.0}", score.seconds),
    ]
}

impl Display for MeasureDesignReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.machine)?;
        let mut table = TextTable::new(&[
            "sheet",
            "rms um",
            "score",
            "of reference",
            "broken",
            "gradients",
            "seconds",
        ]);
        self.scores.iter().for_each(|score| table.row(line(score)));
        write!(f, "{table}")?;
        for score in &self.scores {
            for failure in &score.failures {
                writeln!(f, "{}: {failure}", score.id)?;
            }
        }
        let expert = |s: &&SheetScore| s.failures.is_empty() && s.score.is_some_and(|v| v <= 1.1);
        let count = self.scores.iter().filter(expert).count();
        writeln!(f, "{count} of {} within 1.1 with every limit kept", self.scores.len())
    }
}
