//! What the window costs.

use crate::cli::failure::Failure;
use crate::cli::output::Output;

/// First frame, edits and frames of the studio, which needs a display
#[derive(Debug, clap::Args)]
pub(super) struct Window {}

impl Window {
    pub(super) fn run(&self, _output: &Output) -> Result<(), Failure> {
        let _ = self;
        Err(Failure::Failed("the window cannot be measured yet".to_owned()))
    }
}
