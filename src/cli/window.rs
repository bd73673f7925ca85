//! Opening the studio, or the alternatives if the program was built without it.

use super::error::CliError;
use crate::files;
use serde_json::Value;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Opens the studio on a lens, or on the first bundled one.
pub(super) fn open(lens: Option<&Path>) -> Result<(), CliError> {
    if let Some(path) = lens {
        reject_mistyped_command(path)?;
        files::open(path)?;
    }
    show(lens)
}

/// Times of the studio, measured in a real window until `stop` is true.
pub(super) fn benchmark(stop: &Arc<AtomicBool>) -> Result<Value, CliError> {
    measured(stop)
}

#[cfg(feature = "studio")]
fn show(lens: Option<&Path>) -> Result<(), CliError> {
    let studio = crate::studio::run(lens);
    studio.map_err(|why| CliError::Failed(why.to_string()))
}

#[cfg(feature = "studio")]
fn measured(stop: &Arc<AtomicBool>) -> Result<Value, CliError> {
    let figures =
        crate::studio::measure_window(stop).map_err(|why| CliError::Failed(why.to_string()))?;
    serde_json::to_value(figures).map_err(|why| CliError::Failed(why.to_string()))
}

#[cfg(not(feature = "studio"))]
fn show(_lens: Option<&Path>) -> Result<(), CliError> {
    Err(without_window())
}

#[cfg(not(feature = "studio"))]
fn measured(_stop: &Arc<AtomicBool>) -> Result<Value, CliError> {
    Err(without_window())
}

#[cfg(not(feature = "studio"))]
fn without_window() -> CliError {
    let without = "this program was built without its window (cargo feature `studio`)\n\
        with it: `cargo run --release`\n\
        the same work without a window: `aplanat info LENS`, `aplanat analyze LENS spot`, \
        `aplanat optimize LENS --out FILE`, `aplanat convert IN OUT`; `aplanat --help` lists all";
    CliError::Failed(without.to_owned())
}

/// Refuses a word that is neither a file nor looks like one: a mistyped subcommand.
fn reject_mistyped_command(path: &Path) -> Result<(), CliError> {
    if path.exists() || path.extension().is_some() || path.components().count() > 1 {
        return Ok(());
    }
    let word = path.display();
    Err(CliError::Input(format!(
        "`{word}` is neither a subcommand nor a file; expected a lens file (.json, .zmx, .zar, .seq, .len, .roa) \
         or a subcommand: `aplanat --help` lists them"
    )))
}
