//! The gradient-index field of a session: a task that is designed in the background or a volume, and
//! the slices and images that show it.
//!
//! Four threads share the work: one takes the steps of the design, one computes slices, one traces
//! all light of the task, one renders the images of a field while no step is taken. Nothing is open at first, and
//! nothing is computed while no panel shows it.

mod backup;
mod contour;
mod document;
mod engine;
mod pictures;
mod slice;

pub use contour::Contour;
pub use document::{DocumentSource, GrinDocument};
pub(super) use engine::GrinExport;
pub use engine::{GrinRun, LossSample, MAX_NODES};
pub use pictures::GrinPictures;
pub use slice::{IndexProfile, Slice, SliceQuantity, SliceSettings};

use super::clock::{Throttle, Timed, time};
use super::run::{BackgroundRun, LatestRequestWorker, RunEvent, RunStatus, RunView};
use crate::grin_design::{GrinField, ViewReport};
use engine::{GrinEngine, GrinInput, GrinRequest};
use pictures::PictureWorker;
use serde::{Deserialize, Serialize};
use slice::{SliceRequest, compute_slice};
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// The shortest time between two traces of all light while a design takes steps.
const INTERVAL: Duration = Duration::from_secs(1);

/// The light of a task in a field, with the time that its trace took.
#[derive(Debug, Clone)]
pub struct GrinAnalysis {
    /// The document with the task.
    pub document: Arc<GrinDocument>,
    /// The field.
    pub field: Arc<GrinField>,
    /// The light of every view.
    pub views: Timed<Vec<ViewReport>>,
}

/// The gradient-index field of a session as panels see it.
#[derive(Debug, Clone, Default)]
pub struct GrinView {
    /// The open document and its design.
    pub run: RunView<GrinRun>,
    /// True while a document is being opened.
    pub opening: bool,
    /// True while a field is being written.
    pub writing: bool,
    /// The settings of the slice.
    pub slice_settings: SliceSettings,
    /// True if a panel shows the field.
    pub is_active: bool,
    /// The newest slice, maybe of an earlier step or setting; or the reason why there is none.
    pub slice: Option<Arc<Result<Slice, String>>>,
    /// The light of the task, maybe of an earlier step; or the reason why it cannot be traced.
    pub analysis: Option<Arc<Result<GrinAnalysis, String>>>,
    /// The rendered images of the field that the newest analysis is of, once it is at rest; or the
    /// reason why there are none.
    pub pictures: Option<Arc<Result<GrinPictures, String>>>,
}

/// The gradient-index field of a session.
#[derive(Debug)]
pub(super) struct GrinState {
    run: BackgroundRun<GrinEngine>,
    slices: LatestRequestWorker<SliceRequest, Result<Slice, String>>,
    analyses:
        LatestRequestWorker<(Arc<GrinDocument>, Arc<GrinField>), Result<GrinAnalysis, String>>,
    pictures: PictureWorker,
    writing: bool,
    slice_settings: SliceSettings,
    is_active: bool,
    document: Option<Arc<GrinDocument>>,
    /// The slice and the field whose light were requested last.
    requested_slice: Option<SliceRequest>,
    requested_field: Option<Arc<GrinField>>,
    throttle: Throttle,
    /// The folder in which fields are kept while they are designed.
    backups: Option<PathBuf>,
}

impl GrinState {
    pub(super) fn spawn(wake: impl Fn() + Send + Clone + 'static) -> io::Result<Self> {
        let open = |input, sender: &_| GrinEngine::open(&input, sender);
        let slice = |request| Ok(compute_slice(request));
        let analyze = |(document, field)| analyze(&document, field);
        Ok(Self {
            run: BackgroundRun::spawn(wake.clone(), open)?,
            slices: LatestRequestWorker::spawn_function("slice", wake.clone(), slice)?,
            analyses: LatestRequestWorker::spawn_function("light", wake.clone(), analyze)?,
            pictures: PictureWorker::spawn(wake)?,
            writing: false,
            slice_settings: SliceSettings::default(),
            is_active: false,
            document: None,
            requested_slice: None,
            requested_field: None,
            throttle: Throttle::new(INTERVAL),
            backups: None,
        })
    }

    /// Keeps fields in a folder while they are designed from now on, and opens the one that a killed
    /// program has left there. Returns its file.
    pub(super) fn set_backup_folder(&mut self, folder: PathBuf) -> Option<PathBuf> {
        let left = backup::take_interrupted(&folder);
        self.backups = Some(folder);
        if let Some(file) = &left {
            self.open(DocumentSource::File(file.clone()));
        }
        left
    }

    fn open(&mut self, source: DocumentSource) {
        self.run.start(GrinInput { source, backups: self.backups.clone() });
    }

    /// Carries out a command, or returns the reason why that is impossible.
    pub(super) fn handle(&mut self, command: GrinCommand) -> Result<(), String> {
        match command {
            GrinCommand::OpenFile(path) => self.open(DocumentSource::File(path)),
            GrinCommand::OpenBuiltin(name) => self.open(DocumentSource::Builtin(name)),
            GrinCommand::Start => self.start()?,
            GrinCommand::Pause => self.run.pause(),
            GrinCommand::Resume => self.run.resume(),
            GrinCommand::Stop => self.run.stop(),
            GrinCommand::Save { path, nodes } => {
                if self.run.snapshot().is_none() {
                    return Err("there is no field to save; open a task first".to_owned());
                }
                self.writing = true;
                self.run.send_request(GrinRequest::Write(path, nodes));
            }
            GrinCommand::Close => {
                self.run.clear();
                self.reset_requests();
            }
            GrinCommand::SetSlice(settings) => {
                let run = self.run.snapshot();
                self.slice_settings =
                    run.map_or(settings, |run| run.document.clamp_slice(settings));
            }
            GrinCommand::SetActive(is_active) => self.is_active = is_active,
        }
        Ok(())
    }

    fn start(&mut self) -> Result<(), String> {
        let run = self.run.snapshot().ok_or("there is no task to work on; open one first")?;
        if run.document.task.is_none() {
            return Err("a volume has no task to work on".to_owned());
        }
        self.run.restart(GrinRequest::Start);
        Ok(())
    }

    fn reset_requests(&mut self) {
        self.requested_slice = None;
        self.requested_field = None;
        self.pictures.reset();
    }

    /// The events of the document and its design since the last call.
    pub(super) fn drain_events(&mut self) -> Vec<RunEvent<GrinExport>> {
        let events = self.run.drain_events();
        if events.iter().any(|event| matches!(event, RunEvent::Report(_))) {
            self.writing = false;
        }
        self.update_document();
        events
    }

    /// Chooses the slice of a document that has just been opened.
    fn update_document(&mut self) {
        let document = self.run.snapshot().map(|run| Arc::clone(&run.document));
        let is_known = match (&document, &self.document) {
            (Some(new), Some(old)) => Arc::ptr_eq(new, old),
            (new, _) => new.is_none(),
        };
        if let Some(document) = document.as_ref().filter(|_| !is_known) {
            self.reset_requests();
            self.slice_settings = document.default_slice();
        }
        self.document = document;
    }

    /// Requests what panels show of the field.
    pub(super) fn sync(&mut self) {
        let Some(run) = self.run.snapshot().filter(|_| self.is_active) else {
            return self.pictures.pause();
        };
        let (document, field) = (Arc::clone(&run.document), Arc::clone(&run.field));
        let request = SliceRequest { document, field, settings: self.slice_settings };
        if !self.requested_slice.as_ref().is_some_and(|last| last.matches(&request)) {
            self.requested_slice = Some(request.clone());
            self.slices.request(request);
        }
        self.request_analysis(&run);
        let has_task = run.document.task.is_some();
        if has_task && self.run.status() != RunStatus::Running {
            self.pictures.request(&run.document, &run.field);
        } else {
            self.pictures.pause();
        }
    }

    /// Requests the light of the task: seldom while the field changes all the time.
    fn request_analysis(&mut self, run: &GrinRun) {
        let last = self.requested_field.as_ref();
        if last.is_some_and(|field| Arc::ptr_eq(field, &run.field)) || run.document.task.is_none() {
            return;
        }
        let is_busy = last.is_some() && self.analysis().is_none();
        let is_running = self.run.status() == RunStatus::Running;
        if !is_running || !is_busy && self.throttle.ready() {
            self.requested_field = Some(Arc::clone(&run.field));
            self.analyses.request((Arc::clone(&run.document), Arc::clone(&run.field)));
        }
    }

    pub(super) fn view(&self) -> GrinView {
        let run = self.run.view();
        let is_shown = |slice: &Slice| {
            run.snapshot.as_ref().is_some_and(|run| Arc::ptr_eq(&slice.document, &run.document))
        };
        let slice = self.slices.latest().filter(|_| self.requested_slice.is_some());
        let analysis = self.analysis();
        let seen = analysis.as_deref().and_then(|analysis| analysis.as_ref().ok());
        GrinView {
            pictures: seen.and_then(|analysis| self.pictures.of(&analysis.field)),
            opening: self.run.is_starting(),
            writing: self.writing,
            slice_settings: self.slice_settings,
            is_active: self.is_active,
            slice: slice.filter(|slice| slice.as_ref().as_ref().map_or(true, is_shown)),
            analysis,
            run,
        }
    }

    /// The newest trace of all light, if it is of the open document.
    fn analysis(&self) -> Option<Arc<Result<GrinAnalysis, String>>> {
        let run = self.run.snapshot()?;
        let is_shown = |analysis: &GrinAnalysis| Arc::ptr_eq(&analysis.document, &run.document);
        let latest = self.analyses.latest().filter(|_| self.requested_field.is_some());
        latest.filter(|latest| latest.as_ref().as_ref().map_or(true, is_shown))
    }
}

/// Traces all light of a task.
fn analyze(document: &Arc<GrinDocument>, field: Arc<GrinField>) -> Result<GrinAnalysis, String> {
    let Some(task) = &document.task else { return Err("a volume has no light".to_owned()) };
    let Timed { value, ms } = time(|| task.report_views(&field));
    let value = value.map_err(|why| why.to_string())?;
    Ok(GrinAnalysis { document: Arc::clone(document), field, views: Timed { value, ms } })
}

/// A command for the gradient-index field that is open.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GrinCommand {
    /// Opens a task or a volume from a file in place of the open document.
    OpenFile(PathBuf),
    /// Opens a built-in task.
    OpenBuiltin(String),
    /// Starts the design of the field from its beginning.
    Start,
    /// Pauses the design after its current step.
    Pause,
    /// Resumes the design.
    Resume,
    /// Stops the design and evaluates the current field; the best one remains.
    Stop,
    /// Writes the best field: `.npz`, or `.json` with the numbers beside it in `.raw`.
    Save {
        /// The file.
        path: PathBuf,
        /// The number of nodes along a side, for a field that is a spline in one coordinate.
        nodes: usize,
    },
    /// Closes the document.
    Close,
    /// Sets the slice to show.
    SetSlice(SliceSettings),
    /// Sets whether a panel shows the field; otherwise no slices and images are computed.
    SetActive(bool),
}
