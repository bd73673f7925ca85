//! A search for a field in the background: orders in, news out.
//!
//! The search takes the same steps as one without a window: looking at it, holding it and writing
//! it change nothing. A panic inside ends the search and not the session: what was found stays.

use super::subject::{Origin, Subject};
use crate::files;
use crate::grin::Integrator;
use crate::grin_task::{Medium, Progress, Runner, Space};
use crate::session::background::{Background, Outbox, Work, guarded, pool};
use crate::session::clock::{Pace, Timed, timed};
use crate::session::slot::Slot;
use crate::session::worker::Standing;
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
pub const MOST_NODES: usize = 513;

/// What is open, and how far its search is.
#[derive(Debug, Clone)]
pub struct Formation {
    /// Which of the session it is, counted from 1.
    pub number: u64,
    /// How the search stands; one that waits for its first step is held, a volume has none.
    pub standing: Standing,
    /// What is open.
    pub subject: Arc<Subject>,
    /// The field to look at: the current one as long as the search can go on, then the best one.
    pub medium: Arc<Medium>,
    /// What the last step did; `None` before the first.
    pub progress: Option<Progress>,
    /// The loss against the step, at most a few thousand points of the whole way.
    pub history: Arc<Vec<Loss>>,
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
pub struct Loss {
    /// Steps so far.
    pub step: usize,
    /// The loss of the field by the rays of this step.
    pub current: f64,
    /// The loss of the best field by the rays that all fields are judged by.
    pub best: f64,
    /// The level, counted from 0.
    pub level: usize,
}

impl Formation {
    fn new(number: u64, subject: Subject, runner: Option<&Runner>) -> Self {
        let standing = if runner.is_some() { Standing::Paused } else { Standing::Stopped };
        Self {
            number,
            standing,
            medium: Arc::new(subject.start.clone()),
            subject: Arc::new(subject),
            progress: None,
            history: Arc::default(),
            rays: 0,
            seconds: 0.0,
            saved: false,
            tracing: runner.map(Runner::tracing),
        }
    }

    /// Whether it takes steps or can.
    pub fn is_under_way(&self) -> bool {
        self.standing.can_go_on()
    }

    /// Whether a field has been formed that is in no file as it is.
    pub fn is_unsaved(&self) -> bool {
        self.progress.is_some() && !self.saved
    }

    /// Whether there is a search that has not taken a step yet.
    pub fn is_ready(&self) -> bool {
        self.is_under_way() && self.progress.is_none()
    }
}

/// What happened; most of it carries the number of what it happened to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::session) enum Told {
    Now(u64, Standing),
    /// It could not be opened: what was open stays so.
    NotOpened(u64, String),
    Failed(u64, String),
    Written(PathBuf, String),
    NotWritten(String),
}

/// What the thread is told.
#[derive(Debug)]
enum Order {
    Open(u64, Origin),
    Start,
    Stand(Standing),
    Write(PathBuf, usize),
    Close,
}

/// The handle of the thread that searches for a field.
#[derive(Debug)]
pub(super) struct Former {
    thread: Background<Order, Told>,
    shown: Slot<Formation>,
}

impl Former {
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let shown = Slot::default();
        let place = shown.clone();
        let desk = |outbox| {
            let pace = Pace::new(BETWEEN);
            Desk { outbox, shown: place, pool: None, pace, run: None }
        };
        Ok(Self { thread: Background::spawn("form", wake, desk)?, shown })
    }

    pub(super) fn open(&self, number: u64, origin: Origin) {
        self.thread.tell(Order::Open(number, origin));
    }

    /// Begins the search, from the beginning.
    pub(super) fn start(&self) {
        self.thread.tell(Order::Start);
    }

    /// Holds the search, lets it go on or ends it, after its step.
    pub(super) fn stand(&self, standing: Standing) {
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
    pub(super) fn formation(&self) -> Option<Arc<Formation>> {
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
    shown: Slot<Formation>,
    /// Threads of its own, from the first search on: what is looked at does not queue behind it.
    pool: Option<ThreadPool>,
    pace: Pace,
    run: Option<Run>,
}

/// What is open.
struct Run {
    runner: Option<Runner>,
    state: Formation,
    /// Every so many steps there is a point of the history.
    stride: usize,
}

impl Work for Desk {
    type Order = Order;

    fn is_running(&self) -> bool {
        self.run.as_ref().is_some_and(|run| run.state.standing == Standing::Running)
    }

    fn obey(&mut self, order: Order) {
        match order {
            Order::Open(number, origin) => match guarded(|| Subject::open(&origin)) {
                Ok((subject, runner)) => self.show(number, subject, runner),
                Err(why) => self.outbox.emit(Told::NotOpened(number, why)),
            },
            Order::Start => self.start(),
            Order::Stand(standing) => {
                if self.run.as_ref().is_some_and(|run| run.state.is_under_way()) {
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
            Ok(true) => self.stand(Standing::Finished),
            Ok(false) if self.pace.is_due() => {
                self.shown.set(run.look());
                self.outbox.wake();
            }
            Ok(false) => {}
            Err(why) => self.give_up(why),
        }
    }
}

impl Desk {
    fn show(&mut self, number: u64, subject: Subject, runner: Option<Runner>) {
        let state = Formation::new(number, subject, runner.as_ref());
        let standing = state.standing;
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
            Ok(()) => self.stand(Standing::Running),
            Err(why) => self.give_up(why),
        }
    }

    /// Lets the search stand otherwise, shows it and says so.
    fn stand(&mut self, standing: Standing) {
        let Some(run) = &mut self.run else { return };
        // The best field is known once the one that it is stopped at is judged.
        let settled = match (&mut run.runner, standing) {
            (Some(runner), Standing::Stopped) => {
                guarded(|| runner.settle().map_err(|why| why.to_string()))
            }
            _ => Ok(()),
        };
        if let Err(why) = settled {
            return self.give_up(why);
        }
        run.state.standing = standing;
        let number = run.state.number;
        self.shown.set(run.look());
        self.outbox.emit(Told::Now(number, standing));
    }

    fn give_up(&mut self, why: String) {
        let Some(run) = &mut self.run else { return };
        run.state.standing = Standing::Stopped;
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
        let Some(task) = &self.state.subject.task else {
            return Err("a volume has no task to work on".to_owned());
        };
        if self.state.progress.is_some() {
            let runner = Runner::new(task).map_err(|why| why.to_string())?;
            self.state.medium = Arc::new(runner.current().clone());
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
        let Timed { value, ms } = timed(|| pool.install(|| runner.step()));
        let progress = value.map_err(|why| why.to_string())?;
        let finished = progress.finished;
        self.state.seconds += 1e-3 * ms;
        self.note(&progress);
        self.state.progress = Some(progress);
        self.state.saved = false;
        Ok(finished)
    }

    fn note(&mut self, progress: &Progress) {
        let Progress { step, loss, best, level, finished, .. } = *progress;
        let history = Arc::make_mut(&mut self.state.history);
        if finished || step.is_multiple_of(self.stride) {
            history.push(Loss { step, current: loss, best, level });
        }
        if history.len() > HISTORY {
            self.stride *= 2;
            history.retain(|point| point.step.is_multiple_of(self.stride));
        }
    }

    /// Takes over what the search has found.
    fn look(&mut self) -> Formation {
        if let Some(runner) = &self.runner {
            let under_way = self.state.is_under_way();
            let medium = if under_way { runner.current() } else { runner.best() };
            if *self.state.medium != *medium {
                self.state.medium = Arc::new(medium.clone());
            }
            self.state.rays = runner.rays();
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
        if !(2..=MOST_NODES).contains(&nodes) {
            return Err(format!("{nodes} nodes along a side: expected 2 to {MOST_NODES}"));
        }
        let subject = &self.state.subject;
        let medium = self.runner.as_ref().map_or(&subject.start, Runner::best);
        let volume = match &subject.task {
            Some(task) => task.volume(medium, nodes),
            // The nodes are written as they are, whatever the space.
            None => medium.volume(Space::Cube { half: 1.0 }, nodes),
        };
        let volume = volume.map_err(|why| why.to_string())?;
        let files = files::write_volume(path, &volume).map_err(|why| why.to_string())?;
        let files: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
        let [x, y, z] = volume.grid.counts();
        Ok(format!("{x} × {y} × {z} nodes of the best field written to {}", files.join(" and ")))
    }
}
