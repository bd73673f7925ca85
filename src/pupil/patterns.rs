//! Patterns of pupil points with equal weights, as other programs use them: for comparison and for
//! drawings.

use std::f64::consts::TAU;

/// A pattern of points in the unit disc.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PupilPattern {
    /// The centres of the cells of a square grid with this many cells on a side.
    Square(usize),
    /// The centre and rings of 6, 12, 18, … points, the last one on the rim: the usual pattern. The
    /// rim has full weight, which biases its sums by a few to twenty percent.
    Hexapolar(usize),
    /// The same rings in the middle of bands of equal width, without the centre: unbiased.
    HexapolarInside(usize),
    /// Independent points from a seed.
    Random {
        /// The number of points.
        count: usize,
        /// The seed of the generator.
        seed: u32,
    },
    /// Owen-scrambled Sobol points (Burley, JCGT 9, 2020).
    Sobol {
        /// The number of points.
        count: usize,
        /// The seed of the scrambling.
        seed: u32,
    },
}

/// The points of a pattern in the unit disc.
pub fn pattern_points(pattern: PupilPattern) -> Vec<[f64; 2]> {
    match pattern {
        PupilPattern::Square(cells) => square_grid(cells),
        PupilPattern::Hexapolar(rings) => {
            let ring = |j: usize| (j as f64 / rings as f64, 6 * j);
            std::iter::once([0.0, 0.0]).chain(circles((1..=rings).map(ring))).collect()
        }
        PupilPattern::HexapolarInside(rings) => {
            // Every ring's points stand for equal areas: 6, 18, 30, ... of them.
            let ring = |j: usize| ((j as f64 + 0.5) / rings as f64, 12 * j + 6);
            circles((0..rings).map(ring)).collect()
        }
        PupilPattern::Random { count, seed } => {
            let mut random = SplitMix(u64::from(seed));
            (0..count).map(|_| disc_point(random.uniform(), random.uniform())).collect()
        }
        PupilPattern::Sobol { count, seed } => {
            let number = |i: usize, dimension: u32| {
                let index = u32::try_from(i % LONGEST).unwrap_or(0);
                f64::from(sobol_burley::sample(index, dimension, seed))
            };
            (0..count).map(|i| disc_point(number(i, 0), number(i, 1))).collect()
        }
    }
}

/// The sequence repeats after this many points.
const LONGEST: usize = 1 << 16;

fn square_grid(cells: usize) -> Vec<[f64; 2]> {
    let at = |i: usize| (2.0 * i as f64 + 1.0) / cells as f64 - 1.0;
    let points = (0..cells).flat_map(|row| (0..cells).map(move |column| [at(column), at(row)]));
    points.filter(|p| p[0] * p[0] + p[1] * p[1] <= 1.0).collect()
}

/// Points on circles of a radius and a count, the first of each on +x.
fn circles(rings: impl Iterator<Item = (f64, usize)>) -> impl Iterator<Item = [f64; 2]> {
    rings.flat_map(|(radius, count)| {
        (0..count).map(move |m| {
            let (sin, cos) = (TAU * m as f64 / count as f64).sin_cos();
            [radius * cos, radius * sin]
        })
    })
}

/// A point of the unit disc from one of the unit square, area for area.
fn disc_point(u: f64, v: f64) -> [f64; 2] {
    let (sin, cos) = (TAU * v).sin_cos();
    [u.sqrt() * cos, u.sqrt() * sin]
}

/// Point `i` of Roberts's additive sequence over the unit square, begun at `start`: any number of
/// points fills the square evenly.
pub(crate) fn additive_sequence(start: [f64; 2], i: usize) -> [f64; 2] {
    const STEP: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];
    [0, 1].map(|k| (start[k] + STEP[k] * i as f64).fract())
}

/// Steele, Lea and Flood's generator (OOPSLA 2014): small, seeded, the same everywhere.
pub(super) struct SplitMix(pub(super) u64);

impl SplitMix {
    pub(super) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 * 2f64.powi(-53)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn six_rings_are_127_points() {
        assert_eq!(pattern_points(PupilPattern::Hexapolar(6)).len(), 127);
    }

    #[test]
    fn unbiased_patterns_have_the_second_moment_of_the_disc() {
        for chosen in [
            PupilPattern::Square(100),
            PupilPattern::HexapolarInside(40),
            PupilPattern::Random { count: 40_000, seed: 7 },
            PupilPattern::Sobol { count: 4096, seed: 7 },
        ] {
            let points = pattern_points(chosen);
            let sum: f64 = points.iter().map(|p| p[0] * p[0] + p[1] * p[1]).sum();
            assert!((sum / points.len() as f64 - 0.5).abs() < 0.01, "{chosen:?}");
        }
    }
}
