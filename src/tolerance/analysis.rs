//! The whole analysis: sensitivities, the quadratic form, real lenses, and how well both agree.

use super::form::growth_shares;
use super::monte_carlo::{KnownLens, RealLensRun};
use super::pupils::PupilTreatment;
use super::travel::{AdjustmentTravel, StoppedLenses, stopped_lenses, travels};
use super::{
    Compensation, FocusTreatment, PupilMotion, QuadraticForm, RayEffects, RealLens,
    SecondDerivatives, StopTest, ToleranceError, ToleranceScene, refuse_if_stopped,
    wilson_interval,
};
use crate::lens::{Perturbation, ToleranceSheet};
use serde::Serialize;

/// The scope of an analysis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToleranceRequest {
    /// The seed of random errors.
    pub seed: u64,
    /// The number of real lenses.
    pub samples: usize,
    /// The largest rms spot radius of a good lens in mm, for the yield; `None` for no yield.
    pub limit: Option<f64>,
}

/// The result.
#[derive(Debug, Clone)]
pub struct ToleranceAnalysis {
    /// True if the second derivatives of rays by errors are a part of the forms.
    pub has_second_derivatives: bool,
    /// The quadratic forms at the fixed image plane and refocused.
    pub forms: [QuadraticForm; 2],
    /// The spots at the fixed image plane and refocused.
    pub spots: [AsBuiltSpot; 2],
    /// The travels of focus and of the other compensators, in their order.
    pub travels: Vec<AdjustmentTravel>,
    /// The real lenses of which a compensator ends at its stop; `None` if none does.
    pub stopped: Option<StoppedLenses>,
    /// The number of real lenses.
    pub samples: usize,
    /// The number of those of which a ray does not arrive; they count as bad.
    pub lost: usize,
    /// The number of lenses that are traced with rims that clip too, and of those of which a field gets
    /// no light through them though all rays arrive without.
    pub with_rims: usize,
    /// The number of the latter.
    pub dark: usize,
    /// The mean relative change of the mean square spot, at the fixed image plane and refocused, and
    /// the mean share of light lost where rims clip, which the spots leave out; `None` without rays, and
    /// where pupils move.
    pub clipping: Option<[f64; 3]>,
    /// The decision whether the pupils of lenses with errors are found anew.
    pub pupils: PupilMotion,
    /// The lenses with random errors whose rays were traced.
    pub real: Vec<RealLens>,
}

/// The spot of lenses that are made, as an rms radius over all fields.
#[derive(Debug, Clone, Serialize)]
pub struct AsBuiltSpot {
    /// The treatment of the focus.
    pub focus: FocusTreatment,
    /// The rms of the lens as designed, in mm.
    pub nominal_rms: f64,
    /// The root of the expected mean square by the form, in mm; that of its random lenses if the travel of a
    /// compensator has an end.
    pub form_root_mean_square: f64,
    /// The mean of the rms by the form, in mm.
    pub form_mean_rms: f64,
    /// The mean of the rms in mm with its error: the form, corrected by the real lenses. The error is
    /// the standard error and, beyond it, what rims would clip.
    pub mean_rms: [f64; 2],
    /// The mean change of the rms where rims clip, with its standard error, in mm; `None` without
    /// rays, and where pupils move.
    pub clipping: Option<[f64; 2]>,
    /// The mean of the rms of the real lenses minus that of the form on the same errors, in mm, with
    /// its standard error.
    pub difference: [f64; 2],
    /// True if that difference is within twice its error, or below half a per cent, and most of the real
    /// lenses have a spot to compare.
    pub form_agrees: bool,
    /// True if the change where rims clip is within twice its error, or below half a per cent.
    pub rims_agree: bool,
    /// The rms that these shares of all lenses do not exceed.
    pub quantiles: Vec<Quantile>,
    /// The distribution of the rms: shares of all lenses in even steps, with the rms that they do not
    /// exceed.
    #[serde(skip)]
    pub distribution: Vec<Quantile>,
    /// The rms of each real lens whose rays arrive in mm, the least first.
    #[serde(skip)]
    pub real_rms: Vec<f64>,
    /// The share of good lenses, if a limit was given.
    pub good: Option<YieldEstimate>,
}

/// The rms that a share of all lenses does not exceed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quantile {
    /// The share of the lenses.
    pub share: f64,
    /// By the form, in mm.
    pub form: f64,
    /// The same corrected by the real lenses, in mm.
    pub corrected: f64,
    /// The standard error of the latter, in mm.
    pub error: f64,
}

/// The share of good lenses.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct YieldEstimate {
    /// By the form.
    pub form: f64,
    /// Of the real lenses.
    pub real: f64,
    /// The interval of the real lenses with 95 % confidence.
    pub interval: [f64; 2],
    /// The form, corrected by the real lenses on the same errors.
    pub corrected: f64,
}

/// The shares of the quantiles.
const SHARES: [f64; 4] = [0.5, 0.8, 0.9, 0.98];
/// The steps of the distribution.
const STEPS: usize = 50;
/// The number of lenses by the form.
const FORM_SAMPLES: u64 = 20_000;
/// The number of real lenses that are traced with rims too.
const WITH_RIMS: usize = 50;
/// A difference between form and real lenses below this share is no matter.
const NEGLIGIBLE: f64 = 0.005;

/// Analyses the tolerances of a lens.
///
/// # Errors
/// An error of making that is not possible, or a lens as designed whose rays do not arrive.
pub fn analyze(
    scene: &ToleranceScene,
    sheet: &ToleranceSheet,
    request: ToleranceRequest,
) -> Result<ToleranceAnalysis, ToleranceError> {
    let model = ErrorModel::new(scene, sheet, SecondDerivatives::default(), &|| false)?;
    model.analyze(scene, sheet, request, &|| false)
}

/// The quadratic forms of a lens with its errors, before any random lens.
#[derive(Debug, Clone)]
pub struct ErrorModel {
    compensation: Compensation,
    /// The forms at the fixed image plane and refocused.
    pub forms: [QuadraticForm; 2],
    has_second_derivatives: bool,
    /// The decision whether the pupils of lenses with errors are found anew.
    pub pupils: PupilMotion,
}

impl ErrorModel {
    /// The model of a lens with its tolerances.
    ///
    /// # Errors
    /// No tolerances, an error of making that is not possible, a lens as designed whose rays do not
    /// arrive, and [`ToleranceError::Stopped`] once `stop` says so.
    pub fn new(
        scene: &ToleranceScene,
        sheet: &ToleranceSheet,
        second: SecondDerivatives,
        stop: StopTest<'_>,
    ) -> Result<Self, ToleranceError> {
        if sheet.errors.is_empty() {
            let text = "no tolerances; expected at least one".to_owned();
            return Err(ToleranceError::Other(text));
        }
        let errors: Vec<Perturbation> = sheet.errors.iter().map(|t| t.error).collect();
        let effects = RayEffects::with_moving_pupils(scene, &errors, second, stop)?;
        let compensation = Compensation::new(scene, sheet)?;
        refuse_if_stopped(stop)?;
        let forms = TREATMENTS.map(|focus| {
            QuadraticForm::with_moving_and_held_pupils(&effects, focus, &compensation)
        });
        let [[fixed, fixed_held], [refocused, refocused_held]] = forms;
        let (moving, held) = ([fixed, refocused], [fixed_held, refocused_held]);
        let pupils = match &scene.pupils {
            PupilTreatment::Held(why) => PupilMotion::held(why),
            PupilTreatment::Known(own) if effects.has_moving_pupils() => {
                PupilMotion::new(own, &effects, sheet, (&moving, &held))?
            }
            PupilTreatment::Known(_) => {
                PupilMotion::held("a ray on the edge of a pupil does not arrive")
            }
        };
        let forms = if pupils.moves { moving } else { held };
        let has_second_derivatives = effects.has_second_derivatives();
        Ok(Self { compensation, forms, has_second_derivatives, pupils })
    }

    /// The analysis by random lenses: many by the forms, and some by their rays, fewer once `stop`
    /// says so.
    ///
    /// # Errors
    /// Correlations that no errors can have, and [`ToleranceError::Stopped`] if `stop` says so before
    /// the real lenses.
    pub fn analyze(
        self,
        scene: &ToleranceScene,
        sheet: &ToleranceSheet,
        request: ToleranceRequest,
        stop: StopTest<'_>,
    ) -> Result<ToleranceAnalysis, ToleranceError> {
        self.analyze_on((scene, sheet), request, stop, (&[], |_| {}))
    }

    /// The same where the first real lenses are known; all lenses so far are shown to `visit` after every
    /// part. The result does not depend on how many are known.
    ///
    /// # Errors
    /// As those of [`ErrorModel::analyze`].
    pub fn analyze_on(
        self,
        (scene, sheet): (&ToleranceScene, &ToleranceSheet),
        request: ToleranceRequest,
        stop: StopTest<'_>,
        (known, visit): (&[KnownLens], impl FnMut(&[RealLens])),
    ) -> Result<ToleranceAnalysis, ToleranceError> {
        let by_form = self.lenses(sheet, request.seed, stop)?;
        let run = RealLensRun::new(scene, sheet, request.seed)?;
        let run = run.with_pupils(self.pupils.moves).with_known(known);
        let real = run.advance((request.samples, self.with_rims(request.samples)), stop, visit)?;
        self.compared(sheet, request, (by_form, real))
    }

    /// The number of lenses that are traced with rims: all of them where pupils move.
    fn with_rims(&self, samples: usize) -> usize {
        if self.pupils.moves { samples } else { samples.min(WITH_RIMS) }
    }

    /// Many lenses by the forms.
    fn lenses(
        &self,
        sheet: &ToleranceSheet,
        seed: u64,
        stop: StopTest<'_>,
    ) -> Result<[FormLenses; 2], ToleranceError> {
        let [fixed, refocused] =
            self.forms.each_ref().map(|form| FormLenses::new(form, sheet, seed, stop));
        Ok([fixed?, refocused?])
    }

    /// The analysis from lenses by the forms and from real ones.
    fn compared(
        self,
        sheet: &ToleranceSheet,
        request: ToleranceRequest,
        ([fixed, refocused], real): ([FormLenses; 2], Vec<RealLens>),
    ) -> Result<ToleranceAnalysis, ToleranceError> {
        let with_rims = self.with_rims(real.len());
        let Self { compensation, forms, has_second_derivatives, pupils } = self;
        let parts = &compensation.adjustments;
        let travels = travels(parts, &forms[1], &refocused.adjustments, &real);
        let stopped = stopped_lenses(parts, &forms[1], &real);
        let spot = |i: usize, lenses: FormLenses| {
            let form = (&forms[i], forms[i].expectation(sheet)?);
            let clipping = if pupils.moves { None } else { rms_changes(&real, i) };
            let known = (&real[..], clipping);
            Ok::<_, ToleranceError>(as_built(TREATMENTS[i], form, lenses, known, request))
        };
        let spots = [spot(0, fixed)?, spot(1, refocused)?];
        let is_dark = |lens: &&RealLens| lens.mean_square.is_some() && lens.clipped.is_none();
        Ok(ToleranceAnalysis {
            has_second_derivatives,
            forms,
            spots,
            travels,
            stopped,
            samples: real.len(),
            lost: real.iter().filter(|lens| lens.mean_square.is_none()).count(),
            with_rims,
            dark: real[..with_rims].iter().filter(is_dark).count(),
            clipping: if pupils.moves { None } else { clipping(&real) },
            pupils,
            real,
        })
    }
}

/// The image planes of both forms.
const TREATMENTS: [FocusTreatment; 2] = [FocusTreatment::Fixed, FocusTreatment::Refocused];

impl ToleranceAnalysis {
    /// The share of each error in the growth of the expected mean square spot, at the fixed image plane
    /// and refocused; correlated errors share what they do together.
    ///
    /// # Errors
    /// Correlations that no errors can have.
    pub fn growth_shares(&self, sheet: &ToleranceSheet) -> Result<Vec<[f64; 2]>, ToleranceError> {
        growth_shares(&self.forms, sheet)
    }
}

/// The mean changes where rims clip.
fn clipping(real: &[RealLens]) -> Option<[f64; 3]> {
    let both = real.iter().filter_map(|lens| lens.mean_square.zip(lens.clipped));
    let changes: Vec<[f64; 3]> = both
        .map(|(open, (rims, lost))| [rims[0] / open[0] - 1.0, rims[1] / open[1] - 1.0, lost])
        .collect();
    let mean = |i: usize| changes.iter().map(|c| c[i]).sum::<f64>() / changes.len() as f64;
    (!changes.is_empty()).then(|| [0, 1, 2].map(mean))
}

/// The mean change of the rms where rims clip, with its standard error, in mm.
fn rms_changes(real: &[RealLens], which: usize) -> Option<[f64; 2]> {
    let both = real.iter().filter_map(|lens| lens.mean_square.zip(lens.clipped));
    let change = |(open, (rims, _)): ([f64; 2], ([f64; 2], f64))| {
        rims[which].max(0.0).sqrt() - open[which].max(0.0).sqrt()
    };
    let changes: Vec<f64> = both.map(change).collect();
    (!changes.is_empty()).then(|| mean_with_error(&changes))
}

fn as_built(
    focus: FocusTreatment,
    (form, expected): (&QuadraticForm, f64),
    lenses: FormLenses,
    (real, clipping): (&[RealLens], Option<[f64; 2]>),
    request: ToleranceRequest,
) -> AsBuiltSpot {
    let many = sorted(lenses.rms);
    let form_mean_rms = mean(&many);
    let squares = || mean(&many.iter().map(|rms| rms * rms).collect::<Vec<f64>>());
    let expected = if form.has_stops() { squares() } else { expected };
    let which = usize::from(focus == FocusTreatment::Refocused);
    // Real lenses and the form on the same errors.
    let pairs: Vec<[f64; 2]> = real
        .iter()
        .filter_map(|lens| Some([lens.mean_square?[which].sqrt(), form.at(&lens.errors).sqrt()]))
        .collect();
    let differences: Vec<f64> = pairs.iter().map(|[real, form]| real - form).collect();
    let difference = mean_with_error(&differences);
    let is_small =
        |change: [f64; 2]| change[0].abs() <= (2.0 * change[1]).max(NEGLIGIBLE * form_mean_rms);
    let clipped = clipping.map_or(0.0, |[change, _]| change.abs());
    let spread = mean_with_error(&many)[1];
    let corrected = form_mean_rms + difference[0];
    let columns = [0, 1].map(|i| sorted(pairs.iter().map(|pair| pair[i]).collect()));
    let at_share = |share: f64| quantile(share, &many, (&columns, &pairs));
    AsBuiltSpot {
        focus,
        nominal_rms: form.as_designed().sqrt(),
        form_root_mean_square: expected.max(0.0).sqrt(),
        form_mean_rms,
        mean_rms: [corrected, difference[1].hypot(spread) + clipped],
        clipping,
        difference,
        form_agrees: is_small(difference) && 2 * pairs.len() >= real.len(),
        rims_agree: clipping.is_none_or(is_small),
        quantiles: SHARES.map(at_share).to_vec(),
        distribution: (0..=STEPS).map(|i| at_share(i as f64 / STEPS as f64)).collect(),
        real_rms: columns[0].clone(),
        good: request.limit.map(|limit| good_share(limit, &many, &pairs, real.len())),
    }
}

/// Lenses with random errors, by a form.
struct FormLenses {
    /// The rms of each, in mm.
    rms: Vec<f64>,
    /// The adjustments of each, focus first; none at the fixed image plane.
    adjustments: Vec<Vec<f64>>,
}

impl FormLenses {
    fn new(
        form: &QuadraticForm,
        sheet: &ToleranceSheet,
        seed: u64,
        stop: StopTest<'_>,
    ) -> Result<Self, ToleranceError> {
        let reduced = form.reduced(sheet)?;
        // Other errors than those of the real lenses.
        let other = seed ^ 0x5DEE_CE66_D1CE_CAFE;
        let lenses = reduced.random_lenses(&sheet.errors, other, FORM_SAMPLES, stop)?;
        Ok(Self {
            rms: lenses.iter().map(|errors| reduced.at_multiple(errors, 1.0).sqrt()).collect(),
            adjustments: lenses.iter().map(|errors| reduced.adjustments(errors)).collect(),
        })
    }
}

/// The rms in mm of 20,000 lenses with random errors, by a form.
///
/// # Errors
/// Correlations that no errors can have.
pub fn form_spots(
    form: &QuadraticForm,
    sheet: &ToleranceSheet,
    seed: u64,
) -> Result<Vec<f64>, ToleranceError> {
    Ok(FormLenses::new(form, sheet, seed, &|| false)?.rms)
}

fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values
}

/// A quantile of lenses by the form, corrected by the real lenses and the form on the same errors; `columns` are
/// these sorted, `pairs` lens by lens.
fn quantile(
    share: f64,
    many: &[f64],
    ([real, same], pairs): (&[Vec<f64>; 2], &[[f64; 2]]),
) -> Quantile {
    let form = at_share(many, share);
    let change = if real.is_empty() { 0.0 } else { at_share(real, share) - at_share(same, share) };
    let error = sampled_error(many, share).hypot(change_error(pairs, same, share));
    Quantile { share, form, corrected: form + change, error }
}

/// The standard error of a quantile of a sample: half of the distance between those of the shares that are one
/// standard error of a share apart from it.
fn sampled_error(sorted: &[f64], share: f64) -> f64 {
    let step = (share * (1.0 - share) / sorted.len().max(1) as f64).sqrt();
    let [low, high] = [share - step, share + step].map(|s| at_share(sorted, s.clamp(0.0, 1.0)));
    0.5 * (high - low)
}

/// The standard error of the change of a quantile from the form to real lenses on the same errors: that of the mean
/// of their differences over the lenses about the quantile, which are twice the smaller share beside it.
fn change_error(pairs: &[[f64; 2]], same: &[f64], share: f64) -> f64 {
    let least = share.min(1.0 - share).max(1.0 / same.len().max(1) as f64);
    let [low, high] = [share - least, share + least].map(|s| at_share(same, s.clamp(0.0, 1.0)));
    let near = pairs.iter().filter(|[_, form]| (low..=high).contains(form));
    let differences: Vec<f64> = near.map(|[real, form]| real - form).collect();
    mean_with_error(&differences)[1]
}

/// The value that a share of sorted values does not exceed, between two of them linearly.
fn at_share(sorted: &[f64], share: f64) -> f64 {
    let position = share * (sorted.len().max(1) - 1) as f64;
    let low = position.floor() as usize;
    let at = |i: usize| sorted.get(i).copied().unwrap_or(f64::NAN);
    let high = (low + 1).min(sorted.len().max(1) - 1);
    at(low) + (position - low as f64) * (at(high) - at(low))
}

fn good_share(limit: f64, many: &[f64], pairs: &[[f64; 2]], count: usize) -> YieldEstimate {
    let below = |values: &mut dyn Iterator<Item = f64>| values.filter(|rms| *rms <= limit).count();
    let form = below(&mut many.iter().copied()) as f64 / many.len().max(1) as f64;
    let good = below(&mut pairs.iter().map(|pair| pair[0]));
    let by_form = below(&mut pairs.iter().map(|pair| pair[1]));
    let (real, same) =
        (good as f64 / count.max(1) as f64, by_form as f64 / pairs.len().max(1) as f64);
    let corrected = if pairs.is_empty() { form } else { (form + real - same).clamp(0.0, 1.0) };
    YieldEstimate { form, real, interval: wilson_interval(good, count), corrected }
}

pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The mean of values and its standard error.
pub(super) fn mean_with_error(values: &[f64]) -> [f64; 2] {
    let (count, middle) = (values.len() as f64, mean(values));
    if values.len() < 2 {
        return [middle, 0.0];
    }
    let squares: f64 = values.iter().map(|value| (value - middle).powi(2)).sum();
    [middle, (squares / (count * (count - 1.0))).sqrt()]
}
