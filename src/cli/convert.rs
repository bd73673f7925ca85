//! From one file format to another.

use super::failure::Failure;
use super::output::Output;
use std::path::PathBuf;

/// Converts a lens between formats and reports what was lost
#[derive(Debug, clap::Args)]
pub(super) struct Convert {
    /// The lens that is read: .json or .zmx
    #[arg(value_name = "IN")]
    from: PathBuf,

    /// The file that is written, in the format of its extension: .json or .zmx
    #[arg(value_name = "OUT")]
    to: PathBuf,
}

impl Convert {
    pub(super) fn run(&self, _output: &Output) -> Result<(), Failure> {
        let opened = crate::files::open(&self.from)?;
        crate::files::save(&opened.lens, &self.to)?;
        Ok(())
    }
}
