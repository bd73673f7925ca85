//! The schedule of an iterated local search (Lourenço, Martin, Stützle, "Iterated Local Search",
//! Handbook of Metaheuristics, 2003) whose perturbations race (successive halving: Jamieson, Talwalkar,
//! "Non-stochastic Best Arm Identification", AISTATS 2016).
//!
//! Chain 0 holds the best point and its descent, which pauses while the other chains run trials: each
//! descends from a mutation. After every stage the worse ones end; the last one goes on as the
//! challenger while it may still overtake the best point, and then takes its place. A descent goes on
//! for as long as it gains faster than races do on average: this maximizes the gain for a budget
//! (Charnov, "Optimal Foraging, the Marginal Value Theorem", 1976). Kinds of mutation are drawn in
//! proportion to their gain by gradient so far.

use crate::search::{MutationKind, MutationWeights};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The share of the trials that go on after a stage.
const KEPT_SHARE: f64 = 0.25;
/// The gradients over which the rate of a descent is measured.
const RATE_GRADIENTS: u64 = 60;
/// The gradients within which a challenger has to overtake the best point at its present rate.
const CATCH_UP_GRADIENTS: f64 = 200.0;
/// The gain by gradient that a race is expected to have before there was one, and the gradients that
/// this expectation counts as much as.
const EXPECTED_RATE: f64 = 1e-4;
const EXPECTATION_GRADIENTS: f64 = 2000.0;
/// The same for one kind of mutation.
const KIND_EXPECTATION_GRADIENTS: f64 = 400.0;
/// The gain by gradient below which a descent pauses, however little races gain: within the error of
/// the spots there is always something to gain.
const LEAST_RATE: f64 = 1e-6;
/// The factor of earlier results when a new one comes in.
const MEMORY: f64 = 0.9;
/// The smallest rate of a kind of mutation relative to the largest one.
const LEAST_SHARE: f64 = 0.1;
/// The largest gain that counts in one descent.
const LARGEST_GAIN: f64 = 5.0;

/// The relative gain from one loss to another: the logarithm of their ratio if both are positive; 0 if
/// there is none.
pub(super) fn relative_gain(before: f64, after: f64) -> f64 {
    let gain = if before > 0.0 && after > 0.0 {
        before.ln() - after.ln()
    } else {
        before / before.abs().max(after.abs()) - after / before.abs().max(after.abs())
    };
    if gain > 0.0 { gain.min(LARGEST_GAIN) } else { 0.0 }
}

/// A gain and the gradients that it took.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct GainRate {
    gain: f64,
    gradients: f64,
}

impl GainRate {
    fn expected(gradients: f64) -> Self {
        Self { gain: EXPECTED_RATE * gradients, gradients }
    }

    fn value(self) -> f64 {
        self.gain / self.gradients
    }

    fn add(&mut self, gain: f64, gradients: f64) {
        self.gain = MEMORY * self.gain + gain;
        self.gradients = MEMORY * self.gradients + gradients;
    }
}

/// The stage of an iterated local search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum RaceStage {
    /// Chain 0 descends.
    Best,
    /// The other chains run trials; they have made so many moves.
    Trials(u64),
    /// The chain of this index descends as the challenger.
    Challenger(usize),
}

/// The rate of a descent that runs alone, measured in blocks of gradients.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct DescentRate {
    /// The gradients and the loss at the start of the block.
    gradients: u64,
    loss: f64,
}

/// The state of an iterated local search besides its chains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::search) struct Race {
    pub(super) stage: RaceStage,
    block: DescentRate,
    /// The rate of the descent of the best point when it was last measured.
    pub(super) best_rate: f64,
    /// The mutation that led to the best point, and the loss before it, until its descent pauses.
    winner: Option<(MutationKind, f64)>,
    /// The gradients of the race so far.
    gradients: u64,
    rate: GainRate,
    kinds: BTreeMap<MutationKind, GainRate>,
    /// True if no point near the best one keeps every limit.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(super) breaks_limits: bool,
}

impl Race {
    /// The state at the start of a search from a point of this loss.
    pub(super) fn new(loss: f64) -> Self {
        Self {
            stage: RaceStage::Best,
            block: DescentRate { gradients: 0, loss },
            best_rate: 0.0,
            winner: None,
            gradients: 0,
            rate: GainRate::expected(EXPECTATION_GRADIENTS),
            kinds: BTreeMap::new(),
            breaks_limits: false,
        }
    }

    /// True if the state can be that of a run with so many chains.
    pub(in crate::search) fn is_of_chains(&self, count: usize) -> bool {
        match self.stage {
            RaceStage::Best | RaceStage::Trials(_) => count > 1,
            RaceStage::Challenger(chain) => (1..count).contains(&chain),
        }
    }

    /// Another point has become the best one, from whose descent much is expected.
    pub(super) fn note_other_best(&mut self, loss: f64) {
        self.winner = None;
        self.best_rate = LARGEST_GAIN;
        self.measure_from(0, loss);
    }

    /// The rate of races so far, and the least one that a descent needs to go on.
    pub(super) fn rate(&self) -> f64 {
        self.rate.value().max(LEAST_RATE)
    }

    /// Counts gradients of the race; the descent of the best point belongs to the race that it has won.
    pub(super) fn count(&mut self, gradients: u64) {
        if self.stage != RaceStage::Best || self.winner.is_some() {
            self.gradients += gradients;
        }
    }

    /// True if the race has made no gradient.
    pub(super) fn is_empty(&self) -> bool {
        self.gradients == 0
    }

    /// Begins to measure a descent.
    pub(super) fn measure_from(&mut self, gradients: u64, loss: f64) {
        self.block = DescentRate { gradients, loss };
    }

    /// The rate of a descent at the end of a block; `None` within one.
    pub(super) fn measured(&mut self, gradients: u64, loss: f64) -> Option<f64> {
        let used = gradients.saturating_sub(self.block.gradients);
        let gain = relative_gain(self.block.loss, loss);
        if used < RATE_GRADIENTS {
            return None;
        }
        self.measure_from(gradients, loss);
        Some(gain / used as f64)
    }

    /// True if a descent at this rate may overtake the best point soon.
    pub(super) fn may_catch_up(loss: f64, best: f64, rate: f64) -> bool {
        rate > 0.0 && relative_gain(loss, best) <= rate * CATCH_UP_GRADIENTS
    }

    /// The number of trials that go on after a stage.
    pub(super) fn kept(trials: usize) -> usize {
        let kept = (KEPT_SHARE * trials as f64).ceil() as usize;
        kept.clamp(1, trials.saturating_sub(1).max(1))
    }

    /// Notes the mutation that has led to a new best point, and the loss of the one before.
    pub(super) fn note_winner(&mut self, kind: Option<MutationKind>, before: f64) {
        self.winner = kind.map(|kind| (kind, before));
    }

    /// Notes a trial that has gained nothing.
    pub(super) fn note_trial(&mut self, kind: MutationKind, gradients: u64) {
        self.of_kind(kind).add(0.0, gradients as f64);
    }

    /// Ends a race: the gain of the winner, whose descent took these gradients, is that of its kind.
    pub(super) fn settle(&mut self, loss: f64, gradients: u64) {
        let mut gain = 0.0;
        if let Some((kind, before)) = self.winner.take() {
            gain = relative_gain(before, loss);
            self.of_kind(kind).add(gain, gradients as f64);
        }
        if self.gradients > 0 {
            self.rate.add(gain, self.gradients as f64);
        }
        self.gradients = 0;
    }

    fn of_kind(&mut self, kind: MutationKind) -> &mut GainRate {
        self.kinds.entry(kind).or_insert_with(|| GainRate::expected(KIND_EXPECTATION_GRADIENTS))
    }

    /// Weights of the kinds of mutation in proportion to their rates, multiplied by those of the user.
    pub(super) fn weights(&self, user: &MutationWeights) -> MutationWeights {
        let expected = GainRate::expected(KIND_EXPECTATION_GRADIENTS);
        let rate = |kind| self.kinds.get(&kind).copied().unwrap_or(expected).value();
        let largest = MutationKind::PERTURBATIONS.into_iter().map(rate).fold(0.0, f64::max);
        let mut weights = user.clone();
        for kind in MutationKind::PERTURBATIONS {
            let share = (rate(kind) / largest).max(LEAST_SHARE);
            weights.set(kind, share * user.of(kind));
        }
        weights
    }
}
