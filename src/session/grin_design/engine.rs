//! The engine of the design of a gradient-index field. Its steps are those of a design without a
//! window: showing, pausing and writing the field change nothing.

use super::backup::{FieldBackup, NODES};
use super::document::{DocumentSource, GrinDocument};
use crate::files;
use crate::grin::Integrator;
use crate::grin_design::{Domain, GrinField, GrinOptimizer, GrinProgress};
use crate::session::clock::{Timed, time};
use crate::session::run::{Engine, EventSender, RunKind, RunStatus, thin_history};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// The maximum number of points of the history.
const MAX_HISTORY: usize = 3000;
/// The maximum number of nodes along a side of a volume that is written.
pub const MAX_NODES: usize = 513;

/// The open document and the state of its design.
#[derive(Debug, Clone)]
pub struct GrinRun {
    /// The open document.
    pub document: Arc<GrinDocument>,
    /// The field to show: the current one while the design is active, the best one afterwards.
    pub field: Arc<GrinField>,
    /// The outcome of the last step; `None` before the first.
    pub progress: Option<GrinProgress>,
    /// The loss against the step, with at most a few thousand points over the whole run.
    pub history: Arc<Vec<LossSample>>,
    /// The number of rays traced for the loss so far, each with its adjoint.
    pub rays: u64,
    /// The time of the steps without pauses, in seconds.
    pub seconds: f64,
    /// True if the best field is in a file as it is.
    pub saved: bool,
    /// The integrator of the rays of the first view and its step in mm; `None` for a volume.
    pub tracing: Option<(Integrator, f64)>,
}

/// A point of the history.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LossSample {
    /// The number of steps so far.
    pub step: usize,
    /// The loss of the field, by the rays of this step.
    pub current: f64,
    /// The loss of the best field, by the common evaluation rays.
    pub best: f64,
    /// The index of the refinement level.
    pub level: usize,
}

impl GrinRun {
    /// True if there is a designed field that is in no file as it is.
    pub fn is_unsaved(&self) -> bool {
        self.progress.is_some() && !self.saved
    }

    /// True if there is a task whose design has not taken a step yet.
    pub fn is_ready(&self) -> bool {
        self.document.task.is_some() && self.progress.is_none()
    }
}

/// A request to the design.
#[derive(Debug)]
pub(super) enum GrinRequest {
    /// Starts the design from its beginning.
    Start,
    /// Writes the best field with this many nodes along a side.
    Write(PathBuf, usize),
}

/// The outcome of writing a field.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::session) enum GrinExport {
    /// The file, and a text that describes it.
    Written(PathBuf, String),
    /// The reason of the failure.
    Failed(String),
}

/// The open document with its optimizer; a volume has none.
pub(super) struct GrinEngine {
    optimizer: Option<GrinOptimizer>,
    state: GrinRun,
    stride: usize,
    /// True once the design has ended.
    shows_best: bool,
    backup: Option<FieldBackup>,
    /// True after a backup that failed, which is reported once.
    has_failed: bool,
    sender: EventSender<GrinExport>,
}

/// A document to open.
#[derive(Debug, Clone)]
pub(super) struct GrinInput {
    pub(super) source: DocumentSource,
    /// The folder in which the best field is kept while the design goes on; `None` for none.
    pub(super) backups: Option<PathBuf>,
}

impl GrinEngine {
    pub(super) fn open(
        input: &GrinInput,
        sender: &EventSender<GrinExport>,
    ) -> Result<Self, String> {
        let (document, optimizer) = GrinDocument::open(&input.source)?;
        let state = GrinRun {
            field: Arc::new(document.start.clone()),
            document: Arc::new(document),
            progress: None,
            history: Arc::default(),
            rays: 0,
            seconds: 0.0,
            saved: false,
            tracing: optimizer.as_ref().map(GrinOptimizer::tracing),
        };
        Ok(Self {
            optimizer,
            state,
            stride: 1,
            shows_best: false,
            backup: input.backups.as_deref().map(FieldBackup::new),
            has_failed: false,
            sender: sender.clone(),
        })
    }

    /// Prepares for the first step.
    fn restart(&mut self) -> Result<(), String> {
        let Some(task) = &self.state.document.task else {
            return Err("a volume has no task to work on".to_owned());
        };
        if self.state.progress.is_some() {
            let optimizer = GrinOptimizer::new(task).map_err(|why| why.to_string())?;
            self.state.field = Arc::new(optimizer.current().clone());
            self.optimizer = Some(optimizer);
            self.state.progress = None;
            self.state.history = Arc::default();
            self.state.saved = false;
            (self.state.rays, self.state.seconds, self.stride) = (0, 0.0, 1);
        }
        Ok(())
    }

    fn record(&mut self, progress: &GrinProgress) {
        let GrinProgress { step, loss, best, level, finished, .. } = *progress;
        let history = Arc::make_mut(&mut self.state.history);
        if finished || step.is_multiple_of(self.stride) {
            history.push(LossSample { step, current: loss, best, level });
        }
        thin_history(history, &mut self.stride, MAX_HISTORY, |sample| sample.step);
    }

    /// Keeps the best field, so that it outlives a program that is killed.
    fn back_up(&mut self) {
        let (Some(backup), Some(optimizer)) = (&mut self.backup, &self.optimizer) else { return };
        let Some(task) = &self.state.document.task else { return };
        let volume = || task.volume(optimizer.best(), NODES).map_err(|why| why.to_string());
        let kept = backup.update(volume);
        if let Some(why) = kept.err().filter(|_| !self.has_failed) {
            self.has_failed = true;
            let text = format!("the field would be lost in a crash: {why}");
            self.sender.report(GrinExport::Failed(text));
        }
    }

    /// Writes the best field and describes what was written.
    fn write(&self, path: &Path, nodes: usize) -> Result<String, String> {
        let ends_in = |extension: &str| {
            path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension))
        };
        if !ends_in("npz") && !ends_in("json") {
            return Err(format!("{}: expected a name that ends in .npz or .json", path.display()));
        }
        if !(2..=MAX_NODES).contains(&nodes) {
            return Err(format!("{nodes} nodes along a side: expected 2 to {MAX_NODES}"));
        }
        let document = &self.state.document;
        let field = self.optimizer.as_ref().map_or(&document.start, GrinOptimizer::best);
        let volume = match &document.task {
            Some(task) => task.volume(field, nodes),
            // The nodes of a volume are written as they are, whatever the domain.
            None => field.volume(Domain::Cube { half: 1.0 }, nodes),
        };
        let volume = volume.map_err(|why| why.to_string())?;
        let files = files::write_volume(path, &volume).map_err(|why| why.to_string())?;
        let files: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
        let [x, y, z] = volume.grid.counts();
        Ok(format!("{x} × {y} × {z} nodes of the best field written to {}", files.join(" and ")))
    }
}

impl Engine for GrinEngine {
    const KIND: RunKind = RunKind::GrinDesign;
    const THREAD: &'static str = "grin";
    const INTERVAL: Duration = Duration::from_millis(100);
    const KEEPS_PREVIOUS: bool = true;

    type Input = GrinInput;
    type Request = GrinRequest;
    type Report = GrinExport;
    type Snapshot = GrinRun;

    /// A task waits for its start; a volume has nothing to design.
    fn initial_status(&self) -> RunStatus {
        if self.optimizer.is_some() { RunStatus::Paused } else { RunStatus::Stopped }
    }

    fn step(&mut self) -> Result<bool, String> {
        let Some(optimizer) = &mut self.optimizer else { return Ok(true) };
        let Timed { value, ms } = time(|| optimizer.step());
        let progress = value.map_err(|why| why.to_string())?;
        let finished = progress.finished;
        self.state.seconds += 1e-3 * ms;
        self.record(&progress);
        self.state.progress = Some(progress);
        self.state.saved = false;
        self.back_up();
        Ok(finished)
    }

    fn on_status(&mut self, status: RunStatus) -> Result<(), String> {
        self.shows_best = !status.is_active();
        // The best field is known once the one that the design was stopped at is evaluated.
        match &mut self.optimizer {
            Some(optimizer) if status == RunStatus::Stopped => {
                optimizer.finish().map_err(|why| why.to_string())
            }
            _ => Ok(()),
        }
    }

    fn handle(&mut self, request: GrinRequest) -> Result<Option<RunStatus>, String> {
        match request {
            GrinRequest::Start => {
                self.restart()?;
                Ok(Some(RunStatus::Running))
            }
            GrinRequest::Write(path, nodes) => {
                let written = self.write(&path, nodes);
                self.state.saved |= written.is_ok();
                if let Some(backup) = self.backup.as_mut().filter(|_| written.is_ok()) {
                    backup.remove();
                }
                self.sender.report(match written {
                    Ok(text) => GrinExport::Written(path, text),
                    Err(why) => GrinExport::Failed(why),
                });
                Ok(None)
            }
        }
    }

    fn close(&mut self) {
        if let Some(backup) = &mut self.backup {
            backup.remove();
        }
    }

    fn snapshot(&mut self) -> GrinRun {
        if let Some(optimizer) = &self.optimizer {
            let field = if self.shows_best { optimizer.best() } else { optimizer.current() };
            if *self.state.field != *field {
                self.state.field = Arc::new(field.clone());
            }
            self.state.rays = optimizer.rays_traced();
            self.state.tracing = Some(optimizer.tracing());
        }
        self.state.clone()
    }
}
