//! Adam: first-order descent with running means of the gradient and of its square (Kingma and Ba,
//! "Adam: A Method for Stochastic Optimization", ICLR 2015, algorithm 1).
//!
//! The merit may rise for a while; the best lens is retained. With "reduce on plateau" the rate is
//! halved when the merit has not improved for long, and the descent restarts from the best lens.
//! With cosine annealing the descent takes a given number of steps, while its rate falls to zero as
//! a cosine (Loshchilov and Hutter, "SGDR", ICLR 2017), so that its cost is known in advance.

use super::state::OptimizerState;
use super::{OptimizationEnd, OptimizationProgress, Optimizer};
use crate::lens::Lens;
use crate::merit::{DerivativeLevel, Merit, MeritError, TermValue};
use crate::solve::AdamMoments;
use std::f64::consts::PI;

/// The initial rate with reduction on a plateau, in scaled variables.
const RATE: f64 = 0.1;
/// The rate below which the descent has ended.
const SMALLEST_RATE: f64 = 1e-7;
/// Steps without improvement before the rate is halved.
const PATIENCE: usize = 40;
/// The largest relative increase of the merit in a step.
const WORSE: f64 = 1.0;
/// The initial rate with cosine annealing, in scaled variables.
const ANNEALED_RATE: f64 = 0.01;

/// The schedule of the learning rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LearningRate {
    /// Halved when the merit has not improved for [`PATIENCE`] steps.
    ReduceOnPlateau,
    /// A cosine that falls to zero after this many steps.
    CosineAnnealing(usize),
}

#[derive(Debug)]
pub(super) struct AdamOptimizer {
    state: OptimizerState,
    gradient: Vec<f64>,
    moments: AdamMoments,
    rate: f64,
    schedule: LearningRate,
    since_better: usize,
}

impl AdamOptimizer {
    pub(super) fn new(merit: Merit, lens: &Lens, pace: LearningRate) -> Result<Self, MeritError> {
        let mut state = OptimizerState::new(merit, lens)?;
        let sum = state.merit.evaluate(&state.values, DerivativeLevel::Normal)?;
        if pace == LearningRate::ReduceOnPlateau {
            state.rescale(&sum);
        }
        Ok(Self {
            gradient: sum.gradient.iter().copied().collect(),
            moments: AdamMoments::default(),
            rate: if pace == LearningRate::ReduceOnPlateau { RATE } else { ANNEALED_RATE },
            schedule: pace,
            since_better: 0,
            state,
        })
    }

    /// The step in scaled variables.
    fn direction(&mut self) -> Vec<f64> {
        self.state.adam_step(&mut self.moments, &self.gradient, self.rate)
    }

    /// Restarts from the best lens with half the rate and new moments.
    fn reduce_rate(&mut self) {
        self.rate *= 0.5;
        self.since_better = 0;
        self.moments = AdamMoments::default();
        self.state.return_to_best();
        self.differentiate();
    }

    fn differentiate(&mut self) {
        if let Ok(sum) = self.state.merit.evaluate(&self.state.values, DerivativeLevel::Normal) {
            if self.schedule == LearningRate::ReduceOnPlateau {
                self.state.rescale(&sum);
            }
            self.gradient = sum.gradient.iter().copied().collect();
        }
    }

    fn plateau_step(&mut self) -> f64 {
        let step = self.direction();
        let before = self.state.best_value;
        let limit = self.state.value + WORSE * self.state.value.abs();
        let (accepted, sum) =
            self.state.advance(&step, DerivativeLevel::Gradient, |value| value <= limit);
        match sum {
            Some(sum) => self.gradient = sum.gradient.iter().copied().collect(),
            None => self.reduce_rate(),
        }
        self.since_better = if self.state.best_value < before { 0 } else { self.since_better + 1 };
        if self.since_better >= PATIENCE {
            self.reduce_rate();
        }
        accepted
    }

    /// Takes a step of the cosine schedule, accepted whatever its merit.
    fn annealed_step(&mut self, steps: usize) -> f64 {
        let done = self.state.steps as f64 / steps as f64;
        self.rate = 0.5 * ANNEALED_RATE * (1.0 + (PI * done).cos());
        let step = self.direction();
        let (accepted, sum) = self.state.advance(&step, DerivativeLevel::Gradient, |_| true);
        if let Some(sum) = sum {
            self.gradient = sum.gradient.iter().copied().collect();
        } else {
            self.state.return_to_best();
            self.differentiate();
        }
        accepted
    }

    fn has_ended(&self) -> bool {
        match self.schedule {
            LearningRate::ReduceOnPlateau => self.rate < SMALLEST_RATE || self.state.has_ended(),
            LearningRate::CosineAnnealing(steps) => self.state.steps >= steps,
        }
    }
}

impl Optimizer for AdamOptimizer {
    fn step(&mut self) -> OptimizationProgress {
        if self.has_ended() {
            return self.state.progress(0.0, Some(OptimizationEnd::NoGain));
        }
        let accepted = match self.schedule {
            LearningRate::ReduceOnPlateau => self.plateau_step(),
            LearningRate::CosineAnnealing(steps) => self.annealed_step(steps),
        };
        let progress = self.state.progress(accepted, None);
        if self.state.resample_if_due() && self.schedule == LearningRate::ReduceOnPlateau {
            self.differentiate();
        }
        progress
    }

    fn verify_best(&mut self) {
        self.state.verify_best();
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
}
