//! What happened in a round is written down: tree, reservoir, statistics, the best point.

use super::chain::{Happening, Moved};
use super::reservoir::Entry;
use super::{Ended, Event, Landscape, Point, Run};

impl<P: Point, M: Point + Default> Run<P, M> {
    /// Writes down one thing that happened to a chain.
    pub(super) fn write_down<L>(
        &mut self,
        chain: usize,
        happening: Happening<P>,
        landscape: &L,
        events: &mut Vec<Event>,
    ) where
        L: Landscape<Point = P, Memory = M>,
    {
        match happening {
            Happening::Refused(refusal) => self.statistics.refuse(&refusal),
            Happening::Rejected(kind) => {
                let tally = self.statistics.kind(kind);
                tally.tried += 1;
                tally.rejected += 1;
            }
            Happening::Born(birth) => {
                if let Some(kind) = birth.kind {
                    self.statistics.kind(kind).tried += 1;
                }
                let number = self.tree.add(self.node(chain, birth));
                self.chains[chain].number = number;
                events.push(Event::Born(number));
            }
            Happening::Moved(moved) => self.count(self.chains[chain].number, moved),
            Happening::Ended { ended, point, loss } => {
                let number = self.chains[chain].number;
                events.push(Event::Ended(number));
                if self.close(Entry::of(landscape, number, loss, point), ended) {
                    events.push(Event::Best(number));
                }
            }
        }
    }

    fn count(&mut self, number: u64, moved: Moved) {
        self.statistics.moves += 1;
        self.statistics.gradients += moved.gradients;
        self.statistics.better += u64::from(moved.loss < self.start.loss);
        self.statistics.rejected += u64::from(moved.rejected);
        if let Some(node) = self.tree.node_mut(number) {
            node.moves += 1;
            node.gradients += moved.gradients;
            node.descended = moved.best;
        }
    }

    /// Offers the best point of a descent to the reservoir, and writes down how it went; whether it
    /// is the best of all. Algorithm 1 offers the last point, which is worse where it was a bad
    /// move that ended the descent.
    fn close(&mut self, entry: Entry<P>, ended: Ended) -> bool {
        *self.statistics.ended.entry(ended).or_default() += 1;
        let (number, loss, point) = (entry.number, entry.loss, entry.point.clone());
        let best = self.improve(&entry);
        let offer = self.reservoir.offer(entry);
        let Some(node) = self.tree.node_mut(number) else { return best };
        node.ended = Some(ended);
        node.offer = Some(offer);
        node.descended = loss;
        node.point = point;
        if let Some(kind) = node.kind {
            let (moves, improved) = (node.moves, node.before.is_some_and(|before| loss < before));
            let tally = self.statistics.kind(kind);
            tally.ended += 1;
            tally.moves += moves;
            tally.improved += u64::from(improved);
            tally.entered += u64::from(offer.entered());
        }
        best
    }

    /// Takes a better point as the best.
    fn improve(&mut self, entry: &Entry<P>) -> bool {
        let better = entry.beats(&self.best);
        if better {
            self.best = entry.clone();
        }
        better
    }

    /// Whether a descent that goes on has come to the best point so far.
    pub(super) fn compare<L>(&mut self, chain: usize, landscape: &L, events: &mut Vec<Event>)
    where
        L: Landscape<Point = P, Memory = M>,
    {
        let number = self.chains[chain].number;
        let may_be_better = |loss: f64| loss < self.best.loss || self.best.outside > 0;
        let best = self.chains[chain].best().filter(|(_, loss)| may_be_better(*loss));
        let entry = best.map(|(point, loss)| Entry::of(landscape, number, loss, point.clone()));
        if entry.is_some_and(|entry| self.improve(&entry)) {
            events.push(Event::Best(number));
        }
    }

    /// Forgets generations that matter no more.
    pub(super) fn forget(&mut self) {
        let held = self.reservoir.entries().iter().chain(&self.pinned).chain([&self.best]);
        let held = held.map(|entry| entry.number);
        let living = self.chains.iter().map(|chain| chain.number);
        self.tree.forget(held, living);
    }
}
