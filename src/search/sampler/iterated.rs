//! Iterated local search: the turns of its chains, and what follows from them after a round.

use super::SearchRun;
use super::chain::{
    Chain, ChainDescent, LocalMove, NewDescent, RoundContext, TurnEvent, TurnEvents, end_descent,
};
use super::race::{Perturbation, Race, RaceStage};
use crate::search::{
    DescentEnd, Landscape, MutationError, MutationKind, Random, Refusal, ReservoirEntry,
    SearchEvent, SearchPoint,
};
use rand::RngExt as _;

/// Attempts per turn to find a mutation that applies.
const MAX_ATTEMPTS: usize = 16;
/// The number of points that are mutated: the best one, and the best ones of other structures.
const MAX_PARENTS: usize = 4;
/// The gradients of a trial, those of a challenger divided among all of them.
const TRIAL_GRADIENTS: u64 = 40;

impl<L: Landscape> RoundContext<'_, L> {
    /// One turn: a local move, from a mutation if the chain has no descent.
    pub(super) fn iterated_turn(
        &self,
        chain: &mut Chain<L::Point, L::Memory>,
        most: usize,
        events: &mut TurnEvents<L>,
    ) {
        if chain.descent.is_none() {
            let Some(started) = self.perturb(&mut chain.random, events) else { return };
            chain.descent = Some(ChainDescent::new(started.point.clone(), started.loss));
            events.push(TurnEvent::Started(started));
        }
        let Some(descent) = &mut chain.descent else { return };
        let (point, loss, gradients) =
            self.landscape.descend_within(&descent.point, &mut descent.memory, most);
        let gradients = gradients as u64;
        descent.moves += 1;
        descent.gradients += gradients;
        descent.move_to(point, loss);
        let best = descent.best_loss;
        events.push(TurnEvent::Moved(LocalMove { loss, best, gradients, rejected: false }));
    }

    /// A mutation of one of the parents.
    fn perturb(
        &self,
        random: &mut Random,
        events: &mut TurnEvents<L>,
    ) -> Option<NewDescent<L::Point>> {
        for _ in 0..MAX_ATTEMPTS {
            match self.try_perturbation(random) {
                Ok(started) => return Some(started),
                Err(error) => events.push(TurnEvent::Refused(error)),
            }
        }
        None
    }

    fn try_perturbation(&self, random: &mut Random) -> Result<NewDescent<L::Point>, MutationError> {
        let empty = || MutationError::new(MutationKind::Global, Refusal::EmptyReservoir);
        let parent = self.draw_parent(random).ok_or_else(empty)?;
        let mutated = self.landscape.perturb(&parent.point, self.weights, random)?;
        self.new_descent(Some((parent.number, parent.loss)), mutated)
    }

    /// One of the parents, which are ordered from the best to the worst: the one at rank n, from 1 on,
    /// with a probability in proportion to 1/n².
    fn draw_parent(&self, random: &mut Random) -> Option<&ReservoirEntry<L::Point>> {
        let weight = |rank: usize| 1.0 / ((rank + 1) * (rank + 1)) as f64;
        let sum: f64 = (0..self.parents.len()).map(weight).sum();
        let mut left = random.random::<f64>() * sum;
        let mut ranked = self.parents.iter().enumerate();
        let drawn = ranked.find(|(rank, _)| {
            left -= weight(*rank);
            left < 0.0
        });
        drawn.map(|(_, parent)| parent).or(self.parents.last())
    }
}

/// True if a descent has ended by itself at the best of its points.
fn has_ended<L: Landscape>(descent: &ChainDescent<L::Point, L::Memory>, landscape: &L) -> bool {
    descent.point == descent.best && landscape.has_ended(&descent.memory)
}

impl<P: SearchPoint, M: SearchPoint + Default> SearchRun<P, M> {
    /// For each chain, true if it takes a turn in the next round.
    pub(super) fn active_chains(&self) -> Vec<bool> {
        let all = 0..self.chains.len();
        let Some(race) = &self.race else { return vec![true; self.chains.len()] };
        let is_active = |i: usize| match race.stage {
            RaceStage::Best => i == 0,
            RaceStage::Trials(0) => (1..=self.trial_count(race.perturbation)).contains(&i),
            RaceStage::Trials(_) => i > 0 && self.chains[i].descent.is_some(),
            RaceStage::Challenger(chain) => i == chain,
        };
        all.map(is_active).collect()
    }

    /// The number of trials of a race.
    fn trial_count(&self, perturbation: Perturbation) -> usize {
        match perturbation {
            Perturbation::Mutants => self.settings.trials,
            Perturbation::SingleMutant | Perturbation::Displacement => 1,
        }
    }

    /// The perturbation of the next race: the one that has gained most by gradient, of those that the landscape
    /// has. No displacement leads from a structure that is not permitted to one that is.
    fn next_perturbation<L>(&self, race: &Race, landscape: &L) -> Perturbation
    where
        L: Landscape<Point = P, Memory = M>,
    {
        let is_drawn = |kind: &MutationKind| landscape.weight(*kind) * self.weights.of(*kind) > 0.0;
        let best = self.chains[0].best();
        let is_outside = best.is_some_and(|(point, _)| landscape.structure_violation(point) > 0);
        let is_possible = |perturbation: &Perturbation| {
            let mut kinds = MutationKind::PERTURBATIONS.into_iter();
            kinds.any(|kind| perturbation.includes(kind) && is_drawn(&kind))
                && !(is_outside && *perturbation == Perturbation::Displacement)
        };
        let possible = Perturbation::ALL.into_iter().filter(is_possible);
        let fastest = possible.reduce(|a, b| if race.rate(b) > race.rate(a) { b } else { a });
        fastest.unwrap_or_default()
    }

    /// The points that are mutated in the next round, the best one first: the pinned one alone, the best
    /// one alone where it is displaced, or the best one, the best ones of other structures, and another
    /// minimum of its own.
    pub(super) fn parents<L>(&self, landscape: &L) -> Vec<ReservoirEntry<P>>
    where
        L: Landscape<Point = P, Memory = M>,
    {
        let at_start = |race: &&Race| race.stage == RaceStage::Trials(0);
        let Some(race) = self.race.as_ref().filter(at_start) else { return Vec::new() };
        if let Some(pinned) = &self.pinned {
            return vec![pinned.clone()];
        }
        let Some(best) = self.entry_of(0, landscape) else { return Vec::new() };
        if race.perturbation == Perturbation::Displacement {
            return vec![best];
        }
        let mut entries = self.reservoir.entries().to_vec();
        entries.sort_by(ReservoirEntry::rank);
        let mut parents = vec![best];
        for entry in &entries {
            let is_other = parents.iter().all(|parent| parent.topology != entry.topology);
            if is_other && parents.len() < MAX_PARENTS {
                parents.push(entry.clone());
            }
        }
        // Another minimum of the best structure where there are few structures.
        if parents.len() < MAX_PARENTS {
            let is_twin = |entry: &&ReservoirEntry<P>| entry.topology == parents[0].topology;
            let apart = |entry: &&ReservoirEntry<P>| {
                !landscape.is_same_minimum(&entry.point, &parents[0].point)
            };
            let twin = entries.iter().filter(is_twin).find(apart).cloned();
            parents.extend(twin);
        }
        parents
    }

    /// The best point of the descent of a chain.
    fn entry_of<L>(&self, chain: usize, landscape: &L) -> Option<ReservoirEntry<P>>
    where
        L: Landscape<Point = P, Memory = M>,
    {
        let chain = self.chains.get(chain)?;
        let (point, loss) = chain.best()?;
        Some(ReservoirEntry::new(landscape, chain.generation, loss, point.clone()))
    }

    /// Draws the conclusions from a round in which these gradients were made.
    pub(super) fn advance_race<L>(
        &mut self,
        landscape: &L,
        gradients: u64,
        events: &mut Vec<SearchEvent>,
    ) where
        L: Landscape<Point = P, Memory = M>,
    {
        let Some(mut race) = self.race.take() else { return };
        race.count(gradients);
        match race.stage {
            RaceStage::Best => self.after_best(&mut race, landscape),
            RaceStage::Trials(moves) => {
                self.after_trials(&mut race, moves + 1, landscape, events);
            }
            RaceStage::Challenger(chain) => {
                self.after_challenge(&mut race, chain, landscape, events);
            }
        }
        self.race = Some(race);
    }

    /// After a move of the best point: its descent pauses once races gain faster, and at once if its
    /// structure is not permitted.
    fn after_best<L>(&mut self, race: &mut Race, landscape: &L)
    where
        L: Landscape<Point = P, Memory = M>,
    {
        if self.best_pauses(race, landscape) {
            race.breaks_limits = !self.keep_limits_of(0, landscape);
            if let Some(descent) = &self.chains[0].descent {
                race.settle(descent.best_loss, descent.gradients);
            }
            self.begin_race(race, landscape);
        }
    }

    /// True after a move of the best point if its descent pauses.
    fn best_pauses<L>(&mut self, race: &mut Race, landscape: &L) -> bool
    where
        L: Landscape<Point = P, Memory = M>,
    {
        let Some(descent) = &mut self.chains[0].descent else { return false };
        landscape.allow_long_moves(&mut descent.memory);
        let (gradients, loss) = (descent.gradients, descent.best_loss);
        let is_lost = !descent.loss.is_finite();
        if is_lost {
            descent.point = descent.best.clone();
            descent.loss = loss;
            descent.memory = M::default();
        }
        let is_outside = landscape.structure_violation(&descent.best) > 0;
        let ended = is_lost || is_outside || has_ended(descent, landscape);
        let measured = || race.measured(gradients, loss).map(|rates| rates.recent);
        let Some(rate) = ended.then_some(0.0).or_else(measured) else { return false };
        race.best_rate = rate;
        rate <= self.required_rate(race, landscape)
    }

    fn begin_race<L>(&self, race: &mut Race, landscape: &L)
    where
        L: Landscape<Point = P, Memory = M>,
    {
        race.perturbation = self.next_perturbation(race, landscape);
        race.stage = RaceStage::Trials(0);
    }

    /// Moves the best point of the descent of a chain to one that keeps every limit, and the descent with
    /// it; false if none was found near it.
    fn keep_limits_of<L>(&mut self, chain: usize, landscape: &L) -> bool
    where
        L: Landscape<Point = P, Memory = M>,
    {
        let Some(mut entry) = self.entry_of(chain, landscape) else { return true };
        let is_kept = self.keep_limits(landscape, &mut entry);
        if let Some(descent) = self.chains[chain].descent.as_mut().filter(|_| is_kept)
            && descent.best != entry.point
        {
            (descent.best, descent.best_loss) = (entry.point.clone(), entry.loss);
            (descent.point, descent.loss) = (entry.point, entry.loss);
            self.find_best_again(landscape);
        }
        is_kept
    }

    /// The rate below which the descent of the best point pauses: that of the next race, or 0 once there are
    /// too few gradients for it.
    fn required_rate<L>(&self, race: &Race, landscape: &L) -> f64
    where
        L: Landscape<Point = P, Memory = M>,
    {
        let next = self.next_perturbation(race, landscape);
        let done = self.statistics.gradients;
        let left = self.settings.gradients.map(|limit| limit.saturating_sub(done));
        let needed = TRIAL_GRADIENTS * self.trial_count(next) as u64;
        if left.is_some_and(|left| left < needed) { 0.0 } else { race.required_rate(next) }
    }

    /// The consecutive rounds without progress, after one more that made some or none. Those of the best
    /// point do not count: a search is idle while no trial can start.
    pub(super) fn idle_rounds(&self, moved: bool) -> u64 {
        let is_best = self.race.as_ref().is_some_and(|race| race.stage == RaceStage::Best);
        match (moved, is_best) {
            (true, true) => self.statistics.idle,
            (true, false) => 0,
            (false, _) => self.statistics.idle + 1,
        }
    }

    /// After a move of the trials.
    fn after_trials<L>(
        &mut self,
        race: &mut Race,
        moves: u64,
        landscape: &L,
        events: &mut Vec<SearchEvent>,
    ) where
        L: Landscape<Point = P, Memory = M>,
    {
        race.stage = RaceStage::Trials(moves);
        let is_lost = |chain: &Chain<P, M>| {
            chain.descent.as_ref().is_some_and(|descent| !descent.loss.is_finite())
        };
        let lost: Vec<usize> =
            (1..self.chains.len()).filter(|i| is_lost(&self.chains[*i])).collect();
        for chain in lost {
            self.end_trial(race, chain, DescentEnd::InfiniteLoss, landscape, events);
        }
        let running = (1..self.chains.len()).filter(|i| self.chains[*i].descent.is_some());
        let mut entries: Vec<(usize, ReservoirEntry<P>)> =
            running.filter_map(|i| Some((i, self.entry_of(i, landscape)?))).collect();
        if entries.len() > 1 {
            entries.sort_by(|(_, a), (_, b)| a.rank(b));
            for (chain, _) in entries.split_off(Race::kept(entries.len())) {
                self.end_trial(race, chain, DescentEnd::Outranked, landscape, events);
            }
        }
        match entries[..] {
            [] => self.end_race(race, landscape),
            [(chain, _)] => {
                race.stage = RaceStage::Challenger(chain);
                if let Some(descent) = &self.chains[chain].descent {
                    race.measure_from(descent.gradients, descent.best_loss);
                }
                self.try_overtaking(race, chain, landscape, events);
            }
            _ => {}
        }
    }

    /// After a move of the challenger.
    fn after_challenge<L>(
        &mut self,
        race: &mut Race,
        chain: usize,
        landscape: &L,
        events: &mut Vec<SearchEvent>,
    ) where
        L: Landscape<Point = P, Memory = M>,
    {
        let ended = self.chains[chain].descent.as_ref().is_some_and(|d| has_ended(d, landscape));
        if self.try_overtaking(race, chain, landscape, events) {
            return;
        }
        let best = self.chains[0].best().map_or(f64::INFINITY, |(_, loss)| loss);
        let Some(descent) = &self.chains[chain].descent else {
            return self.end_race(race, landscape);
        };
        let (gradients, loss) = (descent.gradients, descent.best_loss);
        let mut end = DescentEnd::InfiniteLoss;
        if descent.loss.is_finite() {
            let measured = || race.measured(gradients, loss).map(|rates| rates.last);
            let Some(rate) = ended.then_some(0.0).or_else(measured) else { return };
            // A better loss with a structure farther from the permitted ones never overtakes.
            if loss > best && Race::may_catch_up(loss, best, rate) {
                return;
            }
            end = DescentEnd::Unpromising;
        }
        self.end_trial(race, chain, end, landscape, events);
        self.end_race(race, landscape);
    }

    /// Makes the challenger the best point if it is better; true if it is.
    fn try_overtaking<L>(
        &mut self,
        race: &mut Race,
        chain: usize,
        landscape: &L,
        events: &mut Vec<SearchEvent>,
    ) -> bool
    where
        L: Landscape<Point = P, Memory = M>,
    {
        let [best, challenger] = [0, chain].map(|i| self.entry_of(i, landscape));
        let is_better = |challenger: &ReservoirEntry<P>| {
            best.as_ref().is_none_or(|best| challenger.is_better_than(best))
        };
        if !challenger.is_some_and(|challenger| is_better(&challenger)) {
            return false;
        }
        let keeps_limits = self.keep_limits_of(chain, landscape);
        let challenger = self.entry_of(chain, landscape);
        let is_next = keeps_limits || race.breaks_limits;
        let Some(challenger) = challenger.filter(|found| is_next && is_better(found)) else {
            return false;
        };
        race.breaks_limits = !keeps_limits;
        let node = self.lineage.node_mut(challenger.number);
        let kind = node.and_then(|node| {
            node.chain = 0;
            node.kind
        });
        let before = best.map_or(challenger.loss, |best| best.loss);
        race.note_winner(kind, before);
        let (first, others) = self.chains.split_at_mut(chain);
        std::mem::swap(&mut first[0].descent, &mut others[0].descent);
        std::mem::swap(&mut first[0].generation, &mut others[0].generation);
        self.end_chain(chain, DescentEnd::Outranked, landscape, events);
        self.begin_descent_of_best(race);
        true
    }

    fn begin_descent_of_best(&self, race: &mut Race) {
        if let Some(descent) = &self.chains[0].descent {
            race.measure_from(descent.gradients, descent.best_loss);
        }
        race.stage = RaceStage::Best;
    }

    /// Makes a point that another run has found, and that has this generation, the best one if it is
    /// better; without effect in a run of another method.
    pub(in crate::search) fn take_over<L>(&mut self, landscape: &L, found: &ReservoirEntry<P>)
    where
        L: Landscape<Point = P, Memory = M>,
    {
        let is_better = |best: ReservoirEntry<P>| found.is_better_than(&best);
        if self.race.is_none() || !self.entry_of(0, landscape).is_none_or(is_better) {
            return;
        }
        self.end_chain(0, DescentEnd::Outranked, landscape, &mut Vec::new());
        self.chains[0].generation = found.number;
        self.chains[0].descent = Some(ChainDescent::new(found.point.clone(), found.loss));
        if let Some(race) = &mut self.race {
            race.note_other_best(found.loss);
        }
    }

    /// Ends a race without a winner.
    fn end_race<L>(&self, race: &mut Race, landscape: &L)
    where
        L: Landscape<Point = P, Memory = M>,
    {
        let required = if race.is_empty() { 0.0 } else { self.required_rate(race, landscape) };
        if race.is_empty() {
            // Where no trial can begin, the other perturbation comes next.
            race.count(TRIAL_GRADIENTS);
        }
        race.settle(0.0, 0);
        if race.best_rate > required {
            self.begin_descent_of_best(race);
        } else {
            self.begin_race(race, landscape);
        }
    }

    fn end_trial<L>(
        &mut self,
        race: &mut Race,
        chain: usize,
        end: DescentEnd,
        landscape: &L,
        events: &mut Vec<SearchEvent>,
    ) where
        L: Landscape<Point = P, Memory = M>,
    {
        let node = self.lineage.node(self.chains[chain].generation);
        if let Some((kind, gradients)) = node.and_then(|node| Some((node.kind?, node.gradients))) {
            race.note_trial(kind, gradients);
        }
        self.end_chain(chain, end, landscape, events);
    }

    /// Ends the descent of a chain.
    fn end_chain<L>(
        &mut self,
        chain: usize,
        end: DescentEnd,
        landscape: &L,
        events: &mut Vec<SearchEvent>,
    ) where
        L: Landscape<Point = P, Memory = M>,
    {
        let mut ended = Vec::new();
        end_descent(&mut self.chains[chain], end, &mut ended);
        for event in ended {
            self.record(chain, event, landscape, events);
        }
    }
}
