//! Dragging the handles of the design.

use super::Session;
use crate::paraxial::{DragSettings, Handle};
use crate::session::drag::held_text;
use crate::session::history::VersionOrigin;
use crate::session::journal::JournalEntry;
use crate::session::view::Severity;
use std::sync::Arc;

impl Session {
    /// Moves a handle. The drag of another handle ends.
    pub(super) fn drag_handle(&mut self, handle: Handle, value: f64, rim: Option<f64>) {
        if self.drag.handle().is_some_and(|other| other != handle) {
            self.end_drag();
        }
        let zoom = self.settings.zoom;
        match self.drag.drag(&self.lens, zoom, handle, (value, rim)) {
            Ok(lens) if lens == *self.lens => {}
            Ok(lens) => self.set_design(Arc::new(lens)),
            Err(Some(why)) => self.post(Severity::Warning, why),
            Err(None) => {}
        }
    }

    /// Ends the drag as one undo step, and says what has moved to hold what is locked.
    pub(super) fn end_drag(&mut self) {
        let Some(drag) = self.drag.take() else { return };
        let dragged = std::mem::replace(&mut self.lens, Arc::clone(&drag.before));
        if *dragged == *self.lens {
            return;
        }
        self.accept(Ok((*dragged).clone()), VersionOrigin::new(drag.title()));
        if let Some(moved) = drag.moved_text() {
            let text = held_text(&self.drag.settings, &moved);
            self.post(Severity::Note, text);
        }
    }

    /// Restores the design before the drag.
    pub(super) fn cancel_drag(&mut self) {
        if let Some(drag) = self.drag.take()
            && *drag.before != *self.lens
        {
            self.set_design(Arc::clone(&drag.before));
        }
    }

    pub(super) fn set_drag_settings(&mut self, settings: DragSettings) {
        if self.drag.settings != settings {
            self.record(JournalEntry::Locks(settings.clone()));
            self.drag.hold(settings);
        }
    }

    /// Requests the slopes of the merit once the analyses of the design are there.
    pub(super) fn sync_drag(&mut self) {
        let analyzed = self.analysis.latest().is_some_and(|latest| latest.version == self.version);
        if analyzed && self.drag.lacks_slopes(self.version) {
            let settings = (self.settings.zoom, self.settings.tolerance);
            let goal = self.goal();
            self.drag.request_slopes(self.version, &self.lens, goal, settings);
        }
    }
}
