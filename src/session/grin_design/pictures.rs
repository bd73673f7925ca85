//! The images of a field at rest, rendered until their error is small.
//!
//! While a design takes steps, its images are those of its loss, which are traced anyway; a rendered image takes many
//! times as many rays, which the design would lack. It is made once the field rests, and ended early for a newer one.

use super::GrinDocument;
use crate::grin_design::GrinField;
use crate::picture::{ProjectedView, ProjectionSettings, project_views};
use crate::session::clock::{Timed, time};
use crate::session::run::{LatestRequestWorker, WorkerOutput, catch_panic};
use std::io;
use std::ops::ControlFlow;
use std::sync::Arc;

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

/// The thread that renders the images.
#[derive(Debug)]
pub(super) struct PictureWorker {
    worker: LatestRequestWorker<PictureRequest, Result<GrinPictures, String>>,
    /// The field that was requested last.
    requested: Option<Arc<GrinField>>,
}

impl PictureWorker {
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let worker = LatestRequestWorker::spawn("field pictures", wake, render)?;
        Ok(Self { worker, requested: None })
    }

    /// Requests the images of a field, unless they were requested before.
    pub(super) fn request(&mut self, document: &Arc<GrinDocument>, field: &Arc<GrinField>) {
        if self.requested.as_ref().is_some_and(|last| Arc::ptr_eq(last, field)) {
            return;
        }
        self.requested = Some(Arc::clone(field));
        self.worker.request((Arc::clone(document), Arc::clone(field)));
    }

    /// Forgets what was requested.
    pub(super) fn reset(&mut self) {
        self.requested = None;
    }

    /// The images of a field, if it is the one that was rendered last.
    pub(super) fn of(&self, field: &Arc<GrinField>) -> Option<Arc<Result<GrinPictures, String>>> {
        let latest = self.worker.latest().filter(|_| self.requested.is_some());
        let is_shown = |pictures: &GrinPictures| Arc::ptr_eq(&pictures.field, field);
        latest.filter(|latest| latest.as_ref().as_ref().map_or(true, is_shown))
    }
}

/// Renders the images of a request and publishes them, unless a newer request ends that.
fn render(
    (document, field): PictureRequest,
    output: &WorkerOutput<PictureRequest, Result<GrinPictures, String>>,
) {
    let is_interrupted = output.interruption();
    match catch_panic(|| pictures(&document, field, &is_interrupted)) {
        Ok(Some(pictures)) => output.publish(Ok(pictures)),
        Ok(None) => {}
        Err(why) => output.publish(Err(why)),
    }
}

/// The images of a task in a field; `None` if that was interrupted.
fn pictures(
    document: &Arc<GrinDocument>,
    field: Arc<GrinField>,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<Option<GrinPictures>, String> {
    let Some(task) = &document.task else { return Err("a volume has no light".to_owned()) };
    let settings = ProjectionSettings { max_rays: MAX_RAYS, ..ProjectionSettings::default() };
    let mut go_on =
        |_| if is_interrupted() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
    let Timed { value, ms } = time(|| project_views(task, &field, &settings, &mut go_on));
    let value = value.map_err(|why| why.to_string())?;
    let is_whole = value.iter().flatten().all(|view| view.light.complete);
    let views = Timed { value, ms };
    Ok(is_whole.then(|| GrinPictures { document: Arc::clone(document), field, views }))
}
