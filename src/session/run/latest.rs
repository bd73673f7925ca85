//! A worker that carries out the latest request; a newer one replaces one that has not begun.

use super::engine::catch_panic;
use crate::session::slot::{LatestRequest, Slot};
use std::io;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// The handle of a thread that carries out the latest request and publishes its newest result.
///
/// Dropping the handle ends the thread.
#[derive(Debug)]
pub(in crate::session) struct LatestRequestWorker<Q, A> {
    requests: Arc<LatestRequest<Q>>,
    results: Slot<A>,
    thread: Option<JoinHandle<()>>,
}

/// The worker's side: publishes results and knows of newer requests.
pub(in crate::session) struct WorkerOutput<Q, A> {
    requests: Arc<LatestRequest<Q>>,
    results: Slot<A>,
    wake: Box<dyn Fn() + Send>,
}

impl<Q: Send + 'static, A: Send + Sync + 'static> LatestRequestWorker<Q, A> {
    /// Starts a thread of this name; `wake` is called from it when there is a new result.
    pub(in crate::session) fn spawn(
        name: &str,
        wake: impl Fn() + Send + 'static,
        mut work: impl FnMut(Q, &WorkerOutput<Q, A>) + Send + 'static,
    ) -> io::Result<Self> {
        let (requests, results) = (Arc::new(LatestRequest::new()), Slot::default());
        let (inbox, published) = (Arc::clone(&requests), results.clone());
        let output = WorkerOutput { requests: inbox, results: published, wake: Box::new(wake) };
        let serve = move || {
            while let Some(request) = output.requests.take() {
                work(request, &output);
            }
        };
        let thread = thread::Builder::new().name(name.to_owned()).spawn(serve)?;
        Ok(Self { requests, results, thread: Some(thread) })
    }
}

impl<Q: Send + 'static, A: Send + Sync + 'static> LatestRequestWorker<Q, Result<A, String>> {
    /// The same for a plain function; a panic in it is an error with its message.
    pub(in crate::session) fn spawn_function(
        name: &str,
        wake: impl Fn() + Send + 'static,
        function: impl Fn(Q) -> Result<A, String> + Send + 'static,
    ) -> io::Result<Self> {
        let work = move |request, output: &WorkerOutput<Q, Result<A, String>>| {
            output.publish(catch_panic(|| function(request)));
        };
        Self::spawn(name, wake, work)
    }
}

impl<Q, A> LatestRequestWorker<Q, A> {
    /// Submits a request in place of one that has not begun.
    pub(in crate::session) fn request(&self, request: Q) {
        self.requests.submit(request);
    }

    /// The newest result.
    pub(in crate::session) fn latest(&self) -> Option<Arc<A>> {
        self.results.latest()
    }

    /// Publishes a result from the side of the session.
    pub(in crate::session) fn publish(&self, result: A) {
        self.results.set(result);
    }
}

impl<Q, A> Drop for LatestRequestWorker<Q, A> {
    fn drop(&mut self) {
        self.requests.close();
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap_or_default();
        }
    }
}

impl<Q: Send, A> WorkerOutput<Q, A> {
    /// A test for other threads: true if a newer request waits or the worker is to end.
    pub(in crate::session) fn interruption(&self) -> impl Fn() -> bool + Sync {
        let requests = &self.requests;
        move || requests.is_interrupted()
    }
}

impl<Q, A> WorkerOutput<Q, A> {
    /// Publishes a result in place of the one before and wakes the window.
    pub(in crate::session) fn publish(&self, result: A) {
        self.results.set(result);
        (self.wake)();
    }

    /// True if a newer request waits or the worker is to end.
    pub(in crate::session) fn is_interrupted(&self) -> bool {
        self.requests.is_interrupted()
    }

    /// True if the worker is to end.
    pub(in crate::session) fn is_closed(&self) -> bool {
        self.requests.is_closed()
    }

    /// Waits for this time. Returns true if no request has arrived.
    pub(in crate::session) fn idle_for(&self, time: Duration) -> bool {
        self.requests.idle_for(time)
    }
}
