//! A Markov chain: one descent after another, each advanced by one local move per turn.
//!
//! In its turn a chain reads the shared state and changes only itself; what happened is returned as
//! a list of events. So all chains can take their turns in parallel, and their events are applied
//! in the order of the chains.

use super::langevin::{GradientScale, LangevinState};
use super::{SearchMethod, SearchSettings, Temperature};
use crate::search::{
    DescentEnd, Landscape, MutatedPoint, MutationError, MutationKind, MutationRecord,
    MutationWeights, Random, Refusal, Reservoir, ReservoirEntry, StructureChange,
};
use rand::RngExt as _;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Attempts per turn to find a point for a new descent.
const MAX_ATTEMPTS: usize = 16;

/// One of the Markov chains of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Chain<P, M> {
    pub(in crate::search) random: Random,
    /// The generation of the current descent, or of the last one.
    #[serde(rename = "number")]
    pub(in crate::search) generation: u64,
    #[serde(rename = "tour")]
    pub(in crate::search) descent: Option<ChainDescent<P, M>>,
    #[serde(rename = "task")]
    pub(in crate::search) job: Option<BruteForceJob>,
    pub(in crate::search) scales: BTreeMap<String, GradientScale>,
}

/// A descent in progress.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChainDescent<P, M> {
    pub(in crate::search) point: P,
    pub(in crate::search) loss: f64,
    pub(in crate::search) memory: M,
    pub(in crate::search) best: P,
    pub(in crate::search) best_loss: f64,
    pub(in crate::search) moves: u64,
    pub(in crate::search) gradients: u64,
    #[serde(rename = "walk")]
    pub(in crate::search) langevin: Option<LangevinState>,
}

/// A mutation that the brute-force method descends from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(in crate::search) struct BruteForceJob {
    pub(in crate::search) element: usize,
    pub(in crate::search) kind: MutationKind,
    /// The gradient budget of its descent.
    pub(in crate::search) budget: u64,
}

impl<P: Clone, M> Chain<P, M> {
    /// The generation of the current descent, or of the last one.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// The current point and its loss; `None` between two descents.
    pub fn position(&self) -> Option<(&P, f64)> {
        self.descent.as_ref().map(|descent| (&descent.point, descent.loss))
    }

    /// The best point of the current descent and its loss; `None` between two descents.
    pub fn best(&self) -> Option<(&P, f64)> {
        self.descent.as_ref().map(|descent| (&descent.best, descent.best_loss))
    }
}

impl<P: Clone, M: Default> ChainDescent<P, M> {
    pub(in crate::search) fn new(point: P, loss: f64) -> Self {
        let best = point.clone();
        let memory = M::default();
        Self { point, loss, memory, best, best_loss: loss, moves: 0, gradients: 0, langevin: None }
    }

    /// Moves to a point, whose loss may be infinite or NaN, and keeps track of the best one.
    pub(in crate::search) fn move_to(&mut self, point: P, loss: f64) {
        if loss < self.best_loss {
            self.best = point.clone();
            self.best_loss = loss;
        }
        self.point = point;
        self.loss = loss;
    }
}

/// The state that all chains read in a round.
#[derive(Debug)]
pub(in crate::search) struct RoundContext<'a, L: Landscape> {
    pub(in crate::search) landscape: &'a L,
    pub(in crate::search) settings: &'a SearchSettings,
    pub(in crate::search) temperature: Temperature,
    pub(in crate::search) weights: &'a MutationWeights,
    pub(in crate::search) start: &'a ReservoirEntry<L::Point>,
    pub(in crate::search) reservoir: &'a Reservoir<L::Point>,
    pub(in crate::search) pinned: Option<&'a ReservoirEntry<L::Point>>,
    /// The points that an iterated local search mutates, the best one first.
    pub(in crate::search) parents: Vec<ReservoirEntry<L::Point>>,
}

/// An event of a chain's turn.
#[derive(Debug)]
pub(in crate::search) enum TurnEvent<P> {
    /// A mutation did not apply.
    Refused(MutationError),
    /// A mutation was rejected by the Metropolis–Hastings test.
    Rejected(MutationKind),
    /// A descent began.
    Started(NewDescent<P>),
    /// The descent made a local move.
    Moved(LocalMove),
    /// The descent ended; with its best point.
    Ended { end: DescentEnd, point: P, loss: f64 },
}

/// The start of a descent.
#[derive(Debug)]
pub(in crate::search) struct NewDescent<P> {
    pub(in crate::search) parent: Option<u64>,
    pub(in crate::search) kind: Option<MutationKind>,
    pub(in crate::search) record: MutationRecord,
    pub(in crate::search) before: Option<f64>,
    pub(in crate::search) loss: f64,
    pub(in crate::search) point: P,
    /// The gradients that were made to choose the mutation.
    pub(in crate::search) gradients: u64,
}

/// The outcome of a local move.
#[derive(Debug, Clone, Copy)]
pub(in crate::search) struct LocalMove {
    pub(in crate::search) loss: f64,
    pub(in crate::search) best: f64,
    pub(in crate::search) gradients: u64,
    /// True if it was a Langevin step that was rejected.
    pub(in crate::search) rejected: bool,
}

/// The events of a turn, in order.
pub(in crate::search) type TurnEvents<L> = Vec<TurnEvent<<L as Landscape>::Point>>;

impl<L: Landscape> RoundContext<'_, L> {
    /// One turn of a chain with a budget of `most` gradients; no events if that is 0.
    pub(in crate::search) fn turn(
        &self,
        chain: &mut Chain<L::Point, L::Memory>,
        most: usize,
    ) -> TurnEvents<L> {
        let mut events = Vec::new();
        if most == 0 {
            return events;
        }
        if self.settings.method == SearchMethod::IteratedLocalSearch {
            self.iterated_turn(chain, most, &mut events);
            return events;
        }
        if chain.descent.is_none() {
            self.begin_descent(chain, &mut events);
        }
        if self.settings.method == SearchMethod::Metropolis {
            self.metropolis_turn(chain, most, &mut events);
        } else {
            self.descend(chain, most, &mut events);
        }
        events
    }

    fn begin_descent(&self, chain: &mut Chain<L::Point, L::Memory>, events: &mut TurnEvents<L>) {
        let started = match (self.settings.method, chain.job) {
            (SearchMethod::BruteForce, None) => None,
            (SearchMethod::BruteForce, Some(job)) => self.start_job(job, &mut chain.random, events),
            _ => self.regenerate(&mut chain.random, events),
        };
        match started {
            Some(started) => {
                chain.descent = Some(ChainDescent::new(started.point.clone(), started.loss));
                events.push(TurnEvent::Started(started));
            }
            None => chain.job = None,
        }
    }

    /// Regeneration, lines 11 to 14 of algorithm 1.
    fn regenerate(
        &self,
        random: &mut Random,
        events: &mut TurnEvents<L>,
    ) -> Option<NewDescent<L::Point>> {
        for _ in 0..MAX_ATTEMPTS {
            match self.try_start(random) {
                Ok(started) => return Some(started),
                Err(error) => events.push(TurnEvent::Refused(error)),
            }
        }
        None
    }

    fn try_start(&self, random: &mut Random) -> Result<NewDescent<L::Point>, MutationError> {
        let anywhere = random.random::<f64>() < self.settings.gamma;
        if anywhere && self.pinned.is_none() && self.weights.of(MutationKind::Global) > 0.0 {
            let point = self.landscape.draw(random)?;
            let (kind, record) = (MutationKind::Global, StructureChange::RandomDraw.into());
            return self.new_descent(
                None,
                MutatedPoint { point, kind, record, log_ratio: None, gradients: 0 },
            );
        }
        let parent = self.choose_parent(random)?;
        let mutated = self.landscape.mutate(&parent.point, self.weights, random)?;
        self.new_descent(Some((parent.number, parent.loss)), mutated)
    }

    /// The point to mutate: the pinned one, or a uniformly random one of the reservoir.
    fn choose_parent(
        &self,
        random: &mut Random,
    ) -> Result<&ReservoirEntry<L::Point>, MutationError> {
        let entries = self.reservoir.entries();
        let any = || (!entries.is_empty()).then(|| &entries[random.random_range(0..entries.len())]);
        let empty = || MutationError::new(MutationKind::Global, Refusal::EmptyReservoir);
        self.pinned.or_else(any).ok_or_else(empty)
    }

    /// Starts the descent of a brute-force job.
    fn start_job(
        &self,
        job: BruteForceJob,
        random: &mut Random,
        events: &mut TurnEvents<L>,
    ) -> Option<NewDescent<L::Point>> {
        let start = self.start;
        let mutated = self.landscape.mutate_at(&start.point, job.element, job.kind, random);
        let started =
            mutated.and_then(|new| self.new_descent(Some((start.number, start.loss)), new));
        started.map_err(|error| events.push(TurnEvent::Refused(error))).ok()
    }

    pub(in crate::search) fn new_descent(
        &self,
        parent: Option<(u64, f64)>,
        new: MutatedPoint<L::Point>,
    ) -> Result<NewDescent<L::Point>, MutationError> {
        let loss = self.landscape.loss(&new.point);
        if !loss.is_finite() {
            return Err(MutationError::new(new.kind, Refusal::NoLoss));
        }
        let (parent, before) = parent.unzip();
        let MutatedPoint { point, kind, record, gradients, .. } = new;
        Ok(NewDescent { parent, kind: Some(kind), record, before, loss, point, gradients })
    }

    /// A local move, and the end of the descent if it ends after it: lines 2 to 8 of algorithm 1.
    fn descend(
        &self,
        chain: &mut Chain<L::Point, L::Memory>,
        most: usize,
        events: &mut TurnEvents<L>,
    ) {
        let Some(descent) = &mut chain.descent else { return };
        let before = descent.loss;
        let left = chain.job.map_or(u64::MAX, |job| job.budget.saturating_sub(descent.gradients));
        let most = most.min(usize::try_from(left).unwrap_or(usize::MAX)).max(1);
        let (point, loss, gradients) =
            self.landscape.descend_within(&descent.point, &mut descent.memory, most);
        descent.moves += 1;
        descent.gradients += gradients as u64;
        descent.move_to(point, loss);
        let (best, gradients) = (descent.best_loss, gradients as u64);
        events.push(TurnEvent::Moved(LocalMove { loss, best, gradients, rejected: false }));
        if let Some(end) = self.descent_end(descent, before, chain.job, &mut chain.random) {
            end_descent(chain, end, events);
        }
    }

    fn descent_end(
        &self,
        descent: &ChainDescent<L::Point, L::Memory>,
        before: f64,
        job: Option<BruteForceJob>,
        random: &mut Random,
    ) -> Option<DescentEnd> {
        let SearchSettings { method, termination, c, longest, .. } = *self.settings;
        // Where no structure may stay, the next mutation is worth more than the next move.
        let is_outside = method == SearchMethod::Restore
            && self.landscape.structure_violation(&descent.point) > 0;
        let chance = termination.chance(self.temperature, c, before, descent.loss);
        if !descent.loss.is_finite() {
            Some(DescentEnd::InfiniteLoss)
        } else if let Some(job) = job {
            // A descent whose moves take no gradients would never use up its budget.
            let spent = descent.gradients >= job.budget || descent.moves >= job.budget;
            spent.then_some(DescentEnd::Budget)
        } else if random.random::<f64>() < chance || is_outside {
            Some(DescentEnd::Regeneration)
        } else {
            (descent.moves >= longest as u64).then_some(DescentEnd::MaxMoves)
        }
    }
}

/// Ends the current descent.
pub(in crate::search) fn end_descent<P: Clone, M>(
    chain: &mut Chain<P, M>,
    end: DescentEnd,
    events: &mut Vec<TurnEvent<P>>,
) {
    chain.job = None;
    if let Some(descent) = chain.descent.take() {
        events.push(TurnEvent::Ended { end, point: descent.best, loss: descent.best_loss });
    }
}
