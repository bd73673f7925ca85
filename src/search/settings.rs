//! How a search goes: everything that a run depends on besides its landscape and its start.

use super::{SearchError, Temperature, Termination};
use crate::math::format_short;
use serde::{Deserialize, Serialize};

/// No more chains than this: each takes the memory of a descent, and a turn of every round.
const MAX_CHAINS: usize = 1024;

/// How a search goes; the defaults are the thesis's, or say where they are not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SearchSettings {
    /// The sampler.
    pub method: SearchMethod,
    /// All chance of a run follows from it.
    pub seed: u64,
    /// Chains that share the reservoir: a property of the run, whatever the number of threads.
    pub chains: usize,
    /// How many points the reservoir holds.
    pub reservoir: usize,
    /// Whether the reservoir holds at most one point of each topology.
    pub one_per_topology: bool,
    /// How often a regeneration draws from anywhere: γ of (4.14). The thesis says "small"; 0.02 is
    /// what its program comes to with a full reservoir.
    pub gamma: f64,
    /// How a descent ends.
    pub termination: Termination,
    /// `C` of (4.16) and (4.17): the larger, the shorter descents are. The thesis gives none. With
    /// 0.05, a descent that stands still at half of the density lasts 11 moves on average.
    pub c: f64,
    /// The temperature of (4.7); none is the one that gives the start a density of one half.
    pub temperature: Option<Temperature>,
    /// What a reheat multiplies the temperature with.
    pub reheat: f64,
    /// The longest descent, in local moves: what ends one that no clock ends.
    pub longest: usize,
    /// The run is over after so many local moves of all chains together.
    pub moves: Option<u64>,
    /// The run is over after so many gradients of all chains together, and takes no more: in its
    /// last rounds the chains share what is left, which shortens their moves. Brute force divides
    /// them among its mutations.
    pub gradients: Option<u64>,
    /// How many generations are remembered besides the ancestors of what is in the reservoir.
    pub remembered: usize,
    /// Langevin steps of Metropolis and Hastings.
    pub metropolis: LangevinSettings,
}

impl Default for SearchSettings {
    fn default() -> Self {
        Self {
            method: SearchMethod::Restore,
            seed: 1,
            chains: 4,
            reservoir: 5,
            one_per_topology: true,
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
    /// Whether a run can go on these settings.
    ///
    /// # Errors
    /// The first of them that makes no sense, by name.
    pub fn check(&self) -> Result<(), SearchError> {
        let wrong =
            |name, found: String, expected| Err(SearchError::Setting { name, found, expected });
        for (name, count) in [("chains", self.chains), ("reservoir", self.reservoir)] {
            if count == 0 {
                return wrong(name, "0".to_owned(), "1 or more");
            }
        }
        if self.chains > MAX_CHAINS {
            return wrong("chains", self.chains.to_string(), "1024 at most");
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
        if self.method == SearchMethod::Brute && self.gradients.is_none() {
            return wrong("gradients", "none".to_owned(), "a number, which brute force divides");
        }
        Ok(())
    }
}

/// A sampler.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SearchMethod {
    /// Descents that end by chance and begin again from the reservoir: algorithm 1.
    Restore,
    /// Langevin steps (4.10) and reversible mutations, each accepted or not: (4.8).
    Metropolis,
    /// After each element of the start one more, and each one less, each descended for as long.
    Brute,
}

/// Langevin steps: (4.10) with a diagonal preconditioner `M`,
/// `θ' = θ − ε M ∇L min(1, 1/(2 T)) + √(ε M) ξ`, `M = 1 / (√v + floor)`, `v` the mean square of all
/// gradients so far of this structure.
///
/// The printed step is the Langevin step of temperature ½; any drift samples the target, but one of
/// a lower temperature than the target's hardly ever leaves its slopes.
///
/// A gradient changes that mean by its part of all, so that adaptation fades, which convergence
/// asks for. Dividing `√v` by the number of gradients would fade too, but let `M` grow to 1/floor
/// whatever the slope is: steps of `√(ε/floor)`, 3 units of every variable, which nothing accepts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LangevinSettings {
    /// ε.
    pub epsilon: f64,
    /// What keeps `M` finite where there is no slope.
    pub floor: f64,
    /// How often a mutation is proposed in place of a step: `1 − β` of (4.9).
    pub mutation: f64,
}

impl Default for LangevinSettings {
    fn default() -> Self {
        Self { epsilon: 1e-3, floor: 1e-4, mutation: 0.01 }
    }
}
