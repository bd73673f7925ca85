//! The images of a field at rest, rendered until their error is small.
//!
//! While a design takes steps, its images are those of its loss, which are traced anyway; a rendered image takes many
//! times as many rays, which the design would lack. It is made once no step is taken, and ended early for a newer field,
//! for a design that goes on, and where no panel shows it.

use super::GrinDocument;
use crate::grin_design::GrinField;
use crate::picture::{ProjectedView, ProjectionSettings, project_views};
use crate::session::clock::{Timed, time};
use crate::session::run::{LatestRequestWorker, WorkerOutput, catch_panic};
use std::io;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The largest number of rays of an image.
const MAX_RAYS: usize = 1 << 22;

/// The rendered images of a task in a field.
#[derive(Debug, Clone)]
pub struct GrinPictures {
    /// The document with the task.
    pub document: Arc<GrinDocument>,
    /// The field.
    pub field: Arc<GrinField>,
    /// The image of every view, if its goal is one; with the time that all of them took.
    pub views: Timed<Vec<Option<ProjectedView>>>,
}

/// A document with a task, and the field that it is shown in.
type PictureRequest = (Arc<GrinDocument>, Arc<GrinField>);

/// The images of a field, or the reason why there are none.
type PictureResult = (Arc<GrinField>, Arc<Result<GrinPictures, String>>);

/// The thread that renders the images.
#[derive(Debug)]
pub(super) struct PictureWorker {
    worker: LatestRequestWorker<PictureRequest, PictureResult>,
    /// True while nothing is to be rendered.
    is_paused: Arc<AtomicBool>,
    /// The field that was requested last.
    requested: Option<Arc<GrinField>>,
}

impl PictureWorker {
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let is_paused = Arc::new(AtomicBool::new(false));
        let paused = Arc::clone(&is_paused);
        let work = move |request: PictureRequest, output: &WorkerOutput<_, _>| {
            render(request, &paused, output);
        };
        let worker = LatestRequestWorker::spawn("field pictures", wake, work)?;
        Ok(Self { worker, is_paused, requested: None })
    }

    /// Requests the images of a field, unless they were requested before.
    pub(super) fn request(&mut self, document: &Arc<GrinDocument>, field: &Arc<GrinField>) {
        self.is_paused.store(false, Ordering::Relaxed);
        if self.requested.as_ref().is_some_and(|last| Arc::ptr_eq(last, field)) {
            return;
        }
        self.requested = Some(Arc::clone(field));
        self.worker.request((Arc::clone(document), Arc::clone(field)));
    }

    /// Ends a rendering, which is requested anew when it is wanted again.
    pub(super) fn pause(&mut self) {
        self.is_paused.store(true, Ordering::Relaxed);
        let is_rendered = |field: &Arc<GrinField>| self.of(field).is_some();
        if !self.requested.as_ref().is_some_and(is_rendered) {
            self.requested = None;
        }
    }

    /// Forgets what was requested.
    pub(super) fn reset(&mut self) {
        self.requested = None;
    }

    /// The images of a field, if it is the one that was rendered last.
    pub(super) fn of(&self, field: &Arc<GrinField>) -> Option<Arc<Result<GrinPictures, String>>> {
        let latest = self.worker.latest().filter(|_| self.requested.is_some());
        let latest = latest.filter(|latest| Arc::ptr_eq(&latest.0, field));
        latest.map(|latest| Arc::clone(&latest.1))
    }
}

/// Renders the images of a request and publishes them, unless a newer request or a pause ends that.
fn render(
    (document, field): PictureRequest,
    is_paused: &AtomicBool,
    output: &WorkerOutput<PictureRequest, PictureResult>,
) {
    let is_replaced = output.interruption();
    let is_interrupted = || is_replaced() || is_paused.load(Ordering::Relaxed);
    let rendered = catch_panic(|| pictures(&document, &field, &is_interrupted));
    if let Some(found) = rendered.transpose() {
        output.publish((field, Arc::new(found)));
    }
}

/// The images of a task in a field; `None` if that was interrupted.
fn pictures(
    document: &Arc<GrinDocument>,
    field: &Arc<GrinField>,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<Option<GrinPictures>, String> {
    let Some(task) = &document.task else { return Err("a volume has no light".to_owned()) };
    let settings = ProjectionSettings { max_rays: MAX_RAYS, ..ProjectionSettings::default() };
    let mut go_on =
        |_| if is_interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
    let Timed { value, ms } = time(|| project_views(task, field, &settings, &mut go_on));
    let value = value.map_err(|why| why.to_string())?;
    let is_whole = value.iter().flatten().all(|view| view.light.complete);
    let views = Timed { value, ms };
    let (document, field) = (Arc::clone(document), Arc::clone(field));
    Ok(is_whole.then_some(GrinPictures { document, field, views }))
}
