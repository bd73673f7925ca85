//! The effects that are computed for a lens, with the measured time of each.

use crate::cli::error::CliError;
use crate::cli::input::LoadedLens;
use crate::cli::output::ShortNumber;
use crate::effects::{EffectDecision, EffectMeasurements, EffectOverrides};
use crate::measure::EffectTask;

/// The tolerance of spots, relative to the smallest one.
pub(super) const SPOT_TOLERANCE: f64 = 1e-3;

/// The decisions for spots at a zoom position, and the measurements behind them.
pub(super) fn decisions(
    opened: &LoadedLens,
    zoom: usize,
) -> Result<(EffectMeasurements, Vec<EffectDecision>), CliError> {
    let unusable = |source| CliError::RayModel { file: opened.file.clone(), source };
    let overrides = EffectOverrides::default();
    let tolerance = SPOT_TOLERANCE;
    let task = EffectTask { lens: &opened.lens, zoom, tolerance, overrides: &overrides };
    let facts = task.measure_effects().map_err(unusable)?;
    let plan = task.measure_costs(&facts, || false);
    Ok((facts, plan.map(|plan| plan.decisions).unwrap_or_default()))
}

pub(super) fn decision_text(decision: &EffectDecision) -> String {
    let EffectDecision { effect, computed, reason, error, limit, unit, cost, .. } = decision;
    let verdict = if *computed { "computed" } else { "omitted" };
    let saving = if *computed { "without it" } else { "saves" };
    let numbers = format!("{} of {} {unit}", ShortNumber(*error), ShortNumber(*limit));
    let time = cost.map_or_else(String::new, |cost| {
        format!("; {saving} {:.0} %, {:.2} ms", 100.0 * cost.saved_share, cost.saved_ms)
    });
    format!("  {:<18} {verdict}  {reason} ({numbers}{time})", effect.name())
}
