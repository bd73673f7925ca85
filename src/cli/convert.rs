//! `convert`: conversion between file formats, with a report of every loss.

use super::error::CliError;
use super::input::LoadedLens;
use super::output::Output;
use super::output_paths::OutputPaths;
use crate::files::{self, ImportSettings, VignettingChoice};
use std::path::PathBuf;

/// Converts a lens between formats; reports used, approximated, preserved and dropped parts
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/convert.txt"))]
pub(super) struct ConvertArgs {
    /// The lens to read: .json, .zmx, .zar, .seq, .len or .roa
    #[arg(value_name = "IN")]
    from: PathBuf,

    /// The file to write, in the format of its extension: .json, .zmx, .seq, .len, .roa or .optiland.json
    #[arg(value_name = "OUT")]
    to: PathBuf,

    /// The treatment of the vignetting factors of a .zmx or .seq file
    #[arg(long, value_enum, default_value_t = VignettingChoice::Rims)]
    vignetting: VignettingChoice,
}

impl ConvertArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let mut paths = OutputPaths::reading([("the lens", self.from.as_path())]);
        paths.file("OUT", Some(&self.to), &["json", "zmx", "seq", "len", "roa"])?;
        let opened = files::open_with(&self.from, ImportSettings { vignetting: self.vignetting })?;
        let file = self.from.display().to_string();
        LoadedLens { lens: opened.lens.clone(), file }.check_traceable()?;
        output.print(&opened.convert_to(&self.to)?)
    }
}
