//! A test of samples against a density: histograms of independent chains against the probabilities
//! of the bins.
//!
//! For each chain and bin, `r = W_bin − p_bin W` is the weight in the bin minus its expected part
//! of the weight of the chain. Under the density its mean is zero, whatever the correlations within
//! a chain and the weights of its samples; only chains have to be independent. So Hotelling's test
//! of a mean vector applies, `T² = n r̄ᵀ S⁻¹ r̄` with the covariance `S` of the chains, and `T² (n
//! − k) / (k (n − 1))` is `F` distributed. It is converted to standard deviations of a normal
//! distribution (Paulson, "An Approximate Normalization of the Analysis of Variance Distribution",
//! Annals of Mathematical Statistics 1942): 3.1 has a probability of one in a thousand.

use nalgebra::{DMatrix, DVector};

/// Bins with a smaller probability are merged: a mean over chains is normal only if chains visit
/// the bin.
const SMALL: f64 = 2e-3;
/// The number of points per bin and direction from which its probability is computed.
const PLACES: usize = 24;

/// Bins of equal size in one or two directions.
#[derive(Debug, Clone)]
pub(super) struct HistogramGrid {
    pub(super) ranges: Vec<[f64; 2]>,
    /// The number of bins in each direction.
    pub(super) bins: usize,
}

impl HistogramGrid {
    /// The number of bins.
    pub(super) fn bin_count(&self) -> usize {
        self.bins.pow(self.ranges.len() as u32)
    }

    /// The index of the bin of a point, the first direction running fastest.
    pub(super) fn bin(&self, point: &[f64]) -> usize {
        let place = |(value, range): (&f64, &[f64; 2])| {
            let share = (value - range[0]) / (range[1] - range[0]);
            ((share * self.bins as f64) as usize).min(self.bins - 1)
        };
        let places = point.iter().zip(&self.ranges).map(place);
        places.rev().fold(0, |bin, place| bin * self.bins + place)
    }

    /// A point in a bin, from fractions 0 to 1 in every direction.
    fn point_in_bin(&self, bin: usize, share: impl Fn(usize) -> f64) -> Vec<f64> {
        let each = |(i, range): (usize, &[f64; 2])| {
            let index = (bin / self.bins.pow(i as u32)) % self.bins;
            range[0] + (range[1] - range[0]) * (index as f64 + share(i)) / self.bins as f64
        };
        self.ranges.iter().enumerate().map(each).collect()
    }

    /// The centre of a bin.
    pub(super) fn bin_center(&self, bin: usize) -> Vec<f64> {
        self.point_in_bin(bin, |_| 0.5)
    }

    /// The probability of every bin under a density, by the midpoint rule.
    pub(super) fn bin_shares(&self, density: impl Fn(&Vec<f64>) -> f64) -> Vec<f64> {
        let places = PLACES.pow(self.ranges.len() as u32);
        let share = |index: usize, i: usize| {
            let place = (index / PLACES.pow(i as u32)) % PLACES;
            (place as f64 + 0.5) / PLACES as f64
        };
        let sum =
            |bin| (0..places).map(|p| density(&self.point_in_bin(bin, |i| share(p, i)))).sum();
        normalized((0..self.bin_count()).map(sum).collect())
    }
}

/// Scales the values to the sum 1.
fn normalized(mut values: Vec<f64>) -> Vec<f64> {
    let sum: f64 = values.iter().sum();
    values.iter_mut().for_each(|value| *value /= sum);
    values
}

/// The histogram of all chains together, normalized to 1.
pub(super) fn pool(chains: &[Vec<f64>]) -> Vec<f64> {
    let bins = chains.first().map_or(0, Vec::len);
    normalized((0..bins).map(|bin| chains.iter().map(|chain| chain[bin]).sum()).collect())
}

/// The total variation distance of two distributions.
pub(super) fn total_variation(a: &[f64], b: &[f64]) -> f64 {
    0.5 * a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f64>()
}

/// The deviation of the chains from these probabilities, in standard deviations. It is bounded by
/// about twice the root of the number of chains.
pub(super) fn deviation_in_sigmas(chains: &[Vec<f64>], shares: &[f64]) -> f64 {
    // All bins except one, which follows from the sum, with those of small probability merged.
    let large: Vec<usize> = (0..shares.len()).filter(|bin| shares[*bin] >= SMALL).collect();
    let compared = if large.len() == shares.len() { &large[1..] } else { &large };
    let excess = |chain: &Vec<f64>| {
        let weight: f64 = chain.iter().sum();
        DVector::from_iterator(
            compared.len(),
            compared.iter().map(|i| chain[*i] - shares[*i] * weight),
        )
    };
    let excesses: Vec<DVector<f64>> = chains.iter().map(excess).collect();
    let n = chains.len() as f64;
    let k = compared.len();
    let mean = excesses.iter().sum::<DVector<f64>>() / n;
    let spread = excesses.iter().map(|r| (r - &mean) * (r - &mean).transpose());
    let mut covariance = spread.sum::<DMatrix<f64>>() / (n - 1.0);
    // Bins that no chain visited have no variance; the ridge is too small to affect the others.
    let ridge = 1e-9 * covariance.trace() / k as f64;
    (0..k).for_each(|i| covariance[(i, i)] += ridge);
    let solved = covariance.cholesky().map(|cholesky| cholesky.solve(&mean));
    let square = solved.map_or(f64::NAN, |solved| n * mean.dot(&solved));
    let k = k as f64;
    f_to_normal(square * (n - k) / (k * (n - 1.0)), k, n - k)
}

/// Converts an `F` distributed number to a standard normal one.
fn f_to_normal(f: f64, above: f64, below: f64) -> f64 {
    let [a, b] = [above, below].map(|freedom| 2.0 / (9.0 * freedom));
    let root = f.cbrt();
    ((1.0 - b) * root - (1.0 - a)) / (b * root * root + a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::Random;
    use rand::{RngExt as _, SeedableRng as _};

    /// Independent chains of correlated samples: each number is repeated.
    fn chains(power: f64, seed: u64) -> Vec<Vec<f64>> {
        let mut random = Random::seed_from_u64(seed);
        let grid = HistogramGrid { ranges: vec![[0.0, 1.0]], bins: 10 };
        let mut chain = || {
            let mut bins = vec![0.0; 10];
            for _ in 0..30 {
                let bin = grid.bin(&[random.random::<f64>().powf(power)]);
                bins[bin] += f64::from(random.random_range(1..5));
            }
            bins
        };
        (0..300).map(|_| chain()).collect()
    }

    #[test]
    fn the_test_accepts_its_density_as_often_as_it_says() {
        let deviations = (0..200).map(|seed| deviation_in_sigmas(&chains(1.0, seed), &[0.1; 10]));
        let deviations: Vec<f64> = deviations.collect();
        let above = |z: f64| deviations.iter().filter(|value| **value > z).count();
        // A sixth is above one standard deviation, a fortieth above two.
        assert!(
            (18..=50).contains(&above(1.0)) && above(2.0) <= 14,
            "{} {}",
            above(1.0),
            above(2.0)
        );
        assert_eq!(above(4.0), 0);
    }

    #[test]
    fn the_test_sees_a_density_that_is_a_little_off() {
        assert!(deviation_in_sigmas(&chains(1.15, 1), &[0.1; 10]) > 5.0);
    }

    #[test]
    fn published_quantiles_of_f_are_met() {
        // Upper tenth of a per cent of F(10, 120) and F(20, 60).
        assert!((f_to_normal(3.24, 10.0, 120.0) - 3.09).abs() < 0.02);
        assert!((f_to_normal(2.83, 20.0, 60.0) - 3.09).abs() < 0.03);
    }
}
