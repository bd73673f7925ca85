//! Limited functions and sums of squares at one point, and the steps between two points.

use super::trust_region::LeastSquaresPoint;
use nalgebra::{DMatrix, DVector};

/// The violation, in the unit of each limit, up to which a step from a point that keeps them may
/// break them.
pub const SLACK: f64 = 1e-3;

/// Limited functions of the parameters at one point.
#[derive(Debug, Clone, PartialEq)]
pub struct LimitValues {
    /// The values.
    pub values: DVector<f64>,
    /// Their derivatives, one row each.
    pub slopes: DMatrix<f64>,
    /// The lower and upper bound of each; equal for an equality.
    pub bounds: Vec<[f64; 2]>,
    /// The square of each violation times this is comparable with the sum of squares.
    pub weights: Vec<f64>,
}

/// A sum of squares with its limits at one point.
#[derive(Debug, Clone, PartialEq)]
pub struct LimitedPoint {
    /// The sum of squares.
    pub objective: LeastSquaresPoint,
    /// The limits.
    pub limits: LimitValues,
}

/// A proposed step.
#[derive(Debug, Clone, PartialEq)]
pub struct LimitedStep {
    /// The change of every parameter that the model proposes.
    pub proposed: DVector<f64>,
    /// The change of every parameter that is tried: the proposed one, or what a correction by the
    /// curvature of the limits has made of it.
    pub change: DVector<f64>,
    /// The limited functions behind the step, by their derivatives.
    pub values: DVector<f64>,
    /// The multiplier of every limit: what the sum of squares would gain by a bound looser by one
    /// unit, negative for a lower bound.
    pub multipliers: DVector<f64>,
    /// The parts of the multipliers that belong to the derivatives at the point itself.
    pub(super) own_multipliers: DVector<f64>,
    /// The multipliers of the other branches of kinked limits.
    pub(super) branch_multipliers: Vec<f64>,
    /// Half the gradient of the Lagrangian before the step.
    pub(super) half_lagrangian: DVector<f64>,
    /// True if the limits cannot all hold within the trust region by their derivatives.
    pub is_relaxed: bool,
}

impl LimitValues {
    /// The amount by which each value is above its upper bound, negative below the lower one, 0
    /// between them.
    pub fn excesses(&self, values: &DVector<f64>) -> DVector<f64> {
        let excess = |(value, [low, high]): (&f64, &[f64; 2])| {
            (value - high).max(0.0) + (value - low).min(0.0)
        };
        DVector::from_iterator(values.len(), values.iter().zip(&self.bounds).map(excess))
    }

    /// The same values under other bounds.
    #[must_use]
    pub fn with_bounds(&self, bounds: &[[f64; 2]]) -> Self {
        Self { bounds: bounds.to_vec(), ..self.clone() }
    }

    /// The largest violation.
    pub fn violation(&self) -> f64 {
        self.excesses(&self.values).amax()
    }

    /// The values behind a change of the parameters, by their derivatives.
    pub fn linearized(&self, change: &DVector<f64>) -> DVector<f64> {
        &self.values + &self.slopes * change
    }

    /// The ranges by which the values may still change.
    pub(super) fn room(&self, values: &DVector<f64>) -> Vec<[f64; 2]> {
        let range = |(value, [low, high]): (&f64, &[f64; 2])| [low - value, high - value];
        values.iter().zip(&self.bounds).map(range).collect()
    }
}

impl LimitedPoint {
    /// The length of a step that changes the residuals by their own size.
    pub(super) fn natural_radius(&self) -> f64 {
        let limits = &self.limits;
        let excesses = limits.excesses(&limits.values);
        let broken: f64 = excesses.iter().zip(&limits.weights).map(|(e, w)| w * e * e).sum();
        (self.objective.value.max(0.0) + broken).sqrt().max(f64::MIN_POSITIVE.sqrt())
    }

    /// The sum of squares plus the limited functions times their multipliers.
    pub(super) fn lagrangian(&self, multipliers: &DVector<f64>) -> LeastSquaresPoint {
        let Self { objective, limits } = self;
        LeastSquaresPoint {
            value: objective.value + multipliers.dot(&limits.values),
            half_gradient: &objective.half_gradient + limits.slopes.tr_mul(multipliers) * 0.5,
            normal: objective.normal.clone(),
            separate: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn excesses_are_positive_above_and_negative_below_their_bounds() {
        let values = DVector::from_vec(vec![3.0, -3.0, 0.5, 2.0, -7.0]);
        let limits = LimitValues {
            slopes: DMatrix::zeros(5, 1),
            bounds: vec![
                [-1.0, 1.0],
                [-1.0, 1.0],
                [-1.0, 1.0],
                [2.0, 2.0],
                [f64::NEG_INFINITY, 0.0],
            ],
            weights: vec![1.0; 5],
            values: values.clone(),
        };
        assert_eq!(limits.excesses(&values).as_slice(), [2.0, -2.0, 0.0, 0.0, 0.0]);
        assert_eq!(limits.violation(), 2.0);
        assert_eq!(limits.excesses(&values.add_scalar(4.0)).as_slice(), [6.0, 0.0, 3.5, 4.0, 0.0]);
    }
}
