//! Errors of reading and writing files: the file, the place in it, what was found there and what was
//! expected.

use crate::lens::LensError;
use std::io;

/// An error of reading or writing a file.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The system cannot read the file.
    #[error("{file}: cannot be read: {source}")]
    Unreadable {
        /// The file.
        file: String,
        /// The error of the system.
        source: io::Error,
    },
    /// The system cannot write the file; its previous content, if there was any, is unchanged.
    #[error("{file}: cannot be written: {source}; no file was changed")]
    Unwritable {
        /// The file.
        file: String,
        /// The error of the system.
        source: io::Error,
    },
    /// The file is too long, or is no file but a device.
    #[error("{file}: found {found}; expected {expected}")]
    Unsuitable {
        /// The file.
        file: String,
        /// Its kind or size.
        found: String,
        /// The accepted kind or size.
        expected: String,
    },
    /// Another program writes the file.
    #[error("{file}: in use by {holder}; expected a file that no other program writes")]
    InUse {
        /// The file.
        file: String,
        /// The process that holds it.
        holder: String,
    },
    /// The content is not a lens.
    #[error("{file}: found {found}; expected {expected}")]
    NotALens {
        /// The file.
        file: String,
        /// The kind of content that was recognized.
        found: String,
        /// The contents that are accepted.
        expected: &'static str,
    },
    /// The content does not follow the format.
    #[error("{file}, {place}: found {found}; expected {expected}")]
    Malformed {
        /// The file.
        file: String,
        /// The place: line, column and keys, or line and surface.
        place: String,
        /// The content of that place.
        found: String,
        /// The accepted content.
        expected: String,
    },
    /// The format is right, but the lens is invalid.
    #[error("{file}: {source}")]
    Lens {
        /// The file.
        file: String,
        /// The error of the lens.
        source: LensError,
    },
    /// Read back, the file does not trace like the lens; nothing was saved.
    #[error("{file}: not saved: read back, it does not trace like the lens: {what}")]
    RoundTripFailed {
        /// The file.
        file: String,
        /// The ray or number that differs.
        what: String,
    },
}

/// [`FileError::Malformed`] without the file, which the caller adds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ParseError {
    /// The place: line, column and keys, or line and surface.
    pub(super) place: String,
    /// The content of that place.
    pub(super) found: String,
    /// The accepted content.
    pub(super) expected: String,
}

impl ParseError {
    pub(super) fn in_file(self, file: &str) -> FileError {
        let Self { place, found, expected } = self;
        FileError::Malformed { file: file.to_owned(), place, found, expected }
    }
}
