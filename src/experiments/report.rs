//! An outcome with the experiment that it belongs to: what is printed, shown and written to files.

use super::{Experiment, ExperimentOutcome};
use crate::files::{self, FileError, json};
use serde::Serialize;
use std::io;
use std::path::Path;

/// What a run of an experiment has found.
#[derive(Debug, Clone, Serialize)]
pub struct ExperimentReport {
    /// The number of the figure or table.
    pub id: &'static str,
    /// What it is about.
    pub title: &'static str,
    /// What it shows, in one sentence.
    pub claim: &'static str,
    /// How long it took, in milliseconds.
    pub ms: f64,
    /// How long its parts took, where that was measured.
    pub parts: Vec<PhaseTiming>,
    /// Whether all claims hold.
    pub holds: bool,
    /// What it found.
    #[serde(flatten)]
    pub outcome: ExperimentOutcome,
    /// The files that it was written to.
    pub files: Vec<String>,
}

/// A part of an experiment and how long it took.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PhaseTiming {
    /// What it did.
    pub doing: String,
    /// How long, in milliseconds.
    pub ms: f64,
    /// The time of all threads together, where the system tells it.
    pub processor_ms: Option<f64>,
}

impl ExperimentReport {
    /// The report of an experiment that took so long.
    pub fn new(study: &Experiment, outcome: ExperimentOutcome, ms: f64) -> Self {
        let Experiment { id, title, claim, .. } = *study;
        let holds = outcome.failed().next().is_none();
        Self { id, title, claim, ms, parts: Vec::new(), holds, outcome, files: Vec::new() }
    }

    /// Writes everything into a folder: tables as CSV, pictures as PNG, lenses in our own form, all
    /// numbers as JSON.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&mut self, folder: &Path) -> Result<(), FileError> {
        let id = self.id;
        self.files.clear();
        for table in &self.outcome.tables {
            let name = format!("{id}-{}.csv", table.name);
            files::write_atomic(&folder.join(&name), table.csv().as_bytes())?;
            self.files.push(name);
        }
        for picture in &self.outcome.pictures {
            let name = format!("{id}-{}.png", picture.name);
            let file = folder.join(&name);
            let png = picture.canvas.png().map_err(|error| FileError::Unwritable {
                file: file.display().to_string(),
                source: io::Error::other(error),
            })?;
            files::write_atomic(&file, &png)?;
            self.files.push(name);
        }
        for (name, lens) in &self.outcome.lenses {
            let name = format!("{id}-{name}.json");
            files::save(lens, folder.join(&name))?;
            self.files.push(name);
        }
        let name = format!("{id}.json");
        self.files.push(name.clone());
        files::write_atomic(&folder.join(name), json::pretty(self).as_bytes())
    }
}
