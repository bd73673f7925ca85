//! The state of a design that a journal leads to.

use super::entry::{JournalEntry, RunRecord, VERSION};
use crate::paraxial::DragSettings;
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
    /// The quantities that drags hold.
    pub(in crate::session) locks: DragSettings,
    /// True if the design was closed in order.
    closed: bool,
}

impl JournalState {
    /// The state of a design to which nothing has happened.
    pub(in crate::session) fn begin(path: Option<PathBuf>, history: DesignHistory) -> Self {
        let saved = Some(history.present());
        let (runs, locks) = (Vec::new(), DragSettings::default());
        Self { path, history, saved, runs, locks, closed: false }
    }

    /// The same with quantities that drags hold.
    pub(in crate::session) fn holding(self, locks: DragSettings) -> Self {
        Self { locks, ..self }
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
        let locks = DragSettings::default();
        let mut state = Self { path, history, saved: *saved, runs, locks, closed: false };
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
            JournalEntry::Locks(locks) => self.locks.clone_from(locks),
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

    /// True if the program ended without closing the design.
    pub(in crate::session) const fn was_interrupted(&self) -> bool {
        !self.closed
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
        let locks = (self.locks != DragSettings::default())
            .then(|| JournalEntry::Locks(self.locks.clone()));
        std::iter::once(begin).chain(nodes).chain(runs).chain(locks).chain([present]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::blank;
    use crate::paraxial::FirstOrderLock;
    use crate::session::history::VersionOrigin;

    #[test]
    fn what_is_held_is_in_the_lines() {
        let history = DesignHistory::new(Arc::new(blank()), VersionOrigin::new("opened"));
        let mut state = JournalState::begin(None, history);
        let count = state.entries().len();
        let locks = vec![FirstOrderLock::FocalLength];
        state.apply(&JournalEntry::Locks(DragSettings { locks, ..DragSettings::default() }));
        let entries = state.entries();
        assert_eq!(entries.len(), count + 1);
        let lines: Vec<_> = entries.iter().filter_map(JournalEntry::line).collect();
        let read = |line: &Vec<u8>| JournalEntry::from_line(&line[..line.len() - 1]);
        let again: Vec<_> = lines.iter().filter_map(read).collect();
        assert_eq!(JournalState::read(&again).unwrap().locks, state.locks);
    }
}
