//! A search for a field in the background: orders in, news out.
//!
//! The search takes the same steps as one without a window: looking at it, holding it and writing
//! it change nothing. A panic inside ends the search and not the session: what was found stays.

use super::subject::{DocumentSource, GrinDocument};
use crate::files;
use crate::grin::Integrator;
use crate::grin_design::{Domain, GrinField, GrinOptimizer, GrinProgress};
use crate::session::background::{Background, Outbox, Work, guarded, pool};
use crate::session::clock::{Throttle, Timed, time};
use crate::session::slot::Slot;
use crate::session::worker::RunStatus;
use rayon::ThreadPool;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// The time between two looks of the window, at least.
const BETWEEN: Duration = Duration::from_millis(100);
/// How many points of the history are kept; beyond that every second one goes.
const HISTORY: usize = 3000;
/// Most nodes along a side of a volume that is written.
pub const MAX_NODES: usize = 513;

/// What is open, and how far its search is.
#[derive(Debug, Clone)]
pub struct GrinRun {
    /// Which of the session it is, counted from 1.
    pub number: u64,
    /// How the search stands; one that waits for its first step is held, a volume has none.
    pub status: RunStatus,
    /// What is open.
    pub document: Arc<GrinDocument>,
    /// The field to look at: the current one as long as the search can go on, then the best one.
    pub field: Arc<GrinField>,
    /// What the last step did; `None` before the first.
    pub progress: Option<GrinProgress>,
    /// The loss against the step, at most a few thousand points of the whole way.
    pub history: Arc<Vec<LossSample>>,
    /// Rays traced for the loss so far, each with its way back.
    pub rays: u64,
    /// The time that the steps took, in seconds, pauses apart.
    pub seconds: f64,
    /// Whether the best field is in a file as it is.
    pub saved: bool,
    /// How rays of the first view are traced: the kind of step and its length in mm; `None` for a
    /// volume.
    pub tracing: Option<(Integrator, f64)>,
}

/// A point of the history.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LossSample {
    /// Steps so far.
    pub step: usize,
    /// The loss of the field by the rays of this step.
    pub current: f64,
    /// The loss of the best field by the rays that all fields are judged by.
    pub best: f64,
    /// The level, counted from 0.
    pub level: usize,
}

impl GrinRun {
    fn new(number: u64, subject: GrinDocument, runner: Option<&GrinOptimizer>) -> Self {
        let standing = if runner.is_some() { RunStatus::Paused } else { RunStatus::Stopped };
        Self {
            number,
            status: standing,
            field: Arc::new(subject.start.clone()),
            document: Arc::new(subject),
            progress: None,
            history: Arc::default(),
            rays: 0,
            seconds: 0.0,
            saved: false,
            tracing: runner.map(GrinOptimizer::tracing),
        }
    }

    /// Whether it takes steps or can.
    pub fn is_active(&self) -> bool {
        self.status.is_active()
    }

    /// Whether a field has been formed that is in no file as it is.
    pub fn is_unsaved(&self) -> bool {
        self.progress.is_some() && !self.saved
    }

    /// Whether there is a search that has not taken a step yet.
    pub fn is_ready(&self) -> bool {
        self.is_active() && self.progress.is_none()
    }
}

/// What happened; most of it carries the number of what it happened to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::session) enum Told {
    Now(u64, RunStatus),
    /// It could not be opened: what was open stays so.
    NotOpened(u64, String),
    Failed(u64, String),
    Written(PathBuf, String),
    NotWritten(String),
}

/// What the thread is told.
#[derive(Debug)]
enum Order {
    Open(u64, DocumentSource),
    Start,
    Stand(RunStatus),
    Write(PathBuf, usize),
    Close,
}

/// The handle of the thread that searches for a field.
#[derive(Debug)]
pub(super) struct Former {
    thread: Background<Order, Told>,
    shown: Slot<GrinRun>,
}

impl Former {
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let shown = Slot::default();
        let place = shown.clone();
        let desk = |outbox| {
            let pace = Throttle::new(BETWEEN);
            Desk { outbox, shown: place, pool: None, pace, run: None }
        };
        Ok(Self { thread: Background::spawn("form", wake, desk)?, shown })
    }

    pub(super) fn open(&self, number: u64, origin: DocumentSource) {
        self.thread.tell(Order::Open(number, origin));
    }

    /// Begins the search, from the beginning.
    pub(super) fn start(&self) {
        self.thread.tell(Order::Start);
    }

    /// Holds the search, lets it go on or ends it, after its step.
    pub(super) fn stand(&self, standing: RunStatus) {
        self.thread.tell(Order::Stand(standing));
    }

    /// Writes the best field.
    pub(super) fn write(&self, path: PathBuf, nodes: usize) {
        self.thread.tell(Order::Write(path, nodes));
    }

    pub(super) fn close(&self) {
        self.thread.tell(Order::Close);
    }

    /// How far it is.
    pub(super) fn formation(&self) -> Option<Arc<GrinRun>> {
        self.shown.latest()
    }

    /// What happened since the last look.
    pub(super) fn told(&self) -> Vec<Told> {
        self.thread.news()
    }
}

/// What the thread works with.
struct Desk {
    outbox: Outbox<Told>,
    shown: Slot<GrinRun>,
    /// Threads of its own, from the first search on: what is looked at does not queue behind it.
    pool: Option<ThreadPool>,
    pace: Throttle,
    run: Option<Run>,
}

/// What is open.
struct Run {
    runner: Option<GrinOptimizer>,
    state: GrinRun,
    /// Every so many steps there is a point of the history.
    stride: usize,
}

impl Work for Desk {
    type Order = Order;

    fn is_running(&self) -> bool {
        self.run.as_ref().is_some_and(|run| run.state.status == RunStatus::Running)
    }

    fn obey(&mut self, order: Order) {
        match order {
            Order::Open(number, origin) => match guarded(|| GrinDocument::open(&origin)) {
                Ok((subject, runner)) => self.show(number, subject, runner),
                Err(why) => self.outbox.emit(Told::NotOpened(number, why)),
            },
            Order::Start => self.start(),
            Order::Stand(standing) => {
                if self.run.as_ref().is_some_and(|run| run.state.is_active()) {
                    self.stand(standing);
                }
            }
            Order::Write(path, nodes) => self.write(path, nodes),
            Order::Close => self.run = None,
        }
    }

    fn advance(&mut self) {
        let (Some(run), Some(pool)) = (&mut self.run, &self.pool) else { return };
        match guarded(|| run.step(pool)) {
            Ok(true) => self.stand(RunStatus::Finished),
            Ok(false) if self.pace.ready() => {
                self.shown.set(run.look());
                self.outbox.wake();
            }
            Ok(false) => {}
            Err(why) => self.give_up(why),
        }
    }
}

impl Desk {
    fn show(&mut self, number: u64, subject: GrinDocument, runner: Option<GrinOptimizer>) {
        let state = GrinRun::new(number, subject, runner.as_ref());
        let standing = state.status;
        self.shown.set(state.clone());
        self.run = Some(Run { runner, state, stride: 1 });
        self.outbox.emit(Told::Now(number, standing));
    }

    /// Begins the search, anew where it has taken steps.
    fn start(&mut self) {
        let Some(run) = &mut self.run else { return };
        let begun = guarded(|| {
            if self.pool.is_none() {
                self.pool = Some(pool("form").map_err(|why| why.to_string())?);
            }
            run.restart()
        });
        match begun {
            Ok(()) => self.stand(RunStatus::Running),
            Err(why) => self.give_up(why),
        }
    }

    /// Lets the search stand otherwise, shows it and says so.
    fn stand(&mut self, standing: RunStatus) {
        let Some(run) = &mut self.run else { return };
        // The best field is known once the one that it is stopped at is judged.
        let settled = match (&mut run.runner, standing) {
            (Some(runner), RunStatus::Stopped) => {
                guarded(|| runner.finish().map_err(|why| why.to_string()))
            }
            _ => Ok(()),
        };
        if let Err(why) = settled {
            return self.give_up(why);
        }
        run.state.status = standing;
        let number = run.state.number;
        self.shown.set(run.look());
        self.outbox.emit(Told::Now(number, standing));
    }

    fn give_up(&mut self, why: String) {
        let Some(run) = &mut self.run else { return };
        run.state.status = RunStatus::Stopped;
        let number = run.state.number;
        self.shown.set(run.look());
        self.outbox.emit(Told::Failed(number, why));
    }

    fn write(&mut self, path: PathBuf, nodes: usize) {
        let Some(run) = &mut self.run else {
            let why = "there is no field to save; open a task first";
            return self.outbox.emit(Told::NotWritten(why.to_owned()));
        };
        let told = match guarded(|| run.write(&path, nodes)) {
            Ok(report) => {
                run.state.saved = true;
                self.shown.set(run.look());
                Told::Written(path, report)
            }
            Err(why) => Told::NotWritten(why),
        };
        self.outbox.emit(told);
    }
}

impl Run {
    /// Makes ready for the first step.
    fn restart(&mut self) -> Result<(), String> {
        let Some(task) = &self.state.document.task else {
            return Err("a volume has no task to work on".to_owned());
        };
        if self.state.progress.is_some() {
            let runner = GrinOptimizer::new(task).map_err(|why| why.to_string())?;
            self.state.field = Arc::new(runner.current().clone());
            self.runner = Some(runner);
            self.state.progress = None;
            self.state.history = Arc::default();
            self.state.saved = false;
            (self.state.rays, self.state.seconds, self.stride) = (0, 0.0, 1);
        }
        Ok(())
    }

    /// Whether the step was the last one.
    fn step(&mut self, pool: &ThreadPool) -> Result<bool, String> {
        let Some(runner) = &mut self.runner else { return Ok(true) };
        let Timed { value, ms } = time(|| pool.install(|| runner.step()));
        let progress = value.map_err(|why| why.to_string())?;
        let finished = progress.finished;
        self.state.seconds += 1e-3 * ms;
        self.note(&progress);
        self.state.progress = Some(progress);
        self.state.saved = false;
        Ok(finished)
    }

    fn note(&mut self, progress: &GrinProgress) {
        let GrinProgress { step, loss, best, level, finished, .. } = *progress;
        let history = Arc::make_mut(&mut self.state.history);
        if finished || step.is_multiple_of(self.stride) {
            history.push(LossSample { step, current: loss, best, level });
        }
        if history.len() > HISTORY {
            self.stride *= 2;
            history.retain(|point| point.step.is_multiple_of(self.stride));
        }
    }

    /// Takes over what the search has found.
    fn look(&mut self) -> GrinRun {
        if let Some(runner) = &self.runner {
            let under_way = self.state.is_active();
            let medium = if under_way { runner.current() } else { runner.best() };
            if *self.state.field != *medium {
                self.state.field = Arc::new(medium.clone());
            }
            self.state.rays = runner.rays_traced();
            self.state.tracing = Some(runner.tracing());
        }
        self.state.clone()
    }

    /// Writes the best field; what was written.
    fn write(&self, path: &Path, nodes: usize) -> Result<String, String> {
        let known = |known: &str| {
            path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(known))
        };
        if !known("npz") && !known("json") {
            return Err(format!("{}: expected a name that ends in .npz or .json", path.display()));
        }
        if !(2..=MAX_NODES).contains(&nodes) {
            return Err(format!("{nodes} nodes along a side: expected 2 to {MAX_NODES}"));
        }
        let subject = &self.state.document;
        let medium = self.runner.as_ref().map_or(&subject.start, GrinOptimizer::best);
        let volume = match &subject.task {
            Some(task) => task.volume(medium, nodes),
            // The nodes are written as they are, whatever the space.
            None => medium.volume(Domain::Cube { half: 1.0 }, nodes),
        };
        let volume = volume.map_err(|why| why.to_string())?;
        let files = files::write_volume(path, &volume).map_err(|why| why.to_string())?;
        let files: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
        let [x, y, z] = volume.grid.counts();
        Ok(format!("{x} × {y} × {z} nodes of the best field written to {}", files.join(" and ")))
    }
}
