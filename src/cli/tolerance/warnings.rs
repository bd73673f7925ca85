//! Warnings in the results of `tolerance`.

use super::compensators::stop_warning;
use crate::tolerance::{AsBuiltSpot, ToleranceAnalysis};

/// Warnings of an analysis.
pub(super) fn warnings(analysis: &ToleranceAnalysis) -> Vec<String> {
    let mut warnings = Vec::new();
    for spot in analysis.spots.iter().filter(|spot| !spot.form_agrees) {
        let [apart, error] = spot.difference.map(|v| 100.0 * v / spot.form_mean_rms);
        warnings.push(format!(
            "{}: the quadratic model differs from Monte Carlo by {apart:.2} % ± {error:.2} %; the \
             corrected numbers count",
            focus_name(spot)
        ));
    }
    warnings.extend(stop_warning(analysis.stopped));
    for spot in analysis.spots.iter().filter(|spot| !spot.rims_agree) {
        let [change, error] =
            spot.clipping.unwrap_or_default().map(|v| 100.0 * v / spot.form_mean_rms);
        warnings.push(format!(
            "{}: rims that clip change the mean rms by {change:.2} % ± {error:.2} %; the errors of the \
             means count that, the quantiles and the yield leave it out",
            focus_name(spot)
        ));
    }
    if analysis.dark > 0 {
        warnings.push(format!(
            "in {} of {} lenses with rims a field gets no light; what rims change leaves these out",
            analysis.dark, analysis.with_rims
        ));
    }
    if analysis.lost > 0 {
        warnings.push(format!(
            "{} of {} lenses lose rays and count as bad; the means leave them out",
            analysis.lost, analysis.samples
        ));
    }
    warnings
}

fn focus_name(spot: &AsBuiltSpot) -> String {
    let name = serde_json::to_value(spot.focus).unwrap_or_default();
    name.as_str().unwrap_or_default().to_owned()
}
