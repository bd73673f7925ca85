//! Tolerances: how exact their derivatives are, what they cost, and what a design gains that is
//! optimized as it is built.

use super::timing::{TimedCase, time_interleaved, time_median};
use super::tolerance_cases::{MeritSweepCost, PoseCost, filled_sheet, merit_sweep_cost, pose_cost};
use super::trace::BenchmarkError;
use crate::lens::{
    Lens, ParameterKind, Perturbation, PerturbationKind, Tolerance, ToleranceGrade, ToleranceSheet,
    add_variables,
};
use crate::merit::{
    DerivativeLevel, Goal, LimitTreatment, Merit, MeritError, PupilEdge, Term, WeightedTerm,
};
use crate::optimize::{DescentMethod, start};
use crate::tolerance::{
    Compensation, Derivatives, ErrorModel, FocusTreatment, NominalLens, QuadraticForm, RayEffects,
    SecondDerivatives, Sensitivity, ToleranceError, ToleranceRequest, ToleranceScene, analyze,
    form_spots, graded_sheet, perturb, sensitivities, traced_lenses,
};
use rayon::ThreadPoolBuilder;
use serde::Serialize;
use std::hint::black_box;
use std::sync::atomic::{AtomicBool, Ordering};

/// The relative accuracy of the spot radii that sensitivities are computed from: growths are squares, and
/// are to be good to 1e-4.
const ACCURACY: f64 = 1e-5;
/// The same for the rays of real lenses, as the command takes them: their number leaves a larger error.
const SAMPLES_ACCURACY: f64 = 1e-3;
/// The numbers of tolerances for which the gradient of the as-built merit is timed.
const COUNTS: [usize; 3] = [10, 100, 1000];

/// The step of the differences of derivatives, as a share of the half range of an error.
const STEP: f64 = 0.125;

/// The turns in which gradients are timed, and the least seconds of each.
const TURNS: usize = 15;
const TURN_SECONDS: f64 = 0.02;

/// The cost of tolerances on a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ToleranceBenchmark {
    /// The number of errors of making.
    pub errors: usize,
    /// The number of rays, those of opposite fields included.
    pub rays: usize,
    /// The largest relative difference of first derivatives by a sweep back and by jets.
    pub first_error: f64,
    /// The largest relative difference of second derivatives by jets and by differences of first
    /// ones.
    pub second_error: f64,
    /// The largest relative difference of the growth by an error from that by rays a hundred times as
    /// accurate.
    pub sampling_error: f64,
    /// The time of the sensitivities and of both forms as `tolerance` finds them, by sweeps back and with the
    /// motion of the edges of pupils, on one core, in milliseconds.
    pub sweep_ms: f64,
    /// True if pupils move.
    pub moving_pupils: bool,
    /// The time of all derivatives by second-order jets, on one core, in milliseconds.
    pub jets_ms: f64,
    /// The time of the distribution and the yield by the quadratic form, on one core, in
    /// milliseconds.
    pub form_ms: f64,
    /// The number of real lenses.
    pub samples: usize,
    /// The number of rays of each as the command traces them, those that find its pupils included.
    pub samples_rays: usize,
    /// The time of all these lenses on two cores, in milliseconds.
    pub samples_ms: f64,
    /// The cost of gradients.
    pub gradients: Vec<AsBuiltCost>,
    /// The cost of other merits than the spot; `None` for a lens that has none.
    pub merits: Option<MeritSweepCost>,
    /// The cost of poses; `None` for a lens whose surfaces are decentred, tilted or irregular by design.
    pub poses: Option<PoseCost>,
}

/// The cost of the gradient of the as-built merit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AsBuiltCost {
    /// The number of tolerances.
    pub tolerances: usize,
    /// The time on one core, in milliseconds.
    pub ms: f64,
    /// The same over the time of the gradient of the spot with the same pupils.
    pub ordinary_gradients: f64,
}

/// The cause for which tolerances cannot be measured.
#[derive(Debug, thiserror::Error)]
pub enum ToleranceBenchmarkError {
    /// The tolerances.
    #[error(transparent)]
    Tolerance(#[from] ToleranceError),
    /// The merit function.
    #[error(transparent)]
    Merit(#[from] MeritError),
    /// The threads.
    #[error(transparent)]
    Threads(#[from] BenchmarkError),
}

/// Measures the tolerances of a class on a lens, filled up to this many errors, with this many real lenses. `None`
/// once `stop` is true.
///
/// # Errors
/// A lens that has no tolerances.
pub fn measure_tolerances(
    lens: &Lens,
    grade: ToleranceGrade,
    (count, samples): (usize, usize),
    stop: &AtomicBool,
) -> Result<Option<ToleranceBenchmark>, ToleranceBenchmarkError> {
    let scene = ToleranceScene::new(lens, 0, ACCURACY)?;
    let sheet = filled_sheet(graded_sheet(lens, &scene.lens, grade), &scene.lens, count);
    let errors: Vec<Perturbation> = sheet.errors.iter().map(|t| t.error).collect();
    let jets = || sensitivities(&scene.lens, &scene.beam, scene.options, &errors);
    let [one, two] = [1, 2].map(|threads| ThreadPoolBuilder::new().num_threads(threads).build());
    let (one, two) = (one.map_err(BenchmarkError::from)?, two.map_err(BenchmarkError::from)?);
    let never = || false;
    let is_stopped = || stop.load(Ordering::Relaxed);
    let model = || ErrorModel::new(&scene, &sheet, SecondDerivatives::Neglected, &never);
    let (found_model, sweep_ms) = one.install(|| time_median(3..=50, model));
    let moves = found_model?.pupils.moves;
    // Jets know no edges.
    let held = scene.clone().with_held_pupils();
    let swept = ErrorModel::new(&held, &sheet, SecondDerivatives::Neglected, &never)?;
    let (found, jets_ms) = one.install(|| time_median(1..=5, jets));
    let found = found?;
    if is_stopped() {
        return Ok(None);
    }
    let form_ms = one.install(|| form_cost(&scene, &sheet, &errors))?;
    let sampled = ToleranceScene::new(lens, 0, SAMPLES_ACCURACY)?;
    let real = || {
        let traced = traced_lenses((&sampled, moves), &sheet, (1, samples), &is_stopped);
        traced.map(|own| own.len())
    };
    let (traced, samples_ms) = two.install(|| time_median(1..=5, real));
    let first_error = first_error(&found, &swept.forms[0], &sheet);
    if is_stopped() {
        return Ok(None);
    }
    let poses = pose_cost(&scene, &one)?;
    Ok(Some(ToleranceBenchmark {
        errors: errors.len(),
        rays: scene.beam.rays(),
        first_error,
        second_error: second_error(&scene, &sheet)?,
        sampling_error: sampling_error(lens, &sheet, &swept.forms[0])?,
        moving_pupils: moves,
        sweep_ms,
        jets_ms,
        form_ms,
        samples: traced?,
        samples_rays: sampled.rays_of_real_lens(moves),
        samples_ms,
        gradients: one.install(|| gradient_costs(lens, &sheet))?,
        merits: merit_sweep_cost((lens, &scene, ACCURACY), &sheet, &one).ok(),
        poses,
    }))
}

/// The time of the distribution and the yield by the quadratic form, in milliseconds.
fn form_cost(
    scene: &ToleranceScene,
    sheet: &ToleranceSheet,
    errors: &[Perturbation],
) -> Result<f64, ToleranceError> {
    let compensation = Compensation::new(scene, sheet)?;
    let effects = RayEffects::new(scene, errors, SecondDerivatives::Neglected, &|| false)?;
    let form = || {
        let form = QuadraticForm::new(&effects, FocusTreatment::Refocused, &compensation);
        form_spots(&form, sheet, 1).map(|spots| spots.len())
    };
    let (spots, ms) = time_median(3..=9, form);
    spots.map(|_count| ms)
}

/// The largest relative difference of growths at the fixed image plane from those by rays that are a
/// hundred times as accurate.
fn sampling_error(
    lens: &Lens,
    sheet: &ToleranceSheet,
    found: &QuadraticForm,
) -> Result<f64, ToleranceError> {
    let scene = ToleranceScene::new(lens, 0, 1e-2 * ACCURACY)?.with_held_pupils();
    let exact = ErrorModel::new(&scene, sheet, SecondDerivatives::Neglected, &|| false)?;
    let [exact, found] = [&exact.forms[0], found].map(|form| growths(form, sheet));
    let floor = NEGLIGIBLE * exact.iter().sum::<f64>();
    let apart = exact.iter().zip(&found);
    let apart = apart.map(|(exact, found)| (found - exact).abs() / exact.abs().max(floor));
    Ok(apart.fold(0.0, f64::max))
}

/// The largest relative difference of first derivatives by a sweep back from those by jets.
fn first_error(found: &[Sensitivity], swept: &QuadraticForm, sheet: &ToleranceSheet) -> f64 {
    let whole = growths(swept, sheet).iter().sum::<f64>();
    let pairs = found.iter().zip(&swept.first).zip(&sheet.errors);
    let apart = pairs.map(|((jet, swept), own)| {
        let jet = jet.mean_square();
        first_difference(jet, *swept) * share_of(jet, own, whole)
    });
    apart.fold(0.0, f64::max)
}

/// The share of the growth by all errors below which that by one is nothing: an error that moves a plane along
/// itself, say, of which only rounding is left.
const NEGLIGIBLE: f64 = 1e-9;

/// The growth of the mean square spot by each error at half of its range, in mm².
fn growths(form: &QuadraticForm, sheet: &ToleranceSheet) -> Vec<f64> {
    let growth = |(i, own): (usize, &Tolerance)| form.second.of(i, i) * own.half_range.powi(2);
    sheet.errors.iter().enumerate().map(growth).collect()
}

/// 1 for an error that matters beside what all of them do, less for one that does next to nothing.
fn share_of(exact: Derivatives, own: &Tolerance, whole: f64) -> f64 {
    let growth = exact.second.abs() * own.half_range.powi(2);
    (growth / (NEGLIGIBLE * whole).max(f64::MIN_POSITIVE)).sqrt().min(1.0)
}

/// The difference of a first derivative, relative to the larger of itself and `√|value × second|`.
fn first_difference(exact: Derivatives, first: f64) -> f64 {
    let scale = exact.first.abs().max((exact.value * exact.second).abs().sqrt());
    (first - exact.first).abs() / scale.max(f64::MIN_POSITIVE)
}

/// The largest relative difference between second derivatives by jets and by differences of first
/// ones, over some errors of every kind.
fn second_error(scene: &ToleranceScene, sheet: &ToleranceSheet) -> Result<f64, ToleranceError> {
    let mut worst = 0.0_f64;
    for kind in PerturbationKind::ALL {
        let of_kind = |t: &&Tolerance| t.error.kind == kind && t.half_range > 0.0;
        let Some(tolerance) = sheet.errors.iter().filter(of_kind).nth(1) else { continue };
        let derivatives = |value: f64| {
            let systems = perturb(&scene.lens, &[(tolerance.error, value)])?;
            let lens = NominalLens { systems, ..scene.lens.clone() };
            let found = sensitivities(&lens, &scene.beam, scene.options, &[tolerance.error])?;
            let mut found = found[0].mean_square();
            if kind == PerturbationKind::Abbe {
                // Two changes multiply instead of adding.
                found.first /= 1.0 + value;
            }
            Ok::<_, ToleranceError>(found)
        };
        // Terms of the sixth order fall with the fourth power of the step, rounding grows with its inverse.
        let step = STEP * tolerance.half_range;
        let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(|i| derivatives(i * step));
        let difference = 8.0 * (c?.first - b?.first) - (d?.first - a?.first);
        let exact = derivatives(0.0)?.second;
        worst = worst.max((difference / (12.0 * step) - exact).abs() / exact.abs());
    }
    Ok(worst)
}

/// The times of gradients of the as-built merit and of the spot, in turn, each the shortest of many.
fn gradient_costs(lens: &Lens, sheet: &ToleranceSheet) -> Result<Vec<AsBuiltCost>, MeritError> {
    let mut lens = lens.clone();
    lens.variables.clear();
    add_variables(&mut lens, &[ParameterKind::Curvatures, ParameterKind::Thicknesses]);
    let merit = |tolerances: Option<ToleranceSheet>, term: Term| {
        let goal = Goal {
            terms: vec![WeightedTerm::new(term, 1.0)],
            pupil: PupilEdge::Moving,
            zoom_ratios: Vec::new(),
            limits: LimitTreatment::default(),
        };
        Merit::new(&Lens { tolerances, ..lens.clone() }, &goal, ACCURACY)
    };
    let made = |count: usize| {
        let errors = sheet.errors.iter().cycle().take(count);
        let shared = (count.div_ceil(sheet.errors.len()) as f64).sqrt();
        let part = |t: &Tolerance| Tolerance { half_range: t.half_range / shared, ..*t };
        let tolerances = ToleranceSheet::of_errors(errors.map(part).collect());
        merit(Some(tolerances), Term::AsBuilt { grade: None })
    };
    let mut merits = vec![merit(None, Term::Spot)?];
    for count in COUNTS {
        merits.push(made(count)?);
    }
    let values = merits[0].values(&lens);
    let evaluate = |merit: &Merit| merit.evaluate(&values, DerivativeLevel::Gradient);
    merits.iter().try_for_each(|merit| evaluate(merit).map(|_| ()))?;
    let case = |merit| -> TimedCase<'_> {
        let repetition = Box::new(move || drop(black_box(evaluate(merit))));
        TimedCase { work: 1.0, repetition }
    };
    let mut cases: Vec<TimedCase<'_>> = merits.iter().map(case).collect();
    let (rates, _) = time_interleaved(&mut cases, TURNS, TURN_SECONDS, &AtomicBool::new(false));
    let ms = |i: usize| 1e3 / rates[i].max;
    let cost = |(i, tolerances): (usize, usize)| {
        let ordinary_gradients = ms(i + 1) / ms(0);
        AsBuiltCost { tolerances, ms: ms(i + 1), ordinary_gradients }
    };
    Ok(COUNTS.into_iter().enumerate().map(cost).collect())
}

/// The variables of a lens that names none.
const VARIED: [ParameterKind; 4] = [
    ParameterKind::Curvatures,
    ParameterKind::Thicknesses,
    ParameterKind::Conics,
    ParameterKind::Aspheres,
];

/// A design that is optimized for its spot as designed, and one for its spot as built.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AsBuiltComparison {
    /// The name of the lens.
    pub name: String,
    /// The class of the tolerances.
    pub grade: ToleranceGrade,
    /// The number of real lenses behind each quantile.
    pub samples: usize,
    /// Optimized as designed.
    pub nominal: MadeDesign,
    /// Optimized as built, from there on, with limits and light alike.
    pub as_built: MadeDesign,
}

impl AsBuiltComparison {
    /// The share by which the 90 % quantile is less for the design that is optimized as built.
    pub fn gain(&self) -> f64 {
        1.0 - self.as_built.quantile / self.nominal.quantile
    }

    /// The share by which it would be less if errors of making did nothing to the design that is
    /// optimized as designed: what there is to gain without a sharper one.
    pub fn most(&self) -> f64 {
        1.0 - self.nominal.rms / self.nominal.quantile
    }
}

/// A design and the lenses that are made by it, refocused.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MadeDesign {
    /// The rms spot radius as designed, in mm.
    pub rms: f64,
    /// The mean rms of lenses that are made, by Monte Carlo, with its standard error, in mm.
    pub mean: [f64; 2],
    /// The rms that nine of ten lenses do not exceed, by Monte Carlo, in mm.
    pub quantile: f64,
    /// The mean area of the pupils, in mm².
    pub light: f64,
    /// The number of steps.
    pub steps: usize,
}

/// Optimizes a lens for its spot as designed, then from there for its spot as built by a class of
/// tolerances; both with the default limits, and with at least the light that they start with, up to this many
/// steps each. A lens without variables gets all curvatures and gaps, and the conic constants and
/// coefficients of its aspheres. `None` once `stop` is true.
///
/// # Errors
/// A lens without a merit or without tolerances.
pub fn compare_as_built(
    lens: &Lens,
    grade: ToleranceGrade,
    (steps, samples): (usize, usize),
    stop: &AtomicBool,
) -> Result<Option<AsBuiltComparison>, ToleranceBenchmarkError> {
    let mut lens = lens.clone();
    if lens.variables.is_empty() {
        add_variables(&mut lens, &VARIED);
    }
    let scene = ToleranceScene::new(&lens, 0, ACCURACY)?;
    let sheet = graded_sheet(&lens, &scene.lens, grade);
    let lens = Lens { tolerances: Some(sheet.clone()), merit: None, ..lens };
    let goal = Goal::default_for(&lens)?;
    let made_goal = goal.clone().as_built(None);
    let Some((nominal, taken)) = descend(&lens, &goal, steps, stop)? else { return Ok(None) };
    let judge = |lens: &Lens, steps: usize| judge(lens, &goal, &sheet, (steps, samples));
    let first = judge(&nominal, taken)?;
    let Some((made, taken)) = descend(&nominal, &made_goal, steps, stop)? else { return Ok(None) };
    let as_built = judge(&made, taken)?;
    let name = made.name;
    Ok(Some(AsBuiltComparison { name, grade, samples, nominal: first, as_built }))
}

/// The best lens of a descent and the number of its steps; `None` once `stop` is true.
fn descend(
    lens: &Lens,
    goal: &Goal,
    steps: usize,
    stop: &AtomicBool,
) -> Result<Option<(Lens, usize)>, MeritError> {
    let mut optimizer = start(DescentMethod::TrustRegion, lens, goal, ACCURACY)?;
    let mut taken = 0;
    while taken < steps {
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        taken += 1;
        if optimizer.step().finished {
            break;
        }
    }
    optimizer.verify_best();
    Ok(Some((optimizer.best().clone(), taken)))
}

/// The lenses that are made by a design.
fn judge(
    lens: &Lens,
    goal: &Goal,
    sheet: &ToleranceSheet,
    (steps, samples): (usize, usize),
) -> Result<MadeDesign, ToleranceBenchmarkError> {
    let scene = ToleranceScene::new(lens, 0, ACCURACY)?;
    let request = ToleranceRequest { seed: 1, samples, limit: None };
    let found = analyze(&scene, sheet, request)?;
    let spot = &found.spots[1];
    let quantile = spot.quantiles.iter().find(|quantile| quantile.share == 0.9);
    Ok(MadeDesign {
        rms: spot.nominal_rms,
        mean: spot.mean_rms,
        quantile: quantile.map_or(f64::NAN, |quantile| quantile.corrected),
        light: Merit::new(lens, goal, ACCURACY)?.light(),
        steps,
    })
}
