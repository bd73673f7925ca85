//! Shared values between threads of which neither waits for the other.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// A slot for the newest value of a thread.
#[derive(Debug)]
pub struct Slot<T>(Arc<Mutex<Option<Arc<T>>>>);

impl<T> Clone for Slot<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> Default for Slot<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<T> Slot<T> {
    /// Replaces the value.
    pub fn set(&self, value: T) {
        *locked(&self.0) = Some(Arc::new(value));
    }

    /// The newest value.
    pub fn latest(&self) -> Option<Arc<T>> {
        locked(&self.0).clone()
    }
}

/// A thread that died while it held the lock left a whole value: only whole values are stored.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A one-element mailbox: a new request replaces an unread one.
#[derive(Debug)]
pub(super) struct LatestRequest<T> {
    state: Mutex<RequestState<T>>,
    arrived: Condvar,
}

#[derive(Debug)]
struct RequestState<T> {
    request: Option<T>,
    closed: bool,
}

impl<T> LatestRequest<T> {
    pub(super) fn new() -> Self {
        let state = RequestState { request: None, closed: false };
        Self { state: Mutex::new(state), arrived: Condvar::new() }
    }

    /// Submits a request.
    pub(super) fn submit(&self, request: T) {
        locked(&self.state).request = Some(request);
        self.arrived.notify_one();
    }

    /// Closes the mailbox.
    pub(super) fn close(&self) {
        locked(&self.state).closed = true;
        self.arrived.notify_all();
    }

    /// True if a request waits or the mailbox is closed.
    pub(super) fn is_interrupted(&self) -> bool {
        let state = locked(&self.state);
        state.closed || state.request.is_some()
    }

    /// Waits for a request; `None` if the mailbox is closed.
    pub(super) fn take(&self) -> Option<T> {
        let waiting = |state: &mut RequestState<T>| !state.closed && state.request.is_none();
        let state = self.arrived.wait_while(locked(&self.state), waiting);
        let mut state = state.unwrap_or_else(PoisonError::into_inner);
        if state.closed { None } else { state.request.take() }
    }

    /// Waits for this time. Returns true if nothing has arrived.
    pub(super) fn idle_for(&self, time: Duration) -> bool {
        let waiting = |state: &mut RequestState<T>| !state.closed && state.request.is_none();
        let waited = self.arrived.wait_timeout_while(locked(&self.state), time, waiting);
        waited.unwrap_or_else(PoisonError::into_inner).1.timed_out()
    }

    /// True if the mailbox is closed.
    pub(super) fn is_closed(&self) -> bool {
        locked(&self.state).closed
    }
}
