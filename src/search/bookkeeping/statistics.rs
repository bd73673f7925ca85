//! Counters of a run.

use super::DescentEnd;
use crate::search::mutation::{MutationError, MutationKind, Refusal, read_counts};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Counters of a run: moves, gradients, mutations and descents.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SearchStatistics {
    /// Rounds; in each every chain takes a turn.
    pub rounds: u64,
    /// Local moves of all chains.
    pub moves: u64,
    /// Moves to a loss below that of the start.
    pub better: u64,
    /// Gradients evaluated by all chains.
    pub gradients: u64,
    /// Gradients besides those of descents: to choose mutations, and to keep the limits of retained points.
    #[serde(default)]
    pub gradients_beside: u64,
    /// Rejected Langevin steps; Metropolis–Hastings only.
    pub rejected: u64,
    /// Consecutive rounds without a move.
    pub idle: u64,
    /// Counters for each kind of mutation that was tried.
    pub kinds: BTreeMap<MutationKind, MutationStatistics>,
    /// The number of descents by the reason for their end.
    pub ended: BTreeMap<DescentEnd, u64>,
}

/// Counters for one kind of mutation.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct MutationStatistics {
    /// Attempts.
    pub tried: u64,
    /// Refused attempts by reason.
    #[serde(deserialize_with = "read_counts")]
    pub refused: BTreeMap<Refusal, u64>,
    /// Attempts rejected by the Metropolis–Hastings test.
    pub rejected: u64,
    /// Completed descents that began with this mutation.
    pub ended: u64,
    /// Completed descents that ended below the loss before the mutation.
    pub improved: u64,
    /// Completed descents that entered the reservoir.
    pub entered: u64,
    /// Local moves of the completed descents.
    pub moves: u64,
}

impl MutationStatistics {
    /// The mean length of its completed descents in local moves; `None` before the first one has
    /// ended.
    pub fn mean_moves(&self) -> Option<f64> {
        (self.ended > 0).then(|| self.moves as f64 / self.ended as f64)
    }
}

impl SearchStatistics {
    pub(in crate::search) fn kind(&mut self, kind: MutationKind) -> &mut MutationStatistics {
        self.kinds.entry(kind).or_default()
    }

    pub(in crate::search) fn refuse(&mut self, error: MutationError) {
        let statistics = self.kind(error.kind);
        statistics.tried += 1;
        *statistics.refused.entry(error.refusal).or_default() += 1;
    }
}
