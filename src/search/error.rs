//! Why a search cannot begin, go on, be steered, saved or loaded.

use crate::files::FileError;

/// Why a search cannot begin, go on, be steered, saved or loaded.
#[derive(Debug, thiserror::Error)]
pub enum SearchError {
    /// A setting makes no sense.
    #[error("setting {name}: found {found}; expected {expected}")]
    Setting {
        /// The setting.
        name: &'static str,
        /// What it is.
        found: String,
        /// What it could be.
        expected: &'static str,
    },
    /// The start is worth nothing.
    #[error("the search cannot begin: the loss of the start is {loss}; expected a number")]
    InvalidStart {
        /// Its loss.
        loss: f64,
    },
    /// No such generation.
    #[error("generation {number} is not remembered, of {born} so far")]
    UnknownGeneration {
        /// The number that was asked for.
        number: u64,
        /// How many there have been.
        born: u64,
    },
    /// The system refuses a checkpoint.
    #[error(transparent)]
    File(#[from] FileError),
    /// A checkpoint would not read back as it is.
    #[error("{file}: not saved, since it would not read back as it is: {what}")]
    RoundTripFailed {
        /// The file.
        file: String,
        /// What would become of it.
        what: String,
    },
    /// What should be a checkpoint is none, or a damaged one.
    #[error("{file}: no sound checkpoint of a search: {what}")]
    Corrupt {
        /// The file.
        file: String,
        /// What is wrong with it, and where.
        what: String,
    },
    /// A checkpoint was written by another version.
    #[error("{file}: a checkpoint of version {found}; expected version {expected}")]
    UnsupportedVersion {
        /// The file.
        file: String,
        /// Its version.
        found: u32,
        /// The version that can be read.
        expected: u32,
    },
    /// A checkpoint belongs to a search from another start.
    #[error(
        "{file}: a checkpoint of another search, from another lens: {name} is {found} there and \
         {expected} here"
    )]
    OtherStart {
        /// The file.
        file: String,
        /// What differs: the names on the way to it.
        name: String,
        /// What it is in the file.
        found: String,
        /// What it is here.
        expected: String,
    },
    /// A checkpoint belongs to another search.
    #[error("{file}: a checkpoint of another search: {name} is {found} there and {expected} here")]
    OtherSearch {
        /// The file.
        file: String,
        /// What differs: the names on the way to it.
        name: String,
        /// What it is in the file.
        found: String,
        /// What it is here.
        expected: String,
    },
}
