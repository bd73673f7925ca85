//! Warnings in the results of `tolerance`.

use super::compensators::stop_warning;
use super::tables::surfaces;
use crate::cli::output::counted;
use crate::lens::{Perturbation, PerturbationKind, SurfaceNumber, ToleranceSheet};
use crate::tolerance::{
    AdjustmentTravel, AsBuiltSpot, NominalLens, ToleranceAnalysis, ToleranceGrade, is_beside_grin,
};
use std::collections::BTreeMap;

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
    warnings.extend(analysis.spots.iter().filter_map(growth_warning));
    warnings.extend(travel_warning(&analysis.travels));
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

/// The share of the growth of the mean rms above which a difference from it is told.
const GROWS_ALIKE: f64 = 0.25;

/// A warning of a growth that is smaller than what the quadratic model leaves out, as where compensators undo the
/// errors.
fn growth_warning(spot: &AsBuiltSpot) -> Option<String> {
    let ([apart, error], growth) = (spot.difference, spot.form_mean_rms - spot.nominal_rms);
    let is_apart = apart.abs() > (2.0 * error).max(GROWS_ALIKE * growth.abs());
    (spot.form_agrees && is_apart).then(|| {
        format!(
            "{}: the errors change the rms so little that what the quadratic model leaves out matters: its growth \
             is {growth:.1e} mm, that of the rays {:.1e} mm; the shares of single errors are not to be trusted",
            focus_name(spot),
            growth + apart
        )
    })
}

/// A warning of compensators that do not move.
fn travel_warning(travels: &[AdjustmentTravel]) -> Option<String> {
    let is_held = |own: &AdjustmentTravel| own.travel == Some(0.0);
    let all_held = !travels.is_empty() && travels.iter().all(is_held);
    all_held.then(|| {
        "no compensator has any travel, so that `refocused` is the fixed image plane".to_owned()
    })
}

/// Warnings of tolerances that are possible but seldom meant.
pub(super) fn sheet_warnings(sheet: &ToleranceSheet, lens: &NominalLens) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut places: BTreeMap<Perturbation, usize> = BTreeMap::new();
    for (place, tolerance) in sheet.errors.iter().enumerate() {
        let error = tolerance.error;
        let name = format!("errors[{place}] (`{}`)", error.kind.name());
        if let Some(first) = places.insert(error, place) {
            warnings.push(format!("{name} is the same error as errors[{first}]; both count"));
        }
        warnings.extend(unusual_place(error, lens).map(|why| format!("{name} {why}")));
    }
    warnings
}

/// What is unusual about the place of an error, as the rest of a sentence.
fn unusual_place(error: Perturbation, lens: &NominalLens) -> Option<String> {
    let system = &lens.systems[lens.primary];
    let surface = system.surfaces.get(error.first)?;
    let number = SurfaceNumber::new(error.first);
    match error.kind {
        PerturbationKind::Index | PerturbationKind::Abbe
            if surface.index == 1.0 && surface.grin.is_none() =>
        {
            Some(format!("is of the air behind surface {number}"))
        }
        kind if kind.moves_a_body() && error.first == error.last && !surface.mirror => Some(
            format!("moves surface {number} alone; `last` names the rear surface of an element"),
        ),
        _ => None,
    }
}

/// A warning of the errors that a class leaves out at surfaces beside a GRIN medium.
pub(super) fn grade_warning(grade: Option<ToleranceGrade>, lens: &NominalLens) -> Option<String> {
    grade?;
    let system = &lens.systems[lens.primary];
    let beside = (0..system.surfaces.len()).filter(|surface| is_beside_grin(system, *surface));
    let names: Vec<String> = beside.map(|surface| surfaces(surface, surface)).collect();
    (!names.is_empty()).then(|| {
        format!(
            "irregularity, tilt and decentre of {} beside a GRIN medium ({}) are not computed; the class leaves \
             them out",
            counted(names.len(), "surface"),
            names.join(", ")
        )
    })
}
