//! The whole analysis: sensitivities, the quadratic form, real lenses, and how well both agree.

use super::travel::{AdjustmentTravel, StoppedLenses, stopped_lenses, travels};
use super::{
    Compensation, FocusTreatment, QuadraticForm, RealLens, Sensitivity, ToleranceError,
    ToleranceScene, real_lenses, sensitivities, wilson_interval,
};
use crate::lens::{Perturbation, ToleranceSheet};
use serde::Serialize;
use std::sync::atomic::AtomicBool;

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
    /// The effect of each error, in the order of the tolerances.
    pub sensitivities: Vec<Sensitivity>,
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
    /// the mean share of light lost where rims clip, which the spots leave out; `None` without rays.
    pub clipping: Option<[f64; 3]>,
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
    /// The root of the expected mean square by the form, in mm.
    pub form_root_mean_square: f64,
    /// The mean of the rms by the form, in mm.
    pub form_mean_rms: f64,
    /// The mean of the rms in mm with its error: the form, corrected by the real lenses. The error is
    /// the standard error and, beyond it, what rims would clip.
    pub mean_rms: [f64; 2],
    /// The mean change of the rms where rims clip, with its standard error, in mm; `None` without
    /// rays.
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
    analyze_until(scene, sheet, request, &AtomicBool::new(false))
}

/// The same with fewer real lenses once `stop` is true.
///
/// # Errors
/// As those of [`analyze`].
pub fn analyze_until(
    scene: &ToleranceScene,
    sheet: &ToleranceSheet,
    request: ToleranceRequest,
    stop: &AtomicBool,
) -> Result<ToleranceAnalysis, ToleranceError> {
    let errors: Vec<Perturbation> = sheet.errors.iter().map(|t| t.error).collect();
    let found = sensitivities(&scene.lens, &scene.beam, scene.options, &errors)?;
    if found.is_empty() {
        return Err(ToleranceError::Other("no tolerances; expected at least one".to_owned()));
    }
    let treatments = [FocusTreatment::Fixed, FocusTreatment::Refocused];
    let compensation = Compensation::new(scene, sheet)?;
    let forms = treatments.map(|focus| QuadraticForm::new(scene, &found, focus, &compensation));
    let real = real_lenses(scene, sheet, request.seed, request.samples, WITH_RIMS, stop)?;
    let [fixed, refocused] =
        forms.each_ref().map(|form| FormLenses::new(form, sheet, request.seed));
    let (fixed, refocused) = (fixed?, refocused?);
    let travels = travels(&compensation.adjustments, &forms[1], &refocused.adjustments, &real);
    let stopped = stopped_lenses(&compensation.adjustments, &forms[1], &real);
    let spot = |i: usize, lenses: FormLenses| {
        let expected = forms[i].expectation(sheet)?;
        Ok::<_, ToleranceError>(as_built(
            treatments[i],
            (&forms[i], expected),
            lenses,
            &real,
            request,
        ))
    };
    let spots = [spot(0, fixed)?, spot(1, refocused)?];
    let lost = real.iter().filter(|lens| lens.mean_square.is_none()).count();
    let clipping = clipping(&real);
    let samples = real.len();
    let with_rims = samples.min(WITH_RIMS);
    let is_dark = |lens: &&RealLens| lens.mean_square.is_some() && lens.clipped.is_none();
    let dark = real[..with_rims].iter().filter(is_dark).count();
    let sensitivities = found;
    Ok(ToleranceAnalysis {
        sensitivities,
        forms,
        spots,
        travels,
        stopped,
        samples,
        lost,
        with_rims,
        dark,
        clipping,
        real,
    })
}

impl ToleranceAnalysis {
    /// The share of each error in the growth of the expected mean square spot, at the fixed image plane
    /// and refocused; correlated errors share what they do together.
    ///
    /// # Errors
    /// Correlations that no errors can have.
    pub fn growth_shares(&self, sheet: &ToleranceSheet) -> Result<Vec<[f64; 2]>, ToleranceError> {
        let [fixed, refocused] = self.forms.each_ref().map(|form| form.growth(sheet));
        let (fixed, refocused) = (fixed?, refocused?);
        let total = |growth: &[f64]| growth.iter().sum::<f64>().abs().max(f64::MIN_POSITIVE);
        let totals = [total(&fixed), total(&refocused)];
        let pairs = fixed.into_iter().zip(refocused);
        Ok(pairs.map(|(a, b)| [a / totals[0], b / totals[1]]).collect())
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
    real: &[RealLens],
    request: ToleranceRequest,
) -> AsBuiltSpot {
    let many = sorted(lenses.rms);
    let form_mean_rms = mean(&many);
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
    let clipping = rms_changes(real, which);
    let clipped = clipping.map_or(0.0, |[change, _]| change.abs());
    let spread = mean_with_error(&many)[1];
    let corrected = form_mean_rms + difference[0];
    let columns = [0, 1].map(|i| sorted(pairs.iter().map(|pair| pair[i]).collect()));
    let at_share = |share: f64| quantile(share, &many, &columns);
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
    ) -> Result<Self, ToleranceError> {
        let reduced = form.reduced(sheet)?;
        // Other errors than those of the real lenses.
        let other = seed ^ 0x5DEE_CE66_D1CE_CAFE;
        let lenses = reduced.random_lenses(&sheet.errors, other, FORM_SAMPLES);
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
    Ok(FormLenses::new(form, sheet, seed)?.rms)
}

fn sorted(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_unstable_by(f64::total_cmp);
    values
}

/// A quantile of lenses by the form, corrected by the real lenses and the form on the same errors, all
/// of them sorted.
fn quantile(share: f64, many: &[f64], [real, same]: &[Vec<f64>; 2]) -> Quantile {
    let form = at_share(many, share);
    let change = if real.is_empty() { 0.0 } else { at_share(real, share) - at_share(same, share) };
    Quantile { share, form, corrected: form + change }
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
