//! A search run: chains over a shared reservoir, advanced one round at a time.
//!
//! In a round all chains take their turns in parallel, reading the reservoir of the previous round;
//! then their events are applied in the order of the chains. So a run is a function of its
//! landscape, start and settings, on any number of threads.

use super::chain::{
    BruteForceJob, Chain, ChainDescent, LocalMove, NewDescent, RoundContext, TurnEvent,
};
use super::race::Race;
use super::{SearchMethod, SearchSettings, Temperature};
use crate::search::{
    Landscape, Lineage, LineageNode, MutationKind, MutationWeights, Random, Reservoir,
    ReservoirEntry, SearchError, SearchPoint, SearchStatistics, StructureChange,
};
use rand::SeedableRng as _;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, VecDeque};
use std::ops::ControlFlow;

/// The number of consecutive rounds without a move that ends a run.
const MAX_IDLE_ROUNDS: u64 = 100;

/// The run of a search on a landscape.
pub type SearchRunOn<L> = SearchRun<<L as Landscape>::Point, <L as Landscape>::Memory>;

/// The complete state of a search, except for its landscape.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SearchRun<P, M> {
    pub(in crate::search) settings: SearchSettings,
    pub(in crate::search) temperature: Temperature,
    pub(in crate::search) weights: MutationWeights,
    pub(in crate::search) pinned: Option<ReservoirEntry<P>>,
    pub(in crate::search) stopped: bool,
    pub(in crate::search) chains: Vec<Chain<P, M>>,
    #[serde(rename = "tree")]
    pub(in crate::search) lineage: Lineage<P>,
    pub(in crate::search) start: ReservoirEntry<P>,
    pub(in crate::search) best: ReservoirEntry<P>,
    pub(in crate::search) reservoir: Reservoir<P>,
    pub(in crate::search) statistics: SearchStatistics,
    #[serde(rename = "tasks")]
    jobs: VecDeque<BruteForceJob>,
    /// The state of an iterated local search; `None` for the other methods.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(in crate::search) race: Option<Race>,
}

/// An event of a round.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SearchEvent {
    /// This generation began its descent.
    Started(u64),
    /// The descent of this generation ended.
    Ended(u64),
    /// This generation reached the best loss so far.
    NewBest(u64),
}

/// A point of the result of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoundPoint<'a, P> {
    /// The point and its loss.
    pub entry: &'a ReservoirEntry<P>,
    /// True while its descent is in progress: only completed descents enter the reservoir.
    pub running: bool,
}

/// The reason for the end of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RunEnd {
    /// It was stopped by the user.
    Stopped,
    /// The maximum number of local moves was reached.
    Moves,
    /// The maximum number of gradients was reached.
    Gradients,
    /// All brute-force jobs are done.
    Done,
    /// In a hundred rounds no descent could be started, or none could compute a gradient.
    Stuck,
}

impl<P: SearchPoint, M: SearchPoint + Default> SearchRun<P, M> {
    /// Creates a run.
    ///
    /// The first chain descends from the start, every other one from a mutation of it; all chains
    /// of Metropolis–Hastings begin at the start. In an iterated local search the first chain holds the
    /// best point, and the others are the trials.
    ///
    /// # Errors
    /// A setting is invalid, or the start has no finite loss.
    pub fn new<L>(landscape: &L, start: P, settings: &SearchSettings) -> Result<Self, SearchError>
    where
        L: Landscape<Point = P, Memory = M>,
    {
        settings.check()?;
        let loss = landscape.loss(&start);
        if !loss.is_finite() {
            return Err(SearchError::InvalidStart { loss });
        }
        let jobs = brute_force_jobs(landscape.element_count(&start), settings);
        let start = ReservoirEntry::new(landscape, 0, loss, start);
        let mut reservoir =
            Reservoir::new(settings.reservoir_capacity(), settings.one_per_topology);
        let offer = reservoir.offer(start.clone());
        let mut run = Self {
            temperature: settings.temperature.unwrap_or(Temperature::at_half_density(loss)),
            weights: MutationWeights::default(),
            pinned: None,
            stopped: false,
            chains: new_chains(settings),
            lineage: Lineage::new(settings.remembered),
            best: start.clone(),
            reservoir,
            statistics: SearchStatistics::default(),
            jobs,
            race: (settings.method == SearchMethod::IteratedLocalSearch).then(|| Race::new(loss)),
            settings: settings.clone(),
            start,
        };
        run.lineage
            .add(LineageNode { offer: Some(offer), ..run.new_node(0, run.descent_from_start()) });
        run.start_chains();
        Ok(run)
    }

    /// The settings.
    pub fn settings(&self) -> &SearchSettings {
        &self.settings
    }

    /// The current temperature.
    pub fn temperature(&self) -> Temperature {
        self.temperature
    }

    /// The relative frequencies of the kinds of mutation, which multiply those of the landscape.
    pub fn weights(&self) -> &MutationWeights {
        &self.weights
    }

    /// The point that all regenerations mutate; `None` if they mutate points of the reservoir.
    pub fn pinned(&self) -> Option<&ReservoirEntry<P>> {
        self.pinned.as_ref()
    }

    /// The start.
    pub fn start(&self) -> &ReservoirEntry<P> {
        &self.start
    }

    /// The best point so far, including descents in progress.
    pub fn best(&self) -> &ReservoirEntry<P> {
        &self.best
    }

    /// The best points of completed descents.
    pub fn reservoir(&self) -> &Reservoir<P> {
        &self.reservoir
    }

    /// The result so far, best first: the points of the reservoir, preceded by the best point if
    /// its descent is still in progress.
    pub fn found_points(&self) -> Vec<FoundPoint<'_, P>> {
        let entries = self.reservoir.entries();
        let running = entries.iter().all(|entry| self.best.is_better_than(entry));
        let mut found: Vec<_> =
            entries.iter().map(|entry| FoundPoint { entry, running: false }).collect();
        found.sort_by(|a, b| a.entry.rank(b.entry));
        if running {
            found.insert(0, FoundPoint { entry: &self.best, running });
        }
        found
    }

    /// The lineage.
    pub fn lineage(&self) -> &Lineage<P> {
        &self.lineage
    }

    /// The chains.
    pub fn chains(&self) -> &[Chain<P, M>] {
        &self.chains
    }

    /// The counters of the run.
    pub fn statistics(&self) -> &SearchStatistics {
        &self.statistics
    }

    /// The reason for the end of the run; `None` while it can continue.
    pub fn end_reason(&self) -> Option<RunEnd> {
        let reached = |limit: Option<u64>, count| limit.is_some_and(|limit| count >= limit);
        let SearchSettings { method, moves, gradients, .. } = self.settings;
        let waits = |chain: &Chain<P, M>| chain.descent.is_none() && chain.job.is_none();
        if self.stopped {
            Some(RunEnd::Stopped)
        } else if method == SearchMethod::BruteForce
            && self.jobs.is_empty()
            && self.chains.iter().all(waits)
        {
            Some(RunEnd::Done)
        } else if reached(moves, self.statistics.moves) {
            Some(RunEnd::Moves)
        } else if method != SearchMethod::BruteForce
            && reached(gradients, self.statistics.gradients)
        {
            Some(RunEnd::Gradients)
        } else {
            (self.statistics.idle >= MAX_IDLE_ROUNDS).then_some(RunEnd::Stuck)
        }
    }

    /// Advances every chain by one turn; does nothing if the run has ended.
    pub fn round<L>(&mut self, landscape: &L) -> Vec<SearchEvent>
    where
        L: Landscape<Point = P, Memory = M>,
    {
        if self.end_reason().is_some() {
            return Vec::new();
        }
        self.assign_jobs();
        let shares = self.gradient_budgets();
        let weights = self.race.as_ref().map(|race| race.weights(&self.weights));
        let context = RoundContext {
            landscape,
            settings: &self.settings,
            temperature: self.temperature,
            weights: weights.as_ref().unwrap_or(&self.weights),
            start: &self.start,
            reservoir: &self.reservoir,
            pinned: self.pinned.as_ref(),
            parents: self.parents(landscape),
        };
        let chains = self.chains.par_iter_mut().zip(shares);
        let turns: Vec<_> = chains.map(|(chain, most)| context.turn(chain, most)).collect();
        let is_progress = |m: &LocalMove| m.gradients > 0 || m.loss.is_finite();
        let moved = turns
            .iter()
            .flatten()
            .any(|event| matches!(event, TurnEvent::Moved(local_move) if is_progress(local_move)));
        let mut events = Vec::new();
        let before = self.statistics.gradients;
        for (chain, turn) in turns.into_iter().enumerate() {
            for event in turn {
                self.record(chain, event, landscape, &mut events);
            }
            self.update_best_from_chain(chain, landscape, &mut events);
        }
        self.statistics.rounds += 1;
        self.statistics.idle = self.idle_rounds(moved);
        self.advance_race(landscape, self.statistics.gradients - before, &mut events);
        self.prune_lineage();
        events
    }

    /// Advances the run until it ends or `watch` breaks, which is called after every round with the
    /// events of the round. The end of the run takes precedence over a break in the same round.
    pub fn advance<L, B>(
        &mut self,
        landscape: &L,
        mut watch: impl FnMut(&Self, &[SearchEvent]) -> ControlFlow<B>,
    ) -> ControlFlow<B, RunEnd>
    where
        L: Landscape<Point = P, Memory = M>,
    {
        loop {
            if let Some(end) = self.end_reason() {
                return ControlFlow::Continue(end);
            }
            let events = self.round(landscape);
            let flow = watch(self, &events);
            if self.end_reason().is_none() {
                flow?;
            }
        }
    }

    /// The gradient budget of each chain in its turn: for those that take one an equal part of the
    /// remaining gradients, far more than a turn takes except in the last rounds. Brute force has divided the gradients
    /// among its jobs.
    fn gradient_budgets(&self) -> Vec<usize> {
        let SearchSettings { method, gradients, .. } = self.settings;
        let limit = gradients.filter(|_| method != SearchMethod::BruteForce);
        let left = limit.map_or(u64::MAX, |limit| limit.saturating_sub(self.statistics.gradients));
        let active = self.active_chains();
        let count = active.iter().filter(|active| **active).count().max(1) as u64;
        let share = |i: u64| left / count + u64::from(i < left % count);
        let mut shares = (0..count).map(|i| usize::try_from(share(i)).unwrap_or(usize::MAX));
        let budget = |active: bool| if active { shares.next().unwrap_or(0) } else { 0 };
        active.into_iter().map(budget).collect()
    }

    /// The lineage node of a new descent.
    pub(in crate::search) fn new_node(&self, chain: usize, start: NewDescent<P>) -> LineageNode<P> {
        let NewDescent { parent, kind, record, before, loss, point, .. } = start;
        LineageNode {
            number: self.lineage.total(),
            parent,
            chain,
            kind,
            mutation: record,
            loss_before: before,
            start_loss: loss,
            best_loss: loss,
            moves: 0,
            gradients: 0,
            end: None,
            offer: None,
            point,
        }
    }

    fn descent_from_start(&self) -> NewDescent<P> {
        let (loss, point) = (self.start.loss, self.start.point.clone());
        NewDescent {
            parent: None,
            kind: None,
            record: StructureChange::Start.into(),
            before: None,
            loss,
            point,
            gradients: 0,
        }
    }

    /// Starts the chains that begin at the start.
    fn start_chains(&mut self) {
        let count = match self.settings.method {
            SearchMethod::Restore | SearchMethod::IteratedLocalSearch => 1,
            SearchMethod::Metropolis => self.chains.len(),
            SearchMethod::BruteForce => 0,
        };
        for i in 0..count {
            if i > 0 {
                self.chains[i].generation =
                    self.lineage.add(self.new_node(i, self.descent_from_start()));
            }
            self.chains[i].descent =
                Some(ChainDescent::new(self.start.point.clone(), self.start.loss));
        }
    }

    fn assign_jobs(&mut self) {
        for chain in &mut self.chains {
            if chain.descent.is_none() && chain.job.is_none() {
                chain.job = self.jobs.pop_front();
            }
        }
    }
}

/// The chains, each with its own random number generator, far apart in one sequence.
fn new_chains<P, M>(settings: &SearchSettings) -> Vec<Chain<P, M>> {
    let mut random = Random::seed_from_u64(settings.seed);
    let mut next = || {
        random.long_jump();
        Chain {
            random: random.clone(),
            generation: 0,
            descent: None,
            job: None,
            scales: BTreeMap::new(),
        }
    };
    (0..settings.chain_count()).map(|_| next()).collect()
}

/// The jobs of brute force, which divide the gradients by twice the number of elements.
fn brute_force_jobs(elements: usize, settings: &SearchSettings) -> VecDeque<BruteForceJob> {
    let Some(gradients) =
        settings.gradients.filter(|_| settings.method == SearchMethod::BruteForce)
    else {
        return VecDeque::new();
    };
    let budget = (gradients / (2 * elements.max(1) as u64)).max(1);
    let kinds = [MutationKind::AddSinglet, MutationKind::RemoveSinglet];
    let each = |element| kinds.map(|kind| BruteForceJob { element, kind, budget });
    // If there are fewer gradients than jobs, the last jobs are dropped.
    let most = usize::try_from(gradients).unwrap_or(usize::MAX);
    (0..elements).flat_map(each).take(most).collect()
}
