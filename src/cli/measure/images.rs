//! `measure images`: what the program finds against exact answers for pictures through lenses.

use crate::cli::error::CliError;
use crate::cli::failures::Failures;
use crate::cli::input::{display_name, read_json};
use crate::cli::output::{Output, TextTable};
use crate::cli::progress::{note_if_stopped, stop_flag, with_bar};
use crate::measure::{ImageAnswers, Machine, image_kinds, measure_images};
use serde::Serialize;
use serde_json::Value;
use std::fmt::{self, Display};
use std::path::PathBuf;

/// Compares pupils, wavefronts, contrast, light and ghosts with a file of exact answers, each to the bound of
/// the file; exit status 1 if one is broken
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_images.txt"))]
pub(super) struct MeasureImagesArgs {
    /// The file of exact answers, as tests/reference/images.json
    #[arg(value_name = "FILE")]
    file: PathBuf,

    /// These kinds alone
    #[arg(long, value_name = "KIND", value_delimiter = ',')]
    only: Vec<String>,
}

impl MeasureImagesArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        if let Some(kind) = self.only.iter().find(|kind| image_kinds().all(|known| known != **kind))
        {
            let known: Vec<&str> = image_kinds().collect();
            let text = format!("--only: found `{kind}`; expected one of {}", known.join(", "));
            return Err(CliError::Input(text));
        }
        let file: Value = read_json(&self.file)?;
        let stop = stop_flag();
        let (found, _) =
            with_bar(&stop, "kinds", |report| measure_images(&file, &self.only, report));
        let name = display_name(&self.file);
        let kinds = found.map_err(|why| CliError::Input(format!("{name}: {why}")))?;
        note_if_stopped(&stop);
        let report = MeasureImagesReport { machine: Machine::detect(), file: name, kinds };
        let mut failures = Failures::default();
        let broken: Vec<&str> = report.broken().map(|found| found.kind).collect();
        if !broken.is_empty() {
            let text = format!("{}: bounds broken: {}", report.file, broken.join(", "));
            failures.note::<(), _>(Err(CliError::Failed(text)));
        }
        failures.note(output.print(&report));
        failures.into_result()
    }
}

/// The printed result.
#[derive(Serialize)]
struct MeasureImagesReport {
    machine: Machine,
    file: String,
    kinds: Vec<ImageAnswers>,
}

impl MeasureImagesReport {
    fn broken(&self) -> impl Iterator<Item = &ImageAnswers> {
        self.kinds.iter().filter(|found| !found.kept)
    }
}

fn cells(found: &ImageAnswers) -> Vec<String> {
    vec![
        found.kind.to_owned(),
        found.numbers.to_string(),
        found
            .difference
            .map_or_else(|| "none".to_owned(), |difference| format!("{difference:.1e}")),
        format!("{:.1e}", found.bound),
        if found.kept { "kept" } else { "broken" }.to_owned(),
        found.place.clone(),
    ]
}

impl Display for MeasureImagesReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}\n{}", self.machine, self.file)?;
        let heads =
            ["kind", "numbers", "difference", "bound", "", "of the number nearest to its bound"];
        let mut table = TextTable::new(&heads);
        self.kinds.iter().for_each(|found| table.row(cells(found)));
        write!(f, "{table}")?;
        let numbers: usize = self.kinds.iter().map(|found| found.numbers).sum();
        let (kept, all) = (self.kinds.len() - self.broken().count(), self.kinds.len());
        writeln!(f, "{kept} of {all} kinds within their bounds, {numbers} numbers")
    }
}
