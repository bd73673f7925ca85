//! The file in which a design is saved between two rounds.

use crate::cli::error::CliError;
use crate::cli::input::read_long_json;
use crate::files::{self, FileError, json};
use crate::search::design::{DesignRun, DesignSettings, LensRequirements};
use std::path::Path;

/// The longest checkpoint, in bytes.
const LONGEST: u64 = 1 << 26;

/// Saves a run.
pub(super) fn save(path: &Path, run: &DesignRun) -> Result<(), FileError> {
    files::write_atomic(path, json::pretty(run).as_bytes())
}

/// Reads a run of the same specification and settings.
pub(super) fn resume(
    path: &Path,
    asked: &LensRequirements,
    settings: &DesignSettings,
) -> Result<DesignRun, CliError> {
    let run: DesignRun = read_long_json(path, LONGEST)?;
    let refuse = |what: &str| {
        let text = format!("{}: found a run of {what}; expected another file", path.display());
        Err(CliError::Input(text))
    };
    if run.requirements() != asked {
        return refuse("another specification");
    }
    if run.settings() != settings {
        return refuse("another --seed or --without");
    }
    Ok(run)
}
