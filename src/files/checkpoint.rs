//! Checkpoints: JSON files with a version number. A checkpoint is read back before it replaces an
//! older one, so that a file on the disk can always be resumed.

use super::{FileError, write_atomic};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// A format of checkpoint files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CheckpointFormat {
    /// The key of the version number.
    pub key: &'static str,
    /// The version that is written; all versions from 1 to this one can be read.
    pub version: u32,
}

/// The reasons that a checkpoint cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file cannot be written or read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The content would not read back unchanged; nothing was written.
    #[error("{file}: not saved, since it would not read back as it is: {what}")]
    RoundTripFailed {
        /// The file.
        file: String,
        /// The difference.
        what: String,
    },
    /// The file is not a checkpoint, or is damaged.
    #[error("{file}: not a valid checkpoint: {what}")]
    Corrupt {
        /// The file.
        file: String,
        /// The problem and its position.
        what: String,
    },
    /// The checkpoint has a version that this program cannot read.
    #[error("{file}: a checkpoint of version {found}; expected version {expected} or less")]
    UnsupportedVersion {
        /// The file.
        file: String,
        /// Its version.
        found: u64,
        /// The newest version that can be read.
        expected: u32,
    },
}

impl CheckpointFormat {
    /// Writes a checkpoint if it reads back as something that `is_same` accepts; on failure an
    /// existing file is left untouched. The content itself holds the version number.
    ///
    /// # Errors
    /// The file cannot be written, or the content would not read back unchanged.
    pub fn write<R: DeserializeOwned>(
        self,
        path: &Path,
        content: &impl Serialize,
        is_same: impl FnOnce(&R) -> bool,
    ) -> Result<(), CheckpointError> {
        let failed = |what: String| {
            let file = path.display().to_string();
            CheckpointError::RoundTripFailed { file, what }
        };
        let bytes = serde_json::to_vec(content).map_err(|error| failed(error.to_string()))?;
        let read = serde_json::from_slice(&bytes).map_err(|error| failed(error.to_string()))?;
        if !is_same(&read) {
            return Err(failed("it reads back as something else".to_owned()));
        }
        Ok(write_atomic(path, &bytes)?)
    }

    /// Reads the content of a checkpoint.
    ///
    /// # Errors
    /// The file cannot be read, is not such a checkpoint, or has an unknown version.
    pub fn read<R: DeserializeOwned>(self, path: &Path) -> Result<R, CheckpointError> {
        let file = path.display().to_string();
        let unreadable = |source| FileError::Unreadable { file: file.clone(), source };
        let bytes = fs::read(path).map_err(unreadable)?;
        let corrupt = |what: String| CheckpointError::Corrupt { file: file.clone(), what };
        let all: Value = serde_json::from_slice(&bytes).map_err(|e| corrupt(e.to_string()))?;
        let version = all.get(self.key).and_then(Value::as_u64);
        let found = version.ok_or_else(|| corrupt(format!("no version number `{}`", self.key)))?;
        if !(1..=u64::from(self.version)).contains(&found) {
            let expected = self.version;
            return Err(CheckpointError::UnsupportedVersion { file, found, expected });
        }
        serde_json::from_slice(&bytes).map_err(|error| corrupt(error.to_string()))
    }
}
