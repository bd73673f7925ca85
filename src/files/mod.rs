//! Reading and writing lenses.
//!
//! A file is known by its content first and its extension second. An import reports what it used,
//! approximated, preserved and dropped; an export is read back and traced before it counts as
//! written; a file is written beside its target and renamed, so that nothing is lost on the way.

mod error;
mod library;
pub mod native;
mod report;
mod save;
mod text;
pub mod zemax;

pub use error::FileError;
pub use library::{Bundled, library};
pub use report::{Outcome, Report, ReportRow};

use crate::lens::Lens;
use std::path::Path;

/// The formats that are read and written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Our own JSON.
    Native,
}

/// A lens from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Opened {
    /// The lens.
    pub lens: Lens,
    /// What it was read from.
    pub format: Format,
}

/// What became of a saved lens.
#[derive(Debug, Clone, PartialEq)]
pub struct SaveReport {
    /// What was written.
    pub format: Format,
}

const KNOWN: &str = "a lens: JSON with the key `aplanat`";

/// Reads a lens from a file of any known format.
pub fn open(path: impl AsRef<Path>) -> Result<Opened, FileError> {
    let path = path.as_ref();
    let file = path.display().to_string();
    let bytes = std::fs::read(path)
        .map_err(|source| FileError::Unreadable { file: file.clone(), source })?;
    parse(&bytes, &file)
}

/// Reads a lens from the bytes of a file; `name` is for messages and, by its extension, a hint.
pub fn parse(bytes: &[u8], name: &str) -> Result<Opened, FileError> {
    if let Some(found) = text::not_text(bytes) {
        return Err(FileError::NotALens { file: name.to_owned(), found, expected: KNOWN });
    }
    let lens = native::read(&text::decode(bytes), name)?;
    Ok(Opened { lens, format: Format::Native })
}

/// Writes a lens to a file, in the format of its extension: `.json`. Where it fails, what was
/// there before is untouched.
pub fn save(lens: &Lens, path: impl AsRef<Path>) -> Result<SaveReport, FileError> {
    let path = path.as_ref();
    let file = || path.display().to_string();
    lens.check().map_err(|source| FileError::Lens { file: file(), source })?;
    save::replace(path, native::write(lens).as_bytes())?;
    Ok(SaveReport { format: Format::Native })
}
