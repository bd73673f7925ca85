//! Opening the studio, or saying what works without it.

use super::failure::Failure;
use crate::files;
use std::path::Path;

/// Opens the studio on a lens, or on the one that comes first in the library.
pub(super) fn open(lens: Option<&Path>) -> Result<(), Failure> {
    if let Some(path) = lens {
        refuse_typing_error(path)?;
        files::open(path)?;
    }
    show(lens)
}

#[cfg(feature = "studio")]
fn show(lens: Option<&Path>) -> Result<(), Failure> {
    let studio = crate::studio::run(lens);
    studio.map_err(|why| Failure::Failed(why.to_string()))
}

#[cfg(not(feature = "studio"))]
fn show(_lens: Option<&Path>) -> Result<(), Failure> {
    Err(Failure::Failed(WITHOUT.to_owned()))
}

#[cfg(not(feature = "studio"))]
const WITHOUT: &str = "this program was built without its window (cargo feature `studio`)\n\
    with it: `cargo run --release`\n\
    the same work without a window: `aplanat info LENS`, `aplanat analyze LENS spot`, \
    `aplanat optimize LENS --out FILE`, `aplanat convert IN OUT`; `aplanat --help` lists all";

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
