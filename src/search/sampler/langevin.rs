//! Langevin steps with an adaptive diagonal preconditioner (4.10).

use super::LangevinSettings;
use crate::search::Random;
use rand::RngExt as _;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// The state of a Langevin chain: topology, variables and gradient.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::search) struct LangevinState {
    pub(super) topology: String,
    pub(super) values: Vec<f64>,
    pub(super) gradient: Vec<f64>,
}

/// The mean square of all gradients that a chain has evaluated for one topology. It is kept between
/// visits to the topology: a mean that restarted with each visit would depend on where the visit
/// began, and the adaptation would never fade.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(in crate::search) struct GradientScale {
    pub(super) square: Vec<f64>,
    count: u64,
}

impl GradientScale {
    /// Adds a gradient to the running mean.
    pub(super) fn add_gradient(&mut self, gradient: &[f64]) {
        if self.square.len() != gradient.len() {
            *self = Self { square: vec![0.0; gradient.len()], count: 0 };
        }
        self.count += 1;
        let part = 1.0 / self.count as f64;
        for (v, g) in self.square.iter_mut().zip(gradient) {
            *v += (g * g - *v) * part;
        }
    }

    /// The variances `ε M` of all variables.
    pub(super) fn variances(&self, settings: &LangevinSettings) -> Vec<f64> {
        self.square.iter().map(|v| settings.epsilon / (v.sqrt() + settings.floor)).collect()
    }
}

/// The Langevin proposal distribution: normal, with these variances, around a mean that is shifted
/// downhill by `drift` × variance × gradient.
pub(super) struct LangevinProposal {
    pub(super) variances: Vec<f64>,
    pub(super) drift: f64,
}

impl LangevinProposal {
    /// The mean of a step.
    fn mean(&self, from: &[f64], gradient: &[f64]) -> Vec<f64> {
        let place = |i: usize| from[i] - self.drift * self.variances[i] * gradient[i];
        (0..from.len()).map(place).collect()
    }

    pub(super) fn sample(&self, from: &[f64], gradient: &[f64], random: &mut Random) -> Vec<f64> {
        let mut noise = |v: &f64| v.sqrt() * random.sample::<f64, _>(StandardNormal);
        let mean = self.mean(from, gradient).into_iter().zip(&self.variances);
        mean.map(|(place, variance)| place + noise(variance)).collect()
    }

    /// The logarithm of the density of a step from one place to another, up to a constant that the
    /// reverse step shares.
    pub(super) fn log_density(&self, from: &[f64], gradient: &[f64], to: &[f64]) -> f64 {
        let mean = self.mean(from, gradient);
        let each = |i: usize| (to[i] - mean[i]).powi(2) / self.variances[i];
        -0.5 * (0..from.len()).map(each).sum::<f64>()
    }
}

/// True if the squares of all components are finite.
pub(super) fn has_finite_squares(gradient: &[f64]) -> bool {
    gradient.iter().all(|g| (g * g).is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The largest number is about 1.8e308, the square of 1.34e154.
    #[test]
    fn a_gradient_is_of_use_if_its_squares_are_numbers() {
        assert!(has_finite_squares(&[0.0, -1e150, 1.3e154]));
        for wrong in [1.4e154, -1e200, f64::INFINITY, f64::NAN] {
            assert!(!has_finite_squares(&[1.0, wrong]), "{wrong:e}");
        }
    }
}
