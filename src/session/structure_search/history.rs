//! The history of a search over lens structures: the merit by rounds and a mark for every descent.

use crate::lens::Lens;
use crate::search::element::piece_count;
use crate::search::lens_landscape::LensLandscape;
use crate::search::{Chain, LineageNode, MutationKind, SearchEvent, SearchRunOn};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The maximum number of samples; beyond it every second one is dropped.
const MAX_SAMPLES: usize = 1500;
/// The maximum number of marks; beyond it every second one without a retained lens is dropped.
const MAX_MARKS: usize = 3000;

/// The merit by rounds, and every descent.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SearchHistory {
    /// The samples, the oldest first.
    pub moments: Vec<HistorySample>,
    /// The descents, the oldest first.
    pub marks: Vec<DescentMark>,
    /// The number of rounds between two samples.
    stride: u64,
    /// Of the descents without a retained lens, those whose number is a multiple of this have a mark.
    sieve: u64,
}

/// The merits after a round.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HistorySample {
    /// The number of rounds so far.
    pub round: u64,
    /// The best merit so far.
    pub best: f64,
    /// The merit and the number of elements of each chain; `None` for one without a position.
    pub chains: Vec<Option<(f64, usize)>>,
}

/// The start of a descent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DescentMark {
    /// Its round.
    pub round: u64,
    /// Its generation.
    pub number: u64,
    /// The index of its chain.
    pub chain: usize,
    /// Its mutation; `None` for a descent that continues another one or starts from the first lens.
    pub kind: Option<MutationKind>,
    /// The merit after the mutation.
    pub merit: f64,
    /// True if its best lens was retained.
    pub entered: bool,
}

impl SearchHistory {
    /// Records the state in which a run starts or resumes.
    pub(super) fn begin(&mut self, run: &SearchRunOn<LensLandscape>) {
        let round = run.statistics().rounds;
        if self.moments.last().is_none_or(|last| last.round < round) {
            self.record(run, &[]);
        }
    }

    /// Records the events of a round.
    pub(super) fn record(&mut self, run: &SearchRunOn<LensLandscape>, events: &[SearchEvent]) {
        let round = run.statistics().rounds;
        for event in events {
            match *event {
                SearchEvent::Started(number) => self.marks.extend(mark_of(run, number, round)),
                SearchEvent::Ended(number) => self.record_end(run, number),
                SearchEvent::NewBest(_) => {}
            }
        }
        self.thin_marks();
        self.stride = self.stride.max(1);
        if round.is_multiple_of(self.stride) {
            self.moments.push(sample(run, round));
        }
        if self.moments.len() > MAX_SAMPLES {
            self.stride *= 2;
            self.moments.retain(|moment| moment.round.is_multiple_of(self.stride));
        }
    }

    /// Records whether the best lens of a descent was retained.
    fn record_end(&mut self, run: &SearchRunOn<LensLandscape>, number: u64) {
        let entered = run.reservoir().contains(number);
        if let Some(mark) = self.marks.iter_mut().rev().find(|mark| mark.number == number) {
            mark.entered = entered;
        }
    }

    fn thin_marks(&mut self) {
        if self.marks.len() > MAX_MARKS {
            self.sieve = 2 * self.sieve.max(1);
            self.marks.retain(|mark| mark.entered || mark.number.is_multiple_of(self.sieve));
        }
    }
}

fn sample(run: &SearchRunOn<LensLandscape>, round: u64) -> HistorySample {
    let place = |chain: &Chain<Arc<Lens>, _>| {
        chain.position().map(|(lens, merit)| (merit, piece_count(lens)))
    };
    HistorySample { round, best: run.best().loss, chains: run.chains().iter().map(place).collect() }
}

fn mark_of(run: &SearchRunOn<LensLandscape>, number: u64, round: u64) -> Option<DescentMark> {
    let node = run.lineage().node(number)?;
    let LineageNode { chain, kind, start_loss: merit, .. } = *node;
    Some(DescentMark { round, number, chain, kind, merit, entered: false })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_of_descents_without_a_retained_lens_are_thinned() {
        let mark = |number: u64| DescentMark {
            round: number,
            number,
            chain: 0,
            kind: None,
            merit: 1.0,
            // One in five, among them odd ones.
            entered: number.is_multiple_of(5),
        };
        let mut history = SearchHistory::default();
        let most = MAX_MARKS as u64;
        history.marks = (0..most).map(mark).collect();
        history.thin_marks();
        assert_eq!(history.marks.len(), MAX_MARKS, "as many as are allowed");
        let numbers = |history: &SearchHistory| -> Vec<u64> {
            history.marks.iter().map(|mark| mark.number).collect()
        };
        let kept = |step: u64| -> Vec<u64> {
            (0..=most).filter(|n| n.is_multiple_of(5) || n.is_multiple_of(step)).collect()
        };
        history.marks = (0..=most).map(mark).collect();
        history.thin_marks();
        assert_eq!(numbers(&history), kept(2));
        // Every second one of the rest goes when there are too many again.
        history.marks = (0..=most).map(mark).collect();
        history.thin_marks();
        assert_eq!(numbers(&history), kept(4));
    }
}
