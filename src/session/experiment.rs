//! Experiments in the background; a new one replaces the one that runs.
//!
//! An experiment is stopped between two of its steps.

use super::clock::{Throttle, Timed, time};
use super::run::{LatestRequestWorker, WorkerOutput, catch_panic};
use crate::experiments::{
    Effort, Experiment, ExperimentError, ExperimentOutcome, ExperimentProgress, ExperimentReport,
};
use std::io;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The shortest time between two states of a running experiment.
const INTERVAL: Duration = Duration::from_millis(50);

/// An experiment that was started.
#[derive(Debug, Clone)]
pub struct ExperimentRun {
    /// The number of the run among those of the session, counted from 1.
    pub number: u64,
    /// The experiment.
    pub experiment: &'static Experiment,
    /// The status of the run.
    pub status: ExperimentStatus,
}

/// The status of an experiment.
#[derive(Debug, Clone)]
pub enum ExperimentStatus {
    /// It is being carried out.
    Running {
        /// The fraction that is done, 0 to 1.
        done: f64,
        /// The step that is being carried out.
        doing: String,
    },
    /// It has been carried out.
    Done(Arc<ExperimentReport>),
    /// It was stopped.
    Stopped,
    /// It could not be carried out for this reason.
    Failed(String),
}

/// A request for an experiment.
#[derive(Debug)]
struct ExperimentRequest {
    number: u64,
    experiment: &'static Experiment,
    effort: Effort,
    cancelled: Arc<AtomicBool>,
}

/// Carries out experiments in the background.
#[derive(Debug)]
pub(super) struct ExperimentWorker {
    worker: LatestRequestWorker<ExperimentRequest, ExperimentRun>,
    cancelled: Arc<AtomicBool>,
    /// The number of experiments so far.
    count: u64,
    /// The last experiment, unless it was dismissed.
    shown: Option<u64>,
}

impl ExperimentWorker {
    /// Starts the thread. `wake` is called from it when there is something new to show.
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let worker = LatestRequestWorker::spawn("experiment", wake, |request, output| {
            run_experiment(&request, output);
        })?;
        Ok(Self { worker, cancelled: Arc::default(), count: 0, shown: None })
    }

    /// Starts an experiment in place of the one that runs.
    pub(super) fn start(&mut self, experiment: &'static Experiment, effort: Effort) {
        self.cancel();
        self.cancelled = Arc::default();
        self.count += 1;
        self.shown = Some(self.count);
        let (number, cancelled) = (self.count, Arc::clone(&self.cancelled));
        let status = ExperimentStatus::Running { done: 0.0, doing: String::new() };
        self.worker.publish(ExperimentRun { number, experiment, status });
        self.worker.request(ExperimentRequest { number, experiment, effort, cancelled });
    }

    /// Stops the experiment.
    pub(super) fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Stops the experiment and dismisses its results.
    pub(super) fn dismiss(&mut self) {
        self.cancel();
        self.shown = None;
    }

    /// The last experiment, unless it was dismissed.
    pub(super) fn run(&self) -> Option<Arc<ExperimentRun>> {
        self.worker.latest().filter(|run| Some(run.number) == self.shown)
    }
}

impl Drop for ExperimentWorker {
    fn drop(&mut self) {
        self.cancel();
    }
}

/// Carries out an experiment and publishes its progress.
fn run_experiment(
    request: &ExperimentRequest,
    output: &WorkerOutput<ExperimentRequest, ExperimentRun>,
) {
    let ExperimentRequest { number, experiment, effort, ref cancelled } = *request;
    let is_cancelled = || output.is_interrupted() || cancelled.load(Ordering::Relaxed);
    let show = |status| output.publish(ExperimentRun { number, experiment, status });
    let mut throttle = Throttle::new(INTERVAL);
    let mut watch = |ExperimentProgress { done, doing }: ExperimentProgress<'_>| {
        if is_cancelled() {
            return ControlFlow::Break(());
        }
        if throttle.ready() {
            show(ExperimentStatus::Running { done, doing: doing.to_owned() });
        }
        ControlFlow::Continue(())
    };
    let run = catch_panic(|| Ok(time(|| (experiment.run)(effort, &mut watch))));
    let status = match run {
        Ok(ended) => ExperimentStatus::after(experiment, ended),
        Err(why) => ExperimentStatus::Failed(why),
    };
    // The state of a newer experiment is not to be replaced.
    if !output.is_interrupted() {
        show(status);
    }
}

impl ExperimentStatus {
    fn after(
        experiment: &Experiment,
        ended: Timed<Result<ExperimentOutcome, ExperimentError>>,
    ) -> Self {
        match ended.value {
            Ok(outcome) => {
                Self::Done(Arc::new(ExperimentReport::new(experiment, outcome, ended.ms)))
            }
            Err(ExperimentError::Stopped) => Self::Stopped,
            Err(ExperimentError::Failed(why)) => Self::Failed(why),
        }
    }
}
