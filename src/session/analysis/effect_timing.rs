//! The measured cost of each effect: the time of the spots of a lens with it and without it.

use super::AnalysisSettings;
use crate::analysis;
use crate::effects;
use crate::effects::{Effect, EffectMeasurements, EffectOverride, EffectPlan, TracePurpose};
use crate::lens::Lens;
use crate::pupil::Accuracy;
use crate::session::clock::time;

/// The number of measurements, of which the shortest counts.
const REPETITIONS: usize = 2;

/// Plans the effects of a lens for spots with the settings, and measures the cost of each effect.
/// Returns `None` if `interrupted` returns true between two measurements.
///
/// # Errors
/// A lens or aperture through which nothing can be traced.
pub fn measure_effect_costs(
    lens: &Lens,
    settings: &AnalysisSettings,
    interrupted: impl Fn() -> bool,
) -> Option<Result<EffectPlan, String>> {
    let facts = match effects::measure_effects(lens, settings.zoom) {
        Ok(facts) => facts,
        Err(why) => return Some(Err(why.to_string())),
    };
    let task = TracePurpose::Spot(settings.tolerance);
    let mut plan = effects::plan(&facts, task, &settings.overrides);
    for decision in &mut plan.decisions {
        let pair = EffectOnOff::new(&facts, settings, decision.effect);
        decision.saved_ms = Some(pair.difference(lens, settings, &interrupted)?);
    }
    Some(Ok(plan))
}

/// The same lens with and without an effect.
struct EffectOnOff {
    on: EffectPlan,
    off: EffectPlan,
}

impl EffectOnOff {
    fn new(facts: &EffectMeasurements, settings: &AnalysisSettings, effect: Effect) -> Self {
        let plan = |choice| {
            let choices = settings.overrides.clone().with(effect, choice);
            effects::plan(facts, TracePurpose::Spot(settings.tolerance), &choices)
        };
        Self { on: plan(EffectOverride::On), off: plan(EffectOverride::Off) }
    }

    /// True if both plans compute the same.
    fn is_same(&self) -> bool {
        let same = |effect: &Effect| self.on.computes(*effect) == self.off.computes(*effect);
        Effect::ALL.iter().all(same)
            && self.on.as_conic == self.off.as_conic
            && self.on.unclipped == self.off.unclipped
    }

    /// The time that the effect takes, in milliseconds, by alternating runs with and without it.
    fn difference(
        &self,
        lens: &Lens,
        settings: &AnalysisSettings,
        interrupted: &impl Fn() -> bool,
    ) -> Option<f64> {
        if self.is_same() {
            return Some(0.0);
        }
        let mut best = [f64::INFINITY; 2];
        for _ in 0..REPETITIONS {
            for (best, plan) in best.iter_mut().zip([&self.on, &self.off]) {
                if interrupted() {
                    return None;
                }
                *best = best.min(time(|| spots_of(lens, settings, plan)).ms);
            }
        }
        Some(best[0] - best[1])
    }
}

/// The number of spots of a lens that is resolved by a plan; 0 if it cannot be.
fn spots_of(lens: &Lens, settings: &AnalysisSettings, plan: &EffectPlan) -> usize {
    let accuracy = Accuracy { tolerance: settings.tolerance, max_rays: MAX_RAYS };
    effects::build_ray_model(lens, settings.zoom, plan)
        .map_or(0, |model| analysis::spots(&model, accuracy).len())
}

/// The limit of rays for a spot: without an effect, a spot may never reach its tolerance.
const MAX_RAYS: usize = 10_000;
