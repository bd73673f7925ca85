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
    pub(in crate::search) number: u64,
    pub(in crate::search) tour: Option<ChainDescent<P, M>>,
    pub(in crate::search) task: Option<BruteForceJob>,
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
    pub(in crate::search) walk: Option<LangevinState>,
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
        self.number
    }

    /// The current point and its loss; `None` between two descents.
    pub fn position(&self) -> Option<(&P, f64)> {
        self.tour.as_ref().map(|tour| (&tour.point, tour.loss))
    }

    /// The best point of the current descent and its loss; `None` between two descents.
    pub fn best(&self) -> Option<(&P, f64)> {
        self.tour.as_ref().map(|tour| (&tour.best, tour.best_loss))
    }
}

impl<P: Clone, M: Default> ChainDescent<P, M> {
    pub(in crate::search) fn new(point: P, loss: f64) -> Self {
        let best = point.clone();
        let memory = M::default();
        Self { point, loss, memory, best, best_loss: loss, moves: 0, gradients: 0, walk: None }
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
    Ended { ended: DescentEnd, point: P, loss: f64 },
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
        let mut turn = Vec::new();
        if most == 0 {
            return turn;
        }
        if chain.tour.is_none() {
            self.begin_descent(chain, &mut turn);
        }
        match self.settings.method {
            SearchMethod::Metropolis => self.metropolis_turn(chain, most, &mut turn),
            SearchMethod::Restore | SearchMethod::BruteForce => {
                self.descend(chain, most, &mut turn)
            }
        }
        turn
    }

    fn begin_descent(&self, chain: &mut Chain<L::Point, L::Memory>, turn: &mut TurnEvents<L>) {
        let birth = match (self.settings.method, chain.task) {
            (SearchMethod::BruteForce, None) => None,
            (SearchMethod::BruteForce, Some(task)) => self.start_job(task, &mut chain.random, turn),
            _ => self.regenerate(&mut chain.random, turn),
        };
        match birth {
            Some(birth) => {
                chain.tour = Some(ChainDescent::new(birth.point.clone(), birth.loss));
                turn.push(TurnEvent::Started(birth));
            }
            None => chain.task = None,
        }
    }

    /// Regeneration, lines 11 to 14 of algorithm 1.
    fn regenerate(
        &self,
        random: &mut Random,
        turn: &mut TurnEvents<L>,
    ) -> Option<NewDescent<L::Point>> {
        for _ in 0..MAX_ATTEMPTS {
            match self.try_start(random) {
                Ok(birth) => return Some(birth),
                Err(error) => turn.push(TurnEvent::Refused(error)),
            }
        }
        None
    }

    fn try_start(&self, random: &mut Random) -> Result<NewDescent<L::Point>, MutationError> {
        let anywhere = random.random::<f64>() < self.settings.gamma;
        if anywhere && self.pinned.is_none() && self.weights.of(MutationKind::Global) > 0.0 {
            let point = self.landscape.draw(random)?;
            let (kind, record) = (MutationKind::Global, StructureChange::RandomDraw.into());
            return self.new_descent(None, MutatedPoint { point, kind, record, log_ratio: None });
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
        task: BruteForceJob,
        random: &mut Random,
        turn: &mut TurnEvents<L>,
    ) -> Option<NewDescent<L::Point>> {
        let start = self.start;
        let mutated = self.landscape.mutate_at(&start.point, task.element, task.kind, random);
        let birth = mutated.and_then(|new| self.new_descent(Some((start.number, start.loss)), new));
        birth.map_err(|error| turn.push(TurnEvent::Refused(error))).ok()
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
        let MutatedPoint { point, kind, record, .. } = new;
        Ok(NewDescent { parent, kind: Some(kind), record, before, loss, point })
    }

    /// A local move, and the end of the descent if it ends after it: lines 2 to 8 of algorithm 1.
    fn descend(
        &self,
        chain: &mut Chain<L::Point, L::Memory>,
        most: usize,
        turn: &mut TurnEvents<L>,
    ) {
        let Some(tour) = &mut chain.tour else { return };
        let before = tour.loss;
        let left = chain.task.map_or(u64::MAX, |task| task.budget.saturating_sub(tour.gradients));
        let most = most.min(usize::try_from(left).unwrap_or(usize::MAX)).max(1);
        let (point, loss, gradients) =
            self.landscape.descend_within(&tour.point, &mut tour.memory, most);
        tour.moves += 1;
        tour.gradients += gradients as u64;
        tour.move_to(point, loss);
        let (best, gradients) = (tour.best_loss, gradients as u64);
        turn.push(TurnEvent::Moved(LocalMove { loss, best, gradients, rejected: false }));
        if let Some(ended) = self.descent_end(tour, before, chain.task, &mut chain.random) {
            end_descent(chain, ended, turn);
        }
    }

    fn descent_end(
        &self,
        tour: &ChainDescent<L::Point, L::Memory>,
        before: f64,
        task: Option<BruteForceJob>,
        random: &mut Random,
    ) -> Option<DescentEnd> {
        let SearchSettings { termination, c, longest, .. } = *self.settings;
        let chance = termination.chance(self.temperature, c, before, tour.loss);
        if !tour.loss.is_finite() {
            Some(DescentEnd::InfiniteLoss)
        } else if let Some(task) = task {
            // A descent whose moves take no gradients would never use up its budget.
            let spent = tour.gradients >= task.budget || tour.moves >= task.budget;
            spent.then_some(DescentEnd::Budget)
        } else if random.random::<f64>() < chance {
            Some(DescentEnd::Regeneration)
        } else {
            (tour.moves >= longest as u64).then_some(DescentEnd::MaxMoves)
        }
    }
}

/// Ends the current descent.
pub(in crate::search) fn end_descent<P: Clone, M>(
    chain: &mut Chain<P, M>,
    ended: DescentEnd,
    turn: &mut Vec<TurnEvent<P>>,
) {
    chain.task = None;
    if let Some(tour) = chain.tour.take() {
        turn.push(TurnEvent::Ended { ended, point: tour.best, loss: tour.best_loss });
    }
}
