//! Errors of starting, steering, saving and loading a search.

use crate::files::CheckpointError;

/// Errors of starting, steering, saving and loading a search.
#[derive(Debug, thiserror::Error)]
pub enum SearchError {
    /// A setting is invalid.
    #[error("setting {name}: found {found}; expected {expected}")]
    Setting {
        /// The name of the setting.
        name: &'static str,
        /// Its value.
        found: String,
        /// The valid values.
        expected: &'static str,
    },
    /// The start has no finite loss.
    #[error("the search cannot start: the loss of the start is {loss}; expected a finite number")]
    InvalidStart {
        /// Its loss.
        loss: f64,
    },
    /// A generation that does not exist or is no longer stored.
    #[error("generation {number} is not stored; there are {total} so far")]
    UnknownGeneration {
        /// The requested number.
        number: u64,
        /// The number of generations so far.
        total: u64,
    },
    /// A checkpoint cannot be written or read.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A checkpoint of a search from another start.
    #[error(
        "{file}: a checkpoint of another search, from another lens: {name} is {found} there and \
         {expected} here"
    )]
    OtherStart {
        /// The file.
        file: String,
        /// The path of the first field that differs.
        name: String,
        /// Its value in the file.
        found: String,
        /// Its value in this search.
        expected: String,
    },
    /// A checkpoint of another search.
    #[error("{file}: a checkpoint of another search: {name} is {found} there and {expected} here")]
    OtherSearch {
        /// The file.
        file: String,
        /// The path of the first field that differs.
        name: String,
        /// Its value in the file.
        found: String,
        /// Its value in this search.
        expected: String,
    },
}
