//! A landscape of several structures with several minima each, with options that make it fail.

use aplanat::search::{
    Landscape, LossGradient, MutatedPoint, MutationError, MutationKind, MutationWeights, Random,
    Refusal, StructureChange,
};
use rand::RngExt as _;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// A structure and a place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Spot {
    pub(super) elements: usize,
    pub(super) x: f64,
}

/// The running mean of the slope, like the moments of Adam.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Momentum(f64);

/// The defects of a landscape.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub(super) enum Fault {
    #[default]
    Nothing,
    /// Everything is worth nothing.
    NotANumber,
    Infinite,
    /// A descent leads to what is worth nothing.
    DescentLost,
    DescentInfinite,
    /// No descent can compute a gradient.
    WithoutGradient,
    /// No mutation and no draw applies.
    AllRefused,
    /// All mutations lead to what is worth nothing.
    AllWorthless,
    /// Nothing is different from anything.
    Flat,
    /// Losses at both ends of what a number can be.
    Huge,
}

/// Best with six elements.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Rugged {
    pub(super) fault: Fault,
    /// True if points may be displaced within their structure.
    pub(super) displaces: bool,
}

pub(super) const START: Spot = Spot { elements: 2, x: 3.0 };
pub(super) const STEPS: usize = 5;

impl Rugged {
    pub(super) fn with(fault: Fault) -> Self {
        Self { fault, ..Self::default() }
    }

    fn sound(spot: &Spot) -> f64 {
        let off = spot.elements as f64 - 6.0;
        0.3 * off * off + spot.x * spot.x + 0.5 * (1.0 - (4.0 * spot.x).cos()) + 0.05
    }

    fn slope_at(x: f64) -> f64 {
        2.0 * x + 2.0 * (4.0 * x).sin()
    }

    fn mutated(
        &self,
        spot: &Spot,
        kind: MutationKind,
        noise: f64,
    ) -> Result<MutatedPoint<Spot>, MutationError> {
        let elements = match kind {
            MutationKind::AddSinglet if spot.elements < 8 => spot.elements + 1,
            MutationKind::RemoveSinglet if spot.elements > 1 => spot.elements - 1,
            MutationKind::Bend | MutationKind::Displacement => spot.elements,
            _ => return Err(MutationError::new(kind, Refusal::TooManyElements)),
        };
        if self.fault == Fault::AllRefused {
            return Err(MutationError::new(kind, Refusal::NoAirGap));
        }
        let x = if self.fault == Fault::AllWorthless { f64::INFINITY } else { spot.x + noise };
        let change = StructureChange::Text(format!("{} at {elements}", kind.name()));
        let (point, record) = (Spot { elements, x }, change.into());
        Ok(MutatedPoint { point, kind, record, log_ratio: Some(0.0), gradients: 0 })
    }
}

impl Landscape for Rugged {
    type Point = Spot;
    type Memory = Momentum;

    fn loss(&self, spot: &Spot) -> f64 {
        match self.fault {
            Fault::NotANumber => f64::NAN,
            Fault::Infinite => f64::INFINITY,
            Fault::Flat => 1.0,
            Fault::Huge => 1e308 * if spot.x > 1.0 { 1.0 } else { -1.0 },
            _ => Self::sound(spot),
        }
    }

    fn descend(&self, spot: &Spot, memory: &mut Momentum) -> (Spot, f64, usize) {
        self.descend_within(spot, memory, STEPS)
    }

    fn descend_within(
        &self,
        spot: &Spot,
        memory: &mut Momentum,
        most: usize,
    ) -> (Spot, f64, usize) {
        let (mut x, steps) = (spot.x, STEPS.min(most));
        for _ in 0..steps {
            memory.0 = 0.8 * memory.0 + 0.2 * Self::slope_at(x);
            x -= 0.03 * memory.0;
        }
        let next = Spot { x, ..*spot };
        let loss = match self.fault {
            Fault::DescentLost => f64::NAN,
            Fault::DescentInfinite => f64::INFINITY,
            Fault::WithoutGradient => return (spot.clone(), f64::INFINITY, 0),
            _ => self.loss(&next),
        };
        (next, loss, steps)
    }

    fn draw(&self, random: &mut Random) -> Result<Spot, MutationError> {
        if self.fault == Fault::AllRefused {
            return Err(MutationError::new(MutationKind::Global, Refusal::NoRandomLens));
        }
        Ok(Spot { elements: random.random_range(1..=8), x: random.random_range(-4.0..4.0) })
    }

    fn mutate(
        &self,
        spot: &Spot,
        weights: &MutationWeights,
        random: &mut Random,
    ) -> Result<MutatedPoint<Spot>, MutationError> {
        let kinds = [
            MutationKind::AddSinglet,
            MutationKind::RemoveSinglet,
            MutationKind::Bend,
            MutationKind::Displacement,
        ];
        let weight = |kind| self.weight(kind) * weights.of(kind);
        let sum: f64 = kinds.into_iter().map(weight).sum();
        let mut left = random.random::<f64>() * sum;
        let drawn = kinds.into_iter().find(|kind| {
            left -= weight(*kind);
            left < 0.0
        });
        let noise = random.sample::<f64, _>(StandardNormal);
        let forbidden = MutationError::new(MutationKind::Bend, Refusal::AllExcluded);
        self.mutated(spot, drawn.ok_or(forbidden)?, noise)
    }

    fn weight(&self, kind: MutationKind) -> f64 {
        f64::from(u8::from(self.displaces || kind != MutationKind::Displacement))
    }

    fn topology(&self, spot: &Spot) -> String {
        format!("{} elements", spot.elements)
    }

    fn fingerprint(&self) -> serde_json::Value {
        serde_json::to_value(self).unwrap()
    }

    fn element_count(&self, spot: &Spot) -> usize {
        spot.elements
    }

    fn mutate_at(
        &self,
        spot: &Spot,
        element: usize,
        kind: MutationKind,
        _random: &mut Random,
    ) -> Result<MutatedPoint<Spot>, MutationError> {
        self.mutated(spot, kind, 0.1 * element as f64)
    }

    fn loss_gradient(&self, spot: &Spot) -> Option<LossGradient> {
        let gradient = vec![Self::slope_at(spot.x)];
        Some(LossGradient { loss: self.loss(spot), values: vec![spot.x], gradient })
    }

    fn with_values(&self, spot: &Spot, values: &[f64]) -> Option<Spot> {
        Some(Spot { x: values[0], ..*spot })
    }
}
