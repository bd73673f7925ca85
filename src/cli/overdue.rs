//! The end of a command that does not come to its end: asked to stop, a command finishes its present
//! step, which may take minutes on a wild lens. After some seconds of patience what the steps before
//! have found is saved and printed, and the process ends.

use super::error::CliError;
use super::exit_status;
use super::progress::are_signals_of_host;
use crate::measure::Stopwatch;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// The time that a command has for its regular end.
const PATIENCE: f64 = 5.0; // seconds
/// The time between two looks at the flag.
const INTERVAL: Duration = Duration::from_millis(50);

/// The result of a command so far, for a thread that ends the process with it if the command itself is
/// too late. Dropping it leaves the end to the command.
#[derive(Debug)]
pub(super) struct FoundSoFar<T>(Arc<Mutex<Option<T>>>);

impl<T: Send + 'static> FoundSoFar<T> {
    /// Begins to watch a command that `stop` asks to end; `finish` saves and prints what it has found. In
    /// a program that this library is a part of, no process is ended.
    pub(super) fn watch(
        stop: &Arc<AtomicBool>,
        found: T,
        finish: impl FnOnce(T) -> Result<(), CliError> + Send + 'static,
    ) -> Self {
        let shared = Arc::new(Mutex::new(Some(found)));
        if !are_signals_of_host() {
            let (stop, watched) = (Arc::clone(stop), Arc::clone(&shared));
            let watch = thread::Builder::new().name("late end".to_owned());
            let begun = watch.spawn(move || end_when_late(&stop, &watched, finish));
            if let Err(error) = begun {
                log::warn!("a step that does not end will not be ended: {error}");
            }
        }
        Self(shared)
    }

    /// Changes what has been found.
    pub(super) fn update(&self, change: impl FnOnce(&mut T)) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).as_mut().map(change);
    }
}

impl<T> Drop for FoundSoFar<T> {
    /// Waits for the end of the process if that has begun, so that nothing is saved or printed twice.
    fn drop(&mut self) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
    }
}

#[expect(clippy::exit, reason = "the thread of the command itself is in a step that does not end")]
fn end_when_late<T>(
    stop: &AtomicBool,
    found: &Mutex<Option<T>>,
    finish: impl FnOnce(T) -> Result<(), CliError>,
) {
    let mut asked = None;
    loop {
        thread::sleep(INTERVAL);
        if stop.load(Ordering::Relaxed) {
            asked.get_or_insert_with(Stopwatch::start);
        }
        let mut found = found.lock().unwrap_or_else(PoisonError::into_inner);
        if found.is_none() {
            return;
        }
        if asked.is_some_and(|asked| asked.seconds() >= PATIENCE)
            && let Some(found) = found.take()
        {
            std::process::exit(i32::from(exit_status(finish(found))));
        }
    }
}
