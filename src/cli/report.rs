//! `report`: the prescription report of a lens as PDF or HTML.

use super::error::CliError;
use super::input::{LensFile, Tolerance};
use super::output::Output;
use super::output_paths::OutputPaths;
use crate::files::write_atomic;
use crate::report::{ReportSettings, report_bytes};
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::PathBuf;

/// A prescription report on paper: data, layout, spots, MTF, effects, bill of material, with errors
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/report.txt"))]
pub(super) struct ReportArgs {
    #[command(flatten)]
    lens: LensFile,

    /// Writes the report into this file: .pdf or .html
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// The error: relative to the radius of a spot, absolute for a contrast
    #[arg(long, default_value = "0.1%", value_name = "TOLERANCE")]
    error: Tolerance,
}

/// The printed result.
#[derive(Serialize)]
struct WrittenReport {
    out: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pages: Option<usize>,
}

impl Display for WrittenReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.pages {
            Some(1) => writeln!(f, "saved as {}, 1 page", self.out),
            Some(pages) => writeln!(f, "saved as {}, {pages} pages", self.out),
            None => writeln!(f, "saved as {}", self.out),
        }
    }
}

impl ReportArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let mut paths = OutputPaths::reading([("the lens", self.lens.path())]);
        paths.file("--out", Some(&self.out), &["pdf", "html"])?;
        let opened = self.lens.open()?;
        let settings = ReportSettings { tolerance: self.error.0 };
        let (bytes, pages) = report_bytes(&opened.lens, settings, &self.out)
            .map_err(|error| CliError::Input(format!("{}: {error}", opened.file)))?;
        write_atomic(&self.out, &bytes)?;
        output.print(&WrittenReport { out: self.out.display().to_string(), pages })
    }
}
