//! The points of samples: Sobol's sequence in eight dimensions, scrambled after Owen by hashing (Burley,
//! JCGT 9, 2020), for many sets at once.
//!
//! A set is a replicate of a pixel with its own seed. All sets take the same point of the sequence and
//! scramble it differently, so that the work runs through vector registers. The wavelength alone is scrambled
//! alike for all pixels of a replicate of a tile.

use crate::math::{SimdWidth, run_vectorized};
use sobol_burley::parts::{hash, owen_scramble_rev, sobol_rev};

/// The dimensions in which every set is scrambled by itself, with their numbers in the sequence: the place in the
/// pixel, the direction, the time, and the displacement by diffraction.
const DIMENSIONS: [u32; 7] = [0, 1, 2, 3, 5, 6, 7];
/// The dimension of the time, and the first of the displacement.
const TIME: usize = 4;
const DISPLACEMENT: usize = 5;
/// The dimension of the wavelength, in which the pixels of a tile share a scramble: their rays are then traced at
/// one wavelength, without being sorted.
const COLOR: u32 = 4;
/// The length of the sequence.
pub(super) const LONGEST: usize = 1 << 16;
/// One over two to the power of the bits of a number.
const UNIT: f64 = 1.0 / 4_294_967_296.0;

/// The points of one sample of many sets.
#[derive(Debug, Clone)]
pub(super) struct SamplePoints {
    /// By dimension, then set.
    seeds: [Vec<u32>; DIMENSIONS.len()],
    columns: [Vec<f64>; DIMENSIONS.len()],
    /// Of those sets that share a wavelength.
    color_seeds: Vec<u32>,
    colors: Vec<f64>,
}

impl SamplePoints {
    /// Points of sets with these seeds, and of groups of sets that share their wavelength.
    pub(super) fn new(seeds: &[u32], color_seeds: &[u32]) -> Self {
        let salted =
            |seed: &u32, dimension: u32| hash(seed ^ (dimension + 1).wrapping_mul(0x9E37_79B9));
        let of_dimension =
            |d: usize| seeds.iter().map(|seed| salted(seed, DIMENSIONS[d])).collect();
        Self {
            seeds: std::array::from_fn(of_dimension),
            columns: std::array::from_fn(|_| vec![0.0; seeds.len()]),
            color_seeds: color_seeds.iter().map(|seed| salted(seed, COLOR)).collect(),
            colors: vec![0.0; color_seeds.len()],
        }
    }

    /// Moves on to a sample, counted from 0 and below [`LONGEST`]; the times stay 0 in a scene at rest, and the
    /// displacements without diffraction.
    pub(super) fn go_to(&mut self, sample: usize, [is_moving, is_diffracted]: [bool; 2]) {
        let reversed = (sample as u32).reverse_bits();
        let is_used = |d: usize| match d {
            TIME => is_moving,
            DISPLACEMENT.. => is_diffracted,
            _ => true,
        };
        for (d, (seeds, column)) in self.seeds.iter().zip(&mut self.columns).enumerate() {
            if is_used(d) {
                scramble_all(sobol_rev(reversed, DIMENSIONS[d]), seeds, column);
            }
        }
        scramble_all(sobol_rev(reversed, COLOR), &self.color_seeds, &mut self.colors);
    }

    /// The places in the pixels, to the right and downwards, the places in the sets of directions, the times, and
    /// two numbers of the displacements, each from 0 to 1, by set.
    pub(super) fn columns(&self) -> [&[f64]; DIMENSIONS.len()] {
        self.columns.each_ref().map(|column| &column[..])
    }

    /// The place in the wavelengths of a colour of a group of sets, from 0 to 1.
    pub(super) fn color(&self, group: usize) -> f64 {
        self.colors[group]
    }
}

/// Scrambles a number, its bits reversed, in many ways.
fn scramble_all(number: u32, seeds: &[u32], column: &mut [f64]) {
    run_vectorized(
        SimdWidth::Bits512,
        #[inline(always)]
        || scramble(number, seeds, column),
    );
}

#[inline(always)]
fn scramble(number: u32, seeds: &[u32], column: &mut [f64]) {
    for (seed, value) in seeds.iter().zip(column) {
        let scrambled = owen_scramble_rev(number, *seed).reverse_bits();
        *value = (f64::from(scrambled) + 0.5) * UNIT;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every pair of dimensions of 256 points has one point in each square of 16 by 16, or few more,
    /// and each dimension alone one in each of 256 parts.
    #[test]
    fn points_of_a_set_fill_every_dimension_evenly() {
        let mut points = SamplePoints::new(&[3, 99], &[7]);
        let found: Vec<Vec<f64>> = (0..256)
            .map(|i| {
                points.go_to(i, [true, true]);
                let columns = points.columns().map(|column| column[1]);
                columns.into_iter().chain([points.color(0)]).collect()
            })
            .collect();
        for d in 0..8 {
            let mut parts: Vec<usize> = found.iter().map(|p| (256.0 * p[d]) as usize).collect();
            parts.sort_unstable();
            assert_eq!(parts, (0..256).collect::<Vec<_>>(), "dimension {d}");
        }
        let square = |p: &Vec<f64>| [p[0], p[1]].map(|v| (16.0 * v) as usize);
        let mut squares: Vec<[usize; 2]> = found.iter().map(square).collect();
        squares.sort_unstable();
        squares.dedup();
        assert_eq!(squares.len(), 256);
    }

    /// Means of a product over sets with other seeds scatter about that of independent numbers.
    #[test]
    fn sets_with_other_seeds_are_independent() {
        let seeds: Vec<u32> = (0..1024).collect();
        let mut points = SamplePoints::new(&seeds, &[]);
        points.go_to(5, [false, false]);
        let off = |set: usize| points.columns()[0][set] - 0.5;
        let neighbours: f64 = (0..1023).map(|set| off(set) * off(set + 1)).sum::<f64>() / 1023.0;
        let mean: f64 = (0..1024).map(off).sum::<f64>() / 1024.0;
        assert!(neighbours.abs() < 4.0 / 12.0 / 32.0, "{neighbours}");
        assert!(mean.abs() < 4.0 * (1.0_f64 / 12.0 / 1024.0).sqrt(), "{mean}");
        assert!(points.columns()[TIME].iter().all(|time| *time == 0.0), "a scene at rest");
    }
}
