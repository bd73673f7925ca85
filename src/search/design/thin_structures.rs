//! Random structures screened as thin lenses: a draw takes microseconds, so that of many thousands the best
//! of each pattern of powers become starts.
//!
//! Powers of either sign, crowns for the positive and flints for the negative ones, stand at random gaps;
//! the last power gives the focal length. Draws are rejected by their length and back focus, and by powers that
//! bend rays too much; the others are ordered by colour and by the Petzval sum.

use super::LensRequirements;
use crate::search::Random;
use rand::RngExt as _;

/// A crown and a flint: index and Abbe number.
const CROWN: (f64, f64) = (1.6204, 60.3);
const FLINT: (f64, f64) = (1.6727, 32.2);
/// The range of the size of powers, and the largest size of the last one, times the focal length.
const POWERS: [f64; 2] = [0.5, 3.0];
const LARGEST: f64 = 4.0;
/// The Petzval sum that is aimed at, times the focal length.
const PETZVAL: f64 = 0.3;
/// The weights of axial and lateral colour, of the Petzval sum and of bent rays in the order of structures.
const WEIGHTS: [f64; 4] = [1e4, 1e4, 4.0, 0.05];
/// The longest gap between two lenses, relative to the focal length.
const LONGEST_GAP: f64 = 0.6;

/// A thin lens of a structure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ThinLens {
    /// Its power, in 1/mm.
    pub(super) power: f64,
    /// The distance to the next one, in mm.
    pub(super) gap: f64,
}

/// Thin lenses with what is against them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ThinStructure {
    pub(super) lenses: Vec<ThinLens>,
    /// The smaller the better.
    pub(super) score: f64,
    /// The distance of the image behind the last lens, in mm.
    pub(super) back: f64,
}

impl ThinStructure {
    /// The signs of the powers.
    fn pattern(&self) -> u32 {
        let bits = self.lenses.iter().enumerate();
        let sign = |(i, lens): (usize, &ThinLens)| u32::from(lens.power > 0.0) << i;
        (1 << self.lenses.len()) + bits.map(sign).sum::<u32>()
    }
}

/// The best structures of different patterns among some draws, the best one first.
pub(super) fn screened_structures(
    asked: &LensRequirements,
    draws: usize,
    most: usize,
    random: &mut Random,
) -> Vec<ThinStructure> {
    let mut best: Vec<ThinStructure> = Vec::new();
    for _ in 0..draws {
        let Some(drawn) = draw(asked, random) else { continue };
        match best.iter_mut().find(|known| known.pattern() == drawn.pattern()) {
            Some(known) if known.score <= drawn.score => {}
            Some(known) => *known = drawn,
            None => best.push(drawn),
        }
    }
    best.sort_by(|a, b| a.score.total_cmp(&b.score));
    best.truncate(most);
    best
}

/// A random structure with the focal length and the image distance that are asked for.
fn draw(asked: &LensRequirements, random: &mut Random) -> Option<ThinStructure> {
    let f = asked.thin_focal_length();
    let elements = asked.elements.min(8);
    let count = if elements > 2 { elements - random.random_range(0..2) } else { elements };
    let mut lenses = Vec::with_capacity(count);
    let (mut height, mut slope) = (1.0, asked.object_slope());
    for i in 0..count {
        let size = POWERS[0] + (POWERS[1] - POWERS[0]) * random.random::<f64>();
        let sign = if random.random::<f64>() < 0.6 { 1.0 } else { -1.0 };
        let gap = LONGEST_GAP * random.random::<f64>().powi(3) * f;
        let is_last = i + 1 == count;
        // Behind the last lens the slope of a ray at a height of 1 is that of the focal length.
        let power =
            if is_last { (slope + 1.0 / asked.focal_length) / height } else { sign * size / f };
        if !(power.abs() * f < LARGEST) || power == 0.0 {
            return None;
        }
        slope -= height * power;
        let gap = if is_last { 0.0 } else { gap };
        lenses.push(ThinLens { power, gap });
        if !is_last {
            height += gap * slope;
        }
    }
    let back = -height / slope;
    let length: f64 = lenses.iter().map(|lens| lens.gap).sum();
    let is_possible = back >= asked.back_focus && back + length <= 0.95 * asked.track;
    let score = is_possible.then(|| score(&lenses, asked)).filter(|score| score.is_finite())?;
    Some(ThinStructure { lenses, score, back })
}

/// The faults of thin lenses: colour, the Petzval sum, and rays that are bent much.
fn score(lenses: &[ThinLens], asked: &LensRequirements) -> f64 {
    let f = asked.thin_focal_length();
    let middle = 0.5 * lenses.iter().map(|lens| lens.gap).sum::<f64>();
    // The chief ray of a stop in the middle, as straight as between the lenses beside it.
    let (mut height, mut slope, mut place) = (1.0, asked.object_slope(), 0.0);
    let mut sums = [0.0; 4];
    for lens in lenses {
        let glass = if lens.power > 0.0 { CROWN } else { FLINT };
        let chief = (place - middle) / f;
        sums[0] += height * height * lens.power * f / glass.1;
        sums[1] += height * chief * lens.power * f / glass.1;
        sums[2] += lens.power * f / glass.0;
        sums[3] += (height * lens.power * f).powi(2) + (chief * lens.power * f).powi(2);
        slope -= height * lens.power;
        height += lens.gap * slope;
        place += lens.gap;
    }
    let [axial, lateral, petzval, bent] = WEIGHTS;
    axial * sums[0].powi(2)
        + lateral * sums[1].powi(2)
        + petzval * (sums[2] - PETZVAL).powi(2)
        + bent * sums[3]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::design::LensSpecification;
    use rand::SeedableRng as _;

    fn requirements(text: &str) -> LensRequirements {
        let spec: LensSpecification = serde_json::from_str(text).unwrap();
        LensRequirements::complete(&spec).unwrap().0
    }

    /// The focal length and the image distance by the product of matrices, and every pattern once.
    #[test]
    fn screened_structures_have_the_focal_length_and_different_patterns() {
        let asked = requirements(
            r#"{"focal_length_mm": 50.0, "f_number": 3.0, "half_field_deg": 20.0, "max_elements": 4,
                "min_back_focus_mm": 20.0}"#,
        );
        let found = screened_structures(&asked, 4000, 6, &mut Random::seed_from_u64(1));
        assert!(found.len() > 3, "{}", found.len());
        assert!(found.is_sorted_by(|a, b| a.score <= b.score));
        for (i, structure) in found.iter().enumerate() {
            assert!(found[..i].iter().all(|other| other.pattern() != structure.pattern()));
            let mut whole = nalgebra::Matrix2::identity();
            for lens in &structure.lenses {
                whole = nalgebra::Matrix2::new(1.0, 0.0, -lens.power, 1.0) * whole;
                whole = nalgebra::Matrix2::new(1.0, lens.gap, 0.0, 1.0) * whole;
            }
            assert!((whole[(1, 0)] + 1.0 / 50.0).abs() < 1e-12, "{whole}");
            let back = -whole[(0, 0)] / whole[(1, 0)];
            assert!((back - structure.back).abs() < 1e-9 && back >= 20.0, "{back}");
        }
        let more = screened_structures(&asked, 8000, 6, &mut Random::seed_from_u64(1));
        assert!(more[0].score <= found[0].score);
    }
}
