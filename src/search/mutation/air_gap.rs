//! The random numbers of a new air gap in a cemented group, and their density.

use super::distributions::{ShiftedExponential, normal_log_density, sample_normal};
use crate::search::{Random, SearchRules};

/// The random numbers of a new air gap.
#[derive(Debug, Clone, Copy)]
pub(super) struct SplitDraw {
    /// Half the difference of the curvatures in front and behind.
    pub(super) difference: f64,
    /// The air space between them.
    pub(super) air: f64,
}

impl SplitDraw {
    fn air_distribution(rules: &SearchRules, scale: f64) -> ShiftedExponential {
        ShiftedExponential::new(rules.air_center, 0.5 * scale / 50.0)
    }

    /// A tenth of that of a new element: the two parts have strong power.
    fn curvature_deviation(scale: f64) -> f64 {
        0.025 / scale
    }

    pub(super) fn draw(rules: &SearchRules, scale: f64, random: &mut Random) -> Self {
        let difference = sample_normal(Self::curvature_deviation(scale), random);
        Self { difference, air: Self::air_distribution(rules, scale).draw(random) }
    }

    pub(super) fn log_density(&self, rules: &SearchRules, scale: f64) -> Option<f64> {
        let air = Self::air_distribution(rules, scale).log_density(self.air)?;
        Some(air + normal_log_density(self.difference, Self::curvature_deviation(scale)))
    }
}
