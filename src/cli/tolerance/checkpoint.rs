//! The file in which real lenses are saved while more of them are traced.

use crate::cli::error::CliError;
use crate::files::{CheckpointError, CheckpointFormat, json};
use crate::lens::Lens;
use crate::tolerance::{KnownLens, RealLens};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The format of these files.
const FORMAT: CheckpointFormat =
    CheckpointFormat { key: "aplanat_tolerance", version: 1, first_with_checksum: 1 };

/// The data on which real lenses depend.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct RandomLensSource {
    /// The lens with its tolerances and compensators, as its file has it.
    lens: String,
    zoom: usize,
    /// The tolerance of spots, on which the rays depend.
    error: f64,
    seed: u64,
    /// True if the pupils of the lens as designed are held.
    #[serde(default)]
    hold_pupils: bool,
}

#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct SavedLenses {
    aplanat_tolerance: u32,
    source: RandomLensSource,
    lenses: Vec<KnownLens>,
}

impl RandomLensSource {
    pub(super) fn new(lens: &Lens, zoom: usize, error: f64, seed: u64) -> Self {
        Self { lens: json::write(lens), zoom, error, seed, hold_pupils: false }
    }

    /// The same with the pupils of the lens as designed, if they are held.
    pub(super) fn with_held_pupils(self, hold_pupils: bool) -> Self {
        Self { hold_pupils, ..self }
    }

    /// The lenses of a file, none if there is no file yet.
    pub(super) fn known(&self, path: &Path) -> Result<Vec<KnownLens>, CliError> {
        if !path.exists() {
            return Ok(Vec::new());
        }
        let fail = |why: CheckpointError| CliError::Input(why.to_string());
        let saved: SavedLenses = FORMAT.read(path).map_err(fail)?;
        let other = if saved.source.lens != self.lens {
            "another lens or other tolerances"
        } else if saved.source.seed != self.seed {
            "another --seed"
        } else if saved.source != *self {
            "another --zoom, --error or --hold-pupils"
        } else {
            return Ok(saved.lenses);
        };
        let file = path.display();
        let text = format!("{file}: found random lenses of {other}; expected another file");
        Err(CliError::Input(text))
    }

    /// Saves lenses.
    pub(super) fn save(&self, path: &Path, lenses: &[RealLens]) -> Result<(), CheckpointError> {
        let content = SavedLenses {
            aplanat_tolerance: FORMAT.version,
            source: self.clone(),
            lenses: lenses.iter().map(KnownLens::from).collect(),
        };
        FORMAT.write(path, &content, |read: &SavedLenses| *read == content)
    }
}
