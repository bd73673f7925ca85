//! Undo and redo. A step holds a whole lens, shared and not copied.

use crate::lens::{EditedCell, Lens};
use std::sync::Arc;

/// The maximum number of undo steps.
const MAX_STEPS: usize = 1000;

/// The lenses before and after the present one in the undo history.
#[derive(Debug, Default)]
pub(super) struct UndoStack {
    past: Vec<UndoStep>,
    future: Vec<UndoStep>,
    /// The cell that the last edit changed, until its edit is committed.
    edited: Option<EditedCell>,
}

/// The lens on the other side of an edit.
#[derive(Debug)]
struct UndoStep {
    lens: Arc<Lens>,
    title: String,
}

impl UndoStack {
    /// Adds the lens before an edit; consecutive edits of one cell are one step.
    pub(super) fn push(&mut self, lens: Arc<Lens>, title: String, cell: Option<EditedCell>) {
        let merges = cell.is_some() && self.edited == cell && !self.past.is_empty();
        self.future.clear();
        self.edited = cell;
        if merges {
            return;
        }
        self.past.push(UndoStep { lens, title });
        if self.past.len() > MAX_STEPS {
            self.past.remove(0);
        }
    }

    /// Ends the edit of a cell.
    pub(super) fn commit(&mut self) {
        self.edited = None;
    }

    /// Replaces the present lens by the one before the last edit.
    pub(super) fn undo(&mut self, present: &Arc<Lens>) -> Option<Arc<Lens>> {
        self.edited = None;
        let step = self.past.pop()?;
        self.future.push(UndoStep { lens: Arc::clone(present), title: step.title });
        Some(step.lens)
    }

    /// Replaces the present lens by the one after the edit that was reverted last.
    pub(super) fn redo(&mut self, present: &Arc<Lens>) -> Option<Arc<Lens>> {
        self.edited = None;
        let step = self.future.pop()?;
        self.past.push(UndoStep { lens: Arc::clone(present), title: step.title });
        Some(step.lens)
    }

    /// The title of the edit that undo reverts.
    pub(super) fn undo_title(&self) -> Option<&str> {
        self.past.last().map(|step| step.title.as_str())
    }

    /// The title of the edit that redo restores.
    pub(super) fn redo_title(&self) -> Option<&str> {
        self.future.last().map(|step| step.title.as_str())
    }
}
