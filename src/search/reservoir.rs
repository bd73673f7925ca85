//! The best points that a search has found, at most one of each topology where that is asked for.

use super::Landscape;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// The best points so far, in no particular order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reservoir<P> {
    size: usize,
    one_per_topology: bool,
    entries: Vec<ReservoirEntry<P>>,
}

/// A point of the reservoir.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReservoirEntry<P> {
    /// Its number in the family tree.
    pub number: u64,
    /// What it is worth.
    pub loss: f64,
    /// What it has in common with points of the same structure.
    pub topology: String,
    /// How far its structure is from those that are asked for; 0 for one of them.
    #[serde(default)]
    pub outside: u64,
    /// The point.
    pub point: P,
}

impl<P> ReservoirEntry<P> {
    /// A point of a landscape.
    pub fn new<L: Landscape<Point = P>>(landscape: &L, number: u64, loss: f64, point: P) -> Self {
        let (topology, outside) =
            (landscape.topology(&point), landscape.structure_violation(&point));
        Self { number, loss, topology, outside, point }
    }

    /// Which of two is better: first the one whose structure is nearer to what is asked for, then
    /// the one of less loss.
    pub fn rank(&self, other: &Self) -> Ordering {
        self.outside.cmp(&other.outside).then(self.loss.total_cmp(&other.loss))
    }

    /// Whether it is better than another one.
    pub fn is_better_than(&self, other: &Self) -> bool {
        (self.outside, self.loss) < (other.outside, other.loss)
    }
}

/// What became of a point that was offered to the reservoir.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OfferOutcome {
    /// It is in, and there was room.
    Entered,
    /// It is in, in place of this one.
    Replaced(u64),
    /// The same point is in already, under this number.
    Same(u64),
    /// A point of its topology is in that is no worse.
    BehindTwin(u64),
    /// All are no worse.
    BehindAll,
    /// Its loss is no number.
    Worthless,
}

impl OfferOutcome {
    /// Whether the point is in.
    pub fn is_accepted(self) -> bool {
        matches!(self, Self::Entered | Self::Replaced(_))
    }
}

impl<P: Clone + PartialEq> Reservoir<P> {
    /// A reservoir without points, for at least one.
    pub fn new(size: usize, one_per_topology: bool) -> Self {
        Self { size: size.max(1), one_per_topology, entries: Vec::new() }
    }

    /// Its points.
    pub fn entries(&self) -> &[ReservoirEntry<P>] {
        &self.entries
    }

    /// The best of them, the first of equals; none before the first one entered.
    pub fn best(&self) -> Option<&ReservoirEntry<P>> {
        self.entries.iter().min_by(|a, b| a.rank(b))
    }

    /// Whether a point of this number is in.
    pub fn contains(&self, number: u64) -> bool {
        self.entries.iter().any(|entry| entry.number == number)
    }

    /// Takes a point in where it is good enough: one of a topology that is in replaces its twin if
    /// it is better; another one takes the free place, or that of the worst if it is better.
    pub fn offer(&mut self, entry: ReservoirEntry<P>) -> OfferOutcome {
        if !entry.loss.is_finite() {
            return OfferOutcome::Worthless;
        }
        if let Some(same) = self.entries.iter().find(|old| old.point == entry.point) {
            return OfferOutcome::Same(same.number);
        }
        let twin = self.entries.iter_mut().find(|old| old.topology == entry.topology);
        if let Some(twin) = twin.filter(|_| self.one_per_topology) {
            return replace_if_better(twin, entry, OfferOutcome::BehindTwin);
        }
        if self.entries.len() < self.size {
            self.entries.push(entry);
            return OfferOutcome::Entered;
        }
        let worst = self.entries.iter_mut().max_by(|a, b| a.rank(b));
        worst.map_or(OfferOutcome::BehindAll, |worst| {
            replace_if_better(worst, entry, |_| OfferOutcome::BehindAll)
        })
    }
}

fn replace_if_better<P>(
    old: &mut ReservoirEntry<P>,
    new: ReservoirEntry<P>,
    refused: fn(u64) -> OfferOutcome,
) -> OfferOutcome {
    let number = old.number;
    if new.is_better_than(old) {
        *old = new;
        OfferOutcome::Replaced(number)
    } else {
        refused(number)
    }
}
