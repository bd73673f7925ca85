//! The loosest tolerances for a spot, or for a share of good lenses, that is asked for.

use super::reduced::{ErrorMultiples, ReducedForm};
use super::{QuadraticForm, ToleranceError};
use crate::lens::{Tolerance, ToleranceSheet};

/// A tolerance is widened or narrowed by at most this factor before all are scaled together.
const MOST: f64 = 10.0;

/// The loosest tolerances for an expected mean square spot radius `target` in mm². Each error costs
/// about the same: half ranges are proportional to one over the root of their second derivative,
/// within a factor of ten of what they were. Where a compensator ends at a stop, the mean square is that of random
/// lenses by the form.
///
/// # Errors
/// A target that the lens without errors does not reach, and a form by which the expected spot falls as tolerances
/// widen.
pub fn loosest_tolerances(
    form: &QuadraticForm,
    sheet: &ToleranceSheet,
    target: f64,
) -> Result<Vec<Tolerance>, ToleranceError> {
    let nominal = form.as_designed();
    if !(target > nominal) {
        let (found, nominal) = (target.max(0.0).sqrt(), nominal.sqrt());
        return Err(ToleranceError::BelowNominal { found, nominal });
    }
    if form.has_stops() {
        return widest_with_equal_costs(form, sheet, |lenses, factor| {
            lenses.mean_square(factor) <= target
        });
    }
    let shaped = with_equal_costs(form, sheet, sheet)?;
    let total: f64 = form.growth(&shaped)?.iter().sum();
    if total < 0.0 {
        let text = "by the quadratic model the expected spot falls as the tolerances widen, so that none are the \
                    loosest; expected pupils that are held or other tolerances";
        return Err(ToleranceError::Other(text.to_owned()));
    }
    let scale = if total > 0.0 { ((target - nominal) / total).sqrt() } else { 1.0 };
    Ok(widened(&shaped.errors, |_| scale))
}

/// Tolerances that are widened so that each costs about the same, with compensators at their stops as often as with
/// the errors of `known`.
fn with_equal_costs(
    form: &QuadraticForm,
    sheet: &ToleranceSheet,
    known: &ToleranceSheet,
) -> Result<ToleranceSheet, ToleranceError> {
    let stops = form.stop_curvature(known)?;
    // What an error costs alone; what correlated ones cost together is in the sum.
    let cost = |(i, t): (usize, &Tolerance)| {
        0.5 * form.second_with_stops((i, i), stops.as_ref()) * t.deviation().powi(2)
    };
    let costs: Vec<f64> = sheet.errors.iter().enumerate().map(cost).collect();
    let paid = costs.iter().filter(|cost| **cost > 0.0).count().max(1);
    let mean = costs.iter().filter(|cost| **cost > 0.0).sum::<f64>() / paid as f64;
    // One that makes the spot smaller, as one that narrows a pupil may, is not free: wide, it would outweigh the others.
    let factor = |cost: &f64| {
        if *cost == 0.0 { MOST } else { (mean / cost.abs()).sqrt().clamp(1.0 / MOST, MOST) }
    };
    let factors: Vec<f64> = costs.iter().map(factor).collect();
    Ok(ToleranceSheet { errors: widened(&sheet.errors, |i| factors[i]), ..sheet.clone() })
}

/// The number of times that the costs of errors are found for the tolerances that they lead to, where compensators
/// have stops.
const ROUNDS: usize = 4;

/// The loosest tolerances with which a condition permits random lenses, by a form and the factor of their errors.
fn widest_with_equal_costs(
    form: &QuadraticForm,
    sheet: &ToleranceSheet,
    is_permitted: impl Fn(&RandomLenses, f64) -> bool,
) -> Result<Vec<Tolerance>, ToleranceError> {
    let mut found = sheet.clone();
    for _ in 0..if form.has_stops() { ROUNDS } else { 1 } {
        let shaped = with_equal_costs(form, sheet, &found)?;
        let lenses = RandomLenses::new(form, &shaped)?;
        let factor = widest(|factor| is_permitted(&lenses, factor));
        found.errors = widened(&shaped.errors, |_| factor);
    }
    Ok(found.errors)
}

fn widened(tolerances: &[Tolerance], factor: impl Fn(usize) -> f64) -> Vec<Tolerance> {
    let wider =
        |(i, t): (usize, &Tolerance)| Tolerance { half_range: t.half_range * factor(i), ..*t };
    tolerances.iter().enumerate().map(wider).collect()
}

/// The number of lenses by the form from which a yield is told: its error is half a per cent.
const LENSES: u64 = 8_000;
/// The factor between those that are tried in turn, and the halvings of the range between two of them.
const TRIED: f64 = 1.5;
const HALVINGS: usize = 30;
/// The factor up to which tolerances are widened or narrowed for a yield.
const WIDEST: f64 = 1e4;

/// The share of lenses with these tolerances whose rms spot is at most `limit` mm, by the form.
///
/// # Errors
/// Correlations that no errors can have.
pub fn form_yield(
    form: &QuadraticForm,
    sheet: &ToleranceSheet,
    limit: f64,
) -> Result<f64, ToleranceError> {
    Ok(RandomLenses::new(form, sheet)?.good(limit, 1.0))
}

/// Random lenses by a form, the same ones for every factor of all tolerances.
struct RandomLenses {
    form: ReducedForm,
    lenses: Vec<ErrorMultiples>,
}

impl RandomLenses {
    fn new(form: &QuadraticForm, sheet: &ToleranceSheet) -> Result<Self, ToleranceError> {
        let form = form.reduced(sheet)?;
        let lenses = form.random_lenses(&sheet.errors, SEED, LENSES, &|| false)?;
        Ok(Self { form, lenses })
    }

    fn mean_squares(&self, factor: f64) -> impl Iterator<Item = f64> {
        self.lenses.iter().map(move |errors| self.form.at_multiple(errors, factor))
    }

    /// The mean of the mean square spot radii in mm².
    fn mean_square(&self, factor: f64) -> f64 {
        self.mean_squares(factor).sum::<f64>() / LENSES as f64
    }

    /// The share of those with an rms spot of at most `limit` mm.
    fn good(&self, limit: f64, factor: f64) -> f64 {
        let good = self.mean_squares(factor).filter(|square| *square <= limit * limit);
        good.count() as f64 / LENSES as f64
    }
}

/// The largest factor of tolerances up to which a condition permits all smaller ones: a form that falls below 0
/// far out permits larger ones too.
fn widest(is_permitted: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (1.0 / WIDEST, TRIED / WIDEST);
    while high < WIDEST && is_permitted(high) {
        (low, high) = (high, TRIED * high);
    }
    for _ in 0..HALVINGS {
        let middle = (low * high).sqrt();
        if is_permitted(middle) { low = middle } else { high = middle }
    }
    low
}

/// The seed of the lenses from which a yield is told.
const SEED: u64 = 0x7E1D;

/// The loosest tolerances with which this share of lenses has an rms spot of at most `limit` mm, by the
/// form. Each error costs about the same, as by [`loosest_tolerances`].
///
/// # Errors
/// A limit that the lens without errors does not reach, and a share that is not between 0 and 1.
pub fn loosest_for_yield(
    form: &QuadraticForm,
    sheet: &ToleranceSheet,
    limit: f64,
    share: f64,
) -> Result<Vec<Tolerance>, ToleranceError> {
    if !(share > 0.0 && share < 1.0) {
        let text = format!("a yield of {share} is asked for; expected more than 0 and less than 1");
        return Err(ToleranceError::Other(text));
    }
    if !(limit * limit > form.as_designed()) {
        let (found, nominal) = (limit, form.as_designed().sqrt());
        return Err(ToleranceError::BelowNominal { found, nominal });
    }
    widest_with_equal_costs(form, sheet, |lenses, factor| lenses.good(limit, factor) >= share)
}
