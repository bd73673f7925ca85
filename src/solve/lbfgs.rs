//! Limited-memory BFGS within bounds, one step at a time (Nocedal, Math. Comput. 35, 1980).

use super::{ParameterBounds, dot};
use std::collections::VecDeque;

/// Stored pairs of steps and changes of the gradient.
const STORED_PAIRS: usize = 12;
/// The fraction of the decrease along the gradient that a step must achieve (Armijo).
const SUFFICIENT_DECREASE: f64 = 1e-4;
/// The largest number of halvings of a step.
const MAX_HALVINGS: usize = 20;

/// Limited-memory BFGS with projection onto the bounds. For a function that stays the same from
/// step to step.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Lbfgs {
    /// Steps and changes of the gradient, the newest last.
    pairs: VecDeque<(Vec<f64>, Vec<f64>)>,
    /// The value and gradient at the end of the last step.
    at: Option<(f64, Vec<f64>)>,
}

/// The result of a step of [`Lbfgs`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LbfgsStep {
    /// The value at the end of the step.
    pub value: f64,
    /// The number of evaluations of value and gradient.
    pub evaluations: usize,
    /// True if further steps would change nothing.
    pub converged: bool,
}

impl Lbfgs {
    /// Takes one step; `evaluate` returns the value and its gradient. A value that is not a finite
    /// number shortens the step.
    pub fn step(
        &mut self,
        parameters: &mut [f64],
        bounds: &ParameterBounds,
        mut evaluate: impl FnMut(&[f64]) -> (f64, Vec<f64>),
    ) -> LbfgsStep {
        let first = usize::from(self.at.is_none());
        let (value, gradient) = self.at.take().unwrap_or_else(|| evaluate(parameters));
        let mut step = self.direction(parameters, &gradient, bounds);
        for evaluations in 1..=MAX_HALVINGS {
            let mut trial: Vec<f64> = parameters.iter().zip(&step).map(|(x, s)| x + s).collect();
            bounds.project(&mut trial);
            let moved: Vec<f64> = trial.iter().zip(&*parameters).map(|(a, b)| a - b).collect();
            let (new, slope) = evaluate(&trial);
            if new <= value + SUFFICIENT_DECREASE * dot(&gradient, &moved) && new.is_finite() {
                let change = slope.iter().zip(&gradient).map(|(a, b)| a - b).collect();
                self.store_pair(moved, change);
                parameters.copy_from_slice(&trial);
                self.at = Some((new, slope));
                let converged = !(new < value);
                return LbfgsStep { value: new, evaluations: evaluations + first, converged };
            }
            step.iter_mut().for_each(|s| *s *= 0.5);
        }
        // Without pairs the direction was the gradient: nothing is left to gain. Otherwise the next
        // step starts again from the gradient.
        let converged = self.pairs.is_empty();
        self.pairs.clear();
        self.at = Some((value, gradient));
        LbfgsStep { value, evaluations: MAX_HALVINGS + first, converged }
    }

    /// Discards everything known of the function, for use with another one.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// Stores a pair if it has positive curvature.
    fn store_pair(&mut self, moved: Vec<f64>, change: Vec<f64>) {
        if dot(&moved, &change) > 1e-12 * dot(&change, &change).sqrt() * dot(&moved, &moved).sqrt()
        {
            self.pairs.push_back((moved, change));
            if self.pairs.len() > STORED_PAIRS {
                self.pairs.pop_front();
            }
        }
    }

    /// The step by the two-loop recursion, with zeros for parameters at active bounds.
    fn direction(
        &self,
        parameters: &[f64],
        gradient: &[f64],
        bounds: &ParameterBounds,
    ) -> Vec<f64> {
        let active = bounds.active_bounds(parameters, gradient);
        let clear_active = |v: &mut [f64]| {
            v.iter_mut().zip(&active).filter(|(_, active)| **active).for_each(|(v, _)| *v = 0.0);
        };
        let mut step: Vec<f64> = gradient.iter().map(|g| -g).collect();
        clear_active(&mut step);
        let mut weights = Vec::with_capacity(self.pairs.len());
        for (s, y) in self.pairs.iter().rev() {
            let weight = dot(s, &step) / dot(s, y);
            step.iter_mut().zip(y).for_each(|(d, y)| *d -= weight * y);
            weights.push(weight);
        }
        if let Some((s, y)) = self.pairs.back() {
            let scale = dot(s, y) / dot(y, y);
            step.iter_mut().for_each(|d| *d *= scale);
        } else {
            // The curvature is unknown: a small step.
            let largest = step.iter().fold(0.0, |max: f64, s| max.max(s.abs()));
            let scale = if largest > 0.0 { 0.1 * bounds.max_change / largest } else { 0.0 };
            step.iter_mut().for_each(|d| *d *= scale);
        }
        for ((s, y), weight) in self.pairs.iter().zip(weights.into_iter().rev()) {
            let correction = weight - dot(y, &step) / dot(s, y);
            step.iter_mut().zip(s).for_each(|(d, s)| *d += correction * s);
        }
        clear_active(&mut step);
        bounds.limit_step(&mut step);
        step
    }
}
