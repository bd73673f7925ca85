//! What a session keeps of its searches over structure: the one that goes on, where it is saved,
//! what was left from before, and where the design stands beside it.

use super::command::StructureSearchCommand;
use super::course::Course;
use super::exploration::StructureSearchSnapshot;
use super::explorer::{Explorer, Told};
use super::judged::ScoredLens;
use super::worker::RunStatus;
use crate::lens::Lens;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How a file of a search ends.
const EXTENSION: &str = "search.json";
/// The search that was forgotten last: `Open…` brings it back.
const DISMISSED: &str = "forgotten.json";
/// How many letters of the name of a lens the name of its file has.
const MAX_STEM: usize = 32;
/// So many searches from lenses of one name are saved, and no more.
const MAX_FILES: usize = 10_000;

/// What is known about searches over structure.
#[derive(Debug, Clone, Default)]
pub struct StructureSearchView {
    /// The search in the background, or the last one.
    pub run: Option<Arc<StructureSearchSnapshot>>,
    /// Whether one was asked for that has not begun yet.
    pub starting: bool,
    /// How it will stand once its round is done, where it was told so.
    pub pending: Option<RunStatus>,
    /// The chain, counted from 0, whose lens is shown in place of the design.
    pub previewed_chain: Option<usize>,
    /// The design beside what was found; maybe as it was a moment ago.
    pub current_design: Option<Arc<ScoredLens>>,
    /// Why the last search could not begin or go on.
    pub error: Option<String>,
    /// Generations whose lenses are being finished.
    pub exporting: Vec<u64>,
    /// Where the next search will be saved, where a person has chosen.
    pub save_path: Option<PathBuf>,
    /// A search that was left when the program was closed.
    pub unfinished: Option<PathBuf>,
}

/// What a session keeps of them.
#[derive(Debug)]
pub(super) struct StructureSearchState {
    explorer: Explorer,
    course: Course,
    exporting: Vec<u64>,
    previewed_chain: Option<usize>,
    /// Where searches are saved that have no place of their own.
    folder: Option<PathBuf>,
    save_path: Option<PathBuf>,
    unfinished: Option<PathBuf>,
    /// The design that was judged last.
    asked: Option<Arc<Lens>>,
}

impl StructureSearchState {
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        Ok(Self {
            explorer: Explorer::spawn(wake)?,
            course: Course::default(),
            exporting: Vec::new(),
            previewed_chain: None,
            folder: None,
            save_path: None,
            unfinished: None,
            asked: None,
        })
    }

    /// Saves searches in a folder from now on, and looks for one that was left there.
    pub(super) fn set_save_folder(&mut self, folder: PathBuf) {
        self.unfinished = newest_search(&folder);
        self.folder = Some(folder);
    }

    /// Does what a person asks for; why that cannot be done.
    pub(super) fn handle(
        &mut self,
        wish: StructureSearchCommand,
        lens: &Arc<Lens>,
    ) -> Result<(), String> {
        match wish {
            StructureSearchCommand::Start(quest) => {
                let path = self
                    .save_path
                    .take()
                    .or_else(|| unused_path(self.folder.as_ref()?, &lens.name));
                let number = self.next();
                self.explorer.start(number, Arc::clone(lens), quest, path);
            }
            StructureSearchCommand::ResumeFrom(Some(path)) => {
                let path = restore_dismissed(path)?;
                let number = self.next();
                self.explorer.go_on(number, path);
            }
            StructureSearchCommand::Pause => self.stand(RunStatus::Paused),
            StructureSearchCommand::Resume => self.stand(RunStatus::Running),
            StructureSearchCommand::Stop => self.stand(RunStatus::Stopped),
            StructureSearchCommand::Control(steer) => self.explorer.steer(steer),
            StructureSearchCommand::Preview(chain) => self.previewed_chain = chain,
            StructureSearchCommand::SaveTo(Some(path)) => {
                match self.run().filter(|run| run.is_active()) {
                    Some(_) => self.explorer.save_to(path),
                    None => self.save_path = Some(path),
                }
            }
            StructureSearchCommand::Export { number, path: Some(path) } => {
                self.explorer.export(number, self.lens_by_number(number)?, path);
                self.exporting.push(number);
            }
            StructureSearchCommand::Clear => self.clear(),
            StructureSearchCommand::DismissUnfinished => self.dismiss_unfinished()?,
            StructureSearchCommand::ResumeFrom(None)
            | StructureSearchCommand::SaveTo(None)
            | StructureSearchCommand::Export { path: None, .. } => {
                return Err("no file was named".to_owned());
            }
            // The session itself changes the design.
            StructureSearchCommand::Accept(_) => {}
        }
        Ok(())
    }

    fn next(&mut self) -> u64 {
        self.unfinished = None;
        self.course.begin()
    }

    /// Lets the search stand otherwise once its round is done; one that has ended stays so.
    fn stand(&mut self, standing: RunStatus) {
        let ended = self.run().is_some_and(|run| !run.is_active());
        if self.course.turn(standing, ended) {
            self.explorer.stand(standing);
        }
    }

    fn clear(&mut self) {
        self.explorer.clear();
        self.course.forget();
        self.previewed_chain = None;
        self.asked = None;
    }

    /// Puts the file of the search that was left aside, in place of the one that was forgotten before.
    fn dismiss_unfinished(&mut self) -> Result<(), String> {
        let Some(left) = self.unfinished.take() else { return Ok(()) };
        let aside = left.with_file_name(DISMISSED);
        fs::rename(&left, aside).map_err(|why| format!("{}: {why}", left.display()))
    }

    /// The lens of a generation.
    pub(super) fn lens_by_number(&self, number: u64) -> Result<Arc<Lens>, String> {
        let run = self.run().ok_or_else(|| "there is no search over structure".to_owned())?;
        let lens = run.lens_by_number(number).cloned();
        lens.ok_or_else(|| format!("generation {number} of the search is not remembered"))
    }

    /// The lens that is shown in place of the design, with the number of its search.
    pub(super) fn previewed(&self) -> Option<(u64, Arc<Lens>)> {
        let run = self.run().filter(|run| run.is_active())?;
        let place = run.chains.get(self.previewed_chain?)?.as_ref()?;
        Some((run.number, Arc::clone(&place.lens)))
    }

    /// Shows the design again.
    pub(super) fn end_preview(&mut self) {
        self.previewed_chain = None;
    }

    /// What happened since the last look to the search that is shown.
    pub(super) fn drain_events(&mut self) -> Vec<Told> {
        let mut told = self.explorer.told();
        told.retain(|told| match told {
            Told::Now(number, _) | Told::Failed(number, _) => self.course.is(*number),
            Told::Refused(_) | Told::Written(..) | Told::NotWritten(..) | Told::NotSaved(_) => true,
        });
        for told in &told {
            match told {
                Told::Failed(_, why) => self.course.fails(why),
                Told::Now(_, now) => self.course.stands(*now),
                Told::Written(number, ..) | Told::NotWritten(number, _) => {
                    self.exporting.retain(|exporting| exporting != number);
                }
                _ => {}
            }
        }
        told
    }

    /// Has the design judged, once for each, as long as there is something to compare it with.
    pub(super) fn sync(&mut self, lens: &Arc<Lens>) {
        let known = self.asked.as_ref().is_some_and(|asked| Arc::ptr_eq(asked, lens));
        if self.course.is_there() && !known {
            self.asked = Some(Arc::clone(lens));
            self.explorer.judge(Arc::clone(lens));
        }
    }

    pub(super) fn view(&self) -> StructureSearchView {
        let run = self.run();
        StructureSearchView {
            starting: self.course.is_starting(run.is_some()),
            run,
            pending: self.course.pending(),
            previewed_chain: self.previewed_chain,
            current_design: self.explorer.judged().filter(|_| self.asked.is_some()),
            error: self.course.failed(),
            exporting: self.exporting.clone(),
            save_path: self.save_path.clone(),
            unfinished: self.unfinished.clone(),
        }
    }

    fn run(&self) -> Option<Arc<StructureSearchSnapshot>> {
        self.explorer.run().filter(|run| self.course.is(run.number))
    }
}

/// The file of a search in a folder that was written last.
fn newest_search(folder: &Path) -> Option<PathBuf> {
    let files = fs::read_dir(folder).ok()?.flatten();
    let searches = files.filter(|file| file.file_name().to_string_lossy().ends_with(EXTENSION));
    let dated = searches.filter_map(|file| Some((file.metadata().ok()?.modified().ok()?, file)));
    dated.max_by_key(|(date, _)| *date).map(|(_, file)| file.path())
}

/// Where a search goes on: one that was forgotten has a file of its own again.
fn restore_dismissed(path: PathBuf) -> Result<PathBuf, String> {
    if path.file_name().is_none_or(|name| name != DISMISSED) {
        return Ok(path);
    }
    let own = path.parent().and_then(|folder| unused_path(folder, "remembered"));
    let own = own.ok_or_else(|| format!("{}: no room beside it", path.display()))?;
    fs::rename(&path, &own).map_err(|why| format!("{}: {why}", path.display()))?;
    Ok(own)
}

/// A file for the search from a lens of this name that does not exist yet.
fn unused_path(folder: &Path, name: &str) -> Option<PathBuf> {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { ' ' };
    let words: String = name.chars().map(plain).collect();
    let words: Vec<&str> = words.split_whitespace().collect();
    let stem: String = words.join("_").chars().take(MAX_STEM).collect();
    let stem = if stem.is_empty() { "lens".to_owned() } else { stem };
    let path = |number: usize| folder.join(format!("{stem}_{number}.{EXTENSION}"));
    (1..=MAX_FILES).map(path).find(|path| !path.exists())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_search_has_a_file_of_its_own_and_the_newest_is_found_again() -> io::Result<()> {
        let folder = std::env::temp_dir().join(format!("aplanat-kept-{}", std::process::id()));
        fs::create_dir_all(&folder)?;
        assert_eq!(newest_search(&folder), None);
        let first = unused_path(&folder, "Nikkor-S 50/1.4 (1962)").unwrap_or_default();
        assert_eq!(first, folder.join("Nikkor-S_50_1.4_1962_1.search.json"));
        fs::write(&first, "")?;
        let second = unused_path(&folder, "Nikkor-S 50/1.4 (1962)").unwrap_or_default();
        assert_eq!(second, folder.join("Nikkor-S_50_1.4_1962_2.search.json"));
        fs::write(folder.join("other.json"), "")?;
        assert_eq!(newest_search(&folder), Some(first));
        assert_eq!(unused_path(&folder, " / "), Some(folder.join("lens_1.search.json")));
        fs::remove_dir_all(&folder)
    }
}
