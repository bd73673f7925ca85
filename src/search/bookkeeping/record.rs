//! Applies the events of a round to lineage, reservoir, statistics and best point.

use super::{DescentEnd, LineageNode, OfferOutcome, ReservoirEntry};
use crate::search::sampler::chain::{Chain, LocalMove, NewDescent, TurnEvent};
use crate::search::{
    Landscape, SearchEvent, SearchMethod, SearchPoint, SearchRun, Settlement, StructureChange,
};

impl<P: SearchPoint, M: SearchPoint + Default> SearchRun<P, M> {
    /// Admits a point that another run on the same landscape has found, between two rounds. Its loss
    /// is computed here, whatever the other run says; a point without a finite one is rejected.
    pub fn admit<L>(&mut self, landscape: &L, point: P) -> OfferOutcome
    where
        L: Landscape<Point = P, Memory = M>,
    {
        let loss = landscape.loss(&point);
        let entry = ReservoirEntry::new(landscape, self.lineage.total(), loss, point.clone());
        let offer = self.offer(landscape, entry.clone());
        if offer.is_accepted() {
            let record = StructureChange::Received.into();
            let gradients = 0;
            let start = NewDescent {
                parent: None,
                kind: None,
                record,
                before: None,
                loss,
                point,
                gradients,
            };
            let node = LineageNode { offer: Some(offer), ..self.new_node(0, start) };
            self.lineage.add(node);
            self.update_best(&entry);
            self.take_over(landscape, &entry);
        }
        offer
    }

    /// Offers a point to the reservoir: as a minimum, or as the best point of its topology.
    fn offer<L>(&mut self, landscape: &L, entry: ReservoirEntry<P>) -> OfferOutcome
    where
        L: Landscape<Point = P, Memory = M>,
    {
        if self.settings.retains_minima() {
            self.reservoir.offer_minimum(entry, |one, other| landscape.is_same_minimum(one, other))
        } else {
            self.reservoir.offer(entry)
        }
    }

    /// Applies one event of a chain.
    pub(in crate::search) fn record<L>(
        &mut self,
        chain: usize,
        event: TurnEvent<P>,
        landscape: &L,
        events: &mut Vec<SearchEvent>,
    ) where
        L: Landscape<Point = P, Memory = M>,
    {
        match event {
            TurnEvent::Refused(error) => self.statistics.refuse(error),
            TurnEvent::Rejected(kind) => {
                let statistics = self.statistics.kind(kind);
                statistics.tried += 1;
                statistics.rejected += 1;
            }
            TurnEvent::Started(started) => {
                self.statistics.gradients_beside += started.gradients;
                if let Some(kind) = started.kind {
                    self.statistics.kind(kind).tried += 1;
                }
                let number = self.lineage.add(self.new_node(chain, started));
                self.chains[chain].generation = number;
                events.push(SearchEvent::Started(number));
            }
            TurnEvent::Moved(moved) => self.record_move(self.chains[chain].generation, moved),
            TurnEvent::Ended { end, point, loss } => {
                let number = self.chains[chain].generation;
                events.push(SearchEvent::Ended(number));
                let entry = ReservoirEntry::new(landscape, number, loss, point);
                if self.record_end(entry, end, landscape) {
                    events.push(SearchEvent::NewBest(number));
                }
            }
        }
    }

    fn record_move(&mut self, number: u64, moved: LocalMove) {
        self.statistics.moves += 1;
        self.statistics.gradients += moved.gradients;
        self.statistics.better += u64::from(moved.loss < self.start.loss);
        self.statistics.rejected += u64::from(moved.rejected);
        if let Some(node) = self.lineage.node_mut(number) {
            node.moves += 1;
            node.gradients += moved.gradients;
            node.best_loss = moved.best;
        }
    }

    /// Offers the best point of a descent to the reservoir and records the outcome; true if it is
    /// the best of all. Algorithm 1 offers the last point, which is worse if the descent ended with
    /// a bad move.
    ///
    /// An iterated local search retains only points that keep every limit.
    fn record_end<L>(&mut self, entry: ReservoirEntry<P>, end: DescentEnd, landscape: &L) -> bool
    where
        L: Landscape<Point = P, Memory = M>,
    {
        *self.statistics.ended.entry(end).or_default() += 1;
        let is_iterated = self.settings.method == SearchMethod::IteratedLocalSearch;
        let mut entry = entry;
        let breaks_limits = is_iterated
            && self.reservoir.would_accept(&entry)
            && !self.keep_limits(landscape, &mut entry);
        let (number, loss, point) = (entry.number, entry.loss, entry.point.clone());
        let best = !breaks_limits && self.update_best(&entry);
        let offer =
            if breaks_limits { OfferOutcome::RejectedLimits } else { self.offer(landscape, entry) };
        if is_iterated && self.best.number == number && self.best.point != point {
            self.find_best_again(landscape);
        }
        let Some(node) = self.lineage.node_mut(number) else { return best };
        node.end = Some(end);
        node.offer = Some(offer);
        node.best_loss = loss;
        node.point = point;
        if let Some(kind) = node.kind {
            let (moves, improved) =
                (node.moves, node.loss_before.is_some_and(|before| loss < before));
            let statistics = self.statistics.kind(kind);
            statistics.ended += 1;
            statistics.moves += moves;
            statistics.improved += u64::from(improved);
            statistics.entered += u64::from(offer.is_accepted());
        }
        best
    }

    /// Moves an entry to a point that keeps every limit; false if none was found near it.
    pub(in crate::search) fn keep_limits<L>(
        &mut self,
        landscape: &L,
        entry: &mut ReservoirEntry<P>,
    ) -> bool
    where
        L: Landscape<Point = P, Memory = M>,
    {
        match landscape.settle(&entry.point) {
            Settlement::Kept => true,
            Settlement::Restored { point, loss, gradients } => {
                self.statistics.gradients_beside += gradients;
                (entry.point, entry.loss) = (point, loss);
                loss.is_finite()
            }
            Settlement::Broken { gradients } => {
                self.statistics.gradients_beside += gradients;
                false
            }
        }
    }

    /// Takes the best of the descents in progress and of the retained points as the best one, after one
    /// that was taken for it has turned out to break limits.
    pub(in crate::search) fn find_best_again<L>(&mut self, landscape: &L)
    where
        L: Landscape<Point = P, Memory = M>,
    {
        let entry = |chain: &Chain<P, M>| {
            let (point, loss) = chain.best()?;
            Some(ReservoirEntry::new(landscape, chain.generation, loss, point.clone()))
        };
        let running = self.chains.iter().filter_map(entry);
        let all = running.chain(self.reservoir.entries().iter().cloned());
        if let Some(best) = all.min_by(ReservoirEntry::rank) {
            self.best = best;
        }
    }

    /// Replaces the best point by a better one; true if it is better.
    fn update_best(&mut self, entry: &ReservoirEntry<P>) -> bool {
        let better = entry.is_better_than(&self.best);
        if better {
            self.best = entry.clone();
        }
        better
    }

    /// Checks if a descent in progress has reached the best point so far.
    pub(in crate::search) fn update_best_from_chain<L>(
        &mut self,
        chain: usize,
        landscape: &L,
        events: &mut Vec<SearchEvent>,
    ) where
        L: Landscape<Point = P, Memory = M>,
    {
        let number = self.chains[chain].generation;
        let may_be_better = |loss: f64| loss < self.best.loss || self.best.structure_violation > 0;
        let best = self.chains[chain].best().filter(|(_, loss)| may_be_better(*loss));
        let entry =
            best.map(|(point, loss)| ReservoirEntry::new(landscape, number, loss, point.clone()));
        if entry.is_some_and(|entry| self.update_best(&entry)) {
            events.push(SearchEvent::NewBest(number));
        }
    }

    /// Removes generations that are neither recent nor ancestors of anything kept.
    pub(in crate::search) fn prune_lineage(&mut self) {
        let held = self.reservoir.entries().iter().chain(&self.pinned).chain([&self.best]);
        let held = held.map(|entry| entry.number);
        let active = self.chains.iter().map(|chain| chain.generation);
        self.lineage.prune(held, active);
    }
}
