//! A thread that is told orders and tells news: what all work in the background has in common.
//!
//! Work that runs goes on, bit by bit, as long as no order waits; work that does not run waits for
//! the next order. Dropping the handle ends the thread.

use rayon::{ThreadPool, ThreadPoolBuilder};
use std::any::Any;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{self, Receiver, Sender, TryRecvError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

/// What a thread in the background does.
pub(super) trait Work {
    /// What it is told.
    type Order;

    /// Whether it goes on by itself.
    fn is_running(&self) -> bool;

    /// Does as it is told.
    fn obey(&mut self, order: Self::Order);

    /// Goes on for a bit.
    fn advance(&mut self);

    /// Does what is left to do before the thread ends.
    fn close(&mut self) {}
}

/// The handle of a thread.
#[derive(Debug)]
pub(super) struct Background<O, N> {
    orders: Option<Sender<O>>,
    pub(super) news: Receiver<N>,
    thread: Option<JoinHandle<()>>,
}

/// Where a thread leaves its news; `wake` says that there is something new to look at.
pub(super) struct Outbox<N> {
    news: Sender<N>,
    wake: Arc<Mutex<dyn Fn() + Send>>,
}

impl<N> Clone for Outbox<N> {
    fn clone(&self) -> Self {
        Self { news: self.news.clone(), wake: Arc::clone(&self.wake) }
    }
}

impl<N> Outbox<N> {
    /// Nobody listens any more when the handle is being dropped; the next look at the orders ends
    /// the thread then.
    pub(super) fn emit(&self, news: N) {
        self.news.send(news).unwrap_or_default();
        self.wake();
    }

    pub(super) fn wake(&self) {
        self.wake.lock().unwrap_or_else(PoisonError::into_inner)();
    }
}

impl<O, N> Background<O, N>
where
    O: Send + 'static,
    N: Send + 'static,
{
    /// Starts a thread of this name; `wake` is called from it.
    pub(super) fn spawn<W>(
        name: &str,
        wake: impl Fn() + Send + 'static,
        work: impl FnOnce(Outbox<N>) -> W,
    ) -> io::Result<Self>
    where
        W: Work<Order = O> + Send + 'static,
    {
        let (orders, inbox) = mpsc::channel();
        let (sender, news) = mpsc::channel();
        let work = work(Outbox { news: sender, wake: Arc::new(Mutex::new(wake)) });
        let thread = thread::Builder::new().name(name.into()).spawn(move || serve(work, &inbox))?;
        Ok(Self { orders: Some(orders), news, thread: Some(thread) })
    }

    /// The thread outlives every panic of its work, so it hears every order.
    pub(super) fn tell(&self, order: O) {
        if let Some(orders) = &self.orders {
            orders.send(order).unwrap_or_default();
        }
    }

    /// What happened since the last look.
    pub(super) fn news(&self) -> Vec<N> {
        self.news.try_iter().collect()
    }
}

impl<O, N> Drop for Background<O, N> {
    fn drop(&mut self) {
        self.orders = None;
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap_or_default();
        }
    }
}

/// What comes next.
enum Next<O> {
    Obey(O),
    Advance,
    End,
}

/// Works until the handle is dropped.
fn serve<W: Work>(mut work: W, inbox: &Receiver<W::Order>) {
    loop {
        match next(&work, inbox) {
            Next::Obey(order) => work.obey(order),
            Next::Advance => work.advance(),
            Next::End => return work.close(),
        }
    }
}

fn next<W: Work>(work: &W, inbox: &Receiver<W::Order>) -> Next<W::Order> {
    if !work.is_running() {
        return inbox.recv().map_or(Next::End, Next::Obey);
    }
    match inbox.try_recv() {
        Ok(order) => Next::Obey(order),
        Err(TryRecvError::Empty) => Next::Advance,
        Err(TryRecvError::Disconnected) => Next::End,
    }
}

/// Threads of its own for some work: numbers of panels do not queue behind it.
pub(super) fn pool(name: &'static str) -> io::Result<ThreadPool> {
    let each = move |i: usize| format!("{name} {i}");
    ThreadPoolBuilder::new().thread_name(each).build().map_err(io::Error::other)
}

/// Does something; a panic becomes its words.
pub(super) fn guarded<T>(work: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(said(panic.as_ref())))
}

/// The words of a panic.
pub(super) fn said(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    format!("the search failed: {}", text.unwrap_or_else(|| "for an unknown reason".to_owned()))
}
