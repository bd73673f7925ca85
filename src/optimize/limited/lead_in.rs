//! The way to limits that cannot be kept near where a descent has come to: it begins anew at the first lens,
//! with the limits as penalties whose weight grows, so that it may pass through lenses that break them: the
//! sequential unconstrained minimization of Fiacco and others (*Nonlinear Programming*, 1968).

use super::LimitedOptimizer;
use crate::solve::{LeastSquaresPoint, LimitedPoint, LimitedTrustRegion, TrustRegion};

/// The factor of the weight from one stage to the next, and the largest weight.
const GROWTH: f64 = 10.0;
const LARGEST_WEIGHT: f64 = 1e4;
/// The trials of a stage.
const TRIALS: usize = 60;
/// The decrease relative to the penalized sum that a stage has to promise to go on.
const SMALL_GAIN: f64 = 1e-3;
/// The violation at the end of a stage from which the limits are constraints again.
const NEAR: f64 = 1e-2;

/// A descent with penalties.
#[derive(Debug)]
pub(super) struct LeadIn {
    region: TrustRegion,
    /// The factor of the weights of all limits.
    weight: f64,
    /// The trials of this stage.
    trials: usize,
}

impl LeadIn {
    fn new(count: usize) -> Self {
        Self { region: TrustRegion::new(count), weight: 1.0, trials: 0 }
    }

    /// The sum of squares with the weighted squares of the violations.
    fn penalized(&self, point: &LimitedPoint) -> LeastSquaresPoint {
        let limits = &point.limits;
        let mut sum = point.objective.clone();
        for (i, excess) in limits.excesses(&limits.values).iter().enumerate() {
            if *excess != 0.0 {
                let weight = self.weight * limits.weights[i];
                let slope = limits.slopes.row(i).transpose();
                sum.value += weight * excess * excess;
                sum.half_gradient.axpy(weight * excess, &slope, 1.0);
                sum.normal.ger(weight, &slope, &slope, 1.0);
            }
        }
        sum
    }
}

impl LimitedOptimizer {
    /// Begins anew at the first lens; false if its rays are not found.
    pub(super) fn begin_lead_in(&mut self) -> bool {
        self.may_lead_in = false;
        let before = (self.state.values.clone(), self.state.current.clone());
        self.state.values.clone_from(&self.first);
        self.state.current = self.state.merit.lens(&self.first);
        if !self.find_rays() {
            (self.state.values, self.state.current) = before;
            return false;
        }
        self.lead_in = Some(LeadIn::new(self.state.values.len()));
        true
    }

    /// Tries one step with penalties; returns the part of it that was taken, 0 or 1.
    pub(super) fn try_lead_in_step(&mut self, mut lead_in: LeadIn) -> f64 {
        let room = self.state.room();
        let point = lead_in.penalized(&self.point);
        let step = lead_in.region.propose(&point, &room);
        let is_small = |promised: f64| promised <= SMALL_GAIN * point.value;
        let is_idle = is_small(lead_in.region.attainable_decrease(&point, &room));
        let Some(step) = step.filter(|_| !is_idle && lead_in.trials < TRIALS) else {
            self.end_stage(lead_in.weight);
            return 0.0;
        };
        lead_in.trials += 1;
        let values = self.state.proposal(step.change.as_slice(), 1.0);
        let mut accepted = false;
        match self.try_values(&values, &step.change) {
            None => lead_in.region.note_failure(&step),
            Some((to, found)) => {
                accepted = lead_in.region.note_trial(&step, &point, &lead_in.penalized(&to));
                if accepted {
                    self.accept(values, to, found);
                }
            }
        }
        self.lead_in = Some(lead_in);
        if accepted { 1.0 } else { 0.0 }
    }

    /// Goes on with a larger weight, or with the limits as constraints.
    fn end_stage(&mut self, weight: f64) {
        let count = self.state.values.len();
        let is_near = self.point.limits.violation() <= NEAR;
        let weight = GROWTH * weight;
        if is_near || weight > LARGEST_WEIGHT {
            self.method = LimitedTrustRegion::new(count, self.limits.len());
            self.first_gradient = None;
        } else {
            self.lead_in = Some(LeadIn { weight, ..LeadIn::new(count) });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::LimitValues;
    use nalgebra::{DMatrix, DVector};

    /// Two variables, of which the first one is 0.5 above its bound and the second one within it.
    fn point() -> LimitedPoint {
        LimitedPoint {
            objective: LeastSquaresPoint {
                value: 3.0,
                half_gradient: DVector::from_column_slice(&[1.0, -2.0]),
                normal: DMatrix::identity(2, 2),
            },
            limits: LimitValues {
                values: DVector::from_column_slice(&[1.5, 0.3]),
                slopes: DMatrix::identity(2, 2),
                bounds: vec![[0.0, 1.0]; 2],
                weights: vec![2.0, 5.0],
            },
        }
    }

    #[test]
    fn broken_limits_alone_are_penalized_by_their_weights() {
        let stage = LeadIn { weight: 10.0, ..LeadIn::new(2) };
        let sum = stage.penalized(&point());
        assert!((sum.value - (3.0 + 20.0 * 0.25)).abs() < 1e-12, "{}", sum.value);
        assert_eq!(sum.half_gradient.as_slice(), [1.0 + 20.0 * 0.5, -2.0]);
        assert_eq!(sum.normal.as_slice(), [21.0, 0.0, 0.0, 1.0]);
    }
}
