//! The measured cost of each effect: the time of the spots of a lens with it and without it.

use super::timing::time_ms;
use crate::analysis;
use crate::effects::{
    self, Effect, EffectCost, EffectMeasurements, EffectOverride, EffectOverrides, EffectPlan,
    TracePurpose,
};
use crate::lens::Lens;
use crate::pupil::{Accuracy, RayModelError};

/// The number of measurements, of which the shortest counts.
const REPETITIONS: usize = 2;
/// The limit of rays for a spot: without an effect, a spot may never reach its tolerance.
const MAX_RAYS: usize = 10_000;

/// The spots for which effects are planned and timed.
#[derive(Debug, Clone)]
pub struct EffectTask<'a> {
    /// The lens.
    pub lens: &'a Lens,
    /// The zoom position.
    pub zoom: usize,
    /// The relative tolerance of the spots.
    pub tolerance: f64,
    /// The choices of the user.
    pub overrides: &'a EffectOverrides,
}

impl EffectTask<'_> {
    /// Plans the effects and measures the cost of each. Returns `None` if `interrupted` returns true
    /// between two measurements.
    ///
    /// # Errors
    /// A lens or aperture through which nothing can be traced.
    pub fn measure_costs(
        &self,
        facts: &EffectMeasurements,
        interrupted: impl Fn() -> bool,
    ) -> Option<EffectPlan> {
        let mut plan = self.plan(facts, self.overrides);
        for decision in &mut plan.decisions {
            decision.cost = Some(self.cost(facts, decision.effect, &interrupted)?);
        }
        Some(plan)
    }

    /// Measures how far each effect moves rays.
    ///
    /// # Errors
    /// A lens or aperture through which nothing can be traced.
    pub fn measure_effects(&self) -> Result<EffectMeasurements, RayModelError> {
        effects::measure_effects(self.lens, self.zoom)
    }

    fn plan(&self, facts: &EffectMeasurements, overrides: &EffectOverrides) -> EffectPlan {
        effects::plan(facts, TracePurpose::Spot(self.tolerance), overrides)
    }

    /// The time that an effect takes, by alternating runs with it and without it.
    fn cost(
        &self,
        facts: &EffectMeasurements,
        effect: Effect,
        interrupted: &impl Fn() -> bool,
    ) -> Option<EffectCost> {
        let plans = [EffectOverride::On, EffectOverride::Off]
            .map(|choice| self.plan(facts, &self.overrides.clone().with(effect, choice)));
        if computes_same(&plans) {
            return Some(EffectCost { saved_share: 0.0, saved_ms: 0.0 });
        }
        let mut best = [f64::INFINITY; 2];
        for _ in 0..REPETITIONS {
            for (best, plan) in best.iter_mut().zip(&plans) {
                if interrupted() {
                    return None;
                }
                *best = best.min(time_ms(|| self.compute_spots(plan)).1);
            }
        }
        let saved_ms = best[0] - best[1];
        Some(EffectCost { saved_share: saved_ms / best[0], saved_ms })
    }

    /// The number of spots of the lens resolved by a plan; 0 if it cannot be.
    fn compute_spots(&self, plan: &EffectPlan) -> usize {
        let accuracy = Accuracy { tolerance: self.tolerance, max_rays: MAX_RAYS };
        effects::build_ray_model(self.lens, self.zoom, plan)
            .map_or(0, |model| analysis::spots(&model, accuracy).len())
    }
}

/// True if both plans compute the same.
fn computes_same([on, off]: &[EffectPlan; 2]) -> bool {
    let same = |effect: &Effect| on.computes(*effect) == off.computes(*effect);
    Effect::ALL.iter().all(same) && on.as_conic == off.as_conic && on.unclipped == off.unclipped
}
