//! Warnings of tolerances that are seldom meant, and of what the quadratic model cannot tell of them.

use crate::lens::{Perturbation, PerturbationKind, SurfaceNumber, ToleranceSheet};
use crate::tolerance::{
    AdjustmentTravel, AsBuiltSpot, FocusTreatment, NominalLens, ToleranceAnalysis, is_beside_grin,
};
use std::collections::BTreeMap;

/// Warnings of the tolerances of a lens, of which `are_of_a_class` says whether a class proposed them, and of
/// their analysis.
pub fn tolerance_warnings(
    (sheet, are_of_a_class): (&ToleranceSheet, bool),
    lens: &NominalLens,
    analysis: &ToleranceAnalysis,
) -> Vec<String> {
    let mut warnings: Vec<String> = analysis.spots.iter().filter_map(growth_warning).collect();
    warnings.extend(travel_warning(&analysis.travels));
    warnings.extend(sheet_warnings(sheet, lens));
    warnings.extend(are_of_a_class.then(|| grin_warning(lens)).flatten());
    warnings
}

/// The share of the growth of the mean rms above which a difference from it is told.
const GROWS_ALIKE: f64 = 0.25;

/// A warning of a growth that is smaller than what the quadratic model leaves out, as where compensators undo the
/// errors.
fn growth_warning(spot: &AsBuiltSpot) -> Option<String> {
    let ([apart, error], growth) = (spot.difference, spot.form_mean_rms - spot.nominal_rms);
    let is_apart = apart.abs() > (2.0 * error).max(GROWS_ALIKE * growth.abs());
    (!spot.real_rms.is_empty() && spot.form_agrees && is_apart).then(|| {
        format!(
            "{}: the errors change the rms so little that what the quadratic model leaves out matters: its growth \
             is {growth:.1e} mm, that of the rays {:.1e} mm; the shares of single errors are not to be trusted",
            if spot.focus == FocusTreatment::Fixed { "fixed" } else { "refocused" },
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
fn sheet_warnings(sheet: &ToleranceSheet, lens: &NominalLens) -> Vec<String> {
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
fn grin_warning(lens: &NominalLens) -> Option<String> {
    let system = &lens.systems[lens.primary];
    let beside = (0..system.surfaces.len()).filter(|surface| is_beside_grin(system, *surface));
    let names: Vec<String> =
        beside.map(|surface| SurfaceNumber::new(surface).to_string()).collect();
    (!names.is_empty()).then(|| {
        format!(
            "irregularity, tilt and decentre of surfaces beside a GRIN medium ({}) are not computed; the class \
             leaves them out",
            names.join(", ")
        )
    })
}
