//! The merit function of the design, and its value in the history.

use super::Session;
use crate::lens::Lens;
use crate::merit::Goal;
use crate::session::MeritReport;
use crate::session::journal::JournalEntry;
use std::sync::Arc;

impl Session {
    /// The merit function of the design: its own, or else the proposed one.
    pub(super) fn goal(&self) -> Option<Arc<Goal>> {
        let own = self.lens.merit.as_ref().map(|goal| Arc::new(goal.clone()));
        own.or_else(|| self.proposed_goal.clone())
    }

    /// The newest merit, of the lens that is dragged if one is.
    pub(super) fn merit_report(&self) -> Option<Arc<MeritReport>> {
        let dragged = self.drag.merit_report(self.version, &self.lens, self.goal());
        dragged.or_else(|| self.live_merit.latest())
    }

    /// Notes the merit of the present version in the history once it is known.
    pub(super) fn sync_merit(&mut self) {
        let Some(report) = self.live_merit.latest() else { return };
        let Ok(values) = &report.values else { return };
        let present = self.history.present();
        // While a handle is dragged, the lens that is shown is no version yet.
        let is_present =
            self.history.node(present).is_some_and(|node| Arc::ptr_eq(&report.lens, &node.lens));
        if is_present && values.total.is_finite() {
            let merit = values.total;
            if self.history.change(present, |node| node.merit = Some(merit)) {
                self.record(JournalEntry::Merit { node: present, merit });
            }
        }
    }
}

/// The merit function that is proposed for a lens without one.
pub(super) fn propose_goal(lens: &Lens) -> Option<Arc<Goal>> {
    Goal::default_for(lens).ok().map(Arc::new)
}
