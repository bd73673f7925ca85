//! A thread that answers the newest question; an older one that it has not begun is forgotten.

use crate::session::background::guarded;
use crate::session::slot::{Mailbox, Slot};
use std::io;
use std::sync::Arc;
use std::thread::{self, JoinHandle};

/// The handle of a thread that answers questions.
#[derive(Debug)]
pub(super) struct Observer<Q, A> {
    questions: Arc<Mailbox<Q>>,
    answers: Slot<Result<A, String>>,
    thread: Option<JoinHandle<()>>,
}

impl<Q: Send + 'static, A: Send + Sync + 'static> Observer<Q, A> {
    /// Starts a thread of this name; `wake` is called from it when there is an answer.
    pub(super) fn spawn(
        name: &str,
        wake: impl Fn() + Send + 'static,
        answer: impl Fn(Q) -> Result<A, String> + Send + 'static,
    ) -> io::Result<Self> {
        let (questions, answers) = (Arc::new(Mailbox::new()), Slot::default());
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

impl<Q, A> Observer<Q, A> {
    /// Asks, and no longer what was asked before.
    pub(super) fn ask(&self, question: Q) {
        self.questions.put(question);
    }

    /// The newest answer, or why there is none.
    pub(super) fn answer(&self) -> Option<Arc<Result<A, String>>> {
        self.answers.latest()
    }
}

impl<Q, A> Drop for Observer<Q, A> {
    fn drop(&mut self) {
        self.questions.close();
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap_or_default();
        }
    }
}
