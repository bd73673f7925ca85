//! Which run of its kind a session shows, and how it will stand: what is told of others is not
//! heard.

use super::worker::RunStatus;

/// The last run of a kind, if it is not forgotten.
#[derive(Debug, Default)]
pub(super) struct Course {
    /// How many were begun.
    count: u64,
    number: Option<u64>,
    pending: Option<RunStatus>,
    failed: Option<String>,
}

impl Course {
    /// Begins the next run; its number.
    pub(super) fn begin(&mut self) -> u64 {
        *self = Self { count: self.count + 1, ..Self::default() };
        self.number = Some(self.count);
        self.count
    }

    /// Forgets the run.
    pub(super) fn forget(&mut self) {
        *self = Self { count: self.count, ..Self::default() };
    }

    /// Whether there is a run that was not forgotten.
    pub(super) fn is_there(&self) -> bool {
        self.number.is_some()
    }

    /// Whether this is the run.
    pub(super) fn is(&self, number: u64) -> bool {
        self.number == Some(number)
    }

    /// How the run will stand once its present work is done, where it was told so.
    pub(super) fn pending(&self) -> Option<RunStatus> {
        self.pending
    }

    /// Why the run could not begin or go on.
    pub(super) fn failed(&self) -> Option<String> {
        self.failed.clone()
    }

    /// Whether the run was asked for and has neither begun, which `begun` says, nor failed.
    pub(super) fn is_starting(&self, begun: bool) -> bool {
        self.is_there() && !begun && self.failed.is_none()
    }

    /// Notes that the run is to stand otherwise, unless there is none or it has `ended`; whether it
    /// has to be told.
    pub(super) fn turn(&mut self, standing: RunStatus, ended: bool) -> bool {
        let turns = self.is_there() && self.failed.is_none() && !ended;
        if turns {
            self.pending = Some(standing);
        }
        turns
    }

    /// Hears how the run stands; what it stands as may be older than what it was told since.
    pub(super) fn stands(&mut self, now: RunStatus) {
        if Some(now) == self.pending || !now.is_active() {
            self.pending = None;
        }
    }

    /// Hears why the run could not begin or go on.
    pub(super) fn fails(&mut self, why: &str) {
        self.failed = Some(why.to_owned());
        self.pending = None;
    }
}
