//! The effects that are computed for a lens, with the measured time of each.

use crate::cli::effects::EffectChoices;
use crate::cli::error::CliError;
use crate::cli::input::LoadedLens;
use crate::effects::{EffectDecision, EffectMeasurements};
use crate::measure::EffectTask;

/// The tolerance of spots, relative to the smallest one.
pub(super) const SPOT_TOLERANCE: f64 = 1e-3;

/// The decisions for spots at a zoom position, and the measurements behind them.
pub(super) fn decisions(
    opened: &LoadedLens,
    zoom: usize,
    choices: &EffectChoices,
) -> Result<(EffectMeasurements, Vec<EffectDecision>), CliError> {
    let unusable = |source| CliError::RayModel { file: opened.file.clone(), source };
    let overrides = choices.overrides();
    let tolerance = SPOT_TOLERANCE;
    let task = EffectTask { lens: &opened.lens, zoom, tolerance, overrides: &overrides };
    let facts = task.measure_effects().map_err(unusable)?;
    let plan = task.measure_costs(&facts, || false);
    let mut decisions = plan.map(|plan| plan.decisions).unwrap_or_default();
    choices.explain(&mut decisions);
    Ok((facts, decisions))
}
