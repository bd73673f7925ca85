//! The loosest tolerances for a spot that is asked for.

use super::{QuadraticForm, ToleranceError};
use crate::lens::Tolerance;

/// A tolerance is widened or narrowed by at most this factor before all are scaled together.
const MOST: f64 = 10.0;

/// The loosest tolerances for an expected mean square spot radius `target` in mm². Each error costs
/// about the same: half ranges are proportional to one over the root of their second derivative,
/// within a factor of ten of what they were.
///
/// # Errors
/// A target that the lens without errors does not reach.
pub fn loosest_tolerances(
    form: &QuadraticForm,
    tolerances: &[Tolerance],
    target: f64,
) -> Result<Vec<Tolerance>, ToleranceError> {
    if !(target > form.nominal) {
        let rms = form.nominal.max(0.0).sqrt();
        return Err(ToleranceError::Other(format!(
            "an rms of {} mm is asked for; expected more than {rms:.6} mm, that of the lens without \
             errors",
            target.max(0.0).sqrt()
        )));
    }
    let cost = |(i, t): (usize, &Tolerance)| 0.5 * form.second[(i, i)] * t.deviation().powi(2);
    let costs: Vec<f64> = tolerances.iter().enumerate().map(cost).collect();
    let paid = costs.iter().filter(|cost| **cost > 0.0).count().max(1);
    let mean = costs.iter().filter(|cost| **cost > 0.0).sum::<f64>() / paid as f64;
    let factor = |cost: f64| {
        if cost > 0.0 { (mean / cost).sqrt().clamp(1.0 / MOST, MOST) } else { MOST }
    };
    let total: f64 = costs.iter().map(|cost| cost * factor(*cost).powi(2)).sum();
    let scale = if total > 0.0 { ((target - form.nominal) / total).sqrt() } else { 1.0 };
    let widened = tolerances.iter().zip(&costs);
    let widened = widened
        .map(|(t, cost)| Tolerance { half_range: t.half_range * factor(*cost) * scale, ..*t });
    Ok(widened.collect())
}
