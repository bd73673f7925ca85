//! An experiment in the background: a request in, its newest state out, and dropping the handle
//! ends the thread.
//!
//! A new request takes the place of the experiment that runs. An experiment is told to stop between
//! two of its steps.

use super::background::said;
use super::clock::{Pace, Timed, timed};
use super::slot::{Mailbox, Slot};
use crate::experiments::{Effort, Ended, Experiment, Outcome, Progress, Report};
use std::io;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// The time between two looks of the window, at least.
const BETWEEN: Duration = Duration::from_millis(50);

/// An experiment that was begun.
#[derive(Debug, Clone)]
pub struct Trial {
    /// Which trial of the session it is, counted from 1.
    pub number: u64,
    /// The experiment.
    pub study: &'static Experiment,
    /// How it stands.
    pub stage: Stage,
}

/// How an experiment stands.
#[derive(Debug, Clone)]
pub enum Stage {
    /// It works.
    Running {
        /// The part that is done, 0 to 1.
        done: f64,
        /// What it is doing.
        doing: String,
    },
    /// It has found something.
    Done(Arc<Report>),
    /// It was told to stop.
    Stopped,
    /// It could not be carried out.
    Failed(String),
}

/// What is wanted.
#[derive(Debug)]
struct Request {
    number: u64,
    study: &'static Experiment,
    effort: Effort,
    cancelled: Arc<AtomicBool>,
}

/// The handle of the thread that experiments.
#[derive(Debug)]
pub(super) struct Laboratory {
    requests: Arc<Mailbox<Request>>,
    trial: Slot<Trial>,
    cancelled: Arc<AtomicBool>,
    begun: u64,
    /// The last trial, unless it was put away.
    shown: Option<u64>,
    thread: Option<JoinHandle<()>>,
}

impl Laboratory {
    /// Starts the thread. `wake` is called from it when there is something new to look at.
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let requests = Arc::new(Mailbox::new());
        let trial = Slot::default();
        let (inbox, outbox) = (Arc::clone(&requests), trial.clone());
        let thread = thread::Builder::new().name("laboratory".into()).spawn(move || {
            while let Some(request) = inbox.take() {
                carry_out(&request, &inbox, &outbox, &wake);
            }
        })?;
        let cancelled = Arc::default();
        Ok(Self { requests, trial, cancelled, begun: 0, shown: None, thread: Some(thread) })
    }

    /// Begins an experiment in place of the one that runs.
    pub(super) fn begin(&mut self, study: &'static Experiment, effort: Effort) {
        self.cancel();
        self.cancelled = Arc::default();
        self.begun += 1;
        self.shown = Some(self.begun);
        let (number, cancelled) = (self.begun, Arc::clone(&self.cancelled));
        self.trial.set(Trial { number, study, stage: Stage::waiting() });
        self.requests.put(Request { number, study, effort, cancelled });
    }

    /// Tells the experiment to stop.
    pub(super) fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Ends the experiment and forgets what it found.
    pub(super) fn put_away(&mut self) {
        self.cancel();
        self.shown = None;
    }

    /// The last experiment, unless it was put away.
    pub(super) fn trial(&self) -> Option<Arc<Trial>> {
        self.trial.latest().filter(|trial| Some(trial.number) == self.shown)
    }
}

impl Drop for Laboratory {
    fn drop(&mut self) {
        self.cancel();
        self.requests.close();
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap_or_default();
        }
    }
}

impl Stage {
    fn waiting() -> Self {
        Self::Running { done: 0.0, doing: String::new() }
    }
}

/// Carries an experiment out and shows how far it is.
fn carry_out(
    request: &Request,
    inbox: &Mailbox<Request>,
    outbox: &Slot<Trial>,
    wake: &(impl Fn() + Send),
) {
    let Request { number, study, effort, ref cancelled } = *request;
    let unwanted = || inbox.interrupts() || cancelled.load(Ordering::Relaxed);
    let show = |stage: Stage| {
        outbox.set(Trial { number, study, stage });
        wake();
    };
    let mut pace = Pace::new(BETWEEN);
    let mut watch = |Progress { done, doing }: Progress<'_>| {
        if unwanted() {
            return ControlFlow::Break(());
        }
        if pace.is_due() {
            show(Stage::Running { done, doing: doing.to_owned() });
        }
        ControlFlow::Continue(())
    };
    let run = AssertUnwindSafe(|| timed(|| (study.run)(effort, &mut watch)));
    let stage = match catch_unwind(run) {
        Ok(ended) => Stage::after(study, ended),
        Err(panic) => Stage::Failed(said(panic.as_ref())),
    };
    // The place belongs to the next one by now, where there is one.
    if !inbox.interrupts() {
        show(stage);
    }
}

impl Stage {
    fn after(study: &Experiment, ended: Timed<Result<Outcome, Ended>>) -> Self {
        match ended.value {
            Ok(outcome) => Self::Done(Arc::new(Report::new(study, outcome, ended.ms))),
            Err(Ended::Stopped) => Self::Stopped,
            Err(Ended::Failed(why)) => Self::Failed(why),
        }
    }
}
