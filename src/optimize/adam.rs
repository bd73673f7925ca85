//! Adam: first-order descent with running means of the gradient and of its square (Kingma and Ba,
//! "Adam: A Method for Stochastic Optimization", ICLR 2015, algorithm 1).
//!
//! The merit may rise for a while; the best lens is kept. A patient search halves its rate when the
//! merit has not improved for long, and goes back to the best lens; an annealed one takes a given
//! number of steps, while its rate falls to zero as a cosine (Loshchilov and Hutter, "SGDR", ICLR
//! 2017), so that a run costs what it was meant to cost.

use super::state::State;
use super::{Optimizer, Progress};
use crate::lens::Lens;
use crate::merit::{Detail, Merit, MeritError, TermValue};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Decay of the mean gradient and of the mean square.
const DECAY: [f64; 2] = [0.9, 0.999];
/// The first rate, in scaled variables.
const RATE: f64 = 0.1;
/// Below this the search has ended.
const SMALLEST_RATE: f64 = 1e-7;
/// Steps without improvement before the rate is halved.
const PATIENCE: usize = 40;
/// A step may not add more than this part of the merit to it.
const WORSE: f64 = 1.0;
/// The first rate of an annealed search, in scaled variables.
const ANNEALED_RATE: f64 = 0.01;

/// How the rate falls.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pace {
    /// By half, whenever patience ends.
    Patient,
    /// As a cosine, to zero after so many steps.
    Annealed(usize),
}

/// The running means of a gradient in scaled variables and of its square.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Moments {
    mean: Vec<f64>,
    square: Vec<f64>,
    /// Gradients that they have seen.
    age: i32,
}

impl Moments {
    /// Takes a gradient in; the step that follows, in scaled variables. None is taken through a
    /// bound at which a variable is held.
    pub(super) fn step(&mut self, gradient: &[f64], state: &State, rate: f64) -> Vec<f64> {
        if self.mean.len() != gradient.len() {
            *self = Self::default();
            self.mean.resize(gradient.len(), 0.0);
            self.square.resize(gradient.len(), 0.0);
        }
        self.age = self.age.saturating_add(1);
        let [b1, b2] = DECAY;
        let (c1, c2) = (1.0 - b1.powi(self.age), 1.0 - b2.powi(self.age));
        let held = state.held(gradient);
        let step = |i: usize| {
            let g = gradient[i] * state.scales[i];
            self.mean[i] = b1 * self.mean[i] + (1.0 - b1) * g;
            self.square[i] = b2 * self.square[i] + (1.0 - b2) * g * g;
            let size = (self.square[i] / c2).sqrt();
            if held[i] || size == 0.0 { 0.0 } else { -rate * (self.mean[i] / c1) / size }
        };
        (0..gradient.len()).map(step).collect()
    }
}

#[derive(Debug)]
pub(super) struct Adam {
    state: State,
    gradient: Vec<f64>,
    moments: Moments,
    rate: f64,
    pace: Pace,
    since_better: usize,
}

impl Adam {
    pub(super) fn new(merit: Merit, lens: &Lens, pace: Pace) -> Result<Self, MeritError> {
        let mut state = State::new(merit, lens)?;
        let sum = state.merit.sum(&state.values, Detail::Normal)?;
        if pace == Pace::Patient {
            state.rescale(&sum);
        }
        Ok(Self {
            gradient: sum.gradient.iter().copied().collect(),
            moments: Moments::default(),
            rate: if pace == Pace::Patient { RATE } else { ANNEALED_RATE },
            pace,
            since_better: 0,
            state,
        })
    }

    /// The step in scaled variables.
    fn direction(&mut self) -> Vec<f64> {
        self.moments.step(&self.gradient, &self.state, self.rate)
    }

    /// Back to the best lens with half of the rate and fresh moments.
    fn slow_down(&mut self) {
        self.rate *= 0.5;
        self.since_better = 0;
        self.moments = Moments::default();
        self.state.return_to_best();
        self.differentiate();
    }

    fn differentiate(&mut self) {
        if let Ok(sum) = self.state.merit.sum(&self.state.values, Detail::Normal) {
            if self.pace == Pace::Patient {
                self.state.rescale(&sum);
            }
            self.gradient = sum.gradient.iter().copied().collect();
        }
    }

    fn patient_step(&mut self) -> f64 {
        let step = self.direction();
        let before = self.state.best_value;
        let limit = self.state.value + WORSE * self.state.value.abs();
        let (accepted, sum) = self.state.advance(&step, Detail::Gradient, |value| value <= limit);
        match sum {
            Some(sum) => self.gradient = sum.gradient.iter().copied().collect(),
            None => self.slow_down(),
        }
        self.since_better = if self.state.best_value < before { 0 } else { self.since_better + 1 };
        if self.since_better >= PATIENCE {
            self.slow_down();
        }
        accepted
    }

    /// The rate falls with the steps, whatever they do to the merit.
    fn annealed_step(&mut self, steps: usize) -> f64 {
        let done = self.state.steps as f64 / steps as f64;
        self.rate = 0.5 * ANNEALED_RATE * (1.0 + (PI * done).cos());
        let step = self.direction();
        let (accepted, sum) = self.state.advance(&step, Detail::Gradient, |_| true);
        if let Some(sum) = sum {
            self.gradient = sum.gradient.iter().copied().collect();
        } else {
            self.state.return_to_best();
            self.differentiate();
        }
        accepted
    }

    fn has_ended(&self) -> bool {
        match self.pace {
            Pace::Patient => self.rate < SMALLEST_RATE || self.state.has_ended(),
            Pace::Annealed(steps) => self.state.steps >= steps,
        }
    }
}

impl Optimizer for Adam {
    fn step(&mut self) -> Progress {
        if self.has_ended() {
            return self.state.progress(0.0, true);
        }
        let accepted = match self.pace {
            Pace::Patient => self.patient_step(),
            Pace::Annealed(steps) => self.annealed_step(steps),
        };
        let progress = self.state.progress(accepted, false);
        if self.state.resample_if_due() && self.pace == Pace::Patient {
            self.differentiate();
        }
        progress
    }

    fn settle(&mut self) {
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
