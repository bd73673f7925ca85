//! What is seen of a field at work: the light of every view, by the rays that all fields are judged
//! by, and its image beside the picture that is wanted. No gradient, and nothing of a search.

use super::check::TaskError;
use super::measured::known;
use super::medium::Medium;
use super::scene::{Shot, ViewResult, setups, shots};
use super::source::Draw;
use super::space::length;
use super::task::Task;
use crate::grin::{Exit, Field, Integrator, Ray, Setup, Tracer};

/// Rays by which the error of the tracing is known.
const SAMPLE: usize = 64;

/// An image of a view on its screen beside the picture that is wanted: rows from the bottom, as many
/// as columns, both of mean 1 where all light arrives.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Pixels along a side.
    pub pixels: usize,
    /// Half of the side of the screen, in mm.
    pub half: f64,
    /// The picture.
    pub wanted: Vec<f64>,
    /// What the light makes.
    pub made: Vec<f64>,
}

/// What became of the light of a view.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    /// Loss, spot, quality, and what became of the rays; without a way back, so that no ray is
    /// known to be chaotic.
    pub result: ViewResult,
    /// Its image, where it makes one.
    pub image: Option<Image>,
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

impl Task {
    /// What becomes of the light of every view in a field, those of weight 0 included.
    ///
    /// # Errors
    /// A field that is given in a file and cannot be read, or a space of no extent.
    pub fn seen(&self, medium: &Medium) -> Result<Vec<Seen>, TaskError> {
        let field = medium.field();
        let setups = setups(self, field, Draw::Judge)?;
        shots(self, &known(self)?, &setups, Draw::Judge)?
            .iter()
            .map(|shot| seen(shot, field))
            .collect()
    }
}

fn seen(shot: &Shot, field: &dyn Field<f64>) -> Result<Seen, TaskError> {
    let Setup { integrator, step, .. } = shot.setup;
    let exits = Tracer::new(field, shot.setup.clone())?.rays(&shot.rays);
    let image = shot.screen.as_ref().map(|screen| Image {
        pixels: screen.pixels,
        half: screen.half,
        wanted: screen.wanted.clone(),
        made: Shot::image(screen, &exits),
    });
    let (error, sample) = error(shot, field, &exits)?;
    Ok(Seen { result: shot.result(&exits, 0.0), image, integrator, step, error, sample })
}

/// By how much exits move where the step is halved, by a sample of the rays; and its size.
fn error(
    shot: &Shot,
    field: &dyn Field<f64>,
    exits: &[Exit<f64>],
) -> Result<(Option<f64>, usize), TaskError> {
    let stride = shot.rays.len().div_ceil(SAMPLE).max(1);
    let rays: Vec<Ray<f64>> = shot.rays.iter().step_by(stride).copied().collect();
    let halved = Setup { step: 0.5 * shot.setup.step, ..shot.setup.clone() };
    let finer = Tracer::new(field, halved)?.rays(&rays);
    let pairs = exits.iter().step_by(stride).zip(&finer);
    let both = pairs.filter(|(a, b)| Shot::counts(a) && Shot::counts(b));
    Ok((both.map(|(a, b)| length(a.x - b.x)).reduce(f64::max), rays.len()))
}
