//! The cost of some kinds of tolerances alone, for a comparison with a program that knows no others.

use super::ToleranceBenchmarkError;
use super::timing::time_median;
use super::trace::BenchmarkError;
use crate::lens::{Lens, PerturbationKind, Tolerance, ToleranceGrade, ToleranceSheet};
use crate::tolerance::{
    ErrorModel, SecondDerivatives, ToleranceScene, graded_sheet, traced_lenses,
};
use rayon::ThreadPoolBuilder;
use serde::Serialize;

/// The sensitivities of a lens to some kinds of errors, and their cost on one core.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SomeTolerances {
    /// The tolerances.
    #[serde(skip)]
    pub tolerances: Vec<Tolerance>,
    /// The growth of the mean square spot over the fields at the fixed image plane in mm², the mean over both ends
    /// of each error.
    pub growth: Vec<f64>,
    /// The number of rays.
    pub rays: usize,
    /// The time in which the lens is made ready: its pupils, and rays that reach the accuracy, in milliseconds.
    pub setup_ms: f64,
    /// The time of all sensitivities, refocused ones included, in milliseconds.
    pub sensitivities_ms: f64,
    /// The time of a lens with all errors at random, by its own rays, in milliseconds.
    pub lens_ms: f64,
}

/// Measures the tolerances of some kinds and a class, with spots to a relative tolerance and a number of lenses
/// with random errors; without any that are adjusted by another surface.
///
/// # Errors
/// A lens without such tolerances, or whose rays do not arrive.
pub fn measure_some_tolerances(
    lens: &Lens,
    (kinds, grade): (&[PerturbationKind], ToleranceGrade),
    (accuracy, samples): (f64, usize),
) -> Result<SomeTolerances, ToleranceBenchmarkError> {
    let pool = ThreadPoolBuilder::new().num_threads(1).build().map_err(BenchmarkError::from)?;
    let ready = || ToleranceScene::new(lens, 0, accuracy);
    let (scene, setup_ms) = pool.install(|| time_median(1..=5, ready));
    let scene = scene?;
    let graded = graded_sheet(lens, &scene.lens, grade);
    let of_kinds = |t: &&Tolerance| kinds.contains(&t.error.kind) && t.half_range > 0.0;
    let tolerances: Vec<Tolerance> = graded.errors.iter().filter(of_kinds).copied().collect();
    let sheet = ToleranceSheet::of_errors(tolerances.clone());
    let model = || ErrorModel::new(&scene, &sheet, SecondDerivatives::Neglected, &|| false);
    let (model, sensitivities_ms) = pool.install(|| time_median(3..=50, model));
    let model = model?;
    let moves = model.pupils.moves;
    let real = || traced_lenses((&scene, moves), &sheet, (1, samples), &|| false);
    let (traced, samples_ms) = pool.install(|| time_median(1..=5, real));
    let traced = traced?.len().max(1);
    let second = |i: usize| model.forms[0].second.of(i, i);
    let growth = |(i, t): (usize, &Tolerance)| 0.5 * second(i) * t.half_range.powi(2);
    Ok(SomeTolerances {
        growth: tolerances.iter().enumerate().map(growth).collect(),
        tolerances,
        rays: scene.beam.rays(),
        setup_ms,
        sensitivities_ms,
        lens_ms: samples_ms / traced as f64,
    })
}
