//! Why a file could not be read or written: the file, the place in it, what was found there and
//! what was expected.

use crate::lens::LensError;
use std::io;

/// Why a file could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The system refuses to read it.
    #[error("{file}: cannot be read: {source}")]
    Unreadable {
        /// The file.
        file: String,
        /// What the system says.
        source: io::Error,
    },
    /// The system refuses to write it; what was there before is untouched.
    #[error("{file}: cannot be written: {source}; what was there before is untouched")]
    Unwritable {
        /// The file.
        file: String,
        /// What the system says.
        source: io::Error,
    },
    /// It is something else than a lens.
    #[error("{file}: found {found}; expected {expected}")]
    NotALens {
        /// The file.
        file: String,
        /// What it seems to be.
        found: String,
        /// What can be read.
        expected: &'static str,
    },
    /// The text does not say what it should.
    #[error("{file}, {place}: found {found}; expected {expected}")]
    Malformed {
        /// The file.
        file: String,
        /// Line and column, or line and surface.
        place: String,
        /// What stands there.
        found: String,
        /// What should.
        expected: String,
    },
    /// The text is sound, the lens is not.
    #[error("{file}: {source}")]
    Lens {
        /// The file.
        file: String,
        /// What is wrong with the lens.
        source: LensError,
    },
    /// The written file does not trace like the lens; nothing was saved.
    #[error(
        "{file}: not saved, since it does not trace like the lens when it is read back: {what}"
    )]
    RoundTripFailed {
        /// The file.
        file: String,
        /// The ray or number that differs.
        what: String,
    },
}

/// The parts of [`FileError::ParseError`] that a reader of text knows; the file is added outside.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ParseError {
    /// Line and column, or line and surface.
    pub(super) place: String,
    /// What stands there.
    pub(super) found: String,
    /// What should.
    pub(super) expected: String,
}

impl ParseError {
    pub(super) fn in_file(self, file: &str) -> FileError {
        let Self { place, found, expected } = self;
        FileError::Malformed { file: file.to_owned(), place, found, expected }
    }
}
