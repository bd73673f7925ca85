//! What is seen of a field at work: the light of every view, by the rays that all fields are judged
//! by, and its image beside the picture that is wanted. No gradient, and nothing of a search.

use super::check::GrinTaskError;
use super::measured::measure_targets;
use super::medium::GrinField;
use super::scene::{ViewRays, ViewResult, plan_views, view_rays};
use super::source::RaySet;
use super::space::length;
use super::task::GrinTask;
use crate::grin::{GrinRay, GrinSetup, GrinTracer, IndexField, Integrator, RayExit};

/// Rays by which the error of the tracing is known.
const SAMPLE: usize = 64;

/// An image of a view on its screen beside the picture that is wanted: rows from the bottom, as many
/// as columns, both of mean 1 where all light arrives.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewImage {
    /// Pixels along a side.
    pub pixels: usize,
    /// Half of the side of the screen, in mm.
    pub half: f64,
    /// The picture.
    pub target: Vec<f64>,
    /// What the light makes.
    pub formed: Vec<f64>,
}

/// What became of the light of a view.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewReport {
    /// Loss, spot, quality, and what became of the rays; without a way back, so that no ray is
    /// known to be chaotic.
    pub result: ViewResult,
    /// Its image, where it makes one.
    pub image: Option<ViewImage>,
    /// The kind of step.
    pub integrator: Integrator,
    /// The length of a step, in mm.
    pub step: f64,
    /// By how much an exit moves at most, in mm, where the step is halved; `None` where no ray of
    /// the sample arrives with both.
    pub error: Option<f64>,
    /// Rays that this was tried on.
    pub sample: usize,
}

impl GrinTask {
    /// What becomes of the light of every view in a field, those of weight 0 included.
    ///
    /// # Errors
    /// A field that is given in a file and cannot be read, or a space of no extent.
    pub fn report_views(&self, medium: &GrinField) -> Result<Vec<ViewReport>, GrinTaskError> {
        let field = medium.field();
        let setups = plan_views(self, field, RaySet::Scoring)?;
        view_rays(self, &measure_targets(self)?, &setups, RaySet::Scoring)?
            .iter()
            .map(|shot| report_view(shot, field))
            .collect()
    }
}

fn report_view(shot: &ViewRays, field: &dyn IndexField<f64>) -> Result<ViewReport, GrinTaskError> {
    let GrinSetup { integrator, step, .. } = shot.setup;
    let exits = GrinTracer::new(field, shot.setup.clone())?.trace_batch(&shot.rays);
    let image = shot.screen.as_ref().map(|screen| ViewImage {
        pixels: screen.pixels,
        half: screen.half,
        target: screen.wanted.clone(),
        formed: ViewRays::image(screen, &exits),
    });
    let (error, sample) = step_error(shot, field, &exits)?;
    Ok(ViewReport { result: shot.result(&exits, 0.0), image, integrator, step, error, sample })
}

/// By how much exits move where the step is halved, by a sample of the rays; and its size.
fn step_error(
    shot: &ViewRays,
    field: &dyn IndexField<f64>,
    exits: &[RayExit<f64>],
) -> Result<(Option<f64>, usize), GrinTaskError> {
    let stride = shot.rays.len().div_ceil(SAMPLE).max(1);
    let rays: Vec<GrinRay<f64>> = shot.rays.iter().step_by(stride).copied().collect();
    let halved = GrinSetup { step: 0.5 * shot.setup.step, ..shot.setup.clone() };
    let finer = GrinTracer::new(field, halved)?.trace_batch(&rays);
    let pairs = exits.iter().step_by(stride).zip(&finer);
    let both = pairs.filter(|(a, b)| ViewRays::is_valid(a) && ViewRays::is_valid(b));
    Ok((both.map(|(a, b)| length(a.x - b.x)).reduce(f64::max), rays.len()))
}
