//! The only place of the session that reads the clock.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// The present time.
#[expect(clippy::disallowed_methods, reason = "a session paces its window and times its numbers")]
pub(super) fn now() -> Instant {
    Instant::now()
}

/// A result with its computing time.
#[derive(Debug, Clone, PartialEq)]
pub struct Timed<T> {
    /// The result.
    pub value: T,
    /// The time that it took, in milliseconds.
    pub ms: f64,
}

/// Calls a function and measures its time.
pub(super) fn time<T>(compute: impl FnOnce() -> T) -> Timed<T> {
    let start = now();
    let value = compute();
    Timed { value, ms: start.elapsed().as_secs_f64() * 1e3 }
}

/// Limits the rate of an action.
#[derive(Debug)]
pub(super) struct Throttle {
    interval: Duration,
    last: Option<Instant>,
}

impl Throttle {
    pub(super) fn new(every: Duration) -> Self {
        Self { interval: every, last: None }
    }

    /// Returns true if the interval since the last time that this was true has passed.
    pub(super) fn ready(&mut self) -> bool {
        let now = now();
        let due = self.last.is_none_or(|last| now.duration_since(last) >= self.interval);
        if due {
            self.last = Some(now);
        }
        due
    }
}

/// The present time, in seconds since 1970 (UTC); 0 if the clock of the system is before that.
pub(super) fn unix_seconds() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs())
}
