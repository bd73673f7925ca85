//! The effects that are computed for a lens, with the time that each decision saves.

use crate::analysis::spots;
use crate::cli::error::CliError;
use crate::cli::input::LoadedLens;
use crate::cli::output::ShortNumber;
use crate::effects::{
    EffectDecision, EffectMeasurements, EffectOverrides, TracePurpose, build_ray_model,
    measure_effects, plan,
};
use crate::measure::time_ms;
use crate::pupil::Accuracy;

/// The tolerance of spots, relative to the smallest one.
pub(super) const SPOT_TOLERANCE: f64 = 1e-3;
/// Repetitions, of which the fastest counts, since other load only slows them.
const REPETITIONS: usize = 3;

/// The decisions for spots at a zoom position, and the measurements behind them.
pub(super) fn decisions(
    opened: &LoadedLens,
    zoom: usize,
) -> Result<(EffectMeasurements, Vec<EffectDecision>), CliError> {
    let unusable = |source| CliError::RayModel { file: opened.file.clone(), source };
    let facts = measure_effects(&opened.lens, zoom).map_err(unusable)?;
    let plan = plan(&facts, TracePurpose::Spot(SPOT_TOLERANCE), &EffectOverrides::default());
    let bench = build_ray_model(&opened.lens, zoom, &plan).map_err(unusable)?;
    let accuracy = Accuracy { tolerance: SPOT_TOLERANCE, ..Accuracy::default() };
    let turn = || time_ms(|| spots(&bench, accuracy)).1;
    let spots_ms = (0..REPETITIONS).map(|_| turn()).fold(f64::INFINITY, f64::min);
    let mut decisions = plan.decisions;
    for decision in &mut decisions {
        decision.saved_ms = Some(saved_ms(decision, spots_ms));
    }
    Ok((facts, decisions))
}

/// The milliseconds that leaving an effect out saves or would save, if the spots take `spots_ms` with
/// the present plan.
fn saved_ms(decision: &EffectDecision, spots_ms: f64) -> f64 {
    let share = decision.saved_share.clamp(0.0, 0.99);
    let whole = if decision.computed { spots_ms } else { spots_ms / (1.0 - share) };
    share * whole
}

pub(super) fn decision_text(decision: &EffectDecision) -> String {
    let EffectDecision { effect, computed, reason, error, limit, unit, .. } = decision;
    let verdict = if *computed { "computed" } else { "omitted" };
    let saving = if *computed { "without it" } else { "saves" };
    let ms = decision.saved_ms.unwrap_or(0.0);
    let numbers = format!("{} of {} {unit}", ShortNumber(*error), ShortNumber(*limit));
    let time = format!("{saving} {:.0} %, {ms:.2} ms", 100.0 * decision.saved_share);
    format!("  {:<18} {verdict}  {reason} ({numbers}; {time})", effect.name())
}
