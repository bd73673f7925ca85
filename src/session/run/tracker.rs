//! The session's view of the status of its latest run, ahead of what the thread has reported.

use super::engine::{RunEvent, ThreadMessage};
use super::status::RunStatus;

/// Tracks the latest run of one kind; messages of earlier runs are ignored.
#[derive(Debug, Default)]
pub(super) struct RunTracker {
    /// The number of runs started so far.
    count: u64,
    /// The run that is shown.
    current: Option<u64>,
    /// The run that was asked for and has not started.
    starting: Option<u64>,
    status: RunStatus,
    error: Option<String>,
}

impl RunTracker {
    /// Starts the next run and returns its number; `keeps_previous` leaves the run before it in place
    /// until it has started.
    pub(super) fn start(&mut self, keeps_previous: bool) -> u64 {
        self.count += 1;
        self.starting = Some(self.count);
        self.error = None;
        if self.current.is_none() || !keeps_previous {
            self.current = None;
            self.status = RunStatus::Starting;
        }
        self.count
    }

    /// Requests another status. Returns true if the thread has to be told.
    pub(super) fn request(&mut self, request: RunStatus) -> bool {
        use RunStatus::{Paused, Pausing, Running, Starting, Stopping};
        let applies = match request {
            Starting => matches!(self.status, Paused | Pausing),
            Pausing => matches!(self.status, Starting | Running),
            Stopping => self.status.is_active() && self.status != Stopping,
            _ => false,
        };
        if applies {
            self.status = request;
        }
        applies
    }

    /// Notes that the current run was asked to start again.
    pub(super) fn restart(&mut self) {
        self.status = RunStatus::Starting;
        self.error = None;
    }

    /// Dismisses the run.
    pub(super) fn clear(&mut self) {
        *self = Self { count: self.count, ..Self::default() };
    }

    /// Takes a message of the thread; `None` if it is of an earlier run.
    pub(super) fn receive<R>(&mut self, message: ThreadMessage<R>) -> Option<RunEvent<R>> {
        match message {
            ThreadMessage::Status(number, status) => {
                self.receive_status(number, status).then_some(RunEvent::Status(status))
            }
            ThreadMessage::Failed(number, why) => {
                self.receive_error(number, &why).then_some(RunEvent::Failed(why))
            }
            ThreadMessage::Report(report) => Some(RunEvent::Report(report)),
        }
    }

    fn receive_status(&mut self, number: u64, status: RunStatus) -> bool {
        let starts = self.starting == Some(number);
        if starts {
            self.starting = None;
            if self.current.is_some() || self.status == RunStatus::Starting {
                // Requests so far were made to the run before; or there were none.
                self.status = status;
            }
            self.current = Some(number);
        }
        let is_current = self.current == Some(number);
        // A status that is older than the latest request is on its way to be replaced.
        let is_newest = self.status == self.status.target() || self.status.target() == status;
        if is_current && (is_newest || !status.is_active()) {
            self.status = status;
        }
        is_current
    }

    fn receive_error(&mut self, number: u64, why: &str) -> bool {
        let starts = self.starting == Some(number);
        let is_current = self.current == Some(number);
        if starts {
            self.starting = None;
        }
        if starts || is_current {
            self.error = Some(why.to_owned());
        }
        if is_current || starts && self.current.is_none() {
            self.status = RunStatus::Failed;
        }
        starts || is_current
    }

    /// The number of the run that is shown.
    pub(super) const fn current(&self) -> Option<u64> {
        self.current
    }

    /// The number of the run that is shown, or else of the one that was asked for.
    pub(super) fn number(&self) -> Option<u64> {
        self.current.or(self.starting)
    }

    pub(super) const fn is_starting(&self) -> bool {
        self.starting.is_some()
    }

    pub(super) const fn status(&self) -> RunStatus {
        self.status
    }

    pub(super) fn error(&self) -> Option<&str> {
        self.error.as_deref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use RunStatus::{
        Failed, Finished, Idle, Paused, Pausing, Running, Starting, Stopped, Stopping,
    };

    fn report_status(tracker: &mut RunTracker, number: u64, status: RunStatus) -> RunStatus {
        let _: Option<RunEvent<()>> = tracker.receive(ThreadMessage::Status(number, status));
        tracker.status()
    }

    #[test]
    fn a_status_older_than_the_latest_request_is_not_shown() {
        let mut tracker = RunTracker::default();
        assert_eq!((tracker.status(), tracker.request(Pausing)), (Idle, false));
        let number = tracker.start(false);
        assert_eq!(tracker.status(), Starting);
        assert!(tracker.request(Pausing));
        assert_eq!(report_status(&mut tracker, number, Running), Pausing);
        assert!(tracker.request(Starting));
        assert_eq!(report_status(&mut tracker, number, Paused), Starting);
        assert_eq!(report_status(&mut tracker, number, Running), Running);
        assert!(tracker.request(Stopping) && !tracker.request(Pausing));
        assert_eq!(
            report_status(&mut tracker, number, Finished),
            Finished,
            "it ended before it could stop"
        );
        assert!(!tracker.request(Stopping));
    }

    #[test]
    fn earlier_runs_are_ignored_and_a_failure_keeps_its_reason() {
        let mut tracker = RunTracker::default();
        let first = tracker.start(false);
        let second = tracker.start(false);
        assert_eq!(report_status(&mut tracker, first, Stopped), Starting);
        let event = tracker.receive::<()>(ThreadMessage::Failed(second, "no lens".to_owned()));
        assert_eq!(event, Some(RunEvent::Failed("no lens".to_owned())));
        assert_eq!((tracker.status(), tracker.error()), (Failed, Some("no lens")));
        tracker.clear();
        assert_eq!((tracker.status(), tracker.error(), tracker.number()), (Idle, None, None));
    }

    #[test]
    fn a_run_that_is_kept_stays_until_the_next_one_has_started() {
        let mut tracker = RunTracker::default();
        let first = tracker.start(true);
        assert_eq!(report_status(&mut tracker, first, Paused), Paused);
        let second = tracker.start(true);
        assert_eq!((tracker.status(), tracker.current()), (Paused, Some(first)));
        tracker.receive::<()>(ThreadMessage::Failed(second, "no task".to_owned()));
        assert_eq!((tracker.status(), tracker.error()), (Paused, Some("no task")));
        let third = tracker.start(true);
        assert_eq!(report_status(&mut tracker, third, Stopped), Stopped);
        assert_eq!(tracker.current(), Some(third));
    }

    #[test]
    fn a_run_that_starts_again_shows_neither_its_end_nor_its_failure() {
        let mut tracker = RunTracker::default();
        let number = tracker.start(false);
        tracker.receive::<()>(ThreadMessage::Failed(number, "no lens".to_owned()));
        tracker.restart();
        assert_eq!((tracker.status(), tracker.error()), (Starting, None));
    }
}
