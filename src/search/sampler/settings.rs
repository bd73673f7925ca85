//! Settings of a search: everything that a run depends on besides its landscape and its start.

use super::{Temperature, Termination};
use crate::math::format_short;
use crate::search::SearchError;
use serde::{Deserialize, Serialize};

/// The usual capacity of a reservoir with one point of each topology.
const USUAL_RESERVOIR: usize = 5;
/// The usual capacity of a reservoir of different minima, of which one topology has many.
const USUAL_MINIMA: usize = 16;
/// The maximum number of chains: each needs the memory of a descent and a turn in every round.
const MAX_CHAINS: usize = 1024;

/// Settings of a search; the defaults are those of the thesis unless stated otherwise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SearchSettings {
    /// The search method; by default an iterated local search. The sampler of the thesis is
    /// [`SearchMethod::Restore`].
    pub method: SearchMethod,
    /// The seed of all random numbers of a run.
    pub seed: u64,
    /// The number of chains that share the reservoir, independent of the number of threads.
    pub chains: usize,
    /// The number of trials in a race of an iterated local search, which has a chain for each of them and
    /// one for the best point in place of [`SearchSettings::chains`].
    pub trials: usize,
    /// The capacity of the reservoir; `None` for the usual one of the method.
    pub reservoir: Option<usize>,
    /// True to hold at most one point of each topology in the reservoir, unless it holds different minima.
    pub one_per_topology: bool,
    /// True for an iterated local search that holds different minima in its reservoir, in place of one point
    /// of each topology.
    pub minima: bool,
    /// The probability that a regeneration draws a random point: γ of (4.14). The thesis says
    /// "small"; 0.02 is the value of its program with a full reservoir.
    pub gamma: f64,
    /// The rule that ends descents.
    pub termination: Termination,
    /// `C` of (4.16) and (4.17): the larger, the shorter the descents. The thesis gives no value.
    /// With 0.05, a descent at a constant loss with density one half lasts 11 moves on average.
    pub c: f64,
    /// The temperature of (4.7); `None` for the one at which the start has a density of one half.
    pub temperature: Option<Temperature>,
    /// The factor by which a reheat multiplies the temperature.
    pub reheat: f64,
    /// The maximum length of a descent, in local moves.
    pub longest: usize,
    /// The maximum number of local moves of all chains together; `None` for no limit.
    pub moves: Option<u64>,
    /// The maximum number of gradients of all chains together; `None` for no limit. In the last
    /// rounds the chains share the remaining gradients, which shortens their moves. Brute force
    /// divides them among its mutations.
    pub gradients: Option<u64>,
    /// The number of generations that are remembered besides the ancestors of the reservoir.
    pub remembered: usize,
    /// Settings of the Langevin steps of Metropolis–Hastings.
    pub metropolis: LangevinSettings,
}

impl Default for SearchSettings {
    fn default() -> Self {
        Self {
            method: SearchMethod::IteratedLocalSearch,
            seed: 1,
            chains: 4,
            trials: 8,
            reservoir: None,
            one_per_topology: true,
            minima: true,
            gamma: 0.02,
            termination: Termination::Ratio,
            c: 0.05,
            temperature: None,
            reheat: 2.0,
            longest: 500,
            moves: None,
            gradients: Some(10_000),
            remembered: 256,
            metropolis: LangevinSettings::default(),
        }
    }
}

impl SearchSettings {
    /// Checks the settings.
    ///
    /// # Errors
    /// The name of the first invalid setting.
    pub fn check(&self) -> Result<(), SearchError> {
        let wrong =
            |name, found: String, expected| Err(SearchError::Setting { name, found, expected });
        let reservoir = ("reservoir", self.reservoir_capacity());
        let counts = [("chains", self.chains), ("trials", self.trials), reservoir];
        for (name, count) in counts {
            if count == 0 {
                return wrong(name, "0".to_owned(), "1 or more");
            }
        }
        for (name, count) in &counts[..2] {
            if *count > MAX_CHAINS {
                return wrong(name, count.to_string(), "1024 at most");
            }
        }
        if self.longest == 0 {
            return wrong("longest", "0".to_owned(), "1 or more");
        }
        let shares = [("gamma", self.gamma), ("metropolis.mutation", self.metropolis.mutation)];
        for (name, share) in shares {
            if !(0.0..=1.0).contains(&share) {
                return wrong(name, format_short(share), "0 to 1");
            }
        }
        if !(self.c >= 0.0 && self.c.is_finite()) {
            return wrong("c", format_short(self.c), "0 or more");
        }
        let sizes = [
            ("reheat", self.reheat),
            ("metropolis.epsilon", self.metropolis.epsilon),
            ("metropolis.floor", self.metropolis.floor),
        ];
        for (name, size) in sizes {
            if !(size > 0.0 && size.is_finite()) {
                return wrong(name, format_short(size), "more than 0");
            }
        }
        if self.method == SearchMethod::BruteForce && self.gradients.is_none() {
            return wrong("gradients", "none".to_owned(), "a number, which brute force divides");
        }
        Ok(())
    }
}

impl SearchSettings {
    /// The same settings for a descent from the start without mutations, which never ends by itself.
    #[must_use]
    pub fn without_mutations(&self) -> Self {
        Self {
            method: SearchMethod::Restore,
            chains: 1,
            temperature: Temperature::new(f64::INFINITY),
            termination: Termination::Relative,
            c: 0.0,
            longest: usize::MAX,
            ..self.clone()
        }
    }

    /// The capacity of the reservoir: that of the settings, or 16 for the different minima of an iterated
    /// local search and 5 otherwise.
    pub fn reservoir_capacity(&self) -> usize {
        let usual = if self.retains_minima() { USUAL_MINIMA } else { USUAL_RESERVOIR };
        self.reservoir.unwrap_or(usual)
    }

    /// True if the reservoir holds different minima, in place of one point of each topology.
    pub fn retains_minima(&self) -> bool {
        self.method == SearchMethod::IteratedLocalSearch && self.minima
    }

    /// The number of chains of a run.
    pub(in crate::search) fn chain_count(&self) -> usize {
        match self.method {
            SearchMethod::IteratedLocalSearch => self.trials + 1,
            _ => self.chains,
        }
    }
}

/// The method of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SearchMethod {
    /// Descends, mutates the best points, descends from several mutants that race, and goes on from what
    /// is better.
    #[serde(rename = "iterated")]
    IteratedLocalSearch,
    /// Descents that end at random and regenerate from the reservoir: algorithm 1, the Restore
    /// process.
    Restore,
    /// Metropolis–Hastings with Langevin steps (4.10) and reversible mutations, accepted by (4.8).
    Metropolis,
    /// Brute force: adds an element after each element of the start and removes each one, with
    /// equally long descents.
    #[serde(rename = "brute")]
    BruteForce,
}

impl SearchMethod {
    /// True if the method depends on a temperature.
    pub fn has_temperature(self) -> bool {
        matches!(self, Self::Restore | Self::Metropolis)
    }
}

/// Langevin steps (4.10) with a diagonal preconditioner `M`: `θ' = θ − ε M ∇L min(1, 1/(2 T)) + √(ε
/// M) ξ`, `M = 1 / (√v + floor)`, `v` being the mean square of all gradients so far for this
/// topology.
///
/// The printed step is the Langevin step of temperature ½. Any drift samples the target, but the
/// drift of a temperature below the target's is rarely accepted.
///
/// Each gradient changes the mean in proportion to its share of all gradients, so that the
/// adaptation fades, as convergence requires. Dividing `√v` by the number of gradients would fade
/// too, but would let `M` grow to 1/floor whatever the gradient is: steps of `√(ε/floor)`, 3 units
/// of every variable, which are never accepted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LangevinSettings {
    /// ε.
    pub epsilon: f64,
    /// The lower bound of `√v`, which keeps `M` finite where the gradient vanishes.
    pub floor: f64,
    /// The probability of proposing a mutation instead of a step: `1 − β` of (4.9).
    pub mutation: f64,
}

impl Default for LangevinSettings {
    fn default() -> Self {
        Self { epsilon: 1e-3, floor: 1e-4, mutation: 0.01 }
    }
}
