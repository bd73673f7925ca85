//! The gradient-index field of a session: a task that is worked on in the background, or a volume to
//! look at; and what is seen of it.
//!
//! Three threads share the work: one takes the steps of the search, one lays slices, one follows all
//! light of the task. Nothing is open at first, and what nobody looks at is not computed.

mod contour;
mod former;
mod observer;
mod sight;
mod slice;
mod subject;
mod wish;

pub use contour::Contour;
pub(super) use former::Told;
pub use former::{GrinRun, LossSample, MAX_NODES};
pub use sight::{SliceQuantity, SliceSettings};
pub use slice::{IndexProfile, Slice};
pub use subject::{DocumentSource, GrinDocument};
pub use wish::GrinCommand;

use super::clock::{Throttle, Timed, time};
use super::worker::RunStatus;
use crate::grin_design::{GrinField, ViewReport};
use former::Former;
use observer::LatestRequestWorker;
use slice::{SliceRequest, compute_slice};
use std::io;
use std::sync::Arc;
use std::time::Duration;

/// The time between two looks at all light while a search runs, at least.
const BETWEEN: Duration = Duration::from_secs(1);

/// All light of a task in a field, and how long that took.
#[derive(Debug, Clone)]
pub struct GrinAnalysis {
    /// The task.
    pub document: Arc<GrinDocument>,
    /// The field.
    pub field: Arc<GrinField>,
    /// Every view of the task.
    pub views: Timed<Vec<ViewReport>>,
}

/// What is known about the gradient-index field.
#[derive(Debug, Clone, Default)]
pub struct GrinView {
    /// What is open, and how far its search is.
    pub run: Option<Arc<GrinRun>>,
    /// Whether something is being opened.
    pub opening: bool,
    /// Whether a field is being written.
    pub writing: bool,
    /// How the search will stand once its step is done, where it was told so.
    pub pending: Option<RunStatus>,
    /// Why the last thing could not be opened, or why its search broke.
    pub error: Option<String>,
    /// How it is looked at.
    pub slice_settings: SliceSettings,
    /// Whether it is looked at.
    pub is_active: bool,
    /// The newest slice, maybe of a step or a sight before; or why there is none.
    pub slice: Option<Arc<Result<Slice, String>>>,
    /// All light of the task, maybe some steps before; or why that cannot be seen.
    pub analysis: Option<Arc<Result<GrinAnalysis, String>>>,
}

/// What a session keeps of it.
#[derive(Debug)]
pub(super) struct GrinState {
    former: Former,
    slicer: LatestRequestWorker<SliceRequest, Slice>,
    viewer: LatestRequestWorker<(Arc<GrinDocument>, Arc<GrinField>), GrinAnalysis>,
    /// How many were asked for.
    count: u64,
    /// What is open.
    number: Option<u64>,
    /// What was asked for and is not open yet.
    opening: Option<u64>,
    writing: bool,
    pending: Option<RunStatus>,
    error: Option<String>,
    slice_settings: SliceSettings,
    is_active: bool,
    /// The slice and the field whose light was asked for.
    asked: Option<SliceRequest>,
    followed: Option<Arc<GrinField>>,
    pace: Throttle,
}

impl GrinState {
    pub(super) fn spawn(wake: impl Fn() + Send + Clone + 'static) -> io::Result<Self> {
        Ok(Self {
            former: Former::spawn(wake.clone())?,
            slicer: LatestRequestWorker::spawn("slice", wake.clone(), |wanted| {
                Ok(compute_slice(wanted))
            })?,
            viewer: LatestRequestWorker::spawn("light", wake, |(subject, medium)| {
                sighting(&subject, medium)
            })?,
            count: 0,
            number: None,
            opening: None,
            writing: false,
            pending: None,
            error: None,
            slice_settings: SliceSettings::default(),
            is_active: false,
            asked: None,
            followed: None,
            pace: Throttle::new(BETWEEN),
        })
    }

    /// Does what a person asks for; why that cannot be done.
    pub(super) fn handle(&mut self, wish: GrinCommand) -> Result<(), String> {
        match wish {
            GrinCommand::OpenFile(Some(path)) => self.open(DocumentSource::File(path)),
            GrinCommand::OpenBuiltin(name) => self.open(DocumentSource::Builtin(name)),
            GrinCommand::Start => self.start()?,
            GrinCommand::Pause => self.stand(RunStatus::Paused),
            GrinCommand::Resume => self.stand(RunStatus::Running),
            GrinCommand::Stop => self.stand(RunStatus::Stopped),
            GrinCommand::Save { path: Some(path), nodes } => {
                self.writing = true;
                self.former.write(path, nodes);
            }
            GrinCommand::OpenFile(None) | GrinCommand::Save { path: None, .. } => {
                return Err("no file was named".to_owned());
            }
            GrinCommand::Close => self.close(),
            GrinCommand::SetSlice(sight) => {
                let run = self.run();
                self.slice_settings = run.map_or(sight, |run| run.document.clamp_slice(sight));
            }
            GrinCommand::SetActive(watched) => self.is_active = watched,
        }
        Ok(())
    }

    fn open(&mut self, origin: DocumentSource) {
        self.count += 1;
        self.opening = Some(self.count);
        self.error = None;
        self.former.open(self.count, origin);
    }

    fn start(&mut self) -> Result<(), String> {
        let run = self.run().ok_or("there is no task to work on; open one first")?;
        if run.document.task.is_none() {
            return Err("a volume has no task to work on".to_owned());
        }
        self.error = None;
        self.pending = Some(RunStatus::Running);
        self.former.start();
        Ok(())
    }

    /// Lets the search stand otherwise once its step is done; one that has ended stays so.
    fn stand(&mut self, standing: RunStatus) {
        let is_starting = self.pending == Some(RunStatus::Running);
        if is_starting || self.run().is_some_and(|run| run.is_active()) {
            self.pending = Some(standing);
            self.former.stand(standing);
        }
    }

    fn close(&mut self) {
        self.former.close();
        self.number = None;
        self.opening = None;
        self.pending = None;
        self.error = None;
        self.asked = None;
        self.followed = None;
    }

    /// What happened since the last look to what is open or being opened.
    pub(super) fn drain_events(&mut self) -> Vec<Told> {
        let mut told = self.former.told();
        told.retain(|told| match told {
            Told::Now(number, _) | Told::NotOpened(number, _) | Told::Failed(number, _) => {
                self.number == Some(*number) || self.opening == Some(*number)
            }
            Told::Written(..) | Told::NotWritten(_) => true,
        });
        told.iter().for_each(|told| self.hear(told));
        told
    }

    fn hear(&mut self, told: &Told) {
        match told {
            Told::Now(number, standing) => {
                if self.opening == Some(*number) {
                    self.opened(*number);
                } else if Some(*standing) == self.pending || !standing.is_active() {
                    self.pending = None;
                }
            }
            Told::NotOpened(_, why) => {
                self.opening = None;
                self.error = Some(why.clone());
            }
            Told::Failed(_, why) => {
                self.pending = None;
                self.error = Some(why.clone());
            }
            Told::Written(..) | Told::NotWritten(_) => self.writing = false,
        }
    }

    fn opened(&mut self, number: u64) {
        self.number = Some(number);
        self.opening = None;
        self.pending = None;
        self.asked = None;
        self.followed = None;
        if let Some(run) = self.run() {
            self.slice_settings = run.document.default_slice();
        }
    }

    /// Asks for what is to be seen, while somebody looks.
    pub(super) fn sync(&mut self) {
        let Some(run) = self.run().filter(|_| self.is_active) else { return };
        let (subject, medium) = (Arc::clone(&run.document), Arc::clone(&run.field));
        let wanted = SliceRequest { subject, medium, sight: self.slice_settings };
        if !self.asked.as_ref().is_some_and(|asked| asked.matches(&wanted)) {
            self.asked = Some(wanted.clone());
            self.slicer.request(wanted);
        }
        self.follow(&run);
    }

    /// Asks for all light of the task: seldom while the field changes all the time.
    fn follow(&mut self, run: &GrinRun) {
        let known = self.followed.as_ref().is_some_and(|known| Arc::ptr_eq(known, &run.field));
        if known || run.document.task.is_none() {
            return;
        }
        let busy = self.followed.is_some() && self.sighting().is_none();
        let is_running = run.status == RunStatus::Running;
        if !is_running || !busy && self.pace.ready() {
            self.followed = Some(Arc::clone(&run.field));
            self.viewer.request((Arc::clone(&run.document), Arc::clone(&run.field)));
        }
    }

    fn run(&self) -> Option<Arc<GrinRun>> {
        self.former.formation().filter(|run| self.number == Some(run.number))
    }

    pub(super) fn view(&self) -> GrinView {
        let run = self.run();
        let is_of = |slice: &Slice| {
            run.as_ref().is_some_and(|run| Arc::ptr_eq(&slice.document, &run.document))
        };
        let slice = self.slicer.latest().filter(|_| self.asked.is_some());
        let slice = slice.filter(|slice| slice.as_ref().as_ref().map_or(true, is_of));
        GrinView {
            opening: self.opening.is_some(),
            writing: self.writing,
            pending: self.pending,
            error: self.error.clone(),
            slice_settings: self.slice_settings,
            is_active: self.is_active,
            slice,
            analysis: self.sighting(),
            run,
        }
    }

    /// The newest answer about all light, if it is of what is open.
    fn sighting(&self) -> Option<Arc<Result<GrinAnalysis, String>>> {
        let run = self.run()?;
        let is_of = |seen: &GrinAnalysis| Arc::ptr_eq(&seen.document, &run.document);
        let answer = self.viewer.latest().filter(|_| self.followed.is_some());
        answer.filter(|answer| answer.as_ref().as_ref().map_or(true, is_of))
    }
}

/// Follows all light of a task.
fn sighting(subject: &Arc<GrinDocument>, medium: Arc<GrinField>) -> Result<GrinAnalysis, String> {
    let Some(task) = &subject.task else { return Err("a volume has no light".to_owned()) };
    let Timed { value, ms } = time(|| task.report_views(&medium));
    let value = value.map_err(|why| why.to_string())?;
    Ok(GrinAnalysis { document: Arc::clone(subject), field: medium, views: Timed { value, ms } })
}
