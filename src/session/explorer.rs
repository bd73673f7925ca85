//! A search over structure in the background: orders in, news out.
//!
//! The search works on its own copy of the lens and is saved every few seconds, where there is a
//! place for it. A panic inside ends the search and not the session: what was found stays.

use super::background::{Background, Outbox, Work, guarded, pool};
use super::clock::{Throttle, Timed, time};
use super::diary::CheckpointSidecar;
use super::exploration::{EndReason, StructureSearchSnapshot};
use super::judged::ScoredLens;
use super::quest::{LensSearchEngine, StructureSearchEngine, StructureSearchRequest};
use super::slot::Slot;
use super::worker::RunStatus;
use crate::lens::Lens;
use crate::merit::ConstraintMargin;
use crate::search::SteerCommand;
use rayon::ThreadPool;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

/// The time between two looks of the window, at least.
const BETWEEN: Duration = Duration::from_millis(100);
/// The time between two checkpoints, at least.
const SAVED: Duration = Duration::from_secs(5);

/// What happened to a search; each carries its number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Told {
    Now(u64, RunStatus),
    Failed(u64, String),
    Refused(String),
    /// The lens of a generation was finished and written.
    Written(u64, PathBuf, String),
    /// It was not.
    NotWritten(u64, String),
    /// The search itself could not be saved.
    NotSaved(String),
}

/// What the thread is told.
#[derive(Debug)]
enum Order {
    Start {
        number: u64,
        lens: Arc<Lens>,
        quest: Box<StructureSearchRequest>,
        path: Option<PathBuf>,
    },
    GoOn {
        number: u64,
        path: PathBuf,
    },
    Stand(RunStatus),
    Steer(SteerCommand),
    SaveTo(PathBuf),
    Clear,
    Judge(Arc<Lens>),
    Export {
        generation: u64,
        lens: Arc<Lens>,
        path: PathBuf,
    },
}

type Begin =
    dyn Fn(&Lens, &StructureSearchRequest) -> Result<Box<dyn StructureSearchEngine>, String> + Send;

/// The handle of the thread that searches over structure.
#[derive(Debug)]
pub(super) struct Explorer {
    thread: Background<Order, Told>,
    run: Slot<StructureSearchSnapshot>,
    judged: Slot<ScoredLens>,
}

impl Explorer {
    /// Starts the thread. `wake` is called from it when there is something new to look at.
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let begin = |lens: &Lens, quest: &StructureSearchRequest| {
            let engine = LensSearchEngine::start(lens, quest).map_err(|why| why.to_string())?;
            Ok(Box::new(engine) as Box<dyn StructureSearchEngine>)
        };
        Self::with(Box::new(begin), wake)
    }

    fn with(begin: Box<Begin>, wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let (run, judged) = (Slot::default(), Slot::default());
        let (shown, judgements) = (run.clone(), judged.clone());
        let desk = |outbox| Desk {
            outbox,
            shown,
            judged: judgements,
            begin,
            pool: None,
            looks: Throttle::new(BETWEEN),
            saves: Throttle::new(SAVED),
            run: None,
        };
        Ok(Self { thread: Background::spawn("search", wake, desk)?, run, judged })
    }

    /// Begins a search, saved to a file where there is one.
    pub(super) fn start(
        &self,
        number: u64,
        lens: Arc<Lens>,
        quest: Box<StructureSearchRequest>,
        path: Option<PathBuf>,
    ) {
        self.thread.tell(Order::Start { number, lens, quest, path });
    }

    /// Goes on with the search that a file holds.
    pub(super) fn go_on(&self, number: u64, path: PathBuf) {
        self.thread.tell(Order::GoOn { number, path });
    }

    /// Holds the search, lets it go on or ends it, after its round.
    pub(super) fn stand(&self, standing: RunStatus) {
        self.thread.tell(Order::Stand(standing));
    }

    /// Steers the search between two rounds.
    pub(super) fn steer(&self, steer: SteerCommand) {
        self.thread.tell(Order::Steer(steer));
    }

    /// Saves the search to another file from now on.
    pub(super) fn save_to(&self, path: PathBuf) {
        self.thread.tell(Order::SaveTo(path));
    }

    /// Ends the search and forgets it; its file stays.
    pub(super) fn clear(&self) {
        self.thread.tell(Order::Clear);
    }

    /// Asks what a design is worth beside what was found.
    pub(super) fn judge(&self, lens: Arc<Lens>) {
        self.thread.tell(Order::Judge(lens));
    }

    /// Finishes and writes a lens that was found, while the search goes on.
    pub(super) fn export(&self, generation: u64, lens: Arc<Lens>, path: PathBuf) {
        self.thread.tell(Order::Export { generation, lens, path });
    }

    /// How far the search is.
    pub(super) fn run(&self) -> Option<Arc<StructureSearchSnapshot>> {
        self.run.latest()
    }

    /// The design that was judged last.
    pub(super) fn judged(&self) -> Option<Arc<ScoredLens>> {
        self.judged.latest()
    }

    /// What happened since the last look.
    pub(super) fn told(&self) -> Vec<Told> {
        self.thread.news()
    }
}

/// What the thread works with.
struct Desk {
    outbox: Outbox<Told>,
    shown: Slot<StructureSearchSnapshot>,
    judged: Slot<ScoredLens>,
    begin: Box<Begin>,
    /// Threads of its own, from the first search on.
    pool: Option<ThreadPool>,
    looks: Throttle,
    saves: Throttle,
    run: Option<Run>,
}

/// A search under way or ended.
struct Run {
    engine: Box<dyn StructureSearchEngine>,
    state: StructureSearchSnapshot,
    diary: CheckpointSidecar,
}

impl Work for Desk {
    type Order = Order;

    fn is_running(&self) -> bool {
        self.run.as_ref().is_some_and(|run| run.state.status == RunStatus::Running)
    }

    fn obey(&mut self, order: Order) {
        match order {
            Order::Start { number, lens, quest, path } => {
                let begun = guarded(|| (self.begin)(&lens, &quest));
                let diary =
                    CheckpointSidecar { minutes: quest.minutes, ..CheckpointSidecar::default() };
                self.begin(number, begun.map(|engine| (engine, *quest, diary)), path);
            }
            Order::GoOn { number, path } => {
                let begun =
                    guarded(|| LensSearchEngine::resume(&path).map_err(|why| why.to_string()));
                let boxed = |engine| Box::new(engine) as Box<dyn StructureSearchEngine>;
                let begun = begun.map(|(engine, quest, diary)| (boxed(engine), quest, diary));
                self.begin(number, begun, Some(path));
            }
            Order::Stand(standing) => {
                if self.run.as_ref().is_some_and(|run| run.state.is_active()) {
                    self.stand(standing);
                }
            }
            Order::Steer(steer) => self.steer(steer),
            Order::SaveTo(path) => self.save_to(path),
            Order::Clear => {
                self.save();
                self.run = None;
            }
            Order::Judge(lens) => {
                self.judged.set(ScoredLens::new(lens));
                self.outbox.wake();
            }
            Order::Export { generation, lens, path } => self.export(generation, lens, path),
        }
    }

    /// One turn of every chain.
    fn advance(&mut self) {
        let (Some(run), Some(pool)) = (&mut self.run, &self.pool) else { return };
        match guarded(|| Ok(run.round(pool))) {
            Ok(over) => run.state.end_reason = over,
            Err(why) => return self.give_up(why),
        }
        if run.state.end_reason.is_some() {
            self.stand(RunStatus::Finished);
        } else if self.looks.ready() {
            self.show();
        }
        if self.saves.ready() {
            self.save();
            if let Some(run) = &mut self.run {
                run.appraise();
            }
        }
    }

    fn close(&mut self) {
        self.save();
    }
}

impl Desk {
    fn begin(
        &mut self,
        number: u64,
        begun: Result<
            (Box<dyn StructureSearchEngine>, StructureSearchRequest, CheckpointSidecar),
            String,
        >,
        path: Option<PathBuf>,
    ) {
        self.save();
        self.run = None;
        let ready = begun.and_then(|begun| {
            if self.pool.is_none() {
                self.pool = Some(pool("search").map_err(|why| why.to_string())?);
            }
            Ok(begun)
        });
        match ready {
            Ok((engine, quest, mut diary)) => {
                let mut state = StructureSearchSnapshot::new(number, quest, engine.run(), path);
                state.start_violations = broken(engine.as_ref(), &engine.run().start().point);
                diary.history.begin(engine.run());
                self.run = Some(Run { engine, state, diary });
                self.saves.ready();
                self.stand(RunStatus::Running);
            }
            Err(why) => self.outbox.emit(Told::Failed(number, why)),
        }
    }

    /// Lets the search stand otherwise, saves it, shows it and says so.
    fn stand(&mut self, standing: RunStatus) {
        let Some(run) = &mut self.run else { return };
        run.state.status = standing;
        run.appraise();
        let number = run.state.number;
        if standing != RunStatus::Running {
            self.save();
        }
        self.show();
        self.outbox.emit(Told::Now(number, standing));
    }

    fn steer(&mut self, steer: SteerCommand) {
        let Some(run) = &mut self.run else { return };
        if let Err(why) = run.engine.control(steer) {
            self.outbox.emit(Told::Refused(why.to_string()));
        }
        self.show();
    }

    fn save_to(&mut self, path: PathBuf) {
        if let Some(run) = &mut self.run {
            run.state.checkpoint.path = Some(path);
            run.state.checkpoint.moves = None;
        }
        self.save();
        self.show();
    }

    /// Writes the checkpoint, unless the file holds all of the search.
    fn save(&mut self) {
        let Some(run) = &mut self.run else { return };
        let failed = guarded(|| Ok(run.save())).unwrap_or_else(Some);
        if failed.is_some() && run.state.checkpoint.error != failed {
            let why = failed.clone().unwrap_or_default();
            self.outbox.emit(Told::NotSaved(format!("the search is not saved: {why}")));
        }
        run.state.checkpoint.error = failed;
    }

    /// Finishes a lens in a thread of its own, which the end of the program does not wait for.
    fn export(&self, generation: u64, lens: Arc<Lens>, path: PathBuf) {
        let Some(run) = &self.run else { return };
        let (finishing, outbox) = (run.engine.finalizer(), self.outbox.clone());
        let work = move || match finishing.write(&lens, &path) {
            Ok(report) => outbox.emit(Told::Written(generation, path, report)),
            Err(why) => outbox.emit(Told::NotWritten(generation, why)),
        };
        if let Err(why) = thread::Builder::new().name("finish".into()).spawn(work) {
            self.outbox.emit(Told::NotWritten(generation, why.to_string()));
        }
    }

    fn show(&mut self) {
        if let Some(run) = &mut self.run {
            self.shown.set(run.look());
            self.outbox.wake();
        }
    }

    fn give_up(&mut self, why: String) {
        let Some(run) = &mut self.run else { return };
        run.state.status = RunStatus::Stopped;
        let number = run.state.number;
        self.shown.set(run.state.clone());
        self.outbox.emit(Told::Failed(number, why));
    }
}

/// The limits that a lens breaks.
fn broken(engine: &dyn StructureSearchEngine, lens: &Lens) -> Vec<ConstraintMargin> {
    guarded(|| Ok(engine.violations(lens))).unwrap_or_default()
}

impl Run {
    /// One turn of every chain; why the search is over, where it is.
    fn round(&mut self, pool: &ThreadPool) -> Option<EndReason> {
        let before = self.engine.run().statistics().gradients;
        let engine = &mut self.engine;
        let Timed { value: events, ms } = time(|| pool.install(|| engine.round()));
        self.diary.seconds += 1e-3 * ms;
        self.diary.gradients += self.engine.run().statistics().gradients - before;
        self.diary.history.record(self.engine.run(), &events);
        self.over()
    }

    fn over(&self) -> Option<EndReason> {
        let minutes = self.state.request.minutes;
        let late = minutes.is_some_and(|minutes| self.diary.seconds >= 60.0 * minutes);
        let over = self.engine.run().end_reason().map(EndReason::Sampler);
        over.or_else(|| late.then_some(EndReason::TimeLimit))
    }

    /// Counts the rays of a gradient of the best lens, and looks which limits it breaks.
    fn appraise(&mut self) {
        let engine = &self.engine;
        let best = &engine.run().best().point;
        let state = &mut self.state;
        state.rays = guarded(|| Ok(engine.rays())).unwrap_or(state.rays);
        state.best_violations = broken(engine.as_ref(), best);
    }

    /// Takes over what the search has found.
    fn look(&mut self) -> StructureSearchSnapshot {
        self.state.update(self.engine.run());
        self.state.seconds = self.diary.seconds;
        self.state.gradients = self.diary.gradients;
        self.state.history = Arc::new(self.diary.history.clone());
        self.state.clone()
    }

    /// Writes the checkpoint; why that failed, where it did.
    fn save(&mut self) -> Option<String> {
        let moves = self.engine.run().statistics().moves;
        let path = self.state.checkpoint.path.as_ref()?;
        let made = path.parent().map_or(Ok(()), std::fs::create_dir_all);
        let saved = made
            .map_err(|why| format!("{}: {why}", path.display()))
            .and_then(|()| self.engine.save(path, &self.diary).map_err(|why| why.to_string()));
        if saved.is_ok() {
            self.state.checkpoint.moves = Some(moves);
        }
        saved.err()
    }
}
