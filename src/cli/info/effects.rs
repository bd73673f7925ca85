//! Which effects a lens calls for, with the time that each decision saves.

use crate::analysis::spots;
use crate::cli::failure::Failure;
use crate::cli::input::Opened;
use crate::cli::output::Number;
use crate::effects::{Choices, Decision, Facts, Task, bench, plan, survey};
use crate::measure::timed;
use crate::pupil::Accuracy;

/// How good spots shall be, against the smallest one.
pub(super) const SHARE: f64 = 1e-3;
/// The fastest of so many turns counts: what else the machine does only makes it slower.
const TURNS: usize = 3;

/// The plan for spots at a zoom position, and what it rests on.
pub(super) fn decisions(opened: &Opened, zoom: usize) -> Result<(Facts, Vec<Decision>), Failure> {
    let unusable = |source| Failure::Bench { file: opened.file.clone(), source };
    let facts = survey(&opened.lens, zoom).map_err(unusable)?;
    let plan = plan(&facts, Task::Spot(SHARE), &Choices::default());
    let bench = bench(&opened.lens, zoom, &plan).map_err(unusable)?;
    let accuracy = Accuracy { tolerance: SHARE, ..Accuracy::default() };
    let turn = || timed(|| spots(&bench, accuracy)).1;
    let spots_ms = (0..TURNS).map(|_| turn()).fold(f64::INFINITY, f64::min);
    let mut decisions = plan.decisions;
    for decision in &mut decisions {
        decision.saved_ms = Some(saved(decision, spots_ms));
    }
    Ok((facts, decisions))
}

/// The milliseconds that leaving an effect out saves or would save, where the spots take so many
/// with what the plan computes.
fn saved(decision: &Decision, spots_ms: f64) -> f64 {
    let share = decision.saves.clamp(0.0, 0.99);
    let whole = if decision.computed { spots_ms } else { spots_ms / (1.0 - share) };
    share * whole
}

pub(super) fn line(decision: &Decision) -> String {
    let Decision { effect, computed, reason, error, limit, unit, .. } = decision;
    let verdict = if *computed { "computed" } else { "left out" };
    let saving = if *computed { "without it" } else { "saves" };
    let ms = decision.saved_ms.unwrap_or(0.0);
    let numbers = format!("{} of {} {unit}", Number(*error), Number(*limit));
    let time = format!("{saving} {:.0} %, {ms:.2} ms", 100.0 * decision.saves);
    format!("  {:<18} {verdict}  {reason} ({numbers}; {time})", effect.name())
}
