//! The same task by Optiland, timed in the same run: a script runs in the interpreter that is named, on one
//! thread, with the lens in a file of Optiland's own format.

pub(super) mod mtf;
pub(super) mod tolerance;

use crate::cli::error::CliError;
use crate::files;
use crate::lens::Lens;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The note on how to get the program that the scripts need.
pub(super) const HOW_TO_GET: &str = "Optiland: not run; `python -m venv optiland`, \
     `optiland/bin/pip install optiland`, then --optiland optiland/bin/python";

/// A file that is removed in the end.
struct ScratchFile(PathBuf);

impl Drop for ScratchFile {
    fn drop(&mut self) {
        // One that is gone already is no fault.
        drop(std::fs::remove_file(&self.0));
    }
}

/// The answer of a script about a lens: JSON in the last line of its output.
fn ask<T: DeserializeOwned>(
    python: &Path,
    script: &str,
    lens: &Lens,
    arguments: &[String],
) -> Result<T, CliError> {
    let name = format!("aplanat_{}.optiland.json", std::process::id());
    let file = ScratchFile(std::env::temp_dir().join(name));
    files::save(lens, &file.0)?;
    let mut command = Command::new(python);
    command.arg("-c").arg(script).arg(&file.0).args(arguments);
    for library in ["OMP", "OPENBLAS", "MKL", "NUMBA"] {
        let threads = format!("{library}_NUM_THREADS");
        command.env(threads, "1");
    }
    let not_run = |error| CliError::Input(format!("--optiland {}: {error}", python.display()));
    let output = command.output().map_err(not_run)?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        let last = text.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("no message");
        return Err(wrong(python, last));
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().last().unwrap_or_default();
    serde_json::from_str(line).map_err(|error| wrong(python, &error.to_string()))
}

/// The error of an interpreter that does not answer as it should.
fn wrong(python: &Path, what: &str) -> CliError {
    CliError::Failed(format!("{}: {what}", python.display()))
}

/// The error of an answer with another number of values than were asked for.
fn wrong_shape(python: &Path) -> CliError {
    wrong(python, "its answer has not the shape of the question")
}
