//! The only place of the session that reads the clock.

use std::time::{Duration, Instant};

/// The present moment.
#[expect(clippy::disallowed_methods, reason = "a session paces its window and times its numbers")]
pub(super) fn now() -> Instant {
    Instant::now()
}

/// A result and how long it took.
#[derive(Debug, Clone, PartialEq)]
pub struct Timed<T> {
    /// The result.
    pub value: T,
    /// How long it took, in milliseconds.
    pub ms: f64,
}

/// Computes something and looks at the clock before and after.
pub(super) fn time<T>(compute: impl FnOnce() -> T) -> Timed<T> {
    let start = now();
    let value = compute();
    Timed { value, ms: start.elapsed().as_secs_f64() * 1e3 }
}

/// Lets something happen at most so often.
#[derive(Debug)]
pub(super) struct Throttle {
    interval: Duration,
    last: Option<Instant>,
}

impl Throttle {
    pub(super) fn new(every: Duration) -> Self {
        Self { interval: every, last: None }
    }

    /// Whether it is time; if so, the next time is that much later.
    pub(super) fn ready(&mut self) -> bool {
        let now = now();
        let due = self.last.is_none_or(|last| now.duration_since(last) >= self.interval);
        if due {
            self.last = Some(now);
        }
        due
    }
}
