//! The sampler of section 4.4.1: two clocks race at every place, one of rate 1 for the next
//! gradient step and one of rate κ for a regeneration, and the place counts for as long as the
//! faster of them took.
//!
//! What the process samples depends on κ. Let `πP(θ)` be the density that gradient steps bring to
//! `θ`. The weighted samples have the density `π` where what comes in is what goes out, and that is
//! `κ = πP/π − 1 + C μ/π` with any `C` that keeps it positive: (4.11) with `Q* = P* − 1`. A gradient
//! step is a map `g`, and so `πP(θ) = π(g⁻¹(θ)) / |det Dg|`. Equation (4.13) has no determinant, and
//! (4.16) has `C` in place of `C μ/π`, which is the same only if regenerations are already drawn
//! from the target. [`RegenerationRate`] has all of these forms, and figure 4.1 shows which of them sample it.

use super::reservoir::{Reservoir, ReservoirEntry};
use super::{Landscape, MutationError, MutationWeights, Random, Temperature};
use rand::RngExt as _;
use rand_distr::Exp1;
use std::mem;

/// How often a regeneration tries to mutate a point before it draws one from anywhere.
const MAX_ATTEMPTS: usize = 16;

/// A landscape whose densities of draws and of arrivals are known.
pub trait KnownDensity: Landscape {
    /// The density of [`Landscape::draw`]: μ where all regenerations are draws.
    fn draw_density(&self, point: &Self::Point) -> f64;

    /// The density `πP` that a local move brings to a point from all others, itself included.
    fn arrival_density(&self, point: &Self::Point, temperature: Temperature) -> f64;
}

/// The rate κ of regenerations, never below 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RegenerationRate {
    /// `πP(θ)/π(θ) − 1 + C μ(θ)/π(θ)`, μ being the draw from anywhere: (4.11).
    Exact(f64),
    /// `(π(θ) − π(θ*))/π(θ) + C`, `θ*` being where a step from here leads: (4.16).
    AsPrinted(f64),
    /// `(π(θ') − π(θ))/π(θ') + C`, `θ'` being where the step came from: the order of algorithm 1. A
    /// descent that begins came from nowhere, and the first part is 0.
    PreviousStep(f64),
    /// `π(θ')/π(θ) − 1 + C μ(θ)/π(θ)`, `θ'` being where the step came from: (4.11) with (4.13). A
    /// descent that begins came from nowhere, and the first part is 0.
    WithoutDeterminant(f64),
}

/// What a regeneration is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Regeneration {
    /// A draw from anywhere.
    Draw,
    /// A draw from the target, where no density is above 1: what (4.15) hopes for.
    Target,
    /// (4.14): with the chance `gamma` a draw, else a mutation of one of the best `size` points at
    /// which descents ended.
    Reservoir {
        /// γ.
        gamma: f64,
        /// How many points there may be.
        size: usize,
    },
}

/// A place that the process was at.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightedSample<P> {
    /// The place.
    pub point: P,
    /// How long.
    pub weight: f64,
    /// Whether a regeneration ended it.
    pub regenerates: bool,
}

/// The process; an endless iterator over weighted samples.
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
    /// The loss before the step that led here.
    previous_loss: Option<f64>,
    clipped_rates: u64,
    regenerations: u64,
}

impl<'a, L: KnownDensity> CompetingClocks<'a, L> {
    /// A process that begins with a draw from anywhere.
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

    /// How often κ would have been negative, and was taken as 0: where that is not 0, the weighted
    /// samples do not have the target's density.
    pub fn clipped_rates(&self) -> u64 {
        self.clipped_rates
    }

    /// The rate of regenerations here, `next` being the loss behind the next step.
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

    /// Goes to a mutation of any point of the reservoir; whether there was one.
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
