//! The history of a search over structure: the merit round by round, and a mark for every mutation.

use crate::lens::Lens;
use crate::search::element::piece_count;
use crate::search::lens_landscape::LensLandscape;
use crate::search::{Chain, LineageNode, MutationKind, SearchEvent, SearchRunOn};
use serde::{Deserialize, Serialize};

/// How many moments of the history are kept; beyond that every second one goes.
const MAX_SAMPLES: usize = 1500;
/// How many marks are kept; beyond that every second one goes of those that led to nothing.
const MAX_MARKS: usize = 3000;

/// The merit so far, and every mutation.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SearchHistory {
    /// What was seen after a round, the oldest first.
    pub moments: Vec<HistorySample>,
    /// Every descent that began, the oldest first.
    pub marks: Vec<DescentMark>,
    /// Every so many rounds there is a moment.
    stride: u64,
    /// Every so many marks that led to nothing one is kept.
    sieve: u64,
}

/// What was seen after a round.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HistorySample {
    /// Rounds of all chains so far.
    pub round: u64,
    /// The best merit so far.
    pub best: f64,
    /// Merit and elements of each chain; none for one without a place.
    pub chains: Vec<Option<(f64, usize)>>,
}

/// Where a descent began.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DescentMark {
    /// In which round.
    pub round: u64,
    /// Which generation.
    pub number: u64,
    /// In which chain, counted from 0.
    pub chain: usize,
    /// With which mutation; none for one that went on or came from the start.
    pub kind: Option<MutationKind>,
    /// The merit behind the mutation.
    pub merit: f64,
    /// Whether its best lens was kept in the end.
    pub entered: bool,
}

impl SearchHistory {
    /// Notes where a run stands that begins or goes on.
    pub(super) fn begin(&mut self, run: &SearchRunOn<LensLandscape>) {
        let round = run.statistics().rounds;
        if self.moments.last().is_none_or(|last| last.round < round) {
            self.record(run, &[]);
        }
    }

    /// Notes what a round has brought.
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

    /// Notes whether the best lens of a descent was kept.
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
    let place =
        |chain: &Chain<Lens, _>| chain.position().map(|(lens, merit)| (merit, piece_count(lens)));
    HistorySample { round, best: run.best().loss, chains: run.chains().iter().map(place).collect() }
}

fn mark_of(run: &SearchRunOn<LensLandscape>, number: u64, round: u64) -> Option<DescentMark> {
    let node = run.lineage().node(number)?;
    let LineageNode { chain, kind, mutated: merit, .. } = *node;
    Some(DescentMark { round, number, chain, kind, merit, entered: false })
}
