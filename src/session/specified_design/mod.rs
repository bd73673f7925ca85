//! The design of a lens from a specification in the background: its rounds, the file that outlives a
//! killed program, and the lenses at the end.
//!
//! The open design takes no part in it: a lens that is found opens as another document.

mod engine;
mod saved;
mod snapshot;

pub(super) use engine::DesignNotSaved;
pub use snapshot::{OfferedLens, SpecifiedDesign};

use super::run::{BackgroundRun, RunEvent, RunView};
use super::saved_runs::newest_file;
use crate::lens::Lens;
use crate::search::design::{DesignSettings, LensSpecification};
use engine::{SpecificationEngine, SpecificationInput, SpecificationStart};
use serde::{Deserialize, Serialize};
use std::fs;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The end of the names of saved designs.
const ENDING: &str = ".design.json";

/// A specification with the settings of its design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpecificationRequest {
    /// The specification of the lens.
    pub specification: LensSpecification,
    /// The seed and the starts.
    pub settings: DesignSettings,
    /// The time for all rounds, in minutes; rims, limits and focus of the lenses come after it.
    pub minutes: f64,
}

/// The design from a specification as panels see it.
#[derive(Debug, Clone, Default)]
pub struct SpecifiedDesignView {
    /// The latest design.
    pub run: RunView<SpecifiedDesign>,
    /// The file of a design that can be resumed.
    pub unfinished: Option<PathBuf>,
}

/// A command for the design from a specification.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SpecifiedDesignCommand {
    /// Starts a design in place of the one before.
    Start(Box<SpecificationRequest>),
    /// Resumes the design that was stopped, or that was left when the program ended.
    ResumeUnfinished,
    /// Removes the file of that design.
    DismissUnfinished,
    /// Pauses the design after its current round.
    Pause,
    /// Resumes a paused design.
    Resume,
    /// Ends the current round and finishes the best lens so far; the rounds before can be resumed.
    Stop,
    /// Ends the design and dismisses its lenses and its file.
    Clear,
}

/// The design from a specification of a session.
#[derive(Debug)]
pub(super) struct SpecifiedDesignState {
    run: BackgroundRun<SpecificationEngine>,
    /// Ends the round of the run.
    stop: Arc<AtomicBool>,
    folder: Option<PathBuf>,
    unfinished: Option<PathBuf>,
}

impl SpecifiedDesignState {
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let run = BackgroundRun::spawn(wake, SpecificationEngine::start)?;
        Ok(Self { run, stop: Arc::default(), folder: None, unfinished: None })
    }

    /// Saves designs in a folder from now on, and looks for an unfinished one in it.
    pub(super) fn set_save_folder(&mut self, folder: PathBuf) {
        self.unfinished = newest_file(&folder, ENDING);
        self.folder = Some(folder);
    }

    /// Carries out a command, or returns the reason why that is impossible.
    pub(super) fn handle(&mut self, command: SpecifiedDesignCommand) -> Result<(), String> {
        match command {
            SpecifiedDesignCommand::Start(request) => {
                let file = format!("{}{ENDING}", std::process::id());
                let path = self.folder.as_ref().map(|folder| folder.join(file));
                self.start(SpecificationStart::New { request, path });
            }
            SpecifiedDesignCommand::ResumeUnfinished => {
                let path = self.unfinished.clone().ok_or("there is no design to resume")?;
                self.start(SpecificationStart::Saved(path));
            }
            SpecifiedDesignCommand::DismissUnfinished => self.remove_file()?,
            SpecifiedDesignCommand::Pause => self.run.pause(),
            SpecifiedDesignCommand::Resume => self.run.resume(),
            SpecifiedDesignCommand::Stop => {
                self.stop.store(true, Ordering::Relaxed);
                self.run.stop();
            }
            SpecifiedDesignCommand::Clear => {
                self.stop.store(true, Ordering::Relaxed);
                let file = self.run.snapshot().and_then(|design| design.resumable.clone());
                self.unfinished = file.or(self.unfinished.take());
                self.run.clear();
                self.remove_file()?;
            }
        }
        Ok(())
    }

    fn start(&mut self, start: SpecificationStart) {
        self.stop.store(true, Ordering::Relaxed);
        self.stop = Arc::default();
        self.unfinished = None;
        self.run.start(SpecificationInput { start, stop: Arc::clone(&self.stop) });
    }

    fn remove_file(&mut self) -> Result<(), String> {
        let Some(file) = self.unfinished.take() else { return Ok(()) };
        fs::remove_file(&file).map_err(|why| format!("{}: {why}", file.display()))
    }

    /// True if a lens is one of those at the end of the latest design, or its best one so far.
    pub(super) fn has_found(&self, lens: &Lens) -> bool {
        self.run.snapshot().is_some_and(|design| {
            let found = design.lenses.iter().map(|found| &found.lens);
            found.chain(&design.best_lens).any(|found| **found == *lens)
        })
    }

    /// The events of the design since the last call.
    pub(super) fn drain_events(&mut self) -> Vec<RunEvent<DesignNotSaved>> {
        let events = self.run.drain_events();
        let ended =
            |event: &RunEvent<_>| matches!(event, RunEvent::Status(status) if !status.is_active());
        if events.iter().any(ended) {
            self.unfinished = self.run.snapshot().and_then(|design| design.resumable.clone());
        }
        events
    }

    pub(super) fn view(&self) -> SpecifiedDesignView {
        SpecifiedDesignView { run: self.run.view(), unfinished: self.unfinished.clone() }
    }
}

/// The thread is waited for: its round ends early.
impl Drop for SpecifiedDesignState {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}
