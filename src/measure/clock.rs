//! The clock of the measurements.

use std::time::Instant;

/// When something began.
#[derive(Debug, Clone, Copy)]
pub struct Stopwatch(Instant);

impl Stopwatch {
    /// Now.
    #[expect(clippy::disallowed_methods, reason = "measuring is what this floor is for")]
    pub fn start() -> Self {
        Self(Instant::now())
    }

    /// Seconds since then.
    pub fn seconds(self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
}

/// Does some work; what comes out, and the milliseconds that it took.
pub fn time_ms<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let watch = Stopwatch::start();
    let result = work();
    (result, 1e3 * watch.seconds())
}
