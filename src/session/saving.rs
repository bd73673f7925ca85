//! How much time each effect takes, measured: the spots of a lens with it and without it.

use super::clock::time;
use super::view::AnalysisSettings;
use crate::analysis;
use crate::effects;
use crate::effects::{Effect, EffectMeasurements, EffectOverride, EffectPlan, TracePurpose};
use crate::lens::Lens;
use crate::pupil::Accuracy;

/// A time is the shortest of so many.
const REPETITIONS: usize = 2;

/// The plan of a lens for the spots that its settings ask for, with the time that each effect
/// takes; `None` if `interrupted` says so between two measurements.
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

    /// Whether both come to the same.
    fn is_same(&self) -> bool {
        let same = |effect: &Effect| self.on.computes(*effect) == self.off.computes(*effect);
        Effect::ALL.iter().all(same)
            && self.on.as_conic == self.off.as_conic
            && self.on.unclipped == self.off.unclipped
    }

    /// The milliseconds that the effect takes, runs with and without it in turn.
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

/// The spots of a lens as a plan resolves it; a lens without any is done at once.
fn spots_of(lens: &Lens, settings: &AnalysisSettings, plan: &EffectPlan) -> usize {
    let accuracy = Accuracy { tolerance: settings.tolerance, max_rays: MAX_RAYS };
    effects::build_ray_model(lens, settings.zoom, plan)
        .map_or(0, |bench| analysis::spots(&bench, accuracy).len())
}

/// A lens without an effect may have spots that no number of rays gets right.
const MAX_RAYS: usize = 10_000;
