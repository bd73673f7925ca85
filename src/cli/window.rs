//! Opening the studio, or saying what works without it.

use super::failure::Failure;
use crate::files;
use serde_json::Value;
use std::path::Path;

/// Opens the studio on a lens, or on the one that comes first in the library.
pub(super) fn open(lens: Option<&Path>) -> Result<(), Failure> {
    if let Some(path) = lens {
        refuse_typing_error(path)?;
        files::open(path)?;
    }
    show(lens)
}

/// What the window costs, measured in a real one.
pub(super) fn figures() -> Result<Value, Failure> {
    measured()
}

#[cfg(feature = "studio")]
fn show(lens: Option<&Path>) -> Result<(), Failure> {
    let studio = crate::studio::run(lens);
    studio.map_err(|why| Failure::Failed(why.to_string()))
}

#[cfg(feature = "studio")]
fn measured() -> Result<Value, Failure> {
    let figures = crate::studio::measure().map_err(|why| Failure::Failed(why.to_string()))?;
    serde_json::to_value(figures).map_err(|why| Failure::Failed(why.to_string()))
}

#[cfg(not(feature = "studio"))]
fn show(_lens: Option<&Path>) -> Result<(), Failure> {
    measured().map(drop)
}

#[cfg(not(feature = "studio"))]
fn measured() -> Result<Value, Failure> {
    let without = "this program was built without its window (cargo feature `studio`)\n\
        with it: `cargo run --release`\n\
        the same work without a window: `aplanat info LENS`, `aplanat analyze LENS spot`, \
        `aplanat optimize LENS --out FILE`, `aplanat convert IN OUT`; `aplanat --help` lists all";
    Err(Failure::Failed(without.to_owned()))
}

/// A word that is neither a file nor looks like one was meant as a subcommand.
fn refuse_typing_error(path: &Path) -> Result<(), Failure> {
    if path.exists() || path.extension().is_some() || path.components().count() > 1 {
        return Ok(());
    }
    let word = path.display();
    Err(Failure::Input(format!(
        "`{word}` is neither a subcommand nor a file; expected a lens file (.json, .zmx) \
         or a subcommand: `aplanat --help` lists them"
    )))
}
