//! A thread that answers the newest question; an older one that it has not begun is forgotten.

use crate::session::background::guarded;
use crate::session::slot::{LatestRequest, Slot};
use std::io;
use std::sync::Arc;
use std::thread::{self, JoinHandle};

/// The handle of a thread that answers questions.
#[derive(Debug)]
pub(super) struct LatestRequestWorker<Q, A> {
    questions: Arc<LatestRequest<Q>>,
    answers: Slot<Result<A, String>>,
    thread: Option<JoinHandle<()>>,
}

impl<Q: Send + 'static, A: Send + Sync + 'static> LatestRequestWorker<Q, A> {
    /// Starts a thread of this name; `wake` is called from it when there is an answer.
    pub(super) fn spawn(
        name: &str,
        wake: impl Fn() + Send + 'static,
        answer: impl Fn(Q) -> Result<A, String> + Send + 'static,
    ) -> io::Result<Self> {
        let (questions, answers) = (Arc::new(LatestRequest::new()), Slot::default());
        let (inbox, shown) = (Arc::clone(&questions), answers.clone());
        let serve = move || {
            while let Some(question) = inbox.take() {
                shown.set(guarded(|| answer(question)));
                wake();
            }
        };
        let thread = thread::Builder::new().name(name.into()).spawn(serve)?;
        Ok(Self { questions, answers, thread: Some(thread) })
    }
}

impl<Q, A> LatestRequestWorker<Q, A> {
    /// Asks, and no longer what was asked before.
    pub(super) fn request(&self, question: Q) {
        self.questions.submit(question);
    }

    /// The newest answer, or why there is none.
    pub(super) fn latest(&self) -> Option<Arc<Result<A, String>>> {
        self.answers.latest()
    }
}

impl<Q, A> Drop for LatestRequestWorker<Q, A> {
    fn drop(&mut self) {
        self.questions.close();
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap_or_default();
        }
    }
}
