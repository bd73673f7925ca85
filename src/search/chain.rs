//! A chain: one descent after another, each a turn at a time.
//!
//! In its turn a chain reads what all share and changes nothing but itself; what happened is handed
//! back as a list. So chains take their turns at the same time, and the lists are read in the order
//! of the chains.

use super::metropolis::{Scale, Walk};
use super::reservoir::Entry;
use super::{
    Ended, Kind, Landscape, Method, Mutated, Random, Refusal, Reservoir, Settings, Temperature,
    Weights,
};
use rand::RngExt as _;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How often a turn tries to find a point to begin from.
const ATTEMPTS: usize = 16;

/// One of the chains of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Chain<P, M> {
    pub(super) random: Random,
    /// The generation of the present descent, or of the last one.
    pub(super) number: u64,
    pub(super) tour: Option<Tour<P, M>>,
    pub(super) task: Option<Task>,
    pub(super) scales: BTreeMap<String, Scale>,
}

/// A descent that goes on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Tour<P, M> {
    pub(super) point: P,
    pub(super) loss: f64,
    pub(super) memory: M,
    pub(super) best: P,
    pub(super) best_loss: f64,
    pub(super) moves: u64,
    pub(super) gradients: u64,
    pub(super) walk: Option<Walk>,
}

/// A mutation that brute force descends from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Task {
    pub(super) element: usize,
    pub(super) kind: Kind,
    /// Gradients of its descent.
    pub(super) budget: u64,
}

impl<P: Clone, M> Chain<P, M> {
    /// The generation that it descends from, or last did.
    pub fn number(&self) -> u64 {
        self.number
    }

    /// Where it is, and the loss there; none while it waits for its next start.
    pub fn place(&self) -> Option<(&P, f64)> {
        self.tour.as_ref().map(|tour| (&tour.point, tour.loss))
    }

    /// The best point of its present descent, and the loss there.
    pub fn best(&self) -> Option<(&P, f64)> {
        self.tour.as_ref().map(|tour| (&tour.best, tour.best_loss))
    }
}

impl<P: Clone, M: Default> Tour<P, M> {
    pub(super) fn new(point: P, loss: f64) -> Self {
        let best = point.clone();
        let memory = M::default();
        Self { point, loss, memory, best, best_loss: loss, moves: 0, gradients: 0, walk: None }
    }

    /// Goes to a point, which may be worth nothing.
    pub(super) fn go(&mut self, point: P, loss: f64) {
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
pub(super) struct Shared<'a, L: Landscape> {
    pub(super) landscape: &'a L,
    pub(super) settings: &'a Settings,
    pub(super) temperature: Temperature,
    pub(super) weights: &'a Weights,
    pub(super) start: &'a Entry<L::Point>,
    pub(super) reservoir: &'a Reservoir<L::Point>,
    pub(super) pinned: Option<&'a Entry<L::Point>>,
}

/// What happened in a turn.
#[derive(Debug)]
pub(super) enum Happening<P> {
    /// A mutation does not apply.
    Refused(Refusal),
    /// A mutation was not accepted.
    Rejected(Kind),
    /// A descent began.
    Born(Birth<P>),
    /// The descent went on.
    Moved(Moved),
    /// The descent ended, with this best point.
    Ended { ended: Ended, point: P, loss: f64 },
}

/// Where a descent begins.
#[derive(Debug)]
pub(super) struct Birth<P> {
    pub(super) parent: Option<u64>,
    pub(super) kind: Option<Kind>,
    pub(super) what: String,
    pub(super) before: Option<f64>,
    pub(super) loss: f64,
    pub(super) point: P,
}

/// A local move.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moved {
    pub(super) loss: f64,
    pub(super) best: f64,
    pub(super) gradients: u64,
    /// Whether a Langevin step was not accepted.
    pub(super) rejected: bool,
}

/// Everything that happened in a turn, in order.
pub(super) type Turn<L> = Vec<Happening<<L as Landscape>::Point>>;

impl<L: Landscape> Shared<'_, L> {
    /// One turn of a chain, of no more than so many gradients; nothing where it has none.
    pub(super) fn turn(&self, chain: &mut Chain<L::Point, L::Memory>, most: usize) -> Turn<L> {
        let mut turn = Vec::new();
        if most == 0 {
            return turn;
        }
        if chain.tour.is_none() {
            self.begin(chain, &mut turn);
        }
        match self.settings.method {
            Method::Metropolis => self.walk(chain, most, &mut turn),
            Method::Restore | Method::Brute => self.descend(chain, most, &mut turn),
        }
        turn
    }

    fn begin(&self, chain: &mut Chain<L::Point, L::Memory>, turn: &mut Turn<L>) {
        let birth = match (self.settings.method, chain.task) {
            (Method::Brute, None) => None,
            (Method::Brute, Some(task)) => self.given(task, &mut chain.random, turn),
            _ => self.regenerate(&mut chain.random, turn),
        };
        match birth {
            Some(birth) => {
                chain.tour = Some(Tour::new(birth.point.clone(), birth.loss));
                turn.push(Happening::Born(birth));
            }
            None => chain.task = None,
        }
    }

    /// A new start: lines 11 to 14 of algorithm 1.
    fn regenerate(&self, random: &mut Random, turn: &mut Turn<L>) -> Option<Birth<L::Point>> {
        for _ in 0..ATTEMPTS {
            match self.attempt(random) {
                Ok(birth) => return Some(birth),
                Err(refusal) => turn.push(Happening::Refused(refusal)),
            }
        }
        None
    }

    fn attempt(&self, random: &mut Random) -> Result<Birth<L::Point>, Refusal> {
        let anywhere = random.random::<f64>() < self.settings.gamma;
        if anywhere && self.pinned.is_none() && self.weights.of(Kind::Global) > 0.0 {
            let point = self.landscape.draw(random)?;
            let what = "drawn from anywhere".to_owned();
            let drawn = Mutated { point, kind: Kind::Global, what, log_ratio: None };
            return self.birth(None, drawn);
        }
        let parent = self.parent(random)?;
        let mutated = self.landscape.mutate(&parent.point, self.weights, random)?;
        self.birth(Some((parent.number, parent.loss)), mutated)
    }

    /// What is mutated: the pinned point, or any of the reservoir, one as likely as the other.
    fn parent(&self, random: &mut Random) -> Result<&Entry<L::Point>, Refusal> {
        let entries = self.reservoir.entries();
        let any = || (!entries.is_empty()).then(|| &entries[random.random_range(0..entries.len())]);
        let empty = || Refusal { kind: Kind::Global, why: "the reservoir is empty".to_owned() };
        self.pinned.or_else(any).ok_or_else(empty)
    }

    /// The mutation that brute force gave to a chain.
    fn given(
        &self,
        task: Task,
        random: &mut Random,
        turn: &mut Turn<L>,
    ) -> Option<Birth<L::Point>> {
        let start = self.start;
        let mutated = self.landscape.mutate_at(&start.point, task.element, task.kind, random);
        let birth = mutated.and_then(|new| self.birth(Some((start.number, start.loss)), new));
        birth.map_err(|refusal| turn.push(Happening::Refused(refusal))).ok()
    }

    pub(super) fn birth(
        &self,
        parent: Option<(u64, f64)>,
        new: Mutated<L::Point>,
    ) -> Result<Birth<L::Point>, Refusal> {
        let loss = self.landscape.loss(&new.point);
        if !loss.is_finite() {
            let why = "the loss behind it is no number".to_owned();
            return Err(Refusal { kind: new.kind, why });
        }
        let (parent, before) = parent.unzip();
        let Mutated { point, kind, what, .. } = new;
        Ok(Birth { parent, kind: Some(kind), what, before, loss, point })
    }

    /// A local move, and whether the descent ends behind it: lines 2 to 8 of algorithm 1.
    fn descend(&self, chain: &mut Chain<L::Point, L::Memory>, most: usize, turn: &mut Turn<L>) {
        let Some(tour) = &mut chain.tour else { return };
        let before = tour.loss;
        let left = chain.task.map_or(u64::MAX, |task| task.budget.saturating_sub(tour.gradients));
        let most = most.min(usize::try_from(left).unwrap_or(usize::MAX)).max(1);
        let (point, loss, gradients) =
            self.landscape.descend_within(&tour.point, &mut tour.memory, most);
        tour.moves += 1;
        tour.gradients += gradients as u64;
        tour.go(point, loss);
        let (best, gradients) = (tour.best_loss, gradients as u64);
        turn.push(Happening::Moved(Moved { loss, best, gradients, rejected: false }));
        if let Some(ended) = self.ended(tour, before, chain.task, &mut chain.random) {
            end(chain, ended, turn);
        }
    }

    fn ended(
        &self,
        tour: &Tour<L::Point, L::Memory>,
        before: f64,
        task: Option<Task>,
        random: &mut Random,
    ) -> Option<Ended> {
        let Settings { termination, c, longest, .. } = *self.settings;
        let chance = termination.chance(self.temperature, c, before, tour.loss);
        if !tour.loss.is_finite() {
            Some(Ended::Lost)
        } else if let Some(task) = task {
            // A descent without gradients would never use its part up.
            let spent = tour.gradients >= task.budget || tour.moves >= task.budget;
            spent.then_some(Ended::Budget)
        } else if random.random::<f64>() < chance {
            Some(Ended::Clock)
        } else {
            (tour.moves >= longest as u64).then_some(Ended::Longest)
        }
    }
}

/// Ends the present descent.
pub(super) fn end<P: Clone, M>(
    chain: &mut Chain<P, M>,
    ended: Ended,
    turn: &mut Vec<Happening<P>>,
) {
    chain.task = None;
    if let Some(tour) = chain.tour.take() {
        turn.push(Happening::Ended { ended, point: tour.best, loss: tour.best_loss });
    }
}
