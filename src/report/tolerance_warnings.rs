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

/// Warnings of tolerances that are possible but seldom meant, one for each kind of them.
fn sheet_warnings(sheet: &ToleranceSheet, lens: &NominalLens) -> Vec<String> {
    let mut counts: BTreeMap<Perturbation, usize> = BTreeMap::new();
    sheet.errors.iter().for_each(|own| *counts.entry(own.error).or_default() += 1);
    let listed = |is_meant: &dyn Fn(Perturbation, usize) -> bool| -> Vec<Perturbation> {
        let chosen = counts.iter().filter(|(error, count)| is_meant(**error, **count));
        chosen.map(|(error, _)| *error).collect()
    };
    let surface = |error: Perturbation| lens.systems[lens.primary].surfaces.get(error.first);
    let is_of_glass = |kind| matches!(kind, PerturbationKind::Index | PerturbationKind::Abbe);
    let repeated = listed(&|_, count| count > 1);
    let of_air = listed(&|error, _| {
        let is_air = surface(error).is_some_and(|own| own.index == 1.0 && own.grin.is_none());
        is_of_glass(error.kind) && is_air
    });
    let alone = listed(&|error, _| {
        let is_mirror = surface(error).is_some_and(|own| own.mirror);
        error.kind.moves_a_body() && error.first == error.last && !is_mirror
    });
    [
        (repeated, "listed several times, and counted as often"),
        (of_air, "an error of the air behind the surface"),
        (alone, "moves one surface alone; `last` names the rear surface of an element"),
    ]
    .into_iter()
    .filter(|(errors, _)| !errors.is_empty())
    .map(|(errors, what)| format!("{}: {what}", names_of(&errors)))
    .collect()
}

/// The number of errors that a warning names.
const NAMED: usize = 3;

/// The names of some errors with their surfaces, and the number of the others.
fn names_of(errors: &[Perturbation]) -> String {
    let name = |error: &Perturbation| {
        let [first, last] = [error.first, error.last].map(SurfaceNumber::new);
        if first == last {
            format!("`{}` of surface {first}", error.kind.name())
        } else {
            format!("`{}` of surfaces {first}-{last}", error.kind.name())
        }
    };
    let names: Vec<String> = errors.iter().take(NAMED).map(name).collect();
    let others = errors.len().saturating_sub(NAMED);
    let more = if others > 0 { format!(" and {others} more") } else { String::new() };
    format!("{}{more}", names.join(", "))
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
