//! What a run has done so far, in numbers.

use super::{DescentEnd, MutationError, MutationKind};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// So many reasons are told apart for each kind; what comes later is counted together.
const REASONS: usize = 24;
const OTHER: &str = "other reasons";

/// What a run has done so far.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SearchStatistics {
    /// Rounds of all chains.
    pub rounds: u64,
    /// Local moves of all chains.
    pub moves: u64,
    /// Moves that led to a loss below that of the start.
    pub better: u64,
    /// Gradients of all chains.
    pub gradients: u64,
    /// Langevin steps that were not accepted: Metropolis and Hastings only.
    pub rejected: u64,
    /// Rounds in a row in which no chain moved.
    pub idle: u64,
    /// Each kind of mutation that was tried.
    pub kinds: BTreeMap<MutationKind, MutationStatistics>,
    /// What ended descents.
    pub ended: BTreeMap<DescentEnd, u64>,
}

/// What became of a kind of mutation.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct MutationStatistics {
    /// How often it was tried.
    pub tried: u64,
    /// How often it was refused, for each reason.
    pub refused: BTreeMap<String, u64>,
    /// How often Metropolis and Hastings did not accept it.
    pub rejected: u64,
    /// Descents that began with it and have ended.
    pub ended: u64,
    /// Those of them that came below the loss before the mutation.
    pub improved: u64,
    /// Those of them that entered the reservoir.
    pub entered: u64,
    /// Local moves of those descents.
    pub moves: u64,
}

impl MutationStatistics {
    /// Local moves of a descent that began with it, on average; none before the first has ended.
    pub fn mean_moves(&self) -> Option<f64> {
        (self.ended > 0).then(|| self.moves as f64 / self.ended as f64)
    }
}

impl SearchStatistics {
    pub(super) fn kind(&mut self, kind: MutationKind) -> &mut MutationStatistics {
        self.kinds.entry(kind).or_default()
    }

    pub(super) fn refuse(&mut self, refusal: &MutationError) {
        let tally = self.kind(refusal.kind);
        tally.tried += 1;
        let known = tally.refused.contains_key(&refusal.why) || tally.refused.len() < REASONS;
        let why = if known { &refusal.why } else { OTHER };
        *tally.refused.entry(why.to_owned()).or_default() += 1;
    }
}
