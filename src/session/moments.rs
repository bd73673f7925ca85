//! The history of a search over structure: the merit round by round, and a mark for every mutation.

use crate::lens::Lens;
use crate::search::element::pieces;
use crate::search::lens::LensLandscape;
use crate::search::{Chain, Event, Kind, Node, RunOf};
use serde::{Deserialize, Serialize};

/// How many moments of the history are kept; beyond that every second one goes.
const MOMENTS: usize = 1500;
/// How many marks are kept; beyond that every second one goes of those that led to nothing.
const MARKS: usize = 3000;

/// The merit so far, and every mutation.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct History {
    /// What was seen after a round, the oldest first.
    pub moments: Vec<Moment>,
    /// Every descent that began, the oldest first.
    pub marks: Vec<Mark>,
    /// Every so many rounds there is a moment.
    stride: u64,
    /// Every so many marks that led to nothing one is kept.
    sieve: u64,
}

/// What was seen after a round.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Moment {
    /// Rounds of all chains so far.
    pub round: u64,
    /// The best merit so far.
    pub best: f64,
    /// Merit and elements of each chain; none for one without a place.
    pub chains: Vec<Option<(f64, usize)>>,
}

/// Where a descent began.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// In which round.
    pub round: u64,
    /// Which generation.
    pub number: u64,
    /// In which chain, counted from 0.
    pub chain: usize,
    /// With which mutation; none for one that went on or came from the start.
    pub kind: Option<Kind>,
    /// The merit behind the mutation.
    pub merit: f64,
    /// Whether its best lens was kept in the end.
    pub entered: bool,
}

impl History {
    /// Notes where a run stands that begins or goes on.
    pub(super) fn begin(&mut self, run: &RunOf<LensLandscape>) {
        let round = run.statistics().rounds;
        if self.moments.last().is_none_or(|last| last.round < round) {
            self.note(run, &[]);
        }
    }

    /// Notes what a round has brought.
    pub(super) fn note(&mut self, run: &RunOf<LensLandscape>, events: &[Event]) {
        let round = run.statistics().rounds;
        for event in events {
            match *event {
                Event::Born(number) => self.marks.extend(born(run, number, round)),
                Event::Ended(number) => self.end(run, number),
                Event::Best(_) => {}
            }
        }
        self.sift();
        self.stride = self.stride.max(1);
        if round.is_multiple_of(self.stride) {
            self.moments.push(moment(run, round));
        }
        if self.moments.len() > MOMENTS {
            self.stride *= 2;
            self.moments.retain(|moment| moment.round.is_multiple_of(self.stride));
        }
    }

    /// Notes whether the best lens of a descent was kept.
    fn end(&mut self, run: &RunOf<LensLandscape>, number: u64) {
        let entered = run.reservoir().holds(number);
        if let Some(mark) = self.marks.iter_mut().rev().find(|mark| mark.number == number) {
            mark.entered = entered;
        }
    }

    fn sift(&mut self) {
        if self.marks.len() > MARKS {
            self.sieve = 2 * self.sieve.max(1);
            self.marks.retain(|mark| mark.entered || mark.number.is_multiple_of(self.sieve));
        }
    }
}

fn moment(run: &RunOf<LensLandscape>, round: u64) -> Moment {
    let place = |chain: &Chain<Lens, _>| chain.place().map(|(lens, merit)| (merit, pieces(lens)));
    Moment { round, best: run.best().loss, chains: run.chains().iter().map(place).collect() }
}

fn born(run: &RunOf<LensLandscape>, number: u64, round: u64) -> Option<Mark> {
    let node = run.tree().node(number)?;
    let Node { chain, kind, mutated: merit, .. } = *node;
    Some(Mark { round, number, chain, kind, merit, entered: false })
}
