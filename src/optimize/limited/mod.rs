//! A trust-region descent that keeps the limits of the goal: [`LimitedTrustRegion`] applied to a
//! merit function.
//!
//! Limits that need no rays, such as thicknesses and the focal length, are restored at every trial
//! before a ray is traced. On the way the others may be broken by [`SLACK`]; when the descent ends
//! or is stopped, all of them are restored to [`KEPT`] with the rays of the lens itself.

mod conflict;
mod price;
mod settlement;
mod springs;

pub(super) use springs::add_springs;

use super::state::OptimizerState;
use super::{LimitPrice, OptimizationEnd, OptimizationProgress, Optimizer};
use crate::lens::Lens;
use crate::merit::{
    DerivativeLevel, Limit, LimitedSum, Merit, MeritError, SumOfSquares, Term, TermValue,
};
use crate::solve::{
    LimitValues, LimitedPoint, LimitedStep, LimitedTrustRegion, LimitedTrustRegionMemory, SLACK,
};
use nalgebra::{DMatrix, DVector};

/// The number of accepted steps between two checks of the rays, at most.
const CHECK_INTERVAL: usize = 20;
/// The projected gradient relative to the first one that ends the descent.
const SMALL_GRADIENT: f64 = 1e-6;
/// The number of consecutive steps that promise nothing above the tolerance which end the descent.
const PATIENCE: usize = 5;
/// The number of times that the method starts again where its region has vanished although a gain
/// is promised.
const RESTARTS: usize = 3;
/// The promised gain, relative to the tolerance of the spots, below which a step is idle.
const SMALL_GAIN: f64 = 1e-2;

/// The same for a segment of a descent.
const SEGMENT_GAIN: f64 = 1e-7;

/// The largest violation of a limit, in its unit, at the end.
const KEPT: f64 = 1e-9;
/// The violation up to which a correction goes on.
const RESTORED: f64 = 1e-11;
/// The number of corrections of a trial.
const TRIAL_CORRECTIONS: usize = 4;
/// The part of a violation that a correction leaves at most if another one is worth trying.
const CORRECTED: f64 = 0.5;

#[derive(Debug)]
pub(super) struct LimitedOptimizer {
    state: OptimizerState,
    method: LimitedTrustRegion,
    point: LimitedPoint,
    limits: Vec<Limit>,
    /// The norm of the projected gradient at the start.
    first_gradient: Option<f64>,
    tolerance: f64,
    /// The promised gain, relative to the merit, below which a step is idle.
    idle_gain: f64,
    /// The number of evaluations that it never exceeds.
    most_evaluations: usize,
    /// The largest violation of the best lens, 0 up to [`SLACK`].
    best_violation: f64,
    /// The best lens with newly found rays, its violation and its merit.
    verified: Option<(Lens, (f64, f64))>,
    /// The limits of the best lens and their multipliers.
    prices: Vec<LimitPrice>,
    unchecked: usize,
    interval: usize,
    idle: usize,
    /// The steps since the limits last came closer, or could have.
    stuck: usize,
    /// The restarts of the method so far.
    restarts: usize,
    end: Option<OptimizationEnd>,
    conflict: Vec<String>,
}

impl LimitedOptimizer {
    pub(super) fn new(merit: Merit, lens: &Lens, tolerance: f64) -> Result<Self, MeritError> {
        let state = OptimizerState::new(merit, lens)?;
        let found = state.merit.evaluate_with_limits(&state.values, DerivativeLevel::Normal)?;
        let mut this = Self {
            method: LimitedTrustRegion::new(state.values.len(), found.limits.len()),
            point: scaled_point(&state, &found.objective, &found.limits),
            state,
            limits: found.limits,
            first_gradient: None,
            tolerance,
            idle_gain: SMALL_GAIN * tolerance,
            most_evaluations: usize::MAX,
            best_violation: 0.0,
            verified: None,
            prices: Vec::new(),
            unchecked: 0,
            interval: CHECK_INTERVAL,
            idle: 0,
            stuck: 0,
            restarts: 0,
            end: None,
            conflict: Vec::new(),
        };
        this.refuse_contradictions()?;
        this.state.value = found.objective.value;
        this.state.best_value = found.objective.value;
        this.best_violation = this.counted_violation();
        this.note_prices();
        Ok(this)
    }

    /// The same as a segment of a descent, after an earlier one, that takes so many evaluations at most and
    /// ends later than a descent by itself: within the tolerance of the spots there is still something to gain.
    pub(super) fn into_segment(
        mut self,
        evaluations: usize,
        memory: Option<&LimitedTrustRegionMemory>,
    ) -> Self {
        self.idle_gain = SEGMENT_GAIN;
        self.most_evaluations = self.state.evaluations.saturating_add(evaluations);
        if let Some(memory) = memory {
            self.method = LimitedTrustRegion::resume(memory, &self.state.scales, self.limits.len());
        }
        self
    }

    /// The region, to go on with; `None` once the descent has ended.
    pub(super) fn memory(&self) -> Option<LimitedTrustRegionMemory> {
        if self.end.is_some() {
            return None;
        }
        self.method.memory(&self.state.scales)
    }

    /// True if it has ended where nothing can be gained within the limits.
    pub(super) fn is_at_minimum(&self) -> bool {
        self.end.is_some_and(OptimizationEnd::is_minimum)
    }

    /// The evaluations that it may still take.
    pub(super) fn evaluations_left(&self) -> usize {
        self.most_evaluations.saturating_sub(self.state.evaluations)
    }

    /// The state of the descent.
    pub(super) fn into_state(self) -> OptimizerState {
        self.state
    }

    /// The merit of the current lens without its limits.
    pub(super) fn objective(&self) -> f64 {
        self.state.value
    }

    /// The mean light of the current lens over that of the first one, the least over the zoom
    /// positions; `None` if it is not limited.
    pub(super) fn light_share(&self) -> Option<f64> {
        let found = self.limits.iter().filter(|limit| is_mean_light(limit));
        found.map(|limit| limit.margin.value).reduce(f64::min)
    }

    /// True if the current lens keeps the limits to this violation but for that of the mean light.
    pub(super) fn is_kept_but_for_light(&self, violation: f64) -> bool {
        let others = self.limits.iter().filter(|limit| !is_mean_light(limit));
        others.into_iter().all(|limit| limit.violation() <= violation)
    }

    /// The largest violation, 0 up to the slack that is allowed on the way.
    fn counted_violation(&self) -> f64 {
        let violation = self.point.limits.violation();
        if violation <= SLACK { 0.0 } else { violation }
    }

    /// Tries one step; returns the part of it that was taken, 0 or 1, or the reason for which none
    /// is worth trying.
    fn try_step(&mut self) -> Result<f64, OptimizationEnd> {
        let room = self.state.room();
        let Some(step) = self.method.propose(&self.point, &room) else {
            return self.without_step();
        };
        let gradient = self.method.projected_gradient(&self.point, &step, &room);
        let first = *self.first_gradient.get_or_insert(gradient);
        let is_kept = self.point.limits.violation() <= SLACK;
        let makes_progress = !step.is_relaxed || self.gains_limits(&step.values);
        self.stuck = if makes_progress { 0 } else { self.stuck + 1 };
        if self.stuck >= PATIENCE {
            if !self.may_gain_limits(&room) {
                return Err(OptimizationEnd::Conflict);
            }
            self.stuck = 0;
        }
        if is_kept && gradient <= SMALL_GRADIENT * first {
            return Err(OptimizationEnd::Gradient);
        }
        let is_idle = is_kept && self.promised(&step, &room) <= self.small_gain();
        self.idle = if is_idle { self.idle + 1 } else { 0 };
        if !is_idle && self.restarts < RESTARTS && self.method.is_exhausted(&self.point) {
            self.restarts += 1;
            self.method.restart(&self.point);
            return Ok(0.0);
        }
        if self.idle >= PATIENCE || self.method.is_exhausted(&self.point) {
            return Err(match (is_kept || !step.is_relaxed, is_idle) {
                (false, _) => OptimizationEnd::Conflict,
                (true, true) => OptimizationEnd::Tolerance,
                (true, false) => OptimizationEnd::NoGain,
            });
        }
        Ok(if self.take(step) { 1.0 } else { 0.0 })
    }

    /// A smaller region where no step could be computed, as long as one remains.
    fn without_step(&mut self) -> Result<f64, OptimizationEnd> {
        self.method.note_no_step();
        if self.method.is_exhausted(&self.point) { Err(OptimizationEnd::NoGain) } else { Ok(0.0) }
    }

    fn small_gain(&self) -> f64 {
        self.idle_gain * self.point.objective.value
    }

    /// True if the sum of the violations at these values of the limits is smaller than the present one by
    /// more than a thousandth.
    fn gains_limits(&self, values: &DVector<f64>) -> bool {
        let limits = &self.point.limits;
        let sum = |values: &DVector<f64>| limits.excesses(values).abs().sum();
        sum(values) < 0.999 * sum(&limits.values)
    }

    /// True if a correction that the trust region does not confine brings the limits closer.
    fn may_gain_limits(&self, room: &[[f64; 2]]) -> bool {
        let limits = &self.point.limits;
        let change = self.method.correction(limits, room);
        change.is_some_and(|change| self.gains_limits(&limits.linearized(&change)))
    }

    /// The decrease of the merit that the derivatives promise: of the step itself and, if that is
    /// small, of one that the trust region does not confine.
    fn promised(&mut self, step: &LimitedStep, room: &[[f64; 2]]) -> f64 {
        let near = -2.0 * self.point.objective.half_gradient.dot(&step.change);
        if near > self.small_gain() {
            return near;
        }
        self.method.unconfined(&self.point, room).map_or(near, |(_, promised)| promised)
    }

    /// Evaluates a step, and takes it if that lowers the merit at the prices of the limits.
    fn take(&mut self, mut step: LimitedStep) -> bool {
        let proposed = self.state.proposal(step.change.as_slice(), 1.0);
        let values = self.restored(&step, &proposed);
        step.change = self.state.scaled_change(&values);
        let Some((to, found)) = self.evaluate(&values, &step) else { return false };
        if self.method.note_trial(&step, &self.point, &to) {
            self.accept(values, to, found);
            return true;
        }
        // The limits are curved: a second trial that follows them may succeed.
        let follows = to.limits.violation() > SLACK.max(2.0 * self.point.limits.violation());
        let may_follow = !self.method.met_kink() && self.evaluations_left() > 0;
        follows && may_follow && self.second_trial(&step, &values, &to.limits)
    }

    fn second_trial(&mut self, step: &LimitedStep, from: &[f64], found: &LimitValues) -> bool {
        let corrected = self.corrected(from, found);
        let Some(values) = corrected.filter(|to| self.is_near(from, to, step)) else {
            return false;
        };
        let mut step = step.clone();
        step.change = self.state.scaled_change(&values);
        let Some((to, found)) = self.evaluate(&values, &step) else { return false };
        let accepted = self.method.note_trial(&step, &self.point, &to);
        if accepted {
            self.accept(values, to, found);
        }
        accepted
    }

    fn evaluate(
        &mut self,
        values: &[f64],
        step: &LimitedStep,
    ) -> Option<(LimitedPoint, LimitedSum)> {
        let found = self
            .state
            .check_finite(values)
            .and_then(|()| self.state.merit.evaluate_with_limits(values, DerivativeLevel::Normal));
        match found {
            Ok(found) if found.limits.len() == self.limits.len() => {
                self.state.evaluations += 1;
                let point = scaled_point(&self.state, &found.objective, &found.limits);
                Some((point, found))
            }
            Ok(_) => {
                self.method.note_failure(step);
                None
            }
            Err(cause) => {
                self.state.record_refusal(step.change.as_slice(), &cause);
                self.method.note_failure(step);
                None
            }
        }
    }

    /// Goes to a lens. Further trials track the pupils from there: an edge that has changed since the
    /// rays were found would be searched for at every one. Where a field was dark light is looked for everywhere.
    fn accept(&mut self, values: Vec<f64>, point: LimitedPoint, found: LimitedSum) {
        if self.state.merit.has_light() {
            self.state.merit.follow_pupils(found.pupils);
        }
        self.state.values = values;
        self.state.value = point.objective.value;
        self.state.current = self.state.merit.lens(&self.state.values);
        (self.point, self.limits) = (point, found.limits);
        self.unchecked += 1;
        self.note_best();
    }

    /// Makes the current lens the best one if it breaks the limits less, or as little as that with
    /// a lower merit.
    fn note_best(&mut self) {
        let now = (self.counted_violation(), self.state.value);
        if now.0 < self.best_violation
            || (now.0 == self.best_violation && now.1 < self.state.best_value)
        {
            (self.best_violation, self.state.best_value) = now;
            self.state.best.clone_from(&self.state.current);
        }
    }

    /// The values of a proposal after corrections that keep the limits that need no rays as the
    /// derivatives have promised.
    fn restored(&self, step: &LimitedStep, proposed: &[f64]) -> Vec<f64> {
        let aims: Vec<[f64; 2]> = self
            .point
            .limits
            .bounds
            .iter()
            .zip(step.values.iter())
            .map(|([low, high], promised)| [low.min(*promised), high.max(*promised)])
            .collect();
        let mut values = proposed.to_vec();
        let mut last: Option<(Vec<f64>, f64)> = None;
        for _ in 0..TRIAL_CORRECTIONS {
            let merit = &self.state.merit;
            let Ok(found) = merit.mechanical_limits(&values, DerivativeLevel::Gradient) else {
                break;
            };
            let found = limit_values(&self.state, &found);
            let aimed = found.with_bounds(&aims[..found.bounds.len()]);
            let violation = aimed.violation();
            match last {
                Some((earlier, before)) if violation > before => return earlier,
                Some((_, before)) if violation > CORRECTED * before => break,
                _ if violation <= RESTORED => break,
                _ => {}
            }
            // Beyond the length of the step the derivatives tell nothing.
            let is_near = |next: &Vec<f64>| self.is_near(proposed, next, step);
            let Some(next) = self.corrected(&values, &aimed).filter(is_near) else { break };
            last = Some((std::mem::replace(&mut values, next), violation));
        }
        values
    }

    /// True if one set of values is no further from another one than a step is long.
    fn is_near(&self, from: &[f64], to: &[f64], step: &LimitedStep) -> bool {
        let change = self.state.scaled_change(to) - self.state.scaled_change(from);
        self.method.is_shorter(&change, step)
    }

    /// Values corrected so that their limits hold by their derivatives.
    fn corrected(&self, values: &[f64], found: &LimitValues) -> Option<Vec<f64>> {
        let change = self.method.correction(found, &self.state.room_from(values))?;
        Some(self.state.moved(values, change.as_slice()))
    }

    /// Ends the descent, unless the rays turn out to be others by now.
    fn conclude(&mut self, end: OptimizationEnd) {
        let changed = self.unchecked > 0 && self.settle();
        self.idle = 0;
        self.stuck = 0;
        if changed && !self.state.has_ended() {
            self.interval = (self.interval / 2).max(1);
            self.method.note_other_function(false);
            return;
        }
        self.settle();
        self.end = Some(if self.point.limits.violation() <= KEPT {
            end
        } else {
            OptimizationEnd::Conflict
        });
        if self.end == Some(OptimizationEnd::Conflict) {
            self.conflict = self.conflict_here();
        }
    }
}

fn is_mean_light(limit: &Limit) -> bool {
    limit.margin.term == Term::MeanLight(0.0).name()
}

/// The limits with their derivatives by scaled variables.
fn limit_values(state: &OptimizerState, limits: &[Limit]) -> LimitValues {
    LimitValues {
        values: DVector::from_iterator(limits.len(), limits.iter().map(|l| l.margin.value)),
        slopes: DMatrix::from_fn(limits.len(), state.scales.len(), |row, i| {
            limits[row].slope[i] * state.scales[i]
        }),
        bounds: limits.iter().map(Limit::bounds).collect(),
        weights: limits.iter().map(|limit| limit.weight).collect(),
    }
}

fn scaled_point(state: &OptimizerState, sum: &SumOfSquares, limits: &[Limit]) -> LimitedPoint {
    LimitedPoint {
        objective: super::trust_region::scaled_point(state, sum),
        limits: limit_values(state, limits),
    }
}

impl Optimizer for LimitedOptimizer {
    fn step(&mut self) -> OptimizationProgress {
        if self.end.is_some() {
            return self.state.progress(0.0, self.end);
        }
        let tried = self.try_step();
        if let Err(end) = tried {
            self.conclude(end);
        } else if self.unchecked >= self.interval {
            self.interval =
                if self.check_rays() { (self.interval / 2).max(1) } else { CHECK_INTERVAL };
        }
        self.state.progress(tried.unwrap_or(0.0), self.end)
    }

    fn verify_best(&mut self) {
        if self.end.is_none() {
            self.state.current.clone_from(&self.state.best);
            self.state.values = self.state.merit.values(&self.state.best);
            self.settle();
        }
    }

    fn best(&self) -> &Lens {
        &self.state.best
    }

    fn current(&self) -> &Lens {
        &self.state.current
    }

    fn terms(&self) -> Result<Vec<TermValue>, MeritError> {
        self.state.terms()
    }

    fn evaluations(&self) -> usize {
        self.state.evaluations
    }

    fn binding_limits(&self) -> &[LimitPrice] {
        &self.prices
    }

    fn conflict(&self) -> &[String] {
        &self.conflict
    }
}
