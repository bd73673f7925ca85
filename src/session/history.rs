//! Undo and redo: whole lenses, shared and never copied.

use crate::lens::{EditedCell, Lens};
use std::sync::Arc;

/// How many steps can be taken back.
const MAX_STEPS: usize = 1000;

/// The lenses before and after the present one.
#[derive(Debug, Default)]
pub(super) struct UndoStack {
    past: Vec<UndoStep>,
    future: Vec<UndoStep>,
    /// The cell that is being typed into.
    typing: Option<EditedCell>,
}

/// A lens on the other side of an edit.
#[derive(Debug)]
struct UndoStep {
    lens: Arc<Lens>,
    title: String,
}

impl UndoStack {
    /// Notes that `lens` was changed by an edit; more typing into one cell is no new step.
    pub(super) fn push(&mut self, lens: Arc<Lens>, title: String, cell: Option<EditedCell>) {
        let merges = cell.is_some() && self.typing == cell && !self.past.is_empty();
        self.future.clear();
        self.typing = cell;
        if merges {
            return;
        }
        self.past.push(UndoStep { lens, title });
        if self.past.len() > MAX_STEPS {
            self.past.remove(0);
        }
    }

    /// Ends the typing into a cell.
    pub(super) fn commit(&mut self) {
        self.typing = None;
    }

    /// Exchanges the present lens for the one before the last edit.
    pub(super) fn undo(&mut self, present: &Arc<Lens>) -> Option<Arc<Lens>> {
        self.typing = None;
        let step = self.past.pop()?;
        self.future.push(UndoStep { lens: Arc::clone(present), title: step.title });
        Some(step.lens)
    }

    /// Exchanges the present lens for the one after the edit that was taken back last.
    pub(super) fn redo(&mut self, present: &Arc<Lens>) -> Option<Arc<Lens>> {
        self.typing = None;
        let step = self.future.pop()?;
        self.past.push(UndoStep { lens: Arc::clone(present), title: step.title });
        Some(step.lens)
    }

    /// What undo would take back.
    pub(super) fn undo_title(&self) -> Option<&str> {
        self.past.last().map(|step| step.title.as_str())
    }

    /// What redo would do again.
    pub(super) fn redo_title(&self) -> Option<&str> {
        self.future.last().map(|step| step.title.as_str())
    }
}
