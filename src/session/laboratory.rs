//! An experiment in the background: a request in, its newest state out, and dropping the handle
//! ends the thread.
//!
//! A new request takes the place of the experiment that runs. An experiment is told to stop between
//! two of its steps.

use super::background::said;
use super::clock::{Throttle, Timed, time};
use super::slot::{LatestRequest, Slot};
use crate::experiments::{
    Effort, Experiment, ExperimentError, ExperimentOutcome, ExperimentProgress, ExperimentReport,
};
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
pub struct ExperimentRun {
    /// Which trial of the session it is, counted from 1.
    pub number: u64,
    /// The experiment.
    pub experiment: &'static Experiment,
    /// How it stands.
    pub status: ExperimentStatus,
}

/// How an experiment stands.
#[derive(Debug, Clone)]
pub enum ExperimentStatus {
    /// It works.
    Running {
        /// The part that is done, 0 to 1.
        done: f64,
        /// What it is doing.
        doing: String,
    },
    /// It has found something.
    Done(Arc<ExperimentReport>),
    /// It was told to stop.
    Stopped,
    /// It could not be carried out.
    Failed(String),
}

/// What is wanted.
#[derive(Debug)]
struct ExperimentRequest {
    number: u64,
    experiment: &'static Experiment,
    effort: Effort,
    cancelled: Arc<AtomicBool>,
}

/// The handle of the thread that experiments.
#[derive(Debug)]
pub(super) struct ExperimentWorker {
    requests: Arc<LatestRequest<ExperimentRequest>>,
    run: Slot<ExperimentRun>,
    cancelled: Arc<AtomicBool>,
    begun: u64,
    /// The last trial, unless it was put away.
    shown: Option<u64>,
    thread: Option<JoinHandle<()>>,
}

impl ExperimentWorker {
    /// Starts the thread. `wake` is called from it when there is something new to look at.
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let requests = Arc::new(LatestRequest::new());
        let trial = Slot::default();
        let (inbox, outbox) = (Arc::clone(&requests), trial.clone());
        let thread = thread::Builder::new().name("laboratory".into()).spawn(move || {
            while let Some(request) = inbox.take() {
                run_experiment(&request, &inbox, &outbox, &wake);
            }
        })?;
        let cancelled = Arc::default();
        Ok(Self { requests, run: trial, cancelled, begun: 0, shown: None, thread: Some(thread) })
    }

    /// Begins an experiment in place of the one that runs.
    pub(super) fn start(&mut self, study: &'static Experiment, effort: Effort) {
        self.cancel();
        self.cancelled = Arc::default();
        self.begun += 1;
        self.shown = Some(self.begun);
        let (number, cancelled) = (self.begun, Arc::clone(&self.cancelled));
        self.run.set(ExperimentRun {
            number,
            experiment: study,
            status: ExperimentStatus::waiting(),
        });
        self.requests.submit(ExperimentRequest { number, experiment: study, effort, cancelled });
    }

    /// Tells the experiment to stop.
    pub(super) fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Ends the experiment and forgets what it found.
    pub(super) fn dismiss(&mut self) {
        self.cancel();
        self.shown = None;
    }

    /// The last experiment, unless it was put away.
    pub(super) fn run(&self) -> Option<Arc<ExperimentRun>> {
        self.run.latest().filter(|trial| Some(trial.number) == self.shown)
    }
}

impl Drop for ExperimentWorker {
    fn drop(&mut self) {
        self.cancel();
        self.requests.close();
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap_or_default();
        }
    }
}

impl ExperimentStatus {
    fn waiting() -> Self {
        Self::Running { done: 0.0, doing: String::new() }
    }
}

/// Carries an experiment out and shows how far it is.
fn run_experiment(
    request: &ExperimentRequest,
    inbox: &LatestRequest<ExperimentRequest>,
    outbox: &Slot<ExperimentRun>,
    wake: &(impl Fn() + Send),
) {
    let ExperimentRequest { number, experiment: study, effort, ref cancelled } = *request;
    let unwanted = || inbox.is_interrupted() || cancelled.load(Ordering::Relaxed);
    let show = |stage: ExperimentStatus| {
        outbox.set(ExperimentRun { number, experiment: study, status: stage });
        wake();
    };
    let mut pace = Throttle::new(BETWEEN);
    let mut watch = |ExperimentProgress { done, doing }: ExperimentProgress<'_>| {
        if unwanted() {
            return ControlFlow::Break(());
        }
        if pace.ready() {
            show(ExperimentStatus::Running { done, doing: doing.to_owned() });
        }
        ControlFlow::Continue(())
    };
    let run = AssertUnwindSafe(|| time(|| (study.run)(effort, &mut watch)));
    let stage = match catch_unwind(run) {
        Ok(ended) => ExperimentStatus::after(study, ended),
        Err(panic) => ExperimentStatus::Failed(said(panic.as_ref())),
    };
    // The place belongs to the next one by now, where there is one.
    if !inbox.is_interrupted() {
        show(stage);
    }
}

impl ExperimentStatus {
    fn after(study: &Experiment, ended: Timed<Result<ExperimentOutcome, ExperimentError>>) -> Self {
        match ended.value {
            Ok(outcome) => Self::Done(Arc::new(ExperimentReport::new(study, outcome, ended.ms))),
            Err(ExperimentError::Stopped) => Self::Stopped,
            Err(ExperimentError::Failed(why)) => Self::Failed(why),
        }
    }
}
