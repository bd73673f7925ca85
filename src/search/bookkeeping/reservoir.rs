//! The reservoir: the best points of a search, optionally at most one of each topology.

use crate::search::Landscape;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// The best points so far, unordered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reservoir<P> {
    size: usize,
    one_per_topology: bool,
    entries: Vec<ReservoirEntry<P>>,
}

/// A point with its loss, topology and generation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReservoirEntry<P> {
    /// Its generation in the lineage.
    pub number: u64,
    /// Its loss.
    pub loss: f64,
    /// Its topology.
    pub topology: String,
    /// The distance of its structure from the permitted ones; 0 if it is permitted.
    #[serde(default, rename = "outside")]
    pub structure_violation: u64,
    /// The point.
    pub point: P,
}

impl<P> ReservoirEntry<P> {
    /// The entry of a point of a landscape.
    pub fn new<L: Landscape<Point = P>>(landscape: &L, number: u64, loss: f64, point: P) -> Self {
        let topology = landscape.topology(&point);
        let structure_violation = landscape.structure_violation(&point);
        Self { number, loss, topology, structure_violation, point }
    }

    /// Orders entries from best to worst: first by the structure violation, then by the loss.
    pub fn rank(&self, other: &Self) -> Ordering {
        self.structure_violation
            .cmp(&other.structure_violation)
            .then(self.loss.total_cmp(&other.loss))
    }

    /// True if it is better than another one.
    pub fn is_better_than(&self, other: &Self) -> bool {
        (self.structure_violation, self.loss) < (other.structure_violation, other.loss)
    }
}

/// The outcome of an offer to the reservoir.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OfferOutcome {
    /// Accepted; there was room.
    Entered,
    /// Accepted in place of this generation.
    Replaced(u64),
    /// Rejected: the same point is already in the reservoir, under this generation.
    #[serde(rename = "same")]
    AlreadyPresent(u64),
    /// Rejected: this generation has the same topology, or lies at the same minimum, and is at least as
    /// good.
    #[serde(rename = "behind_twin")]
    RejectedSameTopology(u64),
    /// Rejected: the reservoir is full and all its points are at least as good.
    #[serde(rename = "behind_all")]
    RejectedWorse,
    /// Rejected: no point near it keeps every limit.
    #[serde(rename = "breaks_limits")]
    RejectedLimits,
    /// Rejected: the loss is not finite.
    #[serde(rename = "worthless")]
    RejectedNonFinite,
}

impl OfferOutcome {
    /// True if the point was accepted.
    pub fn is_accepted(self) -> bool {
        matches!(self, Self::Entered | Self::Replaced(_))
    }
}

impl<P: Clone + PartialEq> Reservoir<P> {
    /// An empty reservoir with a capacity of at least 1.
    pub fn new(size: usize, one_per_topology: bool) -> Self {
        Self { size: size.max(1), one_per_topology, entries: Vec::new() }
    }

    /// Its points.
    pub fn entries(&self) -> &[ReservoirEntry<P>] {
        &self.entries
    }

    /// Its points, to be judged anew.
    pub(in crate::search) fn entries_mut(&mut self) -> &mut [ReservoirEntry<P>] {
        &mut self.entries
    }

    /// Removes the points without a finite loss, which no point may have.
    pub(in crate::search) fn remove_non_finite(&mut self) {
        self.entries.retain(|entry| entry.loss.is_finite());
    }

    /// The best point, the first among equals; `None` if the reservoir is empty.
    pub fn best(&self) -> Option<&ReservoirEntry<P>> {
        self.entries.iter().min_by(|a, b| a.rank(b))
    }

    /// True if the point of this generation is in the reservoir.
    pub fn contains(&self, number: u64) -> bool {
        self.entries.iter().any(|entry| entry.number == number)
    }

    /// True if an offer may be accepted: the loss is finite, and there is room or a worse point.
    pub(in crate::search) fn would_accept(&self, entry: &ReservoirEntry<P>) -> bool {
        let has_room = self.entries.len() < self.size;
        entry.loss.is_finite()
            && (has_room || self.entries.iter().any(|old| entry.is_better_than(old)))
    }

    /// Offers a point to a reservoir of different minima: it replaces the one at the same minimum if it is
    /// better; otherwise it takes a free place, or that of the worst point if it is better.
    pub(in crate::search) fn offer_minimum(
        &mut self,
        entry: ReservoirEntry<P>,
        is_same: impl Fn(&P, &P) -> bool,
    ) -> OfferOutcome {
        if !entry.loss.is_finite() {
            return OfferOutcome::RejectedNonFinite;
        }
        if let Some(same) = self.entries.iter().find(|old| old.point == entry.point) {
            return OfferOutcome::AlreadyPresent(same.number);
        }
        let is_near = |old: &ReservoirEntry<P>| {
            old.topology == entry.topology && is_same(&old.point, &entry.point)
        };
        let near: Vec<usize> =
            (0..self.entries.len()).filter(|i| is_near(&self.entries[*i])).collect();
        let Some(best) =
            near.iter().copied().min_by(|i, k| self.entries[*i].rank(&self.entries[*k]))
        else {
            return self.take_place(entry);
        };
        let (number, outcome) = (entry.number, OfferOutcome::RejectedSameTopology);
        let outcome = replace_if_better(&mut self.entries[best], entry, outcome);
        if self.entries[best].number == number {
            // A point between two minima that seemed different shows that they are one.
            let mut place = 0..;
            self.entries.retain(|_| place.next().is_some_and(|i| i == best || !near.contains(&i)));
        }
        outcome
    }

    /// Offers a point. With one point per topology it replaces the one of the same topology if it
    /// is better; otherwise it takes a free place, or that of the worst point if it is better.
    pub fn offer(&mut self, entry: ReservoirEntry<P>) -> OfferOutcome {
        if !entry.loss.is_finite() {
            return OfferOutcome::RejectedNonFinite;
        }
        if let Some(same) = self.entries.iter().find(|old| old.point == entry.point) {
            return OfferOutcome::AlreadyPresent(same.number);
        }
        let same_topology = self.entries.iter_mut().find(|old| old.topology == entry.topology);
        if let Some(same_topology) = same_topology.filter(|_| self.one_per_topology) {
            return replace_if_better(same_topology, entry, OfferOutcome::RejectedSameTopology);
        }
        self.take_place(entry)
    }

    /// Takes a free place, or that of the worst point for a better one.
    fn take_place(&mut self, entry: ReservoirEntry<P>) -> OfferOutcome {
        if self.entries.len() < self.size {
            self.entries.push(entry);
            return OfferOutcome::Entered;
        }
        let worst = self.entries.iter_mut().max_by(|a, b| a.rank(b));
        worst.map_or(OfferOutcome::RejectedWorse, |worst| {
            replace_if_better(worst, entry, |_| OfferOutcome::RejectedWorse)
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
