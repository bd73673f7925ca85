//! A search in the background: orders in, news out, and dropping the handle ends the thread.
//!
//! The search works on its own copy of the lens. How far it is sits in a newest-value slot, so a
//! slow window never holds it up; small news travels as events. The window is woken at most
//! thirty times a second, and at once where something ends.

use super::background::{Background, Outbox, Work, guarded};
use super::clock::Throttle;
use super::slot::Slot;
use crate::lens::Lens;
use crate::merit::{Goal, TermValue};
use crate::optimize::{DescentMethod, OptimizationProgress, Optimizer};
use std::io;
use std::sync::Arc;
use std::time::Duration;

/// The time between two looks of the window, at least.
const BETWEEN: Duration = Duration::from_millis(33);
/// How many points of the merit history are kept; beyond that every second one goes.
const HISTORY: usize = 2000;

/// What a search is to do.
#[derive(Debug, Clone, PartialEq)]
pub struct OptimizationRequest {
    /// How to search.
    pub method: DescentMethod,
    /// From where.
    pub lens: Arc<Lens>,
    /// What for.
    pub goal: Goal,
    /// How exact the merit has to be, relative to the size of the spots.
    pub tolerance: f64,
}

/// Begins a search.
pub type OptimizerFactory =
    dyn Fn(&OptimizationRequest) -> Result<Box<dyn Optimizer>, String> + Send;

/// How a search stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunStatus {
    /// It takes steps.
    Running,
    /// It is held and can go on.
    Paused,
    /// It was ended.
    Stopped,
    /// Further steps would change nothing.
    Finished,
}

impl RunStatus {
    /// Whether it goes on or can.
    pub const fn is_active(self) -> bool {
        matches!(self, Self::Running | Self::Paused)
    }
}

/// How far a search is.
#[derive(Debug, Clone)]
pub struct OptimizationSnapshot {
    /// Which search of the session it is, counted from 1.
    pub number: u64,
    /// How it stands.
    pub status: RunStatus,
    /// What it was told to do, with the lens it started from.
    pub request: Arc<OptimizationRequest>,
    /// What its last step did; `None` before the first.
    pub progress: Option<OptimizationProgress>,
    /// The best lens so far.
    pub best: Arc<Lens>,
    /// The lens at the current step.
    pub current: Arc<Lens>,
    /// Every term of the merit for the lens it started from.
    pub initial_terms: Vec<TermValue>,
    /// Every term of the merit for the best lens so far.
    pub best_terms: Vec<TermValue>,
    /// The merit against the step, at most a few thousand points of the whole way.
    pub history: Vec<MeritSample>,
}

/// A point of the merit history.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeritSample {
    /// Steps so far.
    pub step: usize,
    /// Merit of the current lens.
    pub current: f64,
    /// Merit of the best lens so far.
    pub best: f64,
}

/// What happened to a search; each carries its number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum News {
    Started(u64),
    Paused(u64),
    Resumed(u64),
    Stopped(u64),
    Finished(u64),
    Failed(u64, String),
}

/// What a search is told.
#[derive(Debug)]
enum Order {
    Start { number: u64, task: OptimizationRequest },
    Pause,
    Resume,
    Step,
    Stop,
}

/// The handle of the thread that searches.
#[derive(Debug)]
pub(super) struct Worker {
    thread: Background<Order, News>,
    search: Slot<OptimizationSnapshot>,
}

impl Worker {
    /// Starts the thread. `wake` is called from it when there is something new to look at.
    pub(super) fn spawn(
        start: Box<OptimizerFactory>,
        wake: impl Fn() + Send + 'static,
    ) -> io::Result<Self> {
        let search = Slot::default();
        let shown = search.clone();
        let desk =
            |outbox| Desk { outbox, search: shown, start, pace: Throttle::new(BETWEEN), run: None };
        Ok(Self { thread: Background::spawn("optimizer", wake, desk)?, search })
    }

    pub(super) fn start(&self, number: u64, task: OptimizationRequest) {
        self.thread.tell(Order::Start { number, task });
    }

    pub(super) fn pause(&self) {
        self.thread.tell(Order::Pause);
    }

    pub(super) fn resume(&self) {
        self.thread.tell(Order::Resume);
    }

    pub(super) fn step(&self) {
        self.thread.tell(Order::Step);
    }

    pub(super) fn stop(&self) {
        self.thread.tell(Order::Stop);
    }

    /// How far the search is.
    pub(super) fn search(&self) -> Option<Arc<OptimizationSnapshot>> {
        self.search.latest()
    }

    /// What happened since the last look.
    pub(super) fn news(&self) -> Vec<News> {
        self.thread.news()
    }
}

/// What the thread works with.
struct Desk {
    outbox: Outbox<News>,
    search: Slot<OptimizationSnapshot>,
    start: Box<OptimizerFactory>,
    pace: Throttle,
    run: Option<Run>,
}

/// A search under way.
struct Run {
    optimizer: Box<dyn Optimizer>,
    state: OptimizationSnapshot,
    stride: usize,
}

impl Work for Desk {
    type Order = Order;

    fn is_running(&self) -> bool {
        self.run.as_ref().is_some_and(|run| run.state.status == RunStatus::Running)
    }

    fn obey(&mut self, order: Order) {
        self.run = match (order, self.run.take()) {
            (Order::Start { number, task }, _) => self.begin(number, task),
            (order, Some(run)) => self.steer(&order, run),
            (_, None) => None,
        };
    }

    fn advance(&mut self) {
        self.run = self.run.take().and_then(|run| self.step(run));
    }
}

impl Desk {
    fn begin(&self, number: u64, task: OptimizationRequest) -> Option<Run> {
        match guarded(|| (self.start)(&task)) {
            Ok(optimizer) => {
                let before = optimizer.terms().unwrap_or_default();
                let merit = before.iter().map(|term| term.weight * term.value).sum();
                let start = MeritSample { step: 0, current: merit, best: merit };
                let state = OptimizationSnapshot {
                    number,
                    status: RunStatus::Running,
                    progress: None,
                    best: Arc::clone(&task.lens),
                    current: Arc::clone(&task.lens),
                    request: Arc::new(task),
                    initial_terms: before,
                    best_terms: Vec::new(),
                    history: vec![start],
                };
                let run = Run { optimizer, state, stride: 1 };
                self.tell(&run, News::Started(number));
                Some(run)
            }
            Err(why) => {
                self.outbox.emit(News::Failed(number, why));
                None
            }
        }
    }

    fn steer(&mut self, order: &Order, mut run: Run) -> Option<Run> {
        let number = run.state.number;
        match (order, run.state.status) {
            (Order::Pause, RunStatus::Running) => {
                run.state.status = RunStatus::Paused;
                self.tell(&run, News::Paused(number));
            }
            (Order::Resume, RunStatus::Paused) => {
                run.state.status = RunStatus::Running;
                self.tell(&run, News::Resumed(number));
            }
            (Order::Step, RunStatus::Paused) => {
                run = self.step(run)?;
                self.publish(&run);
            }
            (Order::Stop, RunStatus::Running | RunStatus::Paused) => {
                run.state.status = RunStatus::Stopped;
                run.optimizer.verify_best();
                self.tell(&run, News::Stopped(number));
                return None;
            }
            _ => {}
        }
        Some(run)
    }

    /// Takes one step; `None` where the search is over.
    fn step(&mut self, mut run: Run) -> Option<Run> {
        let number = run.state.number;
        let stepped = guarded(|| {
            run.step();
            Ok(())
        });
        if let Err(why) = stepped {
            run.state.status = RunStatus::Stopped;
            self.tell(&run, News::Failed(number, why));
            return None;
        }
        if run.state.progress.as_ref().is_some_and(|progress| progress.finished) {
            run.state.status = RunStatus::Finished;
            self.tell(&run, News::Finished(number));
            return None;
        }
        if self.pace.ready() {
            self.publish(&run);
        }
        Some(run)
    }

    /// Shows how far the search is, then says what happened.
    fn tell(&self, run: &Run, news: News) {
        self.search.set(run.snapshot());
        self.outbox.emit(news);
    }

    fn publish(&self, run: &Run) {
        self.search.set(run.snapshot());
        self.outbox.wake();
    }
}

impl Run {
    fn step(&mut self) {
        let progress = self.optimizer.step();
        if progress.step.is_multiple_of(self.stride) || progress.finished {
            let OptimizationProgress { step, merit: current, best, .. } = progress;
            self.state.history.push(MeritSample { step, current, best });
        }
        if self.state.history.len() > HISTORY {
            self.stride *= 2;
            self.state.history.retain(|merit| merit.step.is_multiple_of(self.stride));
        }
        self.state.progress = Some(progress);
    }

    fn snapshot(&self) -> OptimizationSnapshot {
        OptimizationSnapshot {
            best: Arc::new(self.optimizer.best().clone()),
            current: Arc::new(self.optimizer.current().clone()),
            best_terms: self.optimizer.terms().unwrap_or_default(),
            ..self.state.clone()
        }
    }
}
