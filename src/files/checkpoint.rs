//! Checkpoints: JSON files with a version number and a checksum. A checkpoint is read back before it
//! replaces an older one, so that a file on the disk can always be resumed.

use super::{FileError, MAX_DATA_BYTES, read_file, write_atomic};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::Path;

/// The text between the content and its checksum, which is the last key of the file: eight digits of
/// the CRC-32 of the content without that key.
const CHECKSUM_KEY: &str = ",\"checksum\":\"";
/// The text after the checksum.
const CHECKSUM_END: &str = "\"}";

/// A format of checkpoint files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CheckpointFormat {
    /// The key of the version number.
    pub key: &'static str,
    /// The version that is written; all versions from 1 to this one can be read.
    pub version: u32,
    /// The first version with a checksum.
    pub first_with_checksum: u32,
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
        Ok(write_atomic(path, &add_checksum(bytes))?)
    }

    /// Reads the content of a checkpoint.
    ///
    /// # Errors
    /// The file cannot be read, is not such a checkpoint, or has an unknown version.
    pub fn read<R: DeserializeOwned>(self, path: &Path) -> Result<R, CheckpointError> {
        let file = path.display().to_string();
        let bytes = read_file(path, MAX_DATA_BYTES)?;
        let corrupt = |what: String| CheckpointError::Corrupt { file: file.clone(), what };
        let all: Value = serde_json::from_slice(&bytes).map_err(|e| corrupt(e.to_string()))?;
        let version = all.get(self.key).and_then(Value::as_u64);
        let found = version.ok_or_else(|| corrupt(format!("no version number `{}`", self.key)))?;
        if !(1..=u64::from(self.version)).contains(&found) {
            let expected = self.version;
            return Err(CheckpointError::UnsupportedVersion { file, found, expected });
        }
        let content = match split_checksum(&bytes) {
            Some((content, checksum)) if crc_text(&content) == checksum => content,
            Some(_) => return Err(corrupt("its checksum does not belong to its content".into())),
            None if found >= u64::from(self.first_with_checksum) => {
                return Err(corrupt("it does not end with a checksum".into()));
            }
            None => bytes,
        };
        serde_json::from_slice(&content).map_err(|error| corrupt(error.to_string()))
    }
}

/// The text of an object with its checksum as the last key.
fn add_checksum(mut content: Vec<u8>) -> Vec<u8> {
    let checksum = crc_text(&content);
    content.pop();
    content.extend([CHECKSUM_KEY, &checksum, CHECKSUM_END].concat().into_bytes());
    content
}

/// The text of an object without its checksum, and the checksum; `None` if it has none.
fn split_checksum(bytes: &[u8]) -> Option<(Vec<u8>, &str)> {
    let bytes = bytes.trim_ascii_end().strip_suffix(CHECKSUM_END.as_bytes())?;
    let (content, checksum) = bytes.split_at_checked(bytes.len().checked_sub(8)?)?;
    let content = content.strip_suffix(CHECKSUM_KEY.as_bytes())?;
    Some(([content, b"}"].concat(), std::str::from_utf8(checksum).ok()?))
}

fn crc_text(bytes: &[u8]) -> String {
    format!("{:08x}", crc32fast::hash(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checksum_is_the_last_key_of_an_object() {
        let content = br#"{"version":3,"run":[1.5]}"#;
        let bytes = add_checksum(content.to_vec());
        let json: Value = serde_json::from_slice(&bytes).unwrap_or_default();
        assert_eq!(json["checksum"].as_str().map(str::len), Some(8));
        assert_eq!(json["run"][0], 1.5);
        let (read, checksum) = split_checksum(&bytes).unwrap_or_default();
        assert_eq!((read.as_slice(), crc_text(content).as_str()), (&content[..], checksum));
        assert_eq!(split_checksum(content), None);
        assert_eq!(split_checksum(b""), None);
    }
}
