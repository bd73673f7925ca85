//! The merit function of the design, and its value in the history.

use super::Session;
use crate::lens::Lens;
use crate::merit::Goal;
use crate::session::MeritReport;
use crate::session::journal::JournalEntry;
use crate::session::proposal::MeritProposal;
use std::sync::Arc;

impl Session {
    /// The merit function of the design: its own, or else the proposed one.
    pub(super) fn goal(&self) -> Option<Arc<Goal>> {
        let own = self.lens.merit.as_ref().map(|goal| Arc::new(goal.clone()));
        own.or_else(|| self.proposal.goal.clone())
    }

    /// The design as it is written: with the merit function that is shown, unless a reader of the file
    /// would propose the same one.
    pub(super) fn lens_with_merit(&self) -> Arc<Lens> {
        if self.lens.merit.is_some() {
            return Arc::clone(&self.lens);
        }
        let shown = self.proposal.goal.as_deref().filter(|goal| goal.check(&self.lens).is_ok());
        match shown {
            Some(goal) if Goal::default_for(&self.lens).as_ref() != Ok(goal) => {
                let merit = Some(goal.clone());
                Arc::new(Lens { merit, ..Lens::clone(&self.lens) })
            }
            _ => Arc::clone(&self.lens),
        }
    }

    /// True if the lens of a file is the design, which may have no merit function of its own where
    /// the file has the one that was proposed.
    pub(super) fn is_written_as(&self, file: &Lens) -> bool {
        *self.lens == *file || *self.lens_with_merit() == *file
    }

    /// The merit function that is proposed for the present version of the history.
    pub(super) fn proposal_of_history(&self) -> Arc<MeritProposal> {
        let of_first = || self.history.nodes().first().map(|first| MeritProposal::of(&first.lens));
        self.history.proposal().or_else(of_first).unwrap_or_default()
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
