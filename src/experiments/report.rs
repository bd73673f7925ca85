//! The report of an experiment: its outcome with its title and times, to be printed, shown and
//! written to files.

use super::{Experiment, ExperimentOutcome};
use crate::files::{self, FileError, json};
use serde::Serialize;
use std::io;
use std::path::{Path, PathBuf};

/// The report of a run of an experiment.
#[derive(Debug, Clone, Serialize)]
pub struct ExperimentReport {
    /// The number of the figure or table.
    pub id: &'static str,
    /// The title.
    pub title: &'static str,
    /// The claim, in one sentence.
    pub claim: &'static str,
    /// The parts of the figure that the study leaves out.
    pub omits: &'static str,
    /// The time of the run, in milliseconds.
    pub ms: f64,
    /// The times of its phases, if they were measured.
    pub parts: Vec<PhaseTiming>,
    /// True if all claims hold.
    pub holds: bool,
    /// The outcome.
    #[serde(flatten)]
    pub outcome: ExperimentOutcome,
    /// The files written.
    pub files: Vec<String>,
}

/// The time of a phase of an experiment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PhaseTiming {
    /// The name of the phase.
    pub doing: String,
    /// The elapsed time, in milliseconds.
    pub ms: f64,
    /// The processor time of all threads together in milliseconds, if the system reports it.
    pub processor_ms: Option<f64>,
}

impl ExperimentReport {
    /// The report of an experiment that took `ms` milliseconds.
    pub fn new(study: &Experiment, outcome: ExperimentOutcome, ms: f64) -> Self {
        let Experiment { id, title, claim, omits, .. } = *study;
        let holds = outcome.failed().next().is_none();
        Self { id, title, claim, omits, ms, parts: Vec::new(), holds, outcome, files: Vec::new() }
    }

    /// The files of an earlier report of this experiment that remain in a folder into which this one
    /// was written.
    pub fn stale_files(&self, folder: &Path) -> Vec<PathBuf> {
        let written: Vec<PathBuf> = self.files.iter().map(|name| folder.join(name)).collect();
        let prefix = format!("{}-", self.id);
        files::stale_files(folder, &written, |name| name.starts_with(&prefix))
    }

    /// Writes the report into a folder: tables as CSV, plots as PNG, lenses as lens files, all
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
