//! The file of a design between two rounds.

use super::SpecificationRequest;
use crate::files::{self, FileLock, json};
use crate::search::design::DesignRun;
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};

/// The longest file, in bytes.
const LONGEST: u64 = 1 << 26;

/// The contents of the file.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SavedDesign {
    pub(super) request: SpecificationRequest,
    /// The time of the rounds so far, in seconds.
    pub(super) seconds: f64,
    pub(super) run: DesignRun,
}

/// A file of a design that no other program writes meanwhile.
#[derive(Debug)]
pub(super) struct DesignFile {
    pub(super) path: PathBuf,
    _lock: FileLock,
}

impl DesignFile {
    /// The file of a new design.
    pub(super) fn new(path: PathBuf) -> Result<Self, String> {
        let folder = path.parent().map_or(Ok(()), fs::create_dir_all);
        folder.map_err(|why| format!("{}: {why}", path.display()))?;
        let lock = FileLock::acquire(&path).map_err(|why| why.to_string())?;
        Ok(Self { path, _lock: lock })
    }

    /// Reads a saved design.
    pub(super) fn open(path: PathBuf) -> Result<(Self, SavedDesign), String> {
        let file = Self::new(path)?;
        let saved = read(&file.path)?;
        Ok((file, saved))
    }

    pub(super) fn write(&self, saved: &SavedDesign) -> Result<(), String> {
        let text = json::pretty(saved);
        files::write_atomic(&self.path, text.as_bytes()).map_err(|why| why.to_string())
    }
}

fn read(path: &Path) -> Result<SavedDesign, String> {
    let name = path.display().to_string();
    let bytes = files::read_file(path, LONGEST).map_err(|why| why.to_string())?;
    let text = files::decode_unicode(&bytes, &name).map_err(|why| why.to_string())?;
    json::read_json(&text, &name).map_err(|why| why.to_string())
}
