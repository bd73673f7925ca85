//! The history of a design as a tree: every version is a node, and one that was left behind stays
//! reachable. Undo goes to the parent of the present version, redo to the child visited last.

use super::clock::unix_seconds;
use super::optimization::OptimizationCurve;
use super::proposal::MeritProposal;
use crate::lens::{EditedCell, Lens};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The maximum number of versions; beyond it the oldest ones without followers are forgotten.
pub(super) const MAX_NODES: usize = 1000;

/// A version of the design.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HistoryNode {
    /// The number of the version; a later version has a larger one.
    pub id: u64,
    /// The version that it was made from; `None` for the first one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parent: Option<u64>,
    /// The title of the edit or of the result that led to it.
    pub title: String,
    /// The name that the user gave it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// The value of its merit function; `None` until it is computed, or if it has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub merit: Option<f64>,
    /// The time at which it was made, in seconds since 1970 (UTC).
    pub time: u64,
    /// The seed of the run that found it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// The lens.
    pub lens: Arc<Lens>,
    /// The course of the optimization that led to it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<Arc<OptimizationCurve>>,
    /// The merit function that is proposed for it; `None` for that of the version before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub proposal: Option<Arc<MeritProposal>>,
}

/// The origin of a version.
#[derive(Debug, Clone, Default)]
pub(super) struct VersionOrigin {
    /// The title of the edit or of the result.
    pub(super) title: String,
    /// The cell of the edit: consecutive edits of one cell are one version.
    pub(super) cell: Option<EditedCell>,
    /// The seed of the run.
    pub(super) seed: Option<u64>,
    /// The course of the optimization.
    pub(super) curve: Option<Arc<OptimizationCurve>>,
    /// The merit function that is proposed for it; `None` for that of the version before.
    pub(super) proposal: Option<Arc<MeritProposal>>,
}

impl VersionOrigin {
    /// The origin of a version with nothing but a title.
    pub(super) fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), ..Self::default() }
    }

    /// The origin of the first version of a design, with the merit function that is proposed for it.
    pub(super) fn first(title: &str, proposal: Arc<MeritProposal>) -> Self {
        Self { proposal: Some(proposal), ..Self::new(title) }
    }
}

/// The versions of a design, of which one is present.
#[derive(Debug, Clone)]
pub(super) struct DesignHistory {
    /// The versions by number.
    nodes: Arc<Vec<Arc<HistoryNode>>>,
    present: u64,
    /// The child of each version that was visited last.
    followers: BTreeMap<u64, u64>,
    /// The cell that the last edit changed, until its edit is committed.
    edited: Option<EditedCell>,
}

impl DesignHistory {
    /// The history of a lens that was just opened or begun, with the merit function that is proposed
    /// for it.
    pub(super) fn new(lens: Arc<Lens>, origin: VersionOrigin) -> Self {
        let VersionOrigin { title, seed, curve, proposal, .. } = origin;
        let (name, merit, time) = (None, None, unix_seconds());
        let (id, parent) = (0, None);
        let first =
            HistoryNode { id, parent, title, name, merit, time, seed, lens, curve, proposal };
        Self::from_first(Arc::new(first))
    }

    /// The history with this version alone.
    pub(super) fn from_first(first: Arc<HistoryNode>) -> Self {
        let (present, followers) = (first.id, BTreeMap::new());
        Self { nodes: Arc::new(vec![first]), present, followers, edited: None }
    }

    /// All versions by number.
    pub(super) fn nodes(&self) -> &Arc<Vec<Arc<HistoryNode>>> {
        &self.nodes
    }

    /// The number of the present version.
    pub(super) const fn present(&self) -> u64 {
        self.present
    }

    /// A version.
    pub(super) fn node(&self, id: u64) -> Option<&Arc<HistoryNode>> {
        let place = self.nodes.binary_search_by_key(&id, |node| node.id).ok()?;
        self.nodes.get(place)
    }

    fn place(&self, id: u64) -> Option<usize> {
        self.nodes.binary_search_by_key(&id, |node| node.id).ok()
    }

    fn parent(&self, id: u64) -> Option<u64> {
        self.node(id)?.parent
    }

    /// Adds a version after the present one and makes it the present one; consecutive edits of one
    /// cell are one version. Returns it.
    pub(super) fn push(&mut self, lens: Arc<Lens>, origin: VersionOrigin) -> Arc<HistoryNode> {
        let is_leaf = !self.nodes.iter().any(|node| node.parent == Some(self.present));
        let merges = origin.cell.is_some() && self.edited == origin.cell && is_leaf;
        self.edited = origin.cell;
        let now = self.node(self.present).filter(|node| merges && node.parent.is_some()).cloned();
        if let Some(now) = now {
            let proposal = origin.proposal.or_else(|| now.proposal.clone());
            let merged = HistoryNode { lens, merit: None, proposal, ..HistoryNode::clone(&now) };
            return self.insert(merged);
        }
        let node = self.branch(self.present, lens, origin);
        self.go_to(node.id);
        self.prune(MAX_NODES);
        node
    }

    /// Adds a version after another one, which stays present. Returns it.
    pub(super) fn branch(
        &mut self,
        parent: u64,
        lens: Arc<Lens>,
        origin: VersionOrigin,
    ) -> Arc<HistoryNode> {
        let VersionOrigin { title, seed, curve, proposal, .. } = origin;
        let id = self.nodes.last().map_or(0, |node| node.id + 1);
        let (name, merit, time) = (None, None, unix_seconds());
        let parent = Some(parent);
        let node =
            HistoryNode { id, parent, title, name, merit, time, seed, lens, curve, proposal };
        self.insert(node)
    }

    /// Adds a version, or replaces the one of its number.
    pub(super) fn insert(&mut self, node: HistoryNode) -> Arc<HistoryNode> {
        let node = Arc::new(node);
        let place = self.nodes.binary_search_by_key(&node.id, |node| node.id);
        let nodes = Arc::make_mut(&mut self.nodes);
        match place {
            Ok(place) => nodes[place] = Arc::clone(&node),
            Err(place) => nodes.insert(place, Arc::clone(&node)),
        }
        node
    }

    /// Ends the edit of a cell.
    pub(super) fn commit(&mut self) {
        self.edited = None;
    }

    /// Goes to the version before the present one.
    pub(super) fn undo(&mut self) -> Option<Arc<Lens>> {
        self.go_to(self.parent(self.present)?)
    }

    /// Goes to the version after the present one that was visited last.
    pub(super) fn redo(&mut self) -> Option<Arc<Lens>> {
        self.go_to(*self.followers.get(&self.present)?)
    }

    /// Makes a version the present one; redo leads from its ancestors to it.
    pub(super) fn go_to(&mut self, id: u64) -> Option<Arc<Lens>> {
        let lens = Arc::clone(&self.node(id)?.lens);
        self.present = id;
        let mut child = id;
        while let Some(parent) = self.parent(child) {
            self.followers.insert(parent, child);
            child = parent;
        }
        Some(lens)
    }

    /// Changes a version. Returns true if there is one of this number that changes.
    pub(super) fn change(&mut self, id: u64, change: impl FnOnce(&mut HistoryNode)) -> bool {
        let Some(place) = self.place(id) else { return false };
        let mut node = HistoryNode::clone(&self.nodes[place]);
        change(&mut node);
        let differs = node != *self.nodes[place];
        if differs {
            Arc::make_mut(&mut self.nodes)[place] = Arc::new(node);
        }
        differs
    }

    /// The title of the edit that undo reverts.
    pub(super) fn undo_title(&self) -> Option<&str> {
        let node = self.node(self.present)?;
        node.parent.map(|_| node.title.as_str())
    }

    /// The title of the edit that redo restores.
    pub(super) fn redo_title(&self) -> Option<&str> {
        Some(self.node(*self.followers.get(&self.present)?)?.title.as_str())
    }

    /// The versions from the present one back to the first one.
    fn ancestry(&self) -> Vec<u64> {
        std::iter::successors(Some(self.present), |id| self.parent(*id)).collect()
    }

    /// The merit function that is proposed for the present version, or for the nearest one before it
    /// that has one.
    pub(super) fn proposal(&self) -> Option<Arc<MeritProposal>> {
        self.ancestry().into_iter().find_map(|id| self.node(id)?.proposal.clone())
    }

    /// The number of edits between two versions.
    pub(super) fn distance(&self, from: u64) -> usize {
        let ours = self.ancestry();
        let mut theirs = std::iter::successors(Some(from), |id| self.parent(*id)).enumerate();
        let meeting = theirs
            .find_map(|(up, id)| Some(up + ours.iter().position(|ancestor| *ancestor == id)?));
        meeting.unwrap_or(ours.len())
    }

    /// The titles of the edits from another version to the present one, the newest first; of an edit
    /// that was undone there is none.
    pub(super) fn titles_since(&self, from: u64) -> Vec<&str> {
        let before: Vec<u64> = std::iter::successors(Some(from), |id| self.parent(*id)).collect();
        let new = self.ancestry().into_iter().take_while(|id| !before.contains(id));
        new.filter_map(|id| Some(self.node(id)?.title.as_str())).collect()
    }

    /// Forgets the oldest versions beyond a number of them: first those that lead nowhere, then the
    /// first one. Returns the number of those forgotten.
    pub(super) fn prune(&mut self, limit: usize) -> usize {
        let before = self.nodes.len();
        while self.nodes.len() > limit.max(1) {
            let kept = self.ancestry();
            let is_leaf = |id: u64| !self.nodes.iter().any(|node| node.parent == Some(id));
            let leaf = |node: &&Arc<HistoryNode>| !kept.contains(&node.id) && is_leaf(node.id);
            let oldest = self.nodes.iter().find(leaf).map_or(self.nodes[0].id, |node| node.id);
            self.forget(oldest);
        }
        before - self.nodes.len()
    }

    fn forget(&mut self, id: u64) {
        self.followers.retain(|parent, child| *parent != id && *child != id);
        let nodes = Arc::make_mut(&mut self.nodes);
        nodes.retain(|node| node.id != id);
        for node in nodes.iter_mut().filter(|node| node.parent == Some(id)) {
            *node = Arc::new(HistoryNode { parent: None, ..HistoryNode::clone(node) });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::blank;

    fn grown(count: usize) -> DesignHistory {
        let mut history = DesignHistory::new(Arc::new(blank()), VersionOrigin::new("opened"));
        for i in 0..count {
            history.push(Arc::new(blank()), VersionOrigin::new(format!("edit {i}")));
        }
        history
    }

    #[test]
    fn a_branch_that_was_left_stays_reachable() {
        let mut history = grown(2);
        history.undo();
        history.push(Arc::new(blank()), VersionOrigin::new("another way"));
        assert_eq!((history.present(), history.nodes().len()), (3, 4));
        assert_eq!((history.undo_title(), history.redo_title()), (Some("another way"), None));
        assert!(history.go_to(2).is_some());
        history.undo();
        assert_eq!(history.redo_title(), Some("edit 1"), "redo follows the last visit");
        assert_eq!((history.distance(3), history.distance(2), history.distance(1)), (1, 1, 0));
    }

    #[test]
    fn the_oldest_versions_are_forgotten_and_the_present_one_stays() {
        let mut history = grown(MAX_NODES + 5);
        assert_eq!(history.nodes().len(), MAX_NODES);
        assert_eq!(history.nodes()[0].parent, None);
        let present = history.present();
        for _ in 0..10 {
            history.undo();
        }
        history.prune(20);
        assert_eq!(history.nodes().len(), 20);
        assert!(history.node(present - 10).is_some());
        while history.undo().is_some() {}
        assert_eq!(history.undo_title(), None);
    }
}
