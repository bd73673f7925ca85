//! What a session keeps of its searches over structure: the one that goes on, where it is saved,
//! what was left from before, and where the design stands beside it.

use super::command::Explore;
use super::course::Course;
use super::exploration::Exploration;
use super::explorer::{Explorer, Told};
use super::judged::Judged;
use super::worker::Standing;
use crate::lens::Lens;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How a file of a search ends.
const ENDING: &str = "search.json";
/// The search that was forgotten last: `Open…` brings it back.
const FORGOTTEN: &str = "forgotten.json";
/// How many letters of the name of a lens the name of its file has.
const LONGEST: usize = 32;
/// So many searches from lenses of one name are saved, and no more.
const MOST: usize = 10_000;

/// What is known about searches over structure.
#[derive(Debug, Clone, Default)]
pub struct Explorations {
    /// The search in the background, or the last one.
    pub run: Option<Arc<Exploration>>,
    /// Whether one was asked for that has not begun yet.
    pub starting: bool,
    /// How it will stand once its round is done, where it was told so.
    pub pending: Option<Standing>,
    /// The chain, counted from 0, whose lens is shown in place of the design.
    pub followed: Option<usize>,
    /// The design beside what was found; maybe as it was a moment ago.
    pub here: Option<Arc<Judged>>,
    /// Why the last search could not begin or go on.
    pub failed: Option<String>,
    /// Generations whose lenses are being finished.
    pub exporting: Vec<u64>,
    /// Where the next search will be saved, where a person has chosen.
    pub place: Option<PathBuf>,
    /// A search that was left when the program was closed.
    pub left: Option<PathBuf>,
}

/// What a session keeps of them.
#[derive(Debug)]
pub(super) struct ExplorationDesk {
    explorer: Explorer,
    course: Course,
    exporting: Vec<u64>,
    followed: Option<usize>,
    /// Where searches are saved that have no place of their own.
    folder: Option<PathBuf>,
    place: Option<PathBuf>,
    left: Option<PathBuf>,
    /// The design that was judged last.
    asked: Option<Arc<Lens>>,
}

impl ExplorationDesk {
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        Ok(Self {
            explorer: Explorer::spawn(wake)?,
            course: Course::default(),
            exporting: Vec::new(),
            followed: None,
            folder: None,
            place: None,
            left: None,
            asked: None,
        })
    }

    /// Saves searches in a folder from now on, and looks for one that was left there.
    pub(super) fn keep_in(&mut self, folder: PathBuf) {
        self.left = newest(&folder);
        self.folder = Some(folder);
    }

    /// Does what a person asks for; why that cannot be done.
    pub(super) fn obey(&mut self, wish: Explore, lens: &Arc<Lens>) -> Result<(), String> {
        match wish {
            Explore::Start(quest) => {
                let path = self.place.take().or_else(|| free(self.folder.as_ref()?, &lens.name));
                let number = self.next();
                self.explorer.start(number, Arc::clone(lens), quest, path);
            }
            Explore::GoOn(Some(path)) => {
                let path = remembered(path)?;
                let number = self.next();
                self.explorer.go_on(number, path);
            }
            Explore::Pause => self.stand(Standing::Paused),
            Explore::Resume => self.stand(Standing::Running),
            Explore::Stop => self.stand(Standing::Stopped),
            Explore::Steer(steer) => self.explorer.steer(steer),
            Explore::Follow(chain) => self.followed = chain,
            Explore::SaveTo(Some(path)) => match self.run().filter(|run| run.is_under_way()) {
                Some(_) => self.explorer.save_to(path),
                None => self.place = Some(path),
            },
            Explore::Export { number, path: Some(path) } => {
                self.explorer.export(number, self.lens_of(number)?, path);
                self.exporting.push(number);
            }
            Explore::Clear => self.clear(),
            Explore::ForgetLeft => self.forget_left()?,
            Explore::GoOn(None) | Explore::SaveTo(None) | Explore::Export { path: None, .. } => {
                return Err("no file was named".to_owned());
            }
            // The session itself changes the design.
            Explore::Take(_) => {}
        }
        Ok(())
    }

    fn next(&mut self) -> u64 {
        self.left = None;
        self.course.begin()
    }

    /// Lets the search stand otherwise once its round is done; one that has ended stays so.
    fn stand(&mut self, standing: Standing) {
        let ended = self.run().is_some_and(|run| !run.is_under_way());
        if self.course.turn(standing, ended) {
            self.explorer.stand(standing);
        }
    }

    fn clear(&mut self) {
        self.explorer.clear();
        self.course.forget();
        self.followed = None;
        self.asked = None;
    }

    /// Puts the file of the search that was left aside, in place of the one that was forgotten before.
    fn forget_left(&mut self) -> Result<(), String> {
        let Some(left) = self.left.take() else { return Ok(()) };
        let aside = left.with_file_name(FORGOTTEN);
        fs::rename(&left, aside).map_err(|why| format!("{}: {why}", left.display()))
    }

    /// The lens of a generation.
    pub(super) fn lens_of(&self, number: u64) -> Result<Arc<Lens>, String> {
        let run = self.run().ok_or_else(|| "there is no search over structure".to_owned())?;
        let lens = run.lens_of(number).cloned();
        lens.ok_or_else(|| format!("generation {number} of the search is not remembered"))
    }

    /// The lens that is shown in place of the design, with the number of its search.
    pub(super) fn shown(&self) -> Option<(u64, Arc<Lens>)> {
        let run = self.run().filter(|run| run.is_under_way())?;
        let place = run.chains.get(self.followed?)?.as_ref()?;
        Some((run.number, Arc::clone(&place.lens)))
    }

    /// Shows the design again.
    pub(super) fn stop_following(&mut self) {
        self.followed = None;
    }

    /// What happened since the last look to the search that is shown.
    pub(super) fn told(&mut self) -> Vec<Told> {
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
    pub(super) fn keep_up(&mut self, lens: &Arc<Lens>) {
        let known = self.asked.as_ref().is_some_and(|asked| Arc::ptr_eq(asked, lens));
        if self.course.is_there() && !known {
            self.asked = Some(Arc::clone(lens));
            self.explorer.judge(Arc::clone(lens));
        }
    }

    pub(super) fn view(&self) -> Explorations {
        let run = self.run();
        Explorations {
            starting: self.course.is_starting(run.is_some()),
            run,
            pending: self.course.pending(),
            followed: self.followed,
            here: self.explorer.judged().filter(|_| self.asked.is_some()),
            failed: self.course.failed(),
            exporting: self.exporting.clone(),
            place: self.place.clone(),
            left: self.left.clone(),
        }
    }

    fn run(&self) -> Option<Arc<Exploration>> {
        self.explorer.run().filter(|run| self.course.is(run.number))
    }
}

/// The file of a search in a folder that was written last.
fn newest(folder: &Path) -> Option<PathBuf> {
    let files = fs::read_dir(folder).ok()?.flatten();
    let searches = files.filter(|file| file.file_name().to_string_lossy().ends_with(ENDING));
    let dated = searches.filter_map(|file| Some((file.metadata().ok()?.modified().ok()?, file)));
    dated.max_by_key(|(date, _)| *date).map(|(_, file)| file.path())
}

/// Where a search goes on: one that was forgotten has a file of its own again.
fn remembered(path: PathBuf) -> Result<PathBuf, String> {
    if path.file_name().is_none_or(|name| name != FORGOTTEN) {
        return Ok(path);
    }
    let own = path.parent().and_then(|folder| free(folder, "remembered"));
    let own = own.ok_or_else(|| format!("{}: no room beside it", path.display()))?;
    fs::rename(&path, &own).map_err(|why| format!("{}: {why}", path.display()))?;
    Ok(own)
}

/// A file for the search from a lens of this name that does not exist yet.
fn free(folder: &Path, name: &str) -> Option<PathBuf> {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { ' ' };
    let words: String = name.chars().map(plain).collect();
    let words: Vec<&str> = words.split_whitespace().collect();
    let stem: String = words.join("_").chars().take(LONGEST).collect();
    let stem = if stem.is_empty() { "lens".to_owned() } else { stem };
    let path = |number: usize| folder.join(format!("{stem}_{number}.{ENDING}"));
    (1..=MOST).map(path).find(|path| !path.exists())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_search_has_a_file_of_its_own_and_the_newest_is_found_again() -> io::Result<()> {
        let folder = std::env::temp_dir().join(format!("aplanat-kept-{}", std::process::id()));
        fs::create_dir_all(&folder)?;
        assert_eq!(newest(&folder), None);
        let first = free(&folder, "Nikkor-S 50/1.4 (1962)").unwrap_or_default();
        assert_eq!(first, folder.join("Nikkor-S_50_1.4_1962_1.search.json"));
        fs::write(&first, "")?;
        let second = free(&folder, "Nikkor-S 50/1.4 (1962)").unwrap_or_default();
        assert_eq!(second, folder.join("Nikkor-S_50_1.4_1962_2.search.json"));
        fs::write(folder.join("other.json"), "")?;
        assert_eq!(newest(&folder), Some(first));
        assert_eq!(free(&folder, " / "), Some(folder.join("lens_1.search.json")));
        fs::remove_dir_all(&folder)
    }
}
