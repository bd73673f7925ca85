//! The schedule of an iterated local search (Lourenço, Martin, Stützle, "Iterated Local Search",
//! Handbook of Metaheuristics, 2003) whose perturbations race (successive halving: Jamieson, Talwalkar,
//! "Non-stochastic Best Arm Identification", AISTATS 2016).
//!
//! Chain 0 holds the best point and its descent, which pauses while the other chains run trials: each
//! descends from a mutation. After every stage the worse ones end; the last one goes on as the
//! challenger while it may still overtake the best point, and then takes its place. In place of several
//! mutants there may be a single one, or a displacement of the best point as in basin hopping: the challenger
//! from the start.
//!
//! Whatever gains fastest comes next: a descent goes on for as long as it gains faster than trials do on
//! average, by its last block of gradients or by the mean of the last few, and has not ended. Of the ways to
//! make trials that with the largest gain by gradient so far follows it. This maximizes the gain for a budget
//! (Charnov, "Optimal Foraging, the Marginal Value Theorem", 1976). Kinds of mutation are drawn in proportion
//! to their gain by gradient.

use crate::search::{MutationKind, MutationWeights};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The share of the trials that go on after a stage.
const KEPT_SHARE: f64 = 0.25;
/// The gradients over which the rate of a descent is measured.
const RATE_GRADIENTS: u64 = 60;
/// The number of last blocks over which the best point's descent has to gain little: descents gain unevenly.
const RECENT_BLOCKS: usize = 3;
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct DescentRate {
    /// The gradients and the loss at the start of the block.
    gradients: u64,
    loss: f64,
    /// The last blocks before.
    #[serde(default)]
    earlier: Vec<GainRate>,
}

/// The gain by gradient at the end of a block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BlockRates {
    /// In the block itself.
    pub(super) last: f64,
    /// The larger one of that and of the mean of the last blocks.
    pub(super) recent: f64,
}

/// The changes with which the trials of a race begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Perturbation {
    /// Each with a mutation of one of the parents.
    #[default]
    Mutants,
    /// A single trial with a mutation of one of the parents.
    SingleMutant,
    /// A single trial with a displacement of the best point.
    Displacement,
}

impl Perturbation {
    pub(super) const ALL: [Self; 3] = [Self::Mutants, Self::SingleMutant, Self::Displacement];

    /// True for the kinds that it draws from.
    pub(super) fn includes(self, kind: MutationKind) -> bool {
        (kind == MutationKind::Displacement) == (self == Self::Displacement)
    }
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
    /// The changes with which the trials of the race begin.
    #[serde(default)]
    pub(super) perturbation: Perturbation,
    /// The gain by gradient of the races that began with a perturbation.
    #[serde(default)]
    rates: BTreeMap<Perturbation, GainRate>,
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
            block: DescentRate { gradients: 0, loss, earlier: Vec::new() },
            best_rate: 0.0,
            winner: None,
            gradients: 0,
            perturbation: Perturbation::default(),
            rates: BTreeMap::new(),
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

    /// The gain by gradient of races with such a perturbation so far.
    pub(super) fn rate(&self, perturbation: Perturbation) -> f64 {
        self.gain_rate(perturbation).value()
    }

    fn gain_rate(&self, perturbation: Perturbation) -> GainRate {
        let expected = GainRate::expected(EXPECTATION_GRADIENTS);
        self.rates.get(&perturbation).copied().unwrap_or(expected)
    }

    /// The rate that a descent needs to go on where the next race begins with such a perturbation.
    pub(super) fn required_rate(&self, next: Perturbation) -> f64 {
        self.rate(next).max(LEAST_RATE)
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
        self.block = DescentRate { gradients, loss, earlier: Vec::new() };
    }

    /// The rates of a descent at the end of a block; `None` within one.
    pub(super) fn measured(&mut self, gradients: u64, loss: f64) -> Option<BlockRates> {
        let used = gradients.saturating_sub(self.block.gradients);
        let gain = relative_gain(self.block.loss, loss);
        if used < RATE_GRADIENTS {
            return None;
        }
        let block = GainRate { gain, gradients: used as f64 };
        let mut blocks = std::mem::take(&mut self.block.earlier);
        blocks.push(block);
        let sum = |part: fn(&GainRate) -> f64| blocks.iter().map(part).sum::<f64>();
        let mean = sum(|block| block.gain) / sum(|block| block.gradients);
        let kept = blocks.len().saturating_sub(RECENT_BLOCKS - 1);
        self.block = DescentRate { gradients, loss, earlier: blocks.split_off(kept) };
        let last = block.value();
        Some(BlockRates { last, recent: last.max(mean) })
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
            let mut rate = self.gain_rate(self.perturbation);
            rate.add(gain, self.gradients as f64);
            self.rates.insert(self.perturbation, rate);
        }
        self.gradients = 0;
    }

    fn of_kind(&mut self, kind: MutationKind) -> &mut GainRate {
        self.kinds.entry(kind).or_insert_with(|| GainRate::expected(KIND_EXPECTATION_GRADIENTS))
    }

    /// Weights of the kinds that the present race draws from, in proportion to their rates and multiplied by
    /// those of the user; 0 for the other ones.
    pub(super) fn weights(&self, user: &MutationWeights) -> MutationWeights {
        let expected = GainRate::expected(KIND_EXPECTATION_GRADIENTS);
        let rate = |kind| self.kinds.get(&kind).copied().unwrap_or(expected).value();
        let is_drawn = |kind: &MutationKind| self.perturbation.includes(*kind);
        let drawn = MutationKind::PERTURBATIONS.into_iter().filter(is_drawn);
        let largest = drawn.map(rate).fold(0.0, f64::max);
        let mut weights = user.clone();
        for kind in MutationKind::PERTURBATIONS {
            let share = (rate(kind) / largest).max(LEAST_SHARE);
            weights.set(kind, if is_drawn(&kind) { share * user.of(kind) } else { 0.0 });
        }
        weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ends a race that has taken these gradients with a winner of this loss, the loss before being 1.
    fn settle(race: &mut Race, perturbation: Perturbation, gradients: u64, loss: f64) {
        race.stage = RaceStage::Trials(1);
        race.perturbation = perturbation;
        race.count(gradients);
        race.note_winner(Some(MutationKind::Bend), 1.0);
        race.settle(loss, gradients);
    }

    #[test]
    fn the_rate_of_a_perturbation_follows_its_own_races() {
        let mut race = Race::new(1.0);
        let [mutants, single, displaced] = Perturbation::ALL;
        settle(&mut race, displaced, 300, 1.0);
        assert!(race.rate(displaced) < race.rate(single));
        assert_eq!(race.rate(single), race.rate(mutants));
        settle(&mut race, mutants, 300, 0.5);
        assert!(race.rate(mutants) > 2.0 * race.rate(single));
        for _ in 0..40 {
            settle(&mut race, mutants, 300, 1.0);
        }
        assert!(race.rate(mutants) < race.rate(displaced));
        assert!(race.required_rate(mutants) >= LEAST_RATE);
    }

    #[test]
    fn one_slow_block_does_not_make_a_descent_slow() {
        let mut race = Race::new(1.0);
        assert_eq!(race.measured(RATE_GRADIENTS - 1, 0.5), None);
        let fast = race.measured(RATE_GRADIENTS, 0.5).unwrap();
        assert_eq!(fast.last, fast.recent);
        let slow = race.measured(2 * RATE_GRADIENTS, 0.5).unwrap();
        assert_eq!(slow.last, 0.0);
        assert!(slow.recent > 0.4 * fast.last && slow.recent < fast.last);
        let slower = race.measured(3 * RATE_GRADIENTS, 0.5).unwrap();
        assert!(slower.recent > 0.3 * fast.last && slower.recent < slow.recent);
        assert_eq!(race.measured(4 * RATE_GRADIENTS, 0.5).unwrap().recent, 0.0);
        race.measure_from(0, 0.5);
        assert_eq!(race.measured(RATE_GRADIENTS, 0.25), Some(fast));
    }

    #[test]
    fn a_race_draws_from_the_kinds_of_its_perturbation() {
        let mut race = Race::new(1.0);
        let mut user = MutationWeights::default();
        user.set(MutationKind::Flip, 0.0);
        for perturbation in Perturbation::ALL {
            race.perturbation = perturbation;
            let weights = race.weights(&user);
            for kind in MutationKind::PERTURBATIONS {
                let is_drawn = perturbation.includes(kind) && kind != MutationKind::Flip;
                assert_eq!(weights.of(kind) > 0.0, is_drawn, "{perturbation:?} {kind:?}");
            }
        }
    }
}
