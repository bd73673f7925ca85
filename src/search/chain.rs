//! A chain: one descent after another, each a turn at a time.
//!
//! In its turn a chain reads what all share and changes nothing but itself; what happened is handed
//! back as a list. So chains take their turns at the same time, and the lists are read in the order
//! of the chains.

use super::metropolis::{GradientScale, LangevinState};
use super::reservoir::ReservoirEntry;
use super::{
    DescentEnd, Landscape, MutatedPoint, MutationError, MutationKind, MutationWeights, Random,
    Reservoir, SearchMethod, SearchSettings, Temperature,
};
use rand::RngExt as _;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How often a turn tries to find a point to begin from.
const MAX_ATTEMPTS: usize = 16;

/// One of the chains of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Chain<P, M> {
    pub(super) random: Random,
    /// The generation of the present descent, or of the last one.
    pub(super) number: u64,
    pub(super) tour: Option<ChainDescent<P, M>>,
    pub(super) task: Option<BruteForceJob>,
    pub(super) scales: BTreeMap<String, GradientScale>,
}

/// A descent that goes on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChainDescent<P, M> {
    pub(super) point: P,
    pub(super) loss: f64,
    pub(super) memory: M,
    pub(super) best: P,
    pub(super) best_loss: f64,
    pub(super) moves: u64,
    pub(super) gradients: u64,
    pub(super) walk: Option<LangevinState>,
}

/// A mutation that brute force descends from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct BruteForceJob {
    pub(super) element: usize,
    pub(super) kind: MutationKind,
    /// Gradients of its descent.
    pub(super) budget: u64,
}

impl<P: Clone, M> Chain<P, M> {
    /// The generation that it descends from, or last did.
    pub fn generation(&self) -> u64 {
        self.number
    }

    /// Where it is, and the loss there; none while it waits for its next start.
    pub fn position(&self) -> Option<(&P, f64)> {
        self.tour.as_ref().map(|tour| (&tour.point, tour.loss))
    }

    /// The best point of its present descent, and the loss there.
    pub fn best(&self) -> Option<(&P, f64)> {
        self.tour.as_ref().map(|tour| (&tour.best, tour.best_loss))
    }
}

impl<P: Clone, M: Default> ChainDescent<P, M> {
    pub(super) fn new(point: P, loss: f64) -> Self {
        let best = point.clone();
        let memory = M::default();
        Self { point, loss, memory, best, best_loss: loss, moves: 0, gradients: 0, walk: None }
    }

    /// Goes to a point, which may be worth nothing.
    pub(super) fn move_to(&mut self, point: P, loss: f64) {
        if loss < self.best_loss {
            self.best = point.clone();
            self.best_loss = loss;
        }
        self.point = point;
        self.loss = loss;
    }
}

/// What all chains share in a round.
#[derive(Debug)]
pub(super) struct RoundContext<'a, L: Landscape> {
    pub(super) landscape: &'a L,
    pub(super) settings: &'a SearchSettings,
    pub(super) temperature: Temperature,
    pub(super) weights: &'a MutationWeights,
    pub(super) start: &'a ReservoirEntry<L::Point>,
    pub(super) reservoir: &'a Reservoir<L::Point>,
    pub(super) pinned: Option<&'a ReservoirEntry<L::Point>>,
}

/// What happened in a turn.
#[derive(Debug)]
pub(super) enum TurnEvent<P> {
    /// A mutation does not apply.
    Refused(MutationError),
    /// A mutation was not accepted.
    Rejected(MutationKind),
    /// A descent began.
    Started(NewDescent<P>),
    /// The descent went on.
    Moved(LocalMove),
    /// The descent ended, with this best point.
    Ended { ended: DescentEnd, point: P, loss: f64 },
}

/// Where a descent begins.
#[derive(Debug)]
pub(super) struct NewDescent<P> {
    pub(super) parent: Option<u64>,
    pub(super) kind: Option<MutationKind>,
    pub(super) what: String,
    pub(super) before: Option<f64>,
    pub(super) loss: f64,
    pub(super) point: P,
}

/// A local move.
#[derive(Debug, Clone, Copy)]
pub(super) struct LocalMove {
    pub(super) loss: f64,
    pub(super) best: f64,
    pub(super) gradients: u64,
    /// Whether a Langevin step was not accepted.
    pub(super) rejected: bool,
}

/// Everything that happened in a turn, in order.
pub(super) type TurnEvents<L> = Vec<TurnEvent<<L as Landscape>::Point>>;

impl<L: Landscape> RoundContext<'_, L> {
    /// One turn of a chain, of no more than so many gradients; nothing where it has none.
    pub(super) fn turn(
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
            SearchMethod::Restore | SearchMethod::Brute => self.descend(chain, most, &mut turn),
        }
        turn
    }

    fn begin_descent(&self, chain: &mut Chain<L::Point, L::Memory>, turn: &mut TurnEvents<L>) {
        let birth = match (self.settings.method, chain.task) {
            (SearchMethod::Brute, None) => None,
            (SearchMethod::Brute, Some(task)) => self.start_job(task, &mut chain.random, turn),
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

    /// A new start: lines 11 to 14 of algorithm 1.
    fn regenerate(
        &self,
        random: &mut Random,
        turn: &mut TurnEvents<L>,
    ) -> Option<NewDescent<L::Point>> {
        for _ in 0..MAX_ATTEMPTS {
            match self.try_start(random) {
                Ok(birth) => return Some(birth),
                Err(refusal) => turn.push(TurnEvent::Refused(refusal)),
            }
        }
        None
    }

    fn try_start(&self, random: &mut Random) -> Result<NewDescent<L::Point>, MutationError> {
        let anywhere = random.random::<f64>() < self.settings.gamma;
        if anywhere && self.pinned.is_none() && self.weights.of(MutationKind::Global) > 0.0 {
            let point = self.landscape.draw(random)?;
            let what = "drawn from anywhere".to_owned();
            let drawn = MutatedPoint { point, kind: MutationKind::Global, what, log_ratio: None };
            return self.new_descent(None, drawn);
        }
        let parent = self.choose_parent(random)?;
        let mutated = self.landscape.mutate(&parent.point, self.weights, random)?;
        self.new_descent(Some((parent.number, parent.loss)), mutated)
    }

    /// What is mutated: the pinned point, or any of the reservoir, one as likely as the other.
    fn choose_parent(
        &self,
        random: &mut Random,
    ) -> Result<&ReservoirEntry<L::Point>, MutationError> {
        let entries = self.reservoir.entries();
        let any = || (!entries.is_empty()).then(|| &entries[random.random_range(0..entries.len())]);
        let empty = || MutationError {
            kind: MutationKind::Global,
            why: "the reservoir is empty".to_owned(),
        };
        self.pinned.or_else(any).ok_or_else(empty)
    }

    /// The mutation that brute force gave to a chain.
    fn start_job(
        &self,
        task: BruteForceJob,
        random: &mut Random,
        turn: &mut TurnEvents<L>,
    ) -> Option<NewDescent<L::Point>> {
        let start = self.start;
        let mutated = self.landscape.mutate_at(&start.point, task.element, task.kind, random);
        let birth = mutated.and_then(|new| self.new_descent(Some((start.number, start.loss)), new));
        birth.map_err(|refusal| turn.push(TurnEvent::Refused(refusal))).ok()
    }

    pub(super) fn new_descent(
        &self,
        parent: Option<(u64, f64)>,
        new: MutatedPoint<L::Point>,
    ) -> Result<NewDescent<L::Point>, MutationError> {
        let loss = self.landscape.loss(&new.point);
        if !loss.is_finite() {
            let why = "the loss behind it is no number".to_owned();
            return Err(MutationError { kind: new.kind, why });
        }
        let (parent, before) = parent.unzip();
        let MutatedPoint { point, kind, what, .. } = new;
        Ok(NewDescent { parent, kind: Some(kind), what, before, loss, point })
    }

    /// A local move, and whether the descent ends behind it: lines 2 to 8 of algorithm 1.
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
            Some(DescentEnd::Lost)
        } else if let Some(task) = task {
            // A descent without gradients would never use its part up.
            let spent = tour.gradients >= task.budget || tour.moves >= task.budget;
            spent.then_some(DescentEnd::Budget)
        } else if random.random::<f64>() < chance {
            Some(DescentEnd::Clock)
        } else {
            (tour.moves >= longest as u64).then_some(DescentEnd::Longest)
        }
    }
}

/// Ends the present descent.
pub(super) fn end_descent<P: Clone, M>(
    chain: &mut Chain<P, M>,
    ended: DescentEnd,
    turn: &mut Vec<TurnEvent<P>>,
) {
    chain.task = None;
    if let Some(tour) = chain.tour.take() {
        turn.push(TurnEvent::Ended { ended, point: tour.best, loss: tour.best_loss });
    }
}
