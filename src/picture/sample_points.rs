//! The points of samples: Sobol's sequence in six dimensions, scrambled after Owen by hashing (Burley,
//! JCGT 9, 2020), for many sets at once.
//!
//! A set is a replicate of a pixel with its own seed. All sets take the same point of the sequence and
//! scramble it differently, so that the work runs through vector registers.

use crate::math::{SimdWidth, run_vectorized};
use sobol_burley::parts::{hash, owen_scramble_rev, sobol_rev};

/// The dimensions of a sample: its place in the pixel, its direction, its wavelength, its time.
const DIMENSIONS: usize = 6;
/// The length of the sequence.
pub(super) const LONGEST: usize = 1 << 16;
/// Two to the power of the bits of a number.
const RANGE: f64 = 4_294_967_296.0;

/// The number of a sample's dimensions from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SamplePoint {
    /// The place in the pixel, to the right and downwards.
    pub(super) place: [f64; 2],
    /// The place in the set of directions.
    pub(super) direction: [f64; 2],
    /// The place in the wavelengths of a colour.
    pub(super) color: f64,
    /// The time.
    pub(super) time: f64,
}

/// The points of one sample of many sets.
#[derive(Debug, Clone)]
pub(super) struct SamplePoints {
    /// By dimension, then set.
    seeds: [Vec<u32>; DIMENSIONS],
    columns: [Vec<f64>; DIMENSIONS],
}

impl SamplePoints {
    /// Points of sets with these seeds.
    pub(super) fn new(seeds: &[u32]) -> Self {
        let of_dimension = |dimension: usize| {
            let salt = (dimension as u32 + 1).wrapping_mul(0x9E37_79B9);
            seeds.iter().map(|seed| hash(seed ^ salt)).collect()
        };
        Self {
            seeds: std::array::from_fn(of_dimension),
            columns: std::array::from_fn(|_| vec![0.0; seeds.len()]),
        }
    }

    /// Moves on to a sample, counted from 0 and below [`LONGEST`].
    pub(super) fn go_to(&mut self, sample: usize) {
        let reversed = (sample as u32).reverse_bits();
        for (dimension, (seeds, column)) in self.seeds.iter().zip(&mut self.columns).enumerate() {
            let number = sobol_rev(reversed, dimension as u32);
            run_vectorized(
                SimdWidth::Bits512,
                #[inline(always)]
                || scramble(number, seeds, column),
            );
        }
    }

    /// The point of a set.
    pub(super) fn get(&self, set: usize) -> SamplePoint {
        let [right, down, u, v, color, time] = std::array::from_fn(|d| self.columns[d][set]);
        SamplePoint { place: [right, down], direction: [u, v], color, time }
    }
}

/// Scrambles a number, its bits reversed, in many ways.
#[inline(always)]
fn scramble(number: u32, seeds: &[u32], column: &mut [f64]) {
    for (seed, value) in seeds.iter().zip(column) {
        let scrambled = owen_scramble_rev(number, *seed).reverse_bits();
        *value = (f64::from(scrambled) + 0.5) / RANGE;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every pair of dimensions of 256 points has one point in each square of 16 by 16, or few more,
    /// and each dimension alone one in each of 256 parts.
    #[test]
    fn points_of_a_set_fill_every_dimension_evenly() {
        let mut points = SamplePoints::new(&[3, 99]);
        let found: Vec<SamplePoint> = (0..256)
            .map(|i| {
                points.go_to(i);
                points.get(1)
            })
            .collect();
        let columns = |p: &SamplePoint| {
            [p.place[0], p.place[1], p.direction[0], p.direction[1], p.color, p.time]
        };
        for d in 0..DIMENSIONS {
            let mut parts: Vec<usize> =
                found.iter().map(|p| (256.0 * columns(p)[d]) as usize).collect();
            parts.sort_unstable();
            assert_eq!(parts, (0..256).collect::<Vec<_>>(), "dimension {d}");
        }
        let square = |p: &SamplePoint| p.place.map(|v| (16.0 * v) as usize);
        let mut squares: Vec<[usize; 2]> = found.iter().map(square).collect();
        squares.sort_unstable();
        squares.dedup();
        assert_eq!(squares.len(), 256);
    }

    /// Means of a product over sets with other seeds scatter about that of independent numbers.
    #[test]
    fn sets_with_other_seeds_are_independent() {
        let seeds: Vec<u32> = (0..1024).collect();
        let mut points = SamplePoints::new(&seeds);
        points.go_to(5);
        let off = |set: usize| points.get(set).place[0] - 0.5;
        let neighbours: f64 = (0..1023).map(|set| off(set) * off(set + 1)).sum::<f64>() / 1023.0;
        let mean: f64 = (0..1024).map(off).sum::<f64>() / 1024.0;
        assert!(neighbours.abs() < 4.0 / 12.0 / 32.0, "{neighbours}");
        assert!(mean.abs() < 4.0 * (1.0_f64 / 12.0 / 1024.0).sqrt(), "{mean}");
    }
}
