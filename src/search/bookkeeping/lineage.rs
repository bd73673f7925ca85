//! The lineage of a search: the start, origin and outcome of every descent.

use super::OfferOutcome;
use crate::search::mutation::{MutationKind, MutationRecord, read_record};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// The maximum number of ancestors that are remembered for one descent.
const MAX_ANCESTRY: usize = 1000;

/// A descent: its origin and its outcome.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LineageNode<P> {
    /// Its number, the generation; the start of the run is 0.
    pub number: u64,
    /// The generation whose point was mutated; `None` for the start and for random draws.
    pub parent: Option<u64>,
    /// The chain, counted from 0.
    pub chain: usize,
    /// The kind of mutation; `None` for the start.
    pub kind: Option<MutationKind>,
    /// The mutation that it began with.
    #[serde(rename = "what", deserialize_with = "read_record")]
    pub mutation: MutationRecord,
    /// The loss before the mutation; `None` if there was no mutation.
    #[serde(rename = "before")]
    pub loss_before: Option<f64>,
    /// The loss after the mutation.
    #[serde(rename = "mutated")]
    pub start_loss: f64,
    /// The best loss of the descent so far.
    #[serde(rename = "descended")]
    pub best_loss: f64,
    /// Local moves of the descent so far.
    pub moves: u64,
    /// Gradients of the descent so far.
    pub gradients: u64,
    /// The reason for the end of the descent; `None` while it is in progress.
    #[serde(rename = "ended")]
    pub end: Option<DescentEnd>,
    /// The outcome of the offer to the reservoir; `None` while the descent is in progress.
    pub offer: Option<OfferOutcome>,
    /// The start of the descent while it is in progress, afterwards its best point.
    pub point: P,
}

/// The reason for the end of a descent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DescentEnd {
    /// A random regeneration.
    #[serde(rename = "clock")]
    Regeneration,
    /// The maximum number of moves was reached.
    #[serde(rename = "longest")]
    MaxMoves,
    /// The loss was not finite.
    #[serde(rename = "lost")]
    InfiniteLoss,
    /// A mutation was accepted; Metropolis–Hastings only.
    #[serde(rename = "mutated")]
    Mutation,
    /// The gradient budget was used up; brute force only.
    Budget,
    /// Others were better: of its race, or the one that has taken the place of the best point; iterated
    /// local search only.
    Outranked,
    /// It would not have overtaken the best point soon; iterated local search only.
    Unpromising,
}

/// The generations of a run. Only the last ones and the ancestors of retained ones are remembered,
/// however long the run is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Lineage<P> {
    /// Sorted by number.
    nodes: Vec<LineageNode<P>>,
    next: u64,
    remembered: usize,
    /// The total when the tree was last pruned.
    #[serde(rename = "tidied")]
    last_pruned: u64,
}

impl<P> Lineage<P> {
    /// An empty lineage that remembers up to `remembered` generations besides ancestors.
    pub(in crate::search) fn new(remembered: usize) -> Self {
        Self { nodes: Vec::new(), next: 0, remembered, last_pruned: 0 }
    }

    /// The remembered generations, sorted by number.
    pub fn nodes(&self) -> &[LineageNode<P>] {
        &self.nodes
    }

    /// The total number of generations, including forgotten ones.
    pub fn total(&self) -> u64 {
        self.next
    }

    /// A generation by its number, if it is remembered.
    pub fn node(&self, number: u64) -> Option<&LineageNode<P>> {
        self.index_of(number).map(|place| &self.nodes[place])
    }

    /// A generation and its remembered ancestors, youngest first.
    pub fn ancestry(&self, number: u64) -> impl Iterator<Item = &LineageNode<P>> {
        let first = self.node(number);
        std::iter::successors(first, |node| node.parent.and_then(|parent| self.node(parent)))
    }

    pub(in crate::search) fn node_mut(&mut self, number: u64) -> Option<&mut LineageNode<P>> {
        self.index_of(number).map(|place| &mut self.nodes[place])
    }

    /// Adds a generation and returns its number.
    pub(in crate::search) fn add(&mut self, node: LineageNode<P>) -> u64 {
        let number = self.next;
        self.nodes.push(LineageNode { number, ..node });
        self.next += 1;
        number
    }

    /// Removes the oldest generations except those in `held` with their ancestors, and those in
    /// `living`. It runs only from time to time: up to twice as many as requested are kept.
    pub(in crate::search) fn prune(
        &mut self,
        held: impl Iterator<Item = u64>,
        living: impl Iterator<Item = u64>,
    ) {
        if self.next - self.last_pruned <= self.remembered as u64 {
            return;
        }
        self.last_pruned = self.next;
        let lines = held
            .flat_map(|number| self.ancestry(number).take(MAX_ANCESTRY).map(|node| node.number));
        let needed: BTreeSet<u64> = lines.chain(living).collect();
        let others = self.nodes.iter().filter(|node| !needed.contains(&node.number)).count();
        let mut surplus = others.saturating_sub(self.remembered);
        self.nodes.retain(|node| {
            let stays = surplus == 0 || needed.contains(&node.number);
            surplus -= usize::from(!stays);
            stays
        });
    }

    fn index_of(&self, number: u64) -> Option<usize> {
        self.nodes.binary_search_by_key(&number, |node| node.number).ok()
    }
}
