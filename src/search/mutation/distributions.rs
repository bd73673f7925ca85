//! Probability distributions of new parameters, with their densities.

use crate::lens::Lens;
use crate::lens::glass::{self, Glass};
use crate::search::projection::ProjectionMap;
use crate::search::{Random, SearchRules};
use rand::RngExt as _;
use rand_distr::StandardNormal;

/// A truncated exponential distribution: lengths from `least` up to a maximum, with a mean excess.
/// It covers every permitted length, so that every element could have been added.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShiftedExponential {
    least: f64,
    range: f64,
    mean: f64,
}

impl ShiftedExponential {
    pub(super) fn new([least, most]: [f64; 2], mean: f64) -> Self {
        Self { least, range: (most - least).max(0.0), mean }
    }

    /// The probability of the untruncated exponential within the range.
    fn share(self) -> f64 {
        -(-self.range / self.mean).exp_m1()
    }

    /// The smallest length.
    pub(super) fn least(self) -> f64 {
        self.least
    }

    pub(super) fn draw(self, random: &mut Random) -> f64 {
        let excess = -self.mean * (-random.random::<f64>() * self.share()).ln_1p();
        self.least + excess.min(self.range)
    }

    /// The logarithm of the density of a length; `None` if it cannot be drawn.
    pub(super) fn log_density(self, length: f64) -> Option<f64> {
        let excess = length - self.least;
        let possible = (0.0..=self.range).contains(&excess) && self.range > 0.0;
        possible.then(|| -excess / self.mean - self.mean.ln() - self.share().ln())
    }
}

/// A normal variate with mean 0.
pub(super) fn sample_normal(deviation: f64, random: &mut Random) -> f64 {
    deviation * random.sample::<f64, _>(StandardNormal)
}

/// The logarithm of the normal density with mean 0.
pub(super) fn normal_log_density(value: f64, deviation: f64) -> f64 {
    let t = value / deviation;
    -0.5 * t * t - deviation.ln() - 0.5 * std::f64::consts::TAU.ln()
}

/// A Bernoulli draw: true with probability `chance`.
pub(super) fn bernoulli(chance: f64, random: &mut Random) -> bool {
    random.random::<f64>() < chance
}

/// A uniformly random element; `None` if the slice is empty.
pub(super) fn choose<'a, T>(all: &'a [T], random: &mut Random) -> Option<&'a T> {
    if all.is_empty() { None } else { all.get(random.random_range(0..all.len())) }
}

/// The glasses of new elements: those of the rules that have an index at every wavelength of the
/// lens.
pub(super) fn usable_glasses(lens: &Lens, rules: &SearchRules) -> Vec<&'static Glass> {
    let reaches = |glass: &&'static Glass| {
        let [low, high] = glass.range_um;
        lens.wavelengths.iter().all(|w| (low..=high).contains(&w.um))
    };
    if rules.glasses.is_empty() {
        return glass::catalogue().iter().filter(reaches).collect();
    }
    rules.glasses.iter().filter_map(|name| glass::find(name)).filter(reaches).collect()
}

/// A random projection for a mutation that is its own reverse, so that each of the two undoes the
/// other.
pub(super) fn random_projection_map(random: &mut Random) -> ProjectionMap {
    if bernoulli(0.5, random) { ProjectionMap::Nearest } else { ProjectionMap::AlongNormals }
}

/// The size of a lens of a scale relative to one of 50 mm, for which random lengths are defined.
pub(super) fn size_ratio(scale: f64) -> f64 {
    scale / 50.0
}

/// The standard deviation of a random curvature in 1/mm for a lens of a scale: 0.005 for 50 mm.
pub(super) fn curvature_deviation(scale: f64) -> f64 {
    0.25 / scale
}
