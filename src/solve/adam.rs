//! Adam: first-order descent with running means of the gradient and of its square (Kingma and Ba,
//! "Adam: A Method for Stochastic Optimization", ICLR 2015, algorithm 1).

use super::ParameterBounds;
use serde::{Deserialize, Serialize};

/// Decay of the mean gradient and of the mean square.
const DECAY: [f64; 2] = [0.9, 0.999];

/// The running means of a gradient and of its square.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdamMoments {
    mean: Vec<f64>,
    square: Vec<f64>,
    /// The number of gradients in the means.
    age: i32,
}

impl AdamMoments {
    /// Updates the means with a gradient and returns the step of Adam at this rate. A gradient of
    /// another length than the previous one resets the means.
    pub fn step(&mut self, gradient: &[f64], rate: f64) -> Vec<f64> {
        if self.mean.len() != gradient.len() {
            *self = Self::default();
            self.mean.resize(gradient.len(), 0.0);
            self.square.resize(gradient.len(), 0.0);
        }
        self.age = self.age.saturating_add(1);
        let [b1, b2] = DECAY;
        let (c1, c2) = (1.0 - b1.powi(self.age), 1.0 - b2.powi(self.age));
        let means = self.mean.iter_mut().zip(&mut self.square);
        let step = |(g, (mean, square)): (&f64, (&mut f64, &mut f64))| {
            *mean = b1 * *mean + (1.0 - b1) * g;
            *square = b2 * *square + (1.0 - b2) * g * g;
            let size = (*square / c2).sqrt();
            if size == 0.0 { 0.0 } else { -rate * (*mean / c1) / size }
        };
        gradient.iter().zip(means).map(step).collect()
    }
}

/// Adam within bounds: for gradients that differ from step to step, as with random rays.
#[derive(Debug, Clone, PartialEq)]
pub struct Adam {
    /// The size of a step.
    pub rate: f64,
    moments: AdamMoments,
}

impl Adam {
    /// A descent with steps of this size.
    pub fn new(rate: f64) -> Self {
        Self { rate, moments: AdamMoments::default() }
    }

    /// Takes one step down this gradient.
    pub fn step(&mut self, parameters: &mut [f64], gradient: &[f64], bounds: &ParameterBounds) {
        let active = bounds.active_bounds(parameters, gradient);
        // A parameter at an active bound must not gather momentum.
        let free = |(g, active): (&f64, &bool)| if *active { 0.0 } else { *g };
        let free: Vec<f64> = gradient.iter().zip(&active).map(free).collect();
        let step = self.moments.step(&free, self.rate);
        for (value, step) in parameters.iter_mut().zip(step) {
            *value += step.clamp(-bounds.max_change, bounds.max_change);
        }
        bounds.project(parameters);
    }
}
