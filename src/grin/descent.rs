//! Descent in the parameters of a field, one step at a time: the caller owns the loop.
//!
//! The rays depend on `∇η²` alone, so what they leave open, the level of the index, the loss must fix.
//! A Newton-like method that starts far away runs into other minima, where rays orbit: the largest
//! change of a parameter in a step is limited, and so is the range of the index.

use std::collections::VecDeque;

/// Pairs of steps and changes of the gradient that the curvature is made of.
const STORED_PAIRS: usize = 12;
/// A step must bring this part of what the slope promises (Armijo).
const SUFFICIENT_DECREASE: f64 = 1e-4;
/// How often a step is halved before the direction is given up.
const MAX_HALVINGS: usize = 20;

/// What parameters may do.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterBounds {
    /// Smallest and largest value of each parameter; one that may not change has both alike.
    pub ranges: Vec<[f64; 2]>,
    /// Largest change of a parameter in one step.
    pub max_change: f64,
}

impl ParameterBounds {
    /// The same range for so many parameters.
    pub fn uniform(count: usize, range: [f64; 2], change: f64) -> Self {
        Self { ranges: vec![range; count], max_change: change }
    }

    /// Puts parameters back into their ranges; how many were outside.
    pub fn project(&self, parameters: &mut [f64]) -> usize {
        let mut outside = 0;
        for (value, [low, high]) in parameters.iter_mut().zip(&self.ranges) {
            if !(*value >= *low && *value <= *high) {
                *value = if *value > *high { *high } else { *low };
                outside += 1;
            }
        }
        outside
    }

    /// Scales a step down to the largest change.
    pub fn limit_step(&self, step: &mut [f64]) {
        let largest = step.iter().fold(0.0, |max: f64, s| max.max(s.abs()));
        if largest > self.max_change {
            step.iter_mut().for_each(|s| *s *= self.max_change / largest);
        }
    }

    /// Which parameters stay where they are: descent would push them out of their range.
    pub fn active_bounds(&self, parameters: &[f64], gradient: &[f64]) -> Vec<bool> {
        let held = |((value, g), [low, high]): ((&f64, &f64), &[f64; 2])| {
            (*value <= *low && *g > 0.0) || (*value >= *high && *g < 0.0)
        };
        parameters.iter().zip(gradient).zip(&self.ranges).map(held).collect()
    }
}

/// Adam: running means of the gradient and of its square (Kingma and Ba, ICLR 2015, algorithm 1).
/// For gradients that differ from step to step, as with random rays.
#[derive(Debug, Clone, PartialEq)]
pub struct Adam {
    /// The size of a step.
    pub rate: f64,
    mean: Vec<f64>,
    square: Vec<f64>,
    age: i32,
}

impl Adam {
    /// A descent with steps of this size.
    pub fn new(rate: f64) -> Self {
        Self { rate, mean: Vec::new(), square: Vec::new(), age: 0 }
    }

    /// Takes one step down this gradient.
    pub fn step(&mut self, parameters: &mut [f64], gradient: &[f64], limits: &ParameterBounds) {
        let (b1, b2) = (0.9, 0.999);
        self.mean.resize(parameters.len(), 0.0);
        self.square.resize(parameters.len(), 0.0);
        self.age += 1;
        let (c1, c2) = (1.0 - f64::powi(b1, self.age), 1.0 - f64::powi(b2, self.age));
        let held = limits.active_bounds(parameters, gradient);
        for (i, value) in parameters.iter_mut().enumerate() {
            // What its limit holds must not gather momentum.
            let g = if held[i] { 0.0 } else { gradient[i] };
            self.mean[i] = b1 * self.mean[i] + (1.0 - b1) * g;
            self.square[i] = b2 * self.square[i] + (1.0 - b2) * g * g;
            let size = (self.square[i] / c2).sqrt();
            if size > 0.0 {
                let step = self.rate * (self.mean[i] / c1) / size;
                *value -= step.clamp(-limits.max_change, limits.max_change);
            }
        }
        limits.project(parameters);
    }
}

/// Limited-memory BFGS with projection onto the limits (Nocedal, Math. Comput. 35, 1980). For the
/// same rays in every step.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Lbfgs {
    /// Steps and changes of the gradient, the newest last.
    pairs: VecDeque<(Vec<f64>, Vec<f64>)>,
    /// Value and gradient where the last step ended.
    at: Option<(f64, Vec<f64>)>,
}

/// What a step of [`Lbfgs`] did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LbfgsStep {
    /// The value where it ended.
    pub value: f64,
    /// How often value and gradient were asked for.
    pub evaluations: usize,
    /// Whether further steps would change nothing.
    pub converged: bool,
}

impl Lbfgs {
    /// Takes one step; `evaluate` gives the value and its gradient. A value that is no number
    /// shortens the step.
    pub fn step(
        &mut self,
        parameters: &mut [f64],
        limits: &ParameterBounds,
        mut evaluate: impl FnMut(&[f64]) -> (f64, Vec<f64>),
    ) -> LbfgsStep {
        let fresh = usize::from(self.at.is_none());
        let (value, gradient) = self.at.take().unwrap_or_else(|| evaluate(parameters));
        let mut step = self.direction(parameters, &gradient, limits);
        for evaluations in 1..=MAX_HALVINGS {
            let mut trial: Vec<f64> = parameters.iter().zip(&step).map(|(x, s)| x + s).collect();
            limits.project(&mut trial);
            let moved: Vec<f64> = trial.iter().zip(&*parameters).map(|(a, b)| a - b).collect();
            let (new, slope) = evaluate(&trial);
            if new <= value + SUFFICIENT_DECREASE * dot(&gradient, &moved) && new.is_finite() {
                let change = slope.iter().zip(&gradient).map(|(a, b)| a - b).collect();
                self.store_pair(moved, change);
                parameters.copy_from_slice(&trial);
                self.at = Some((new, slope));
                let finished = !(new < value);
                return LbfgsStep {
                    value: new,
                    evaluations: evaluations + fresh,
                    converged: finished,
                };
            }
            step.iter_mut().for_each(|s| *s *= 0.5);
        }
        // Along the plain gradient nothing better is to be had; else begin again with it.
        let finished = self.pairs.is_empty();
        self.pairs.clear();
        self.at = Some((value, gradient));
        LbfgsStep { value, evaluations: MAX_HALVINGS + fresh, converged: finished }
    }

    /// Forgets what it knows of the loss, which has become another one.
    pub fn restart(&mut self) {
        *self = Self::default();
    }

    /// Keeps a pair that shows positive curvature.
    fn store_pair(&mut self, moved: Vec<f64>, change: Vec<f64>) {
        if dot(&moved, &change) > 1e-12 * dot(&change, &change).sqrt() * dot(&moved, &moved).sqrt()
        {
            self.pairs.push_back((moved, change));
            if self.pairs.len() > STORED_PAIRS {
                self.pairs.pop_front();
            }
        }
    }

    /// The step by the two-loop recursion, with what a limit holds left out.
    fn direction(
        &self,
        parameters: &[f64],
        gradient: &[f64],
        limits: &ParameterBounds,
    ) -> Vec<f64> {
        let held = limits.active_bounds(parameters, gradient);
        let free = |v: &mut [f64]| {
            v.iter_mut().zip(&held).filter(|(_, held)| **held).for_each(|(v, _)| *v = 0.0);
        };
        let mut step: Vec<f64> = gradient.iter().map(|g| -g).collect();
        free(&mut step);
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
            // Nothing is known of the curvature: a small step.
            let largest = step.iter().fold(0.0, |max: f64, s| max.max(s.abs()));
            let scale = if largest > 0.0 { 0.1 * limits.max_change / largest } else { 0.0 };
            step.iter_mut().for_each(|d| *d *= scale);
        }
        for ((s, y), weight) in self.pairs.iter().zip(weights.into_iter().rev()) {
            let correction = weight - dot(y, &step) / dot(s, y);
            step.iter_mut().zip(s).for_each(|(d, s)| *d += correction * s);
        }
        free(&mut step);
        limits.limit_step(&mut step);
        step
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
