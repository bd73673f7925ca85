//! The sampler of section 4.4.1 with competing exponential clocks: at every point a clock of rate 1
//! waits for the next gradient step and a clock of rate κ for a regeneration; the first to ring
//! decides, and its time is the weight of the point.
//!
//! The distribution that the process samples depends on κ. Let `πP(θ)` be the density that gradient
//! steps bring to `θ`. The weighted samples have the density `π` if the flow into every point
//! equals the flow out of it, which gives `κ = πP/π − 1 + C μ/π` with any `C` that keeps it
//! positive: (4.11) with `Q* = P* − 1`. A gradient step is a map `g`, and so `πP(θ) = π(g⁻¹(θ)) /
//! |det Dg|`. Equation (4.13) omits the determinant, and (4.16) has `C` in place of `C μ/π`, which
//! is equivalent only if regenerations are already drawn from the target. [`RegenerationRate`]
//! offers all of these forms, and figure 4.1 shows which of them sample the target.

use super::Temperature;
use crate::search::{Landscape, MutationError, MutationWeights, Random, Reservoir, ReservoirEntry};
use rand::RngExt as _;
use rand_distr::Exp1;
use std::mem;

/// Mutations tried by a regeneration before it draws a random point.
const MAX_ATTEMPTS: usize = 16;

/// A landscape with known densities of random draws and of the points after a local move.
pub trait KnownDensity: Landscape {
    /// The density of [`Landscape::draw`], which is μ if all regenerations are draws.
    fn draw_density(&self, point: &Self::Point) -> f64;

    /// The density `πP` that a local move brings to a point from all points, including itself.
    fn arrival_density(&self, point: &Self::Point, temperature: Temperature) -> f64;
}

/// A formula for the regeneration rate κ; negative values are clipped to 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RegenerationRate {
    /// `πP(θ)/π(θ) − 1 + C μ(θ)/π(θ)` with μ the density of random draws: (4.11).
    Exact(f64),
    /// `(π(θ) − π(θ*))/π(θ) + C`, `θ*` being the point after a step from here: (4.16).
    AsPrinted(f64),
    /// `(π(θ') − π(θ))/π(θ') + C`, `θ'` being the point before the last step: the order of
    /// algorithm 1. At the start of a descent the first term is 0.
    PreviousStep(f64),
    /// `π(θ')/π(θ) − 1 + C μ(θ)/π(θ)`, `θ'` being the point before the last step: (4.11) with
    /// (4.13). At the start of a descent the first term is 0.
    WithoutDeterminant(f64),
}

/// The distribution of regenerations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Regeneration {
    /// A random draw.
    Draw,
    /// A draw from the target by rejection, for densities of at most 1: the assumption of (4.15).
    Target,
    /// (4.14): with probability `gamma` a random draw, otherwise a mutation of one of the best
    /// `size` points at which descents ended.
    Reservoir {
        /// γ.
        gamma: f64,
        /// The capacity of the reservoir.
        size: usize,
    },
}

/// A visited point with its weight.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightedSample<P> {
    /// The point.
    pub point: P,
    /// The holding time.
    pub weight: f64,
    /// True if a regeneration followed.
    pub regenerates: bool,
}

/// The sampling process; an infinite iterator over weighted samples.
#[derive(Debug)]
pub struct CompetingClocks<'a, L: KnownDensity> {
    landscape: &'a L,
    temperature: Temperature,
    rate: RegenerationRate,
    regeneration: Regeneration,
    reservoir: Reservoir<L::Point>,
    random: Random,
    point: L::Point,
    loss: f64,
    memory: L::Memory,
    /// The loss before the last step; `None` at the start of a descent.
    previous_loss: Option<f64>,
    clipped_rates: u64,
    regenerations: u64,
}

impl<'a, L: KnownDensity> CompetingClocks<'a, L> {
    /// A process that begins at a random draw.
    ///
    /// # Errors
    /// The landscape refuses to draw.
    pub fn new(
        landscape: &'a L,
        temperature: Temperature,
        rate: RegenerationRate,
        regeneration: Regeneration,
        mut random: Random,
    ) -> Result<Self, MutationError> {
        let size = match regeneration {
            Regeneration::Draw | Regeneration::Target => 1,
            Regeneration::Reservoir { size, .. } => size,
        };
        let point = landscape.draw(&mut random)?;
        Ok(Self {
            landscape,
            temperature,
            rate,
            regeneration,
            reservoir: Reservoir::new(size, false),
            random,
            loss: landscape.loss(&point),
            point,
            memory: L::Memory::default(),
            previous_loss: None,
            clipped_rates: 0,
            regenerations: 0,
        })
    }

    /// The number of times that κ would have been negative and was set to 0; if it is not 0, the
    /// weighted samples do not have the target's density.
    pub fn clipped_rates(&self) -> u64 {
        self.clipped_rates
    }

    /// The regeneration rate at the current point, `next` being the loss after the next step.
    fn regeneration_rate(&mut self, next: f64) -> f64 {
        let Self { landscape, temperature, loss, ref point, .. } = *self;
        let density = temperature.density(loss);
        let drawn = |c: f64| c * landscape.draw_density(point) / density;
        let kappa = match self.rate {
            RegenerationRate::Exact(c) => {
                landscape.arrival_density(point, temperature) / density - 1.0 + drawn(c)
            }
            RegenerationRate::AsPrinted(c) => 1.0 - temperature.log_ratio(loss, next).exp() + c,
            RegenerationRate::PreviousStep(c) => {
                let came =
                    self.previous_loss.map(|from| 1.0 - temperature.log_ratio(from, loss).exp());
                came.unwrap_or(0.0) + c
            }
            RegenerationRate::WithoutDeterminant(c) => {
                let came =
                    self.previous_loss.map(|from| temperature.log_ratio(loss, from).exp() - 1.0);
                came.unwrap_or(0.0) + drawn(c)
            }
        };
        self.clipped_rates += u64::from(kappa < 0.0);
        kappa.max(0.0)
    }

    fn regenerate(&mut self) {
        if let Regeneration::Reservoir { gamma, .. } = self.regeneration {
            let entry = ReservoirEntry::new(
                self.landscape,
                self.regenerations,
                self.loss,
                self.point.clone(),
            );
            self.reservoir.offer(entry);
            if self.random.random::<f64>() >= gamma && self.mutate() {
                return;
            }
        }
        let any = self.regeneration != Regeneration::Target;
        while let Ok(point) = self.landscape.draw(&mut self.random) {
            let density = self.temperature.density(self.landscape.loss(&point));
            if any || self.random.random::<f64>() < density {
                self.point = point;
                return;
            }
        }
    }

    /// Moves to a mutation of a random point of the reservoir; true if one was found.
    fn mutate(&mut self) -> bool {
        let weights = MutationWeights::default();
        (0..MAX_ATTEMPTS).any(|_| {
            let entries = self.reservoir.entries();
            let Some(last) = entries.len().checked_sub(1) else { return false };
            let parent = &entries[self.random.random_range(0..=last)].point;
            let mutated = self.landscape.mutate(parent, &weights, &mut self.random);
            let found = mutated.ok().filter(|new| self.landscape.loss(&new.point).is_finite());
            found.map(|new| self.point = new.point).is_some()
        })
    }
}

impl<L: KnownDensity> Iterator for CompetingClocks<'_, L> {
    type Item = WeightedSample<L::Point>;

    fn next(&mut self) -> Option<Self::Item> {
        let (next, next_loss, _) = self.landscape.descend(&self.point, &mut self.memory);
        let kappa = self.regeneration_rate(next_loss);
        let local: f64 = self.random.sample(Exp1);
        let global = self.random.sample::<f64, _>(Exp1) / kappa;
        let regenerates = global < local;
        let place = self.point.clone();
        if regenerates {
            self.regenerate();
            self.regenerations += 1;
            self.memory = L::Memory::default();
            self.previous_loss = None;
            self.loss = self.landscape.loss(&self.point);
        } else {
            self.previous_loss = Some(mem::replace(&mut self.loss, next_loss));
            self.point = next;
        }
        Some(WeightedSample { point: place, weight: local.min(global), regenerates })
    }
}
