//! The family tree: every point that a chain started from, where it came from and what became of it.

use super::{MutationKind, OfferOutcome};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// No line of ancestors is remembered further back.
const MAX_ANCESTRY: usize = 1000;

/// Where a descent began, and what became of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LineageNode<P> {
    /// Its number; the start of the run is 0.
    pub number: u64,
    /// The point that it is a mutation of; none for the start and for what was drawn from anywhere.
    pub parent: Option<u64>,
    /// The chain, counted from 0.
    pub chain: usize,
    /// The mutation; none for the start.
    pub kind: Option<MutationKind>,
    /// The mutation in words.
    pub what: String,
    /// The loss of the point before the mutation; none where there was none.
    pub before: Option<f64>,
    /// The loss after the mutation.
    pub mutated: f64,
    /// The best loss of the descent so far.
    pub descended: f64,
    /// Local moves of the descent so far.
    pub moves: u64,
    /// Gradients of the descent so far.
    pub gradients: u64,
    /// What ended the descent; none while it goes on.
    pub ended: Option<DescentEnd>,
    /// What the reservoir said to it; none while the descent goes on.
    pub offer: Option<OfferOutcome>,
    /// Where the descent began while it goes on, then the best point of it.
    pub point: P,
}

/// What ended a descent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DescentEnd {
    /// The clock of regenerations: chance.
    Clock,
    /// It was as long as a descent may be.
    Longest,
    /// It went where a loss is no number.
    Lost,
    /// A mutation was accepted: Metropolis and Hastings only.
    Mutated,
    /// Its part of the gradients was used up: brute force only.
    Budget,
}

/// The generations of a run. However long it is, only the last ones are remembered, and the
/// ancestors of those that matter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Lineage<P> {
    /// In the order of their numbers.
    nodes: Vec<LineageNode<P>>,
    next: u64,
    remembered: usize,
    /// How many there had been when the last ones were forgotten.
    tidied: u64,
}

impl<P> Lineage<P> {
    /// A tree without nodes that remembers so many of those that are no ancestors.
    pub(super) fn new(remembered: usize) -> Self {
        Self { nodes: Vec::new(), next: 0, remembered, tidied: 0 }
    }

    /// The nodes that are remembered, in the order of their numbers.
    pub fn nodes(&self) -> &[LineageNode<P>] {
        &self.nodes
    }

    /// How many there have been.
    pub fn total(&self) -> u64 {
        self.next
    }

    /// The node of a number, if it is remembered.
    pub fn node(&self, number: u64) -> Option<&LineageNode<P>> {
        self.index_of(number).map(|place| &self.nodes[place])
    }

    /// A node and its ancestors, youngest first, as far as they are remembered.
    pub fn ancestry(&self, number: u64) -> impl Iterator<Item = &LineageNode<P>> {
        let first = self.node(number);
        std::iter::successors(first, |node| node.parent.and_then(|parent| self.node(parent)))
    }

    pub(super) fn node_mut(&mut self, number: u64) -> Option<&mut LineageNode<P>> {
        self.index_of(number).map(|place| &mut self.nodes[place])
    }

    /// Adds a node, whose number is given here.
    pub(super) fn add(&mut self, node: LineageNode<P>) -> u64 {
        let number = self.next;
        self.nodes.push(LineageNode { number, ..node });
        self.next += 1;
        number
    }

    /// Forgets the oldest generations but those that are held with their ancestors, and those that
    /// live. It works now and then only: there may be twice as many as are wanted.
    pub(super) fn prune(
        &mut self,
        held: impl Iterator<Item = u64>,
        living: impl Iterator<Item = u64>,
    ) {
        if self.next - self.tidied <= self.remembered as u64 {
            return;
        }
        self.tidied = self.next;
        let lines = held
            .flat_map(|number| self.ancestry(number).take(MAX_ANCESTRY).map(|node| node.number));
        let kept: BTreeSet<u64> = lines.chain(living).collect();
        let others = self.nodes.iter().filter(|node| !kept.contains(&node.number)).count();
        let mut surplus = others.saturating_sub(self.remembered);
        self.nodes.retain(|node| {
            let stays = surplus == 0 || kept.contains(&node.number);
            surplus -= usize::from(!stays);
            stays
        });
    }

    fn index_of(&self, number: u64) -> Option<usize> {
        self.nodes.binary_search_by_key(&number, |node| node.number).ok()
    }
}
