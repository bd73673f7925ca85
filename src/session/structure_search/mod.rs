//! The search over lens structures of a session: its run, its files, and the lens that is previewed.

mod engine;
mod finalize;
mod history;
mod request;
mod snapshot;

pub(super) use engine::StructureSearchReport;
pub use history::{DescentMark, HistorySample, SearchHistory};
pub use request::StructureSearchRequest;
pub use snapshot::{CheckpointStatus, EndReason, FoundLens, StructureSearchSnapshot};

use super::run::{BackgroundRun, RunEvent, RunId, RunStatus, RunView};
use super::saved_runs::newest_file;
use crate::lens::Lens;
use crate::search::SteerCommand;
use engine::{EngineRequest, StructureSearchEngine, StructureSearchInput};
use serde::{Deserialize, Serialize};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The extension of search files.
const EXTENSION: &str = "search.json";
/// The name of the file of the search that was dismissed last.
const DISMISSED: &str = "forgotten.json";
/// The maximum number of characters of a lens name in a file name.
const MAX_STEM: usize = 32;
/// The maximum number of search files for one lens name.
const MAX_FILES: usize = 10_000;

/// The search over lens structures as panels see it.
#[derive(Debug, Clone, Default)]
pub struct StructureSearchView {
    /// The latest search.
    pub run: RunView<StructureSearchSnapshot>,
    /// The index of the chain whose lens is shown in place of the design.
    pub previewed_chain: Option<usize>,
    /// The generations whose lenses are being exported.
    pub exporting: Vec<u64>,
    /// The file that was chosen for the next search.
    pub save_path: Option<PathBuf>,
    /// The file of a search that was unfinished when the program was closed.
    pub unfinished: Option<PathBuf>,
}

/// The search over lens structures of a session.
#[derive(Debug)]
pub(super) struct StructureSearchState {
    run: BackgroundRun<StructureSearchEngine>,
    exporting: Vec<u64>,
    /// The lens that was chosen last, with its generation.
    chosen: Option<(u64, Arc<Lens>)>,
    previewed_chain: Option<usize>,
    /// The folder of searches without a chosen file.
    folder: Option<PathBuf>,
    save_path: Option<PathBuf>,
    unfinished: Option<PathBuf>,
}

impl StructureSearchState {
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        Ok(Self {
            run: BackgroundRun::spawn(wake, StructureSearchEngine::start)?,
            exporting: Vec::new(),
            chosen: None,
            previewed_chain: None,
            folder: None,
            save_path: None,
            unfinished: None,
        })
    }

    /// Saves searches in a folder from now on, and looks for an unfinished one in it.
    pub(super) fn set_save_folder(&mut self, folder: PathBuf) {
        self.unfinished = newest_file(&folder, EXTENSION);
        self.folder = Some(folder);
    }

    /// Carries out a command, or returns the reason why that is impossible.
    pub(super) fn handle(
        &mut self,
        command: StructureSearchCommand,
        lens: &Arc<Lens>,
    ) -> Result<(), String> {
        match command {
            StructureSearchCommand::Start(request) => {
                let chosen = self.save_path.take();
                let path = chosen.or_else(|| unused_path(self.folder.as_ref()?, &lens.name));
                self.start(StructureSearchInput::New { lens: Arc::clone(lens), request, path });
            }
            StructureSearchCommand::StartShown(request) => {
                self.previewed_chain = Some(0);
                return self.handle(StructureSearchCommand::Start(request), lens);
            }
            StructureSearchCommand::ResumeFrom(path) => {
                self.start(StructureSearchInput::Saved(restore_dismissed(path)?));
            }
            StructureSearchCommand::Follow(path) => {
                self.start(StructureSearchInput::Followed(path));
            }
            StructureSearchCommand::Pause => self.run.pause(),
            StructureSearchCommand::Resume => self.run.resume(),
            StructureSearchCommand::Stop => self.run.stop(),
            StructureSearchCommand::Control(command) => {
                self.run.send_request(EngineRequest::Control(command));
            }
            StructureSearchCommand::Preview(chain) => self.previewed_chain = chain,
            StructureSearchCommand::SaveTo(path) => {
                if self.run.status().is_active() {
                    self.run.send_request(EngineRequest::SaveTo(path));
                } else {
                    self.save_path = Some(path);
                }
            }
            StructureSearchCommand::Export { number, path } => {
                let lens = self.lens_by_number(number)?;
                self.run.send_request(EngineRequest::Export { number, lens, path });
                self.exporting.push(number);
            }
            StructureSearchCommand::Clear => {
                self.run.clear();
                self.chosen = None;
                self.previewed_chain = None;
            }
            StructureSearchCommand::DismissUnfinished => self.dismiss_unfinished()?,
            StructureSearchCommand::Choose { number, lens } => {
                self.chosen = Some((number, Arc::new(*lens)));
            }
            // The session itself changes the design.
            StructureSearchCommand::Accept(_) => {}
        }
        Ok(())
    }

    /// Forgets why a search could not start: another design is open.
    pub(super) fn forget_failed_start(&mut self) {
        if self.run.status() == RunStatus::Failed && self.run.snapshot().is_none() {
            self.run.clear();
            self.previewed_chain = None;
        }
    }

    fn start(&mut self, input: StructureSearchInput) {
        self.unfinished = None;
        self.chosen = None;
        self.run.start(input);
    }

    /// Renames the file of the unfinished search; it replaces the one that was dismissed before.
    fn dismiss_unfinished(&mut self) -> Result<(), String> {
        let Some(file) = self.unfinished.take() else { return Ok(()) };
        let dismissed = file.with_file_name(DISMISSED);
        fs::rename(&file, dismissed).map_err(|why| format!("{}: {why}", file.display()))
    }

    /// The lens of a generation: the one that was chosen, or else the one that is stored.
    pub(super) fn lens_by_number(&self, number: u64) -> Result<Arc<Lens>, String> {
        if let Some((_, lens)) = self.chosen.as_ref().filter(|(chosen, _)| *chosen == number) {
            return Ok(Arc::clone(lens));
        }
        let search = self.run.snapshot();
        let search = search.ok_or_else(|| "there is no search over structure".to_owned())?;
        let lens = search.lens_by_number(number).cloned();
        lens.ok_or_else(|| format!("generation {number} of the search is not stored any more"))
    }

    /// The lens that is shown in place of the design, with its search.
    pub(super) fn previewed(&self) -> Option<(RunId, Arc<Lens>)> {
        let view = self.run.view();
        let search = view.snapshot.as_ref().filter(|_| view.is_active())?;
        let lens = search.chains.get(self.previewed_chain?)?.as_ref()?;
        Some((view.id?, Arc::clone(lens)))
    }

    /// The search with a chain that is shown in place of the design; between two descents the chain
    /// has no lens.
    pub(super) fn previewed_run(&self) -> Option<RunId> {
        let view = self.run.view();
        view.id.filter(|_| self.previewed_chain.is_some() && view.is_active())
    }

    /// Shows the design again.
    pub(super) fn end_preview(&mut self) {
        self.previewed_chain = None;
    }

    /// True if there is a search whose lenses the design can be compared with.
    pub(super) fn is_shown(&self) -> bool {
        self.run.view().id.is_some()
    }

    /// The events of the search since the last call.
    pub(super) fn drain_events(&mut self) -> Vec<RunEvent<StructureSearchReport>> {
        let events = self.run.drain_events();
        for event in &events {
            if let RunEvent::Report(
                StructureSearchReport::Exported { number, .. }
                | StructureSearchReport::NotExported { number, .. },
            ) = event
            {
                self.exporting.retain(|exporting| exporting != number);
            }
        }
        events
    }

    pub(super) fn view(&self) -> StructureSearchView {
        StructureSearchView {
            run: self.run.view(),
            previewed_chain: self.previewed_chain,
            exporting: self.exporting.clone(),
            save_path: self.save_path.clone(),
            unfinished: self.unfinished.clone(),
        }
    }
}

/// The file in which a search is resumed: a dismissed one gets a file of its own again.
fn restore_dismissed(path: PathBuf) -> Result<PathBuf, String> {
    if path.file_name().is_none_or(|name| name != DISMISSED) {
        return Ok(path);
    }
    let own = path.parent().and_then(|folder| unused_path(folder, "resumed"));
    let own = own.ok_or_else(|| format!("{}: there is no free name beside it", path.display()))?;
    fs::rename(&path, &own).map_err(|why| format!("{}: {why}", path.display()))?;
    Ok(own)
}

/// A file that does not exist yet, for a search from a lens of this name.
fn unused_path(folder: &Path, name: &str) -> Option<PathBuf> {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { ' ' };
    let words: String = name.chars().map(plain).collect();
    let words: Vec<&str> = words.split_whitespace().collect();
    let stem: String = words.join("_").chars().take(MAX_STEM).collect();
    let stem = if stem.is_empty() { "lens".to_owned() } else { stem };
    let path = |number: usize| folder.join(format!("{stem}_{number}.{EXTENSION}"));
    (1..=MAX_FILES).map(path).find(|path| !path.exists())
}

/// A command for the search over lens structures, which works on a copy of the design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StructureSearchCommand {
    /// Starts a search from the design, in place of the one before.
    Start(Box<StructureSearchRequest>),
    /// Starts it and shows the lens of its first chain as it changes: what a person wants to see first.
    StartShown(Box<StructureSearchRequest>),
    /// Resumes the search of a file.
    ResumeFrom(PathBuf),
    /// Shows the search that another process saves in a file, as it goes on.
    Follow(PathBuf),
    /// Pauses the search after its current round.
    Pause,
    /// Resumes the search.
    Resume,
    /// Stops the search; its lenses remain.
    Stop,
    /// Changes the search between two rounds: its pinned lens, mutations or temperature.
    Control(SteerCommand),
    /// Shows the lens of the chain with this index in place of the design; `None` shows the design.
    Preview(Option<usize>),
    /// Saves the search to this file from now on, or the next search if none is active.
    SaveTo(PathBuf),
    /// Chooses a lens to accept or export. While its generation still descends, its number alone
    /// does not tell which of its lenses is meant.
    Choose {
        /// The generation.
        number: u64,
        /// The lens.
        lens: Box<Lens>,
    },
    /// Makes the lens of a generation the design, as one undo step: the chosen one if its number is
    /// the same.
    Accept(u64),
    /// Finalizes and writes the lens of a generation: the chosen one if its number is the same.
    Export {
        /// The generation.
        number: u64,
        /// The file.
        path: PathBuf,
    },
    /// Ends the search and dismisses its lenses; its file remains.
    Clear,
    /// Dismisses the search that was unfinished when the program was closed.
    DismissUnfinished,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_search_has_a_file_of_its_own_and_the_newest_is_found_again() -> io::Result<()> {
        let folder = std::env::temp_dir().join(format!("aplanat-kept-{}", std::process::id()));
        fs::create_dir_all(&folder)?;
        assert_eq!(newest_file(&folder, EXTENSION), None);
        let first = unused_path(&folder, "Nikkor-S 50/1.4 (1962)").unwrap_or_default();
        assert_eq!(first, folder.join("Nikkor-S_50_1.4_1962_1.search.json"));
        fs::write(&first, "")?;
        let second = unused_path(&folder, "Nikkor-S 50/1.4 (1962)").unwrap_or_default();
        assert_eq!(second, folder.join("Nikkor-S_50_1.4_1962_2.search.json"));
        fs::write(folder.join("other.json"), "")?;
        assert_eq!(newest_file(&folder, EXTENSION), Some(first));
        assert_eq!(unused_path(&folder, " / "), Some(folder.join("lens_1.search.json")));
        fs::remove_dir_all(&folder)
    }
}
