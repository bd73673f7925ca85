//! The lens as it is made, for the window.
//!
//! Sensitivities and the quadratic form follow every edit; once the lens is still, real lenses with
//! random errors correct them.

use super::AnalysisSettings;
use crate::lens::{Lens, ToleranceSheet};
use crate::report::tolerance_warnings;
use crate::tolerance::{
    ContrastChanges, ContrastSummary, ErrorModel, LoosestRequest, LoosestTolerances, MadeLens,
    NominalLens, RealMerit, RealMeritRequest, SecondDerivatives, StopTest, ToleranceAnalysis,
    ToleranceError, ToleranceRequest, ToleranceScene, WavefrontModel, graded_sheet,
    refuse_lost_lenses, worst_lens,
};

/// The tolerances of a lens and what they do to it.
#[derive(Debug, Clone)]
pub struct AsBuiltLens {
    /// The tolerances.
    pub sheet: ToleranceSheet,
    /// True if they are those of the lens file; false if a grade proposes them.
    pub from_lens: bool,
    /// Warnings of tolerances that are seldom meant, and of what the quadratic form cannot tell.
    pub warnings: Vec<String>,
    /// The share of each error in the growth of the expected mean square spot, at the fixed image plane
    /// and refocused.
    pub shares: Vec<[f64; 2]>,
    /// The analysis.
    pub analysis: ToleranceAnalysis,
    /// The RMS wavefront in waves at the primary wavelength, as designed and the root of the expected
    /// variance, each at the fixed image plane and refocused; `None` where only derivatives of spots are
    /// known yet, or for a lens without a wavefront.
    pub wavefront: Option<[[f64; 2]; 2]>,
    /// The root of the mean variance of lenses with random errors by their rays, in waves, likewise.
    pub real_wavefront: Option<RealMerit>,
    /// The share of each error in the growth of the variance of the wavefront, likewise; as many as
    /// there are errors, or none.
    pub wavefront_shares: Vec<[f64; 2]>,
    /// The contrast at the frequency that is asked for, or the reason why there is none; `None` if nothing is,
    /// if it was stopped, and without lenses with random errors.
    pub contrast: Option<Result<ContrastSummary, String>>,
    /// The number of rays of the lens as designed.
    pub rays: usize,
    /// The largest relative error of the radius of a spot by the sampling of its pupil.
    pub sampling_error: f64,
    /// The lens with the largest spot of those with random errors, or the reason why it cannot be written;
    /// `None` without such lenses.
    pub worst: Option<Result<MadeLens, String>>,
    /// The loosest tolerances for what is asked for, or the reason why there are none; `None` if nothing
    /// is, and without lenses with random errors.
    pub loosest: Option<Result<LoosestTolerances, String>>,
    /// The lens as designed, resolved.
    pub nominal: NominalLens,
}

/// The relative error of spots while the lens changes.
const COARSE: f64 = 1e-2;
/// The number of real lenses of one that is still.
const REAL_LENSES: usize = 500;
/// The standard error of the mean of their wavefronts and contrasts, relative to it, at which there are enough.
const ENOUGH: f64 = 0.02;
/// The seed of their errors.
const SEED: u64 = 1;

/// The lens as it is made, by its derivatives alone.
///
/// # Errors
/// A lens that no light gets through, or a tolerance that is not possible, in words.
pub fn predict_as_built(lens: &Lens, settings: &AnalysisSettings) -> Result<AsBuiltLens, String> {
    let tolerance = COARSE.max(settings.tolerance);
    as_built(lens, settings, (tolerance, 0), &|| false).map_err(|why| why.to_string())
}

/// The same; `None` once `stop` says so.
pub(super) fn predict_unless(
    lens: &Lens,
    settings: &AnalysisSettings,
    stop: StopTest<'_>,
) -> Option<Result<AsBuiltLens, String>> {
    let tolerance = COARSE.max(settings.tolerance);
    unless_stopped(as_built(lens, settings, (tolerance, 0), stop))
}

/// The result, or the reason in words why there is none; `None` if it was stopped.
fn unless_stopped<T>(found: Result<T, ToleranceError>) -> Option<Result<T, String>> {
    match found {
        Err(ToleranceError::Stopped) => None,
        found => Some(found.map_err(|why| why.to_string())),
    }
}

/// The lens as it is made, corrected by real lenses.
///
/// # Errors
/// As those of [`predict_as_built`].
pub fn confirm_as_built(lens: &Lens, settings: &AnalysisSettings) -> Result<AsBuiltLens, String> {
    let found = as_built(lens, settings, (settings.tolerance, REAL_LENSES), &|| false);
    found.map_err(|why| why.to_string())
}

/// The same by fewer real lenses, or not at all, once `stop` says so.
pub(super) fn confirm_unless(
    lens: &Lens,
    settings: &AnalysisSettings,
    stop: StopTest<'_>,
) -> Option<Result<AsBuiltLens, String>> {
    unless_stopped(as_built(lens, settings, (settings.tolerance, REAL_LENSES), stop))
}

/// The root of the variance of the wavefront as designed and as it is expected, in waves.
fn root_variances(
    waves: &WavefrontModel,
    sheet: &ToleranceSheet,
) -> Result<[[f64; 2]; 2], ToleranceError> {
    let nominal = waves.nominal().map(|variance| variance.max(0.0).sqrt());
    Ok([nominal, waves.expected_rms(sheet)?])
}

fn as_built(
    lens: &Lens,
    settings: &AnalysisSettings,
    (tolerance, samples): (f64, usize),
    stop: StopTest<'_>,
) -> Result<AsBuiltLens, ToleranceError> {
    let scene = ToleranceScene::new_until(lens, settings.zoom, tolerance, stop)?;
    let graded = || graded_sheet(lens, &scene.lens, settings.grade);
    let sheet = lens.tolerances.clone().unwrap_or_else(graded);
    let request = ToleranceRequest { seed: SEED, samples, limit: settings.good_rms };
    let model = ErrorModel::new(&scene, &sheet, SecondDerivatives::default(), stop)?;
    let analysis = model.analyze(&scene, &sheet, request, stop)?;
    refuse_lost_lenses(analysis.lost, analysis.samples, "these tolerances")?;
    let goal = settings.loosest.filter(|_| samples > 0);
    let form = &analysis.forms[1];
    let form = (form, analysis.pupils.moves);
    let loosest = goal.map(|goal| {
        let request = LoosestRequest { goal, limit: goal.limit(), seed: SEED };
        LoosestTolerances::new((lens, &scene), form, &sheet, request, stop)
    });
    let worst = worst_lens((lens, settings.zoom), &scene, &sheet, &analysis.real);
    let waves = (samples > 0)
        .then(|| {
            let place = (lens, settings.zoom);
            let sheet = (&sheet, SecondDerivatives::Traced);
            WavefrontModel::new(place, &scene, sheet, stop).ok()
        })
        .flatten();
    let request = RealMeritRequest { seed: SEED, most: REAL_LENSES, error: ENOUGH };
    let real_wavefront =
        waves.as_ref().and_then(|waves| waves.real_lenses(&scene, &sheet, request, stop).ok());
    let frequency = settings.tolerance_frequency.filter(|_| samples > 0);
    let contrast = frequency.and_then(|frequency| {
        let place = (lens, settings.zoom, tolerance);
        let found =
            ContrastChanges::with_real_lenses(place, &scene, (&sheet, frequency), request, stop);
        unless_stopped(found.map(|(changes, real)| changes.summary(&sheet, real)))
    });
    Ok(AsBuiltLens {
        warnings: tolerance_warnings((&sheet, lens.tolerances.is_none()), &scene.lens, &analysis),
        contrast,
        real_wavefront: real_wavefront.map(|real| real.root()),
        wavefront: waves.as_ref().map(|waves| root_variances(waves, &sheet)).transpose()?,
        wavefront_shares: waves.map_or(Ok(Vec::new()), |waves| waves.growth_shares(&sheet))?,
        shares: analysis.growth_shares(&sheet)?,
        sheet,
        from_lens: lens.tolerances.is_some(),
        analysis,
        rays: scene.beam.rays(),
        sampling_error: scene.sampling_error,
        worst: worst.map_err(|why| why.to_string()).transpose(),
        loosest: loosest.map(|found| found.map_err(|why| why.to_string())),
        nominal: scene.lens,
    })
}
