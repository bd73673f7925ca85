//! The state of a design that a journal leads to.

use super::entry::{JournalEntry, RunRecord, VERSION};
use crate::session::history::DesignHistory;
use std::path::PathBuf;
use std::sync::Arc;

/// A design as its journal tells it.
#[derive(Debug, Clone)]
pub(in crate::session) struct JournalState {
    /// The file of the design.
    pub(in crate::session) path: Option<PathBuf>,
    /// Its versions.
    pub(in crate::session) history: DesignHistory,
    /// The version that is in its file.
    pub(in crate::session) saved: Option<u64>,
    /// The results of running computations.
    pub(in crate::session) runs: Vec<RunRecord>,
    /// True if the design was closed in order.
    closed: bool,
}

impl JournalState {
    /// The state of a design to which nothing has happened.
    pub(in crate::session) fn begin(path: Option<PathBuf>, history: DesignHistory) -> Self {
        let saved = Some(history.present());
        Self { path, history, saved, runs: Vec::new(), closed: false }
    }

    /// The state after the first lines: the beginning and the first version. The number of lines
    /// that it was made of comes with it.
    pub(super) fn read(entries: &[JournalEntry]) -> Option<Self> {
        let [
            JournalEntry::Begin { version: VERSION, path, saved },
            JournalEntry::Node(first),
            rest @ ..,
        ] = entries
        else {
            return None;
        };
        let history = DesignHistory::from_first(Arc::clone(first));
        let (path, runs) = (path.clone(), Vec::new());
        let mut state = Self { path, history, saved: *saved, runs, closed: false };
        rest.iter().for_each(|entry| state.apply(entry));
        Some(state)
    }

    /// Takes an entry into account.
    pub(super) fn apply(&mut self, entry: &JournalEntry) {
        self.closed = matches!(entry, JournalEntry::Closed);
        match entry {
            JournalEntry::Node(node) => drop(self.history.insert((**node).clone())),
            JournalEntry::Present(id) => drop(self.history.go_to(*id)),
            JournalEntry::Merit { node, merit } => {
                self.history.change(*node, |node| node.merit = Some(*merit));
            }
            JournalEntry::Name { node, name } => {
                let name = Some(name.clone()).filter(|name| !name.is_empty());
                self.history.change(*node, |node| node.name = name);
            }
            JournalEntry::Saved { node, path } => {
                (self.saved, self.path) = (Some(*node), Some(path.clone()));
            }
            JournalEntry::Run(record) => self.add_run(record),
            JournalEntry::RunEnded(kind) => self.runs.retain(|record| record.kind != *kind),
            JournalEntry::Begin { .. } | JournalEntry::Closed => {}
        }
    }

    /// A front grows by its new lenses; of an optimization the best lens counts.
    fn add_run(&mut self, record: &RunRecord) {
        let known = self.runs.iter_mut().find(|known| known.kind == record.kind);
        match known {
            Some(known) if record.keeps_all() => known.lenses.extend(record.lenses.iter().cloned()),
            Some(known) => known.clone_from(record),
            None => self.runs.push(record.clone()),
        }
    }

    /// True if the design was not closed, and differs from its file or has a run that was going on.
    pub(in crate::session) fn needs_recovery(&self) -> bool {
        let present = self.history.node(self.history.present()).map(|node| &node.lens);
        let saved = self.saved.and_then(|id| self.history.node(id)).map(|node| &node.lens);
        !self.closed && (present != saved || !self.runs.is_empty())
    }

    /// The lines that lead to this state.
    pub(super) fn entries(&self) -> Vec<JournalEntry> {
        let begin =
            JournalEntry::Begin { version: VERSION, path: self.path.clone(), saved: self.saved };
        let nodes = self.history.nodes().iter().map(|node| JournalEntry::Node(Arc::clone(node)));
        let runs = self.runs.iter().cloned().map(JournalEntry::Run);
        let present = JournalEntry::Present(self.history.present());
        std::iter::once(begin).chain(nodes).chain(runs).chain([present]).collect()
    }
}
