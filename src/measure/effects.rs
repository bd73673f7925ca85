//! The measured cost of each effect: the time of the spots of a lens with it and without it.

use super::timing::{Stopwatch, time_ms};
use crate::analysis;
use crate::effects::{
    self, Effect, EffectCost, EffectMeasurements, EffectOverride, EffectOverrides, EffectPlan,
    TracePurpose,
};
use crate::lens::Lens;
use crate::pupil::{Accuracy, RayModelError};
use rayon::ThreadPoolBuilder;
use std::hint::black_box;
use std::ops::ControlFlow;

/// The fewest pairs of measurements, with an effect and without it. Of each kind the shortest counts:
/// whatever else the machine does only makes a run longer.
const MIN_PAIRS: usize = 4;
/// The longest time for the pairs of one effect, in seconds: behind it only two pairs are measured, which tell
/// an error.
const MAX_SECONDS: f64 = 0.4;
/// The longest time for a pair that is measured again, and that after which no other effect is measured, in
/// seconds.
const MAX_SECONDS_OF_PAIR: f64 = 1.0;
const MAX_SECONDS_IN_ALL: f64 = 4.0;
/// A saving is known once its error is below this part of it.
const RELATIVE_ERROR: f64 = 0.25;
/// A saving of this part of the time with the effect is too small to be told from none.
const NEGLIGIBLE: f64 = 0.02;
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
    /// Plans the effects and measures the cost of each, but for those whose spots take too long. Returns
    /// `None` if `interrupted` returns true between two measurements.
    ///
    /// # Errors
    /// A lens or aperture through which nothing can be traced.
    pub fn measure_costs(
        &self,
        facts: &EffectMeasurements,
        interrupted: impl Fn() -> bool,
    ) -> Option<EffectPlan> {
        let mut plan = self.plan(facts, self.overrides);
        let watch = Stopwatch::start();
        for decision in &mut plan.decisions {
            if watch.seconds() > MAX_SECONDS_IN_ALL {
                break;
            }
            decision.cost = match self.cost(facts, decision.effect, &interrupted) {
                ControlFlow::Continue(cost) => cost,
                ControlFlow::Break(()) => return None,
            };
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

    /// The time that an effect takes, by alternating runs with it and without it; `None` if one pair takes
    /// too long for an error. It breaks off if it is interrupted.
    fn cost(
        &self,
        facts: &EffectMeasurements,
        effect: Effect,
        interrupted: &impl Fn() -> bool,
    ) -> ControlFlow<(), Option<EffectCost>> {
        let plans = [EffectOverride::On, EffectOverride::Off]
            .map(|choice| self.plan(facts, &self.overrides.clone().with(effect, choice)));
        if computes_same(&plans) {
            return ControlFlow::Continue(Some(EffectCost::default()));
        }
        // Threads of its own: work that waits for the shared ones is no cost of an effect.
        let pool = ThreadPoolBuilder::new().build().ok();
        let run = |plan: &EffectPlan| match &pool {
            Some(pool) => pool.install(|| time_ms(|| self.compute_spots(plan)).1),
            None => time_ms(|| self.compute_spots(plan)).1,
        };
        let (watch, mut times) = (Stopwatch::start(), [ShortestTimes::NONE; 2]);
        for pair in 1.. {
            for (times, plan) in times.iter_mut().zip(&plans) {
                if interrupted() {
                    return ControlFlow::Break(());
                }
                times.add(run(plan));
            }
            let is_known = pair >= MIN_PAIRS && is_resolved(&times);
            if is_known || (pair >= 2 && watch.seconds() > MAX_SECONDS) {
                break;
            }
            if watch.seconds() > MAX_SECONDS_OF_PAIR {
                return ControlFlow::Continue(None);
            }
        }
        ControlFlow::Continue(Some(saving(&times)))
    }

    /// The number of spots of the lens resolved by a plan; 0 if it cannot be.
    fn compute_spots(&self, plan: &EffectPlan) -> usize {
        let accuracy = Accuracy { tolerance: self.tolerance, max_rays: MAX_RAYS };
        let Ok(model) = effects::build_ray_model(self.lens, self.zoom, plan) else { return 0 };
        if plan.computes(Effect::Absorption) {
            black_box(effects::transmitted_light(self.lens, &model));
        }
        analysis::spots(&model, accuracy).len()
    }
}

/// The shortest of some times and the next one, in milliseconds.
#[derive(Debug, Clone, Copy)]
struct ShortestTimes {
    best: f64,
    next: f64,
}

impl ShortestTimes {
    const NONE: Self = Self { best: f64::INFINITY, next: f64::INFINITY };

    fn add(&mut self, ms: f64) {
        self.next = self.next.min(ms.max(self.best));
        self.best = self.best.min(ms);
    }
}

/// The saving between the times with an effect and without it. Its error is the distance of the two
/// shortest times of each.
fn saving([on, off]: &[ShortestTimes; 2]) -> EffectCost {
    let saved_ms = on.best - off.best;
    let error_ms = (on.next - on.best) + (off.next - off.best);
    EffectCost { saved_share: saved_ms / on.best, saved_ms, error_ms }
}

/// True if the saving is known well enough, or is negligible.
fn is_resolved(times: &[ShortestTimes; 2]) -> bool {
    let EffectCost { saved_ms, error_ms, .. } = saving(times);
    error_ms < RELATIVE_ERROR * saved_ms.abs() || error_ms < NEGLIGIBLE * times[0].best
}

/// True if both plans compute the same.
fn computes_same([on, off]: &[EffectPlan; 2]) -> bool {
    let same = |effect: &Effect| on.computes(*effect) == off.computes(*effect);
    Effect::ALL.iter().all(same) && on.as_conic == off.as_conic && on.unclipped == off.unclipped
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shortest(times: &[f64]) -> ShortestTimes {
        let mut shortest = ShortestTimes::NONE;
        times.iter().for_each(|ms| shortest.add(*ms));
        shortest
    }

    #[test]
    fn a_saving_is_that_of_the_shortest_times() {
        let times = [shortest(&[9.0, 3.0, 7.0, 3.25]), shortest(&[1.0, 20.0, 1.0, 1.125])];
        let cost = saving(&times);
        assert_eq!((cost.saved_ms, cost.error_ms), (2.0, 0.25));
        assert!(is_resolved(&times));
    }

    #[test]
    fn a_saving_that_times_cannot_tell_from_none_is_measured_again() {
        assert!(!is_resolved(&[shortest(&[3.0, 5.0]), shortest(&[2.0, 4.0])]));
        assert!(!is_resolved(&[shortest(&[3.0]), shortest(&[2.0])]), "one run has no error");
        assert!(is_resolved(&[shortest(&[3.0, 3.01]), shortest(&[3.0, 3.01])]), "negligible");
    }
}
