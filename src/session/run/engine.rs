//! The contract between a background run and the computation that it carries out.

use super::status::{RunKind, RunStatus};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// A computation that takes steps in the background.
///
/// The engine knows neither its status nor its number: the thread that owns it keeps both. Every
/// method may panic; the run fails then with the message of the panic.
pub(in crate::session) trait Engine: Sized + Send + 'static {
    /// The kind of the run.
    const KIND: RunKind;
    /// The name of the thread.
    const THREAD: &'static str;
    /// The shortest time between two snapshots while the run takes steps.
    const INTERVAL: Duration;
    /// True if the run before stays until a new one has started.
    const KEEPS_PREVIOUS: bool = false;

    /// A specification of the run.
    type Input: Send + 'static;
    /// A request to the run besides start, pause, resume, step, stop.
    type Request: Send + 'static;
    /// A message from the run besides changes of its status.
    type Report: Send + 'static;
    /// The state that panels read.
    type Snapshot: Send + Sync + 'static;

    /// The status in which the run starts: running, paused, or stopped where it has no steps.
    fn initial_status(&self) -> RunStatus {
        RunStatus::Running
    }

    /// Takes a step, in the threads of the run. Returns true if it was the last one.
    fn step(&mut self) -> Result<bool, String>;

    /// Prepares for a status, before the snapshot that shows it.
    fn on_status(&mut self, _status: RunStatus) -> Result<(), String> {
        Ok(())
    }

    /// Carries out a request. Returns the status that follows; `None` leaves it as it is.
    fn handle(&mut self, request: Self::Request) -> Result<Option<RunStatus>, String>;

    /// The present state.
    fn snapshot(&mut self) -> Self::Snapshot;

    /// Finishes the work before the engine is dropped.
    fn close(&mut self) {}
}

/// An event of a background run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::session) enum RunEvent<R> {
    /// The run has another status.
    Status(RunStatus),
    /// The run could not start, or has failed for this reason.
    Failed(String),
    /// A message of the engine.
    Report(R),
}

/// A message from the thread of a run.
#[derive(Debug)]
pub(super) enum ThreadMessage<R> {
    Status(u64, RunStatus),
    Failed(u64, String),
    Report(R),
}

/// Sends messages from a run to the session and wakes the window.
pub(in crate::session) struct EventSender<R> {
    messages: Sender<ThreadMessage<R>>,
    wake: Arc<Mutex<dyn Fn() + Send>>,
}

impl<R> Clone for EventSender<R> {
    fn clone(&self) -> Self {
        Self { messages: self.messages.clone(), wake: Arc::clone(&self.wake) }
    }
}

impl<R> EventSender<R> {
    pub(super) fn new(
        messages: Sender<ThreadMessage<R>>,
        wake: impl Fn() + Send + 'static,
    ) -> Self {
        Self { messages, wake: Arc::new(Mutex::new(wake)) }
    }

    /// Sends a message of the engine.
    pub(in crate::session) fn report(&self, report: R) {
        self.send(ThreadMessage::Report(report));
    }

    /// Sends a message; nobody receives it while the session is being dropped.
    pub(super) fn send(&self, message: ThreadMessage<R>) {
        self.messages.send(message).unwrap_or_default();
        self.wake();
    }

    /// Wakes the window.
    pub(super) fn wake(&self) {
        self.wake.lock().unwrap_or_else(PoisonError::into_inner)();
    }
}

/// Calls a function and turns a panic into an error with its message.
pub(in crate::session) fn catch_panic<T>(
    work: impl FnOnce() -> Result<T, String>,
) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(message(panic.as_ref())))
}

fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    format!("the computation failed: {}", text.unwrap_or_else(|| "unknown reason".to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_a_message_with_its_words() {
        let refused = catch_panic::<()>(|| panic!("no light at {}", 3)).unwrap_err();
        assert!(refused.ends_with("no light at 3"), "{refused}");
        let refused = catch_panic::<()>(|| panic!("dark")).unwrap_err();
        assert!(refused.ends_with("dark"), "{refused}");
        assert_eq!(catch_panic(|| Ok(2)), Ok(2));
    }
}
