//! `convert`: conversion between file formats, with a report of every loss.

use super::error::CliError;
use super::input::check_output_file;
use super::output::Output;
use crate::files;
use std::path::PathBuf;

/// Converts a lens between formats; reports used, approximated, preserved and dropped parts
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("help/convert.txt"))]
pub(super) struct ConvertArgs {
    /// The lens to read: .json or .zmx
    #[arg(value_name = "IN")]
    from: PathBuf,

    /// The file to write, in the format of its extension: .json or .zmx
    #[arg(value_name = "OUT")]
    to: PathBuf,
}

impl ConvertArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        check_output_file(&self.to, &["json", "zmx"])?;
        output.print(&files::convert(&self.from, &self.to)?)
    }
}
