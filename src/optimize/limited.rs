//! A trust-region descent that keeps the limits of the goal: [`LimitedTrustRegion`] applied to a
//! merit function.
//!
//! Limits that need no rays, such as thicknesses and the focal length, are restored at every trial
//! before a ray is traced. On the way the others may be broken by [`SLACK`]; when the descent ends
//! or is stopped, all of them are restored to [`KEPT`] with the rays of the lens itself.

use super::state::OptimizerState;
use super::{LimitPrice, OptimizationEnd, OptimizationProgress, Optimizer};
use crate::lens::Lens;
use crate::merit::{DerivativeLevel, Limit, Merit, MeritError, SumOfSquares, TermValue};
use crate::solve::{
    LimitValues, LimitedPoint, LimitedStep, LimitedTrustRegion, SLACK, smallest_conflict,
};
use nalgebra::{DMatrix, DVector};

/// The largest violation of a limit, in its unit, at the end.
pub(super) const KEPT: f64 = 1e-9;
/// The violation up to which a correction goes on.
const RESTORED: f64 = 1e-11;
/// The distance from the bounds for which a correction aims.
const AIM: f64 = 1e-10;
/// The largest such distance, for limits whose rays are found a little differently each time.
const LARGEST_AIM: f64 = 1e-5;
/// The number of corrections of a trial, and of a lens that is to keep its limits.
const TRIAL_CORRECTIONS: usize = 4;
const CORRECTIONS: usize = 8;
/// The number of times that the rays are found anew while the limits are restored.
const SETTLEMENTS: usize = 6;
/// The number of accepted steps between two checks of the rays, at most.
const CHECK_INTERVAL: usize = 20;
/// The projected gradient relative to the first one that ends the descent.
const SMALL_GRADIENT: f64 = 1e-6;
/// The number of consecutive steps that promise nothing above the tolerance which end the descent.
const PATIENCE: usize = 5;
/// The promised gain, relative to the tolerance of the spots, below which a step is idle.
const SMALL_GAIN: f64 = 1e-2;
/// The distance to a bound, relative to its size, below which a limit binds.
const BINDING: f64 = 1e-6;

#[derive(Debug)]
pub(super) struct LimitedOptimizer {
    state: OptimizerState,
    method: LimitedTrustRegion,
    point: LimitedPoint,
    limits: Vec<Limit>,
    /// The norm of the projected gradient at the start.
    first_gradient: Option<f64>,
    tolerance: f64,
    /// The largest violation of the best lens, 0 up to [`SLACK`].
    best_violation: f64,
    /// The best lens with newly found rays, its violation and its merit.
    verified: Option<(Lens, (f64, f64))>,
    /// The limits of the best lens and their multipliers.
    prices: Vec<LimitPrice>,
    unchecked: usize,
    interval: usize,
    idle: usize,
    /// The consecutive steps after which the limits could not hold.
    stuck: usize,
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
            best_violation: 0.0,
            verified: None,
            prices: Vec::new(),
            unchecked: 0,
            interval: CHECK_INTERVAL,
            idle: 0,
            stuck: 0,
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

    /// The largest violation, 0 up to the slack that is allowed on the way.
    fn counted_violation(&self) -> f64 {
        let violation = self.point.limits.violation();
        if violation <= SLACK { 0.0 } else { violation }
    }

    /// Tries one step; returns the part of it that was taken, 0 or 1, or the reason for which none
    /// is worth trying.
    fn try_step(&mut self) -> Result<f64, OptimizationEnd> {
        let room = self.state.room();
        let step = self.method.propose(&self.point, &room).ok_or(OptimizationEnd::Tolerance)?;
        let gradient = self.method.projected_gradient(&self.point, &step.multipliers, &room);
        let first = *self.first_gradient.get_or_insert(gradient);
        let is_kept = self.point.limits.violation() <= SLACK;
        self.stuck =
            if step.elastic.is_some() && !self.gains_limits(&step) { self.stuck + 1 } else { 0 };
        if self.stuck >= PATIENCE {
            return Err(OptimizationEnd::Conflict);
        }
        if is_kept && gradient <= SMALL_GRADIENT * first {
            return Err(OptimizationEnd::Gradient);
        }
        let is_idle = is_kept && self.promised(&step, &room) <= self.small_gain();
        self.idle = if is_idle { self.idle + 1 } else { 0 };
        if self.idle >= PATIENCE || self.method.is_exhausted(&self.point) {
            let kept = is_kept || step.elastic.is_none();
            return Err(if kept { OptimizationEnd::Tolerance } else { OptimizationEnd::Conflict });
        }
        Ok(if self.take(step) { 1.0 } else { 0.0 })
    }

    fn small_gain(&self) -> f64 {
        SMALL_GAIN * self.tolerance * self.point.objective.value
    }

    /// True if a step brings the limits closer by a thousandth.
    fn gains_limits(&self, step: &LimitedStep) -> bool {
        let limits = &self.point.limits;
        let sum = |values: &DVector<f64>| limits.excesses(values).abs().sum();
        sum(&step.values) < 0.999 * sum(&limits.values)
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
        let values = self.restored(&step, proposed);
        step.change = self.state.scaled_change(&values);
        let Some((to, limits)) = self.evaluate(&values, &step) else { return false };
        if self.method.note_trial(&step, &self.point, &to) {
            self.accept(values, to, limits);
            return true;
        }
        // The limits are curved: a second trial that follows them may succeed.
        let follows = to.limits.violation() > SLACK.max(2.0 * self.point.limits.violation());
        follows && self.second_trial(&step, &values, &to.limits)
    }

    fn second_trial(&mut self, step: &LimitedStep, from: &[f64], found: &LimitValues) -> bool {
        let Some(values) = self.corrected(from, found, &found.bounds) else { return false };
        let mut step = step.clone();
        step.change = self.state.scaled_change(&values);
        let Some((to, limits)) = self.evaluate(&values, &step) else { return false };
        let accepted = self.method.note_trial(&step, &self.point, &to);
        if accepted {
            self.accept(values, to, limits);
        }
        accepted
    }

    fn evaluate(
        &mut self,
        values: &[f64],
        step: &LimitedStep,
    ) -> Option<(LimitedPoint, Vec<Limit>)> {
        let found = self
            .state
            .check_finite(values)
            .and_then(|()| self.state.merit.evaluate_with_limits(values, DerivativeLevel::Normal));
        match found {
            Ok(found) if found.limits.len() == self.limits.len() => {
                self.state.evaluations += 1;
                let point = scaled_point(&self.state, &found.objective, &found.limits);
                Some((point, found.limits))
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

    fn accept(&mut self, values: Vec<f64>, point: LimitedPoint, limits: Vec<Limit>) {
        self.state.values = values;
        self.state.value = point.objective.value;
        self.state.current = self.state.merit.lens(&self.state.values);
        (self.point, self.limits) = (point, limits);
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
    fn restored(&self, step: &LimitedStep, proposed: Vec<f64>) -> Vec<f64> {
        let aims: Vec<[f64; 2]> = self
            .point
            .limits
            .bounds
            .iter()
            .zip(step.values.iter())
            .map(|([low, high], promised)| [low.min(*promised), high.max(*promised)])
            .collect();
        let mut values = proposed;
        for _ in 0..TRIAL_CORRECTIONS {
            let merit = &self.state.merit;
            let Ok(found) = merit.mechanical_limits(&values, DerivativeLevel::Gradient) else {
                break;
            };
            let found = limit_values(&self.state, &found);
            let aims = &aims[..found.bounds.len()];
            let excess = LimitValues { bounds: aims.to_vec(), ..found.clone() }.violation();
            if excess <= RESTORED {
                break;
            }
            match self.corrected(&values, &found, aims) {
                Some(next) => values = next,
                None => break,
            }
        }
        values
    }

    /// Values corrected so that their limits keep within the aims by their derivatives.
    fn corrected(
        &self,
        values: &[f64],
        found: &LimitValues,
        aims: &[[f64; 2]],
    ) -> Option<Vec<f64>> {
        let variables = self.state.merit.variables();
        let range = |i: usize| {
            let (variable, value, scale) = (&variables[i], values[i], self.state.scales[i]);
            let low = variable.min.map_or(f64::NEG_INFINITY, |min| (min - value).min(0.0));
            let high = variable.max.map_or(f64::INFINITY, |max| (max - value).max(0.0));
            [low / scale, high / scale]
        };
        let room: Vec<[f64; 2]> = (0..values.len()).map(range).collect();
        let change = self.method.correction(found, aims, &room)?;
        let moved = |i: usize| {
            super::state::clamp(&variables[i], values[i] + change[i] * self.state.scales[i])
        };
        Some((0..values.len()).map(moved).collect())
    }

    /// Finds the rays of the current lens anew, restores its limits with them, and makes it the best
    /// lens if it is. Returns true if the merit is another one by more than the tolerance.
    fn settle(&mut self) -> bool {
        let before = self.state.value;
        self.unchecked = 0;
        for round in 0..SETTLEMENTS {
            if !self.find_rays() || self.point.limits.violation() <= KEPT {
                break;
            }
            // What is still broken after a correction is the difference that new rays make.
            let difference = 2.0 * self.point.limits.violation();
            self.restore(if round == 0 { AIM } else { difference.clamp(AIM, LARGEST_AIM) });
        }
        self.adopt_verified();
        (self.state.value - before).abs() > 2.0 * self.tolerance * before.abs()
    }

    /// Finds the rays of the current lens anew; false if that fails.
    fn find_rays(&mut self) -> bool {
        let mut merit = self.state.merit.clone();
        let found = merit
            .resample(&self.state.current)
            .and_then(|()| merit.evaluate_with_limits(&self.state.values, DerivativeLevel::Normal));
        match found {
            Ok(found) if found.limits.len() == self.limits.len() => {
                self.state.merit = merit;
                self.state.value = found.objective.value;
                self.point = scaled_point(&self.state, &found.objective, &found.limits);
                self.limits = found.limits;
                true
            }
            Ok(_) => false,
            Err(cause) => {
                self.state.refused = Some(cause.to_string());
                false
            }
        }
    }

    /// Corrects the current lens until it keeps its limits with the present rays, by a margin.
    fn restore(&mut self, margin: f64) {
        for _ in 0..CORRECTIONS {
            let aims: Vec<[f64; 2]> = self
                .point
                .limits
                .bounds
                .iter()
                .map(
                    |[low, high]| {
                        if low == high { [*low, *high] } else { [low + margin, high - margin] }
                    },
                )
                .collect();
            let limits = &self.point.limits;
            let aimed = |limits: &LimitValues| {
                LimitValues { bounds: aims.clone(), ..limits.clone() }.violation()
            };
            if aimed(limits) <= RESTORED.max(0.1 * margin) {
                break;
            }
            let Some(values) = self.corrected(&self.state.values, limits, &aims) else { break };
            let merit = &self.state.merit;
            let Ok(found) = merit.evaluate_with_limits(&values, DerivativeLevel::Normal) else {
                break;
            };
            self.state.evaluations += 1;
            let point = scaled_point(&self.state, &found.objective, &found.limits);
            if !(aimed(&point.limits) < aimed(limits)) {
                break;
            }
            self.state.values = values;
            self.state.value = point.objective.value;
            self.state.current = self.state.merit.lens(&self.state.values);
            (self.point, self.limits) = (point, found.limits);
        }
    }

    /// Makes the current lens, whose rays are its own, the best one, or returns to the one verified
    /// before if that is better.
    fn adopt_verified(&mut self) {
        let rank = self.rank();
        match self.verified.take() {
            Some((lens, before)) if before < rank => {
                self.state.current.clone_from(&lens);
                self.state.values = self.state.merit.values(&lens);
                self.find_rays();
                self.method.note_other_function(true);
                self.state.failed_verifications += 1;
                self.verified = Some((lens, before));
            }
            _ => {
                self.state.failed_verifications = 0;
                self.verified = Some((self.state.current.clone(), rank));
            }
        }
        self.best_violation = self.rank().0;
        self.state.best_value = self.state.value;
        self.state.best.clone_from(&self.state.current);
        self.note_prices();
    }

    /// The violation and the merit of the current lens: the smaller the better, in this order.
    fn rank(&self) -> (f64, f64) {
        let violation = self.point.limits.violation();
        (if violation <= KEPT { 0.0 } else { violation }, self.state.value)
    }

    /// Notes the binding limits of the current lens with their multipliers.
    fn note_prices(&mut self) {
        let room = self.state.room();
        let Some((step, _)) = self.method.unconfined(&self.point, &room) else { return };
        let price = |(limit, multiplier): (&Limit, &f64)| LimitPrice::new(limit, *multiplier);
        let all = self.limits.iter().zip(step.multipliers.iter());
        self.prices = all.filter_map(price).collect();
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

    /// The smallest conflict among the limits at the current lens, by their derivatives.
    fn conflict_here(&self) -> Vec<String> {
        let all: Vec<usize> = (0..self.limits.len()).collect();
        let room = self.state.room();
        let is_conflict = |set: &[usize]| {
            let chosen: Vec<Limit> = set.iter().map(|i| self.limits[*i].clone()).collect();
            let limits = limit_values(&self.state, &chosen);
            let remaining = self.method.correction(&limits, &limits.bounds, &room).map_or_else(
                || limits.violation(),
                |change| limits.excesses(&limits.linearized(&change)).amax(),
            );
            remaining > 1e-7
        };
        if !is_conflict(&all) {
            let broken = self.limits.iter().filter(|limit| limit.violation() > KEPT);
            return broken.map(|limit| limit.margin.name()).collect();
        }
        let named = smallest_conflict(&all, is_conflict);
        named.into_iter().map(|i| self.limits[i].margin.name()).collect()
    }

    /// Refuses limits that need no rays and that no lens near the first one can keep together.
    fn refuse_contradictions(&mut self) -> Result<(), MeritError> {
        let room = self.state.room();
        // The scales of the method are those of its first step.
        drop(self.method.propose(&self.point, &room));
        self.method.forget_radius();
        let all: Vec<usize> = (0..self.limits.len()).collect();
        if self.can_keep(&all) {
            return Ok(());
        }
        let conflict = smallest_conflict(&all, |set| !self.can_keep(set));
        let limits = conflict.into_iter().map(|i| self.limits[i].margin.name()).collect();
        Err(MeritError::ConflictingLimits { limits })
    }

    /// True if a lens near the current one keeps the chosen ones of the limits that need no rays.
    fn can_keep(&self, chosen: &[usize]) -> bool {
        let mut values = self.state.values.clone();
        let (mut least, mut stalls) = (f64::INFINITY, 0);
        for _ in 0..RESTORATIONS {
            let merit = &self.state.merit;
            let Ok(found) = merit.mechanical_limits(&values, DerivativeLevel::Gradient) else {
                return true;
            };
            let kept: Vec<Limit> = chosen.iter().filter_map(|i| found.get(*i)).cloned().collect();
            let limits = limit_values(&self.state, &kept);
            let violation = limits.excesses(&limits.values).abs().sum();
            if violation <= KEPT {
                return true;
            }
            stalls = if violation < 0.999 * least { 0 } else { stalls + 1 };
            if stalls >= PATIENCE {
                return false;
            }
            least = least.min(violation);
            match self.corrected(&values, &limits, &limits.bounds) {
                Some(next) => values = next,
                None => return false,
            }
        }
        true
    }
}

/// The number of corrections after which limits are believed to be compatible.
const RESTORATIONS: usize = 50;

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

impl LimitPrice {
    /// The price of a limit; `None` if it does not bind.
    fn new(limit: &Limit, multiplier: f64) -> Option<Self> {
        let [low, high] = limit.bounds();
        let value = limit.margin.value;
        let near = |bound: f64| {
            bound.is_finite() && (value - bound).abs() <= BINDING * bound.abs().max(1.0)
        };
        let bound = if near(high) {
            high
        } else if near(low) {
            low
        } else {
            return None;
        };
        let price = if low == high { multiplier } else { multiplier.abs() };
        Some(Self { limit: limit.margin.clone(), bound, price })
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
            self.interval = if self.settle() { (self.interval / 2).max(1) } else { CHECK_INTERVAL };
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

    fn binding_limits(&self) -> &[LimitPrice] {
        &self.prices
    }

    fn conflict(&self) -> &[String] {
        &self.conflict
    }
}
