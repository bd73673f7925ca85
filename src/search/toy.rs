//! The toy problem of figure 4.1: one or two thin singlets in front of a sensor with variable gaps.
//!
//! The marginal ray of a collimated beam meets the sensor at a height `y` from the axis: `y = a (1
//! − d/f)` behind one singlet, and `y = a (1 − d₁/f − d₂ (2/f − d₁/f²))` behind two. The loss is
//! `y²`. All quantities of the theory can be computed: the target density, the inverse of a
//! gradient step, and its determinant.

use super::competing_clocks::KnownDensity;
use super::{
    Landscape, LossGradient, MutatedPoint, MutationError, MutationKind, MutationWeights, Random,
    Refusal, StructureChange, Temperature,
};
use rand::RngExt as _;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// The convergence tolerance of the fixed point, relative to the focal length.
const FIXED_POINT_TOLERANCE: f64 = 1e-14;
const MAX_ITERATIONS: usize = 400;

/// One or two thin singlets in front of a sensor. A point is the list of their gaps, in mm, the
/// last one to the sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ToyLandscape {
    /// The minimum and maximum number of singlets, 1 or 2.
    pub singlets: [usize; 2],
    /// The focal length of each, in mm.
    pub focal_length: f64,
    /// The height of the marginal ray, in mm.
    pub height: f64,
    /// The minimum and maximum gap behind a single singlet, in mm.
    pub alone: [f64; 2],
    /// The minimum and maximum gaps behind the first and the second of two singlets, in mm.
    pub pair: [[f64; 2]; 2],
    /// η of (4.12), in mm² by mm².
    pub rate: f64,
    /// The standard deviation of a mutation that keeps the number of singlets, in mm.
    pub shift: f64,
}

impl ToyLandscape {
    /// One singlet at a variable distance from the sensor.
    pub fn one_singlet() -> Self {
        Self {
            singlets: [1, 1],
            focal_length: 50.0,
            height: 10.0,
            alone: [30.0, 70.0],
            pair: [[5.0, 45.0], [0.0, 60.0]],
            rate: 2.5,
            shift: 2.0,
        }
    }

    /// Two singlets with variable distances from each other and from the sensor.
    pub fn two_singlets() -> Self {
        Self { singlets: [2, 2], rate: 1.5, ..Self::one_singlet() }
    }

    /// One or two singlets.
    pub fn one_or_two_singlets() -> Self {
        Self { singlets: [1, 2], ..Self::two_singlets() }
    }

    /// The ranges of the gaps for a number of singlets, in mm.
    pub fn ranges(&self, singlets: usize) -> Vec<[f64; 2]> {
        if singlets == 1 { vec![self.alone] } else { self.pair.to_vec() }
    }

    /// The height of the marginal ray at the sensor, in mm, and its derivatives by the gaps.
    fn ray(&self, gaps: &[f64]) -> (f64, Vec<f64>) {
        let (a, f) = (self.height, self.focal_length);
        match gaps {
            [d] => (a * (1.0 - d / f), vec![-a / f]),
            [first, second] => {
                let steepness = 2.0 / f - first / (f * f);
                let by_first = a * (second / (f * f) - 1.0 / f);
                (a * (1.0 - first / f - second * steepness), vec![by_first, -a * steepness])
            }
            _ => (f64::NAN, vec![f64::NAN; gaps.len()]),
        }
    }

    fn contains(&self, gaps: &[f64]) -> bool {
        let ranges = self.ranges(gaps.len());
        gaps.iter().zip(&ranges).all(|(gap, range)| (range[0]..=range[1]).contains(gap))
    }

    fn gradient(&self, gaps: &[f64]) -> Vec<f64> {
        let (y, slopes) = self.ray(gaps);
        slopes.into_iter().map(|slope| 2.0 * y * slope).collect()
    }

    /// The point after a gradient step, without regard to bounds.
    fn step(&self, gaps: &[f64]) -> Vec<f64> {
        gaps.iter().zip(self.gradient(gaps)).map(|(gap, g)| gap - self.rate * g).collect()
    }

    /// The point before a gradient step: the fixed point of `x = y + η ∇L(x)`, unique where the
    /// step is a contraction; `None` if the iteration does not converge.
    fn invert_step(&self, gaps: &[f64]) -> Option<Vec<f64>> {
        let mut place = gaps.to_vec();
        let settled = FIXED_POINT_TOLERANCE * self.focal_length;
        for _ in 0..MAX_ITERATIONS {
            let gradient = self.gradient(&place);
            let next: Vec<f64> =
                gaps.iter().zip(gradient).map(|(gap, g)| gap + self.rate * g).collect();
            let moved = next.iter().zip(&place).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            place = next;
            if moved <= settled {
                return Some(place);
            }
            if !moved.is_finite() {
                return None;
            }
        }
        None
    }

    /// The determinant of a gradient step, `det(1 − η ∇²L)`.
    fn determinant(&self, gaps: &[f64]) -> f64 {
        let (y, slopes) = self.ray(gaps);
        let curved = |i: usize, j: usize| {
            let mixed = self.height / (self.focal_length * self.focal_length);
            2.0 * (slopes[i] * slopes[j] + if i == j { 0.0 } else { y * mixed })
        };
        let along = |i: usize| 1.0 - self.rate * curved(i, i);
        if slopes.len() == 1 {
            along(0)
        } else {
            along(0) * along(1) - (self.rate * curved(0, 1)).powi(2)
        }
    }

    fn draw_uniform(&self, singlets: usize, random: &mut Random) -> Vec<f64> {
        let ranges = self.ranges(singlets);
        ranges.iter().map(|range| random.random_range(range[0]..=range[1])).collect()
    }

    /// Adds a singlet in front; the logarithm of the density ratio is that of the range of its gap.
    fn add(&self, gaps: &[f64], random: &mut Random) -> MutatedPoint<Vec<f64>> {
        let range = self.pair[0];
        let point = vec![random.random_range(range[0]..=range[1]), gaps[0]];
        let log_ratio = Some((range[1] - range[0]).ln());
        MutatedPoint {
            point,
            kind: MutationKind::AddSinglet,
            record: StructureChange::Text("a singlet more in front".to_owned()).into(),
            log_ratio,
            gradients: 0,
        }
    }

    fn remove(&self, gaps: &[f64]) -> MutatedPoint<Vec<f64>> {
        let range = self.pair[0];
        let log_ratio = Some(-(range[1] - range[0]).ln());
        let change = StructureChange::Text("without the first singlet".to_owned());
        let (point, record) = (vec![gaps[1]], change.into());
        MutatedPoint { point, kind: MutationKind::RemoveSinglet, record, log_ratio, gradients: 0 }
    }

    fn shift(&self, gaps: &[f64], random: &mut Random) -> MutatedPoint<Vec<f64>> {
        let mut noise = || self.shift * random.sample::<f64, _>(StandardNormal);
        let point = gaps.iter().map(|gap| gap + noise()).collect();
        MutatedPoint {
            point,
            kind: MutationKind::Bend,
            record: StructureChange::Text("shifted".to_owned()).into(),
            log_ratio: Some(0.0),
            gradients: 0,
        }
    }
}

impl Landscape for ToyLandscape {
    type Point = Vec<f64>;
    type Memory = ();

    fn loss(&self, gaps: &Vec<f64>) -> f64 {
        if self.contains(gaps) { self.ray(gaps).0.powi(2) } else { f64::INFINITY }
    }

    /// A step of plain gradient descent; a step that would leave the bounds is not made.
    fn descend(&self, gaps: &Vec<f64>, _memory: &mut ()) -> (Vec<f64>, f64, usize) {
        let next = self.step(gaps);
        let next = if self.contains(&next) { next } else { gaps.clone() };
        let loss = self.loss(&next);
        (next, loss, 1)
    }

    fn draw(&self, random: &mut Random) -> Result<Vec<f64>, MutationError> {
        let singlets = random.random_range(self.singlets[0]..=self.singlets[1]);
        Ok(self.draw_uniform(singlets, random))
    }

    fn mutate(
        &self,
        gaps: &Vec<f64>,
        weights: &MutationWeights,
        random: &mut Random,
    ) -> Result<MutatedPoint<Vec<f64>>, MutationError> {
        let mutated = if self.singlets[0] == self.singlets[1] {
            self.shift(gaps, random)
        } else if gaps.len() == 1 {
            self.add(gaps, random)
        } else {
            self.remove(gaps)
        };
        let kind = mutated.kind;
        if weights.of(kind) == 0.0 {
            Err(MutationError::new(kind, Refusal::Excluded))
        } else if self.contains(&mutated.point) {
            Ok(mutated)
        } else {
            Err(MutationError::new(kind, Refusal::OutOfRange))
        }
    }

    fn topology(&self, gaps: &Vec<f64>) -> String {
        gaps.len().to_string()
    }

    fn fingerprint(&self) -> serde_json::Value {
        serde_json::to_value(self).unwrap_or_default()
    }

    fn element_count(&self, gaps: &Vec<f64>) -> usize {
        gaps.len()
    }

    fn mutate_at(
        &self,
        gaps: &Vec<f64>,
        _element: usize,
        kind: MutationKind,
        random: &mut Random,
    ) -> Result<MutatedPoint<Vec<f64>>, MutationError> {
        match (kind, gaps.len()) {
            (MutationKind::AddSinglet, 1) => Ok(self.add(gaps, random)),
            (MutationKind::RemoveSinglet, 2) => Ok(self.remove(gaps)),
            _ => Err(MutationError::new(kind, Refusal::NoElement)),
        }
    }

    fn loss_gradient(&self, gaps: &Vec<f64>) -> Option<LossGradient> {
        let (loss, gradient) = (self.loss(gaps), self.gradient(gaps));
        loss.is_finite().then(|| LossGradient { loss, values: gaps.clone(), gradient })
    }

    fn with_values(&self, _gaps: &Vec<f64>, values: &[f64]) -> Option<Vec<f64>> {
        self.contains(values).then(|| values.to_vec())
    }
}

impl KnownDensity for ToyLandscape {
    fn draw_density(&self, gaps: &Vec<f64>) -> f64 {
        let numbers = (self.singlets[1] - self.singlets[0] + 1) as f64;
        let ranges = self.ranges(gaps.len());
        let volume: f64 = ranges.iter().map(|range| range[1] - range[0]).product();
        1.0 / (numbers * volume)
    }

    fn arrival_density(&self, gaps: &Vec<f64>, temperature: Temperature) -> f64 {
        let stays = !self.contains(&self.step(gaps));
        let staying = if stays { temperature.density(self.loss(gaps)) } else { 0.0 };
        let source = self.invert_step(gaps).filter(|source| self.contains(source));
        let coming = source.map(|source| {
            temperature.density(self.loss(&source)) / self.determinant(&source).abs()
        });
        staying + coming.unwrap_or(0.0)
    }
}
