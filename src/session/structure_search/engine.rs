//! The engine of a search over lens structures: rounds, checkpoints, and exports of its lenses.

use super::request::{CheckpointSidecar, LensSearch, StructureSearchRequest};
use super::snapshot::{EndReason, StructureSearchSnapshot};
use crate::files::FileLock;
use crate::lens::Lens;
use crate::merit::ConstraintMargin;
use crate::search::SteerCommand;
use crate::session::clock::{Throttle, Timed, time};
use crate::session::run::{Engine, EventSender, RunKind, RunStatus, catch_panic};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, SystemTime};

/// The shortest time between two checkpoints.
const SAVE_INTERVAL: Duration = Duration::from_secs(1);
/// The shortest time between two examinations of the best lens.
const EXAMINE_INTERVAL: Duration = Duration::from_secs(5);
/// The largest part of the time that checkpoints take.
const SAVE_SHARE: f64 = 0.05;
/// The time between two looks at the file of another process.
const FOLLOW_INTERVAL: Duration = Duration::from_millis(200);

/// A search to start or to resume.
#[derive(Debug)]
pub(super) enum StructureSearchInput {
    /// A new search, saved to a file if there is one.
    New { lens: Arc<Lens>, request: Box<StructureSearchRequest>, path: Option<PathBuf> },
    /// The search of a checkpoint.
    Saved(PathBuf),
    /// The search that another process saves in a checkpoint, shown as far as that is.
    Followed(PathBuf),
}

/// A request to a search.
#[derive(Debug)]
pub(super) enum EngineRequest {
    /// Changes the search between two rounds.
    Control(SteerCommand),
    /// Saves the search to another file from now on.
    SaveTo(PathBuf),
    /// Finalizes and writes a lens while the search continues.
    Export { number: u64, lens: Arc<Lens>, path: PathBuf },
}

/// A message from a search.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::session) enum StructureSearchReport {
    /// A control of the search was rejected.
    Rejected(String),
    /// The lens of a generation was finalized and written; the text describes it.
    Exported { number: u64, path: PathBuf, text: String },
    /// The lens of a generation could not be exported.
    NotExported { number: u64, why: String },
    /// The search could not be saved.
    NotSaved(String),
}

/// A search with its state and its checkpoint.
pub(super) struct StructureSearchEngine {
    search: LensSearch,
    state: StructureSearchSnapshot,
    sidecar: CheckpointSidecar,
    saves: Throttle,
    examinations: Throttle,
    /// The exclusive use of the checkpoint, from the first time that it is saved or loaded.
    lock: Option<FileLock>,
    /// The checkpoint of another process that is shown.
    followed: Option<FollowedFile>,
    /// True after an error, when the search is not to be saved any more.
    is_broken: bool,
    sender: EventSender<StructureSearchReport>,
}

impl StructureSearchEngine {
    pub(super) fn start(
        input: StructureSearchInput,
        sender: &EventSender<StructureSearchReport>,
    ) -> Result<Self, String> {
        let (search, request, mut sidecar, path, lock, followed) = match input {
            StructureSearchInput::New { lens, request, path } => {
                let search = LensSearch::new(&lens, &request).map_err(|why| why.to_string())?;
                let minutes = request.minutes;
                let sidecar = CheckpointSidecar { minutes, ..CheckpointSidecar::default() };
                (search, *request, sidecar, path, None, None)
            }
            StructureSearchInput::Saved(path) => {
                let lock = FileLock::acquire(&path).map_err(|why| why.to_string())?;
                let (search, request, sidecar) =
                    LensSearch::resume(&path).map_err(|why| why.to_string())?;
                (search, request, sidecar, Some(path), Some(lock), None)
            }
            StructureSearchInput::Followed(path) => {
                let followed = FollowedFile::new(path.clone());
                let (search, request, sidecar) =
                    LensSearch::resume(&path).map_err(|why| why.to_string())?;
                (search, request, sidecar, Some(path), None, Some(followed))
            }
        };
        let mut state = StructureSearchSnapshot::new(request, &search.run, path);
        state.start_violations = violations(&search, &search.run.start().point);
        state.checkpoint.is_followed = followed.is_some();
        state.checkpoint.moves = followed.is_some().then(|| search.run.statistics().moves);
        sidecar.history.begin(&search.run);
        let mut saves = Throttle::new(SAVE_INTERVAL);
        saves.ready();
        let mut examinations = Throttle::new(EXAMINE_INTERVAL);
        examinations.ready();
        Ok(Self {
            search,
            state,
            sidecar,
            saves,
            examinations,
            lock,
            followed,
            is_broken: false,
            sender: sender.clone(),
        })
    }

    /// The reason to end the search, if there is one.
    fn end_reason(&self) -> Option<EndReason> {
        let minutes = self.state.request.minutes;
        let late = minutes.is_some_and(|minutes| self.sidecar.seconds >= 60.0 * minutes);
        let reason = self.search.run.end_reason().map(EndReason::Sampler);
        reason.or_else(|| late.then_some(EndReason::TimeLimit))
    }

    /// Counts the rays of a gradient of the best lens and determines the constraints that it violates.
    fn evaluate_best(&mut self) {
        let search = &self.search;
        self.state.rays = catch_panic(|| Ok(search.rays_per_gradient())).unwrap_or(self.state.rays);
        self.state.best_violations = violations(search, &search.run.best().point);
    }

    fn control(&mut self, command: SteerCommand) {
        if self.followed.is_some() {
            let why = "this search is followed, not run here: it cannot be steered";
            return self.sender.report(StructureSearchReport::Rejected(why.to_owned()));
        }
        if let Err(why) = self.search.control(command) {
            self.sender.report(StructureSearchReport::Rejected(why.to_string()));
        }
    }

    fn save_to(&mut self, path: PathBuf) {
        if self.followed.is_some() {
            let why = "this search is followed, not run here: resume it here to save it elsewhere";
            return self.sender.report(StructureSearchReport::Rejected(why.to_owned()));
        }
        self.lock = None;
        self.state.checkpoint.path = Some(path);
        self.state.checkpoint.moves = None;
        self.save();
    }

    /// Writes the checkpoint, and reports a failure once.
    fn save(&mut self) {
        if self.is_broken || self.followed.is_some() {
            return;
        }
        let error = catch_panic(|| Ok(self.try_save())).unwrap_or_else(Some);
        if error.is_some() && self.state.checkpoint.error != error {
            let why = error.clone().unwrap_or_default();
            let text = format!("the search is not saved: {why}");
            self.sender.report(StructureSearchReport::NotSaved(text));
        }
        self.state.checkpoint.error = error;
    }

    /// Takes over what another process has saved since the last time.
    fn follow(&mut self) {
        let Some(path) = self.followed.as_mut().and_then(FollowedFile::changed) else {
            return thread::sleep(FOLLOW_INTERVAL);
        };
        match LensSearch::resume(&path) {
            Ok((search, request, mut sidecar)) => {
                sidecar.history.begin(&search.run);
                self.state.request = Arc::new(request);
                self.state.checkpoint.moves = Some(search.run.statistics().moves);
                self.state.checkpoint.error = None;
                (self.search, self.sidecar) = (search, sidecar);
            }
            Err(why) => self.state.checkpoint.error = Some(why.to_string()),
        }
    }

    /// Writes the checkpoint if there is a file for it; the reason if that failed.
    fn try_save(&mut self) -> Option<String> {
        let path = self.state.checkpoint.path.clone()?;
        let saved = self.lock_and_save(&path);
        if saved.is_ok() {
            self.state.checkpoint.moves = Some(self.search.run.statistics().moves);
        }
        saved.err()
    }

    fn lock_and_save(&mut self, path: &Path) -> Result<(), String> {
        let made = path.parent().map_or(Ok(()), std::fs::create_dir_all);
        made.map_err(|why| format!("{}: {why}", path.display()))?;
        if self.lock.is_none() {
            self.lock = Some(FileLock::acquire(path).map_err(|why| why.to_string())?);
        }
        self.search.save(path, &self.sidecar).map_err(|why| why.to_string())
    }

    /// Finalizes a lens in a thread of its own, for which the end of the program does not wait.
    fn export(&self, number: u64, lens: Arc<Lens>, path: PathBuf) {
        let (finalizer, sender) = (self.search.finalizer(), self.sender.clone());
        let work = move || match finalizer.write(&lens, &path) {
            Ok(text) => sender.report(StructureSearchReport::Exported { number, path, text }),
            Err(why) => sender.report(StructureSearchReport::NotExported { number, why }),
        };
        if let Err(why) = thread::Builder::new().name("finalize".into()).spawn(work) {
            let why = why.to_string();
            self.sender.report(StructureSearchReport::NotExported { number, why });
        }
    }
}

impl Engine for StructureSearchEngine {
    const KIND: RunKind = RunKind::StructureSearch;
    const THREAD: &'static str = "search";
    const INTERVAL: Duration = Duration::from_millis(100);

    type Input = StructureSearchInput;
    type Request = EngineRequest;
    type Report = StructureSearchReport;
    type Snapshot = StructureSearchSnapshot;

    /// One turn of every chain, or a look at the file of another process.
    fn step(&mut self) -> Result<bool, String> {
        if self.followed.is_some() {
            self.follow();
            if self.examinations.ready() {
                self.evaluate_best();
            }
            return Ok(false);
        }
        let before = self.search.run.statistics().gradients;
        let Timed { value: events, ms } = time(|| self.search.round());
        self.sidecar.seconds += 1e-3 * ms;
        self.sidecar.gradients += self.search.run.statistics().gradients - before;
        self.sidecar.history.record(&self.search.run, &events);
        self.state.end_reason = self.end_reason();
        if self.saves.ready() {
            let Timed { ms, .. } = time(|| self.save());
            let pause = Duration::from_secs_f64(1e-3 * ms / SAVE_SHARE);
            self.saves = Throttle::new(SAVE_INTERVAL.max(pause));
            self.saves.ready();
        }
        if self.examinations.ready() {
            self.evaluate_best();
        }
        Ok(self.state.end_reason.is_some())
    }

    fn on_status(&mut self, status: RunStatus) -> Result<(), String> {
        if status == RunStatus::Failed {
            self.is_broken = true;
            return Ok(());
        }
        self.evaluate_best();
        // A search that is killed in its first second is there, too.
        if status != RunStatus::Running || self.state.checkpoint.moves.is_none() {
            self.save();
        }
        Ok(())
    }

    fn handle(&mut self, request: EngineRequest) -> Result<Option<RunStatus>, String> {
        match request {
            EngineRequest::Control(command) => self.control(command),
            EngineRequest::SaveTo(path) => self.save_to(path),
            EngineRequest::Export { number, lens, path } => self.export(number, lens, path),
        }
        Ok(None)
    }

    fn snapshot(&mut self) -> StructureSearchSnapshot {
        self.state.update(&self.search.run);
        self.state.seconds = self.sidecar.seconds;
        self.state.gradients = self.sidecar.gradients;
        self.state.history = Arc::new(self.sidecar.history.clone());
        self.state.clone()
    }

    fn close(&mut self) {
        self.save();
    }
}

/// A checkpoint that another process writes.
struct FollowedFile {
    path: PathBuf,
    /// The time of the version that was read last.
    modified: Option<SystemTime>,
}

impl FollowedFile {
    fn new(path: PathBuf) -> Self {
        let modified = modified(&path);
        Self { path, modified }
    }

    /// The path if the file is another one than at the last time; a file that is gone is waited for.
    fn changed(&mut self) -> Option<PathBuf> {
        let modified = modified(&self.path);
        let is_new = modified.is_some() && modified != self.modified;
        self.modified = modified.or(self.modified);
        is_new.then(|| self.path.clone())
    }
}

fn modified(path: &Path) -> Option<SystemTime> {
    std::fs::metadata(path).and_then(|data| data.modified()).ok()
}

/// The constraints that a lens violates.
fn violations(search: &LensSearch, lens: &Lens) -> Vec<ConstraintMargin> {
    catch_panic(|| Ok(search.violations(lens))).unwrap_or_default()
}
