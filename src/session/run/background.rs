//! The thread of a background run and the session's handle of it.

use super::engine::{Engine, EventSender, RunEvent, ThreadMessage, catch_panic};
use super::status::{RunId, RunStatus, RunView};
use super::tracker::RunTracker;
use crate::session::clock::Throttle;
use crate::session::slot::Slot;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::fmt;
use std::io;
use std::sync::Arc;
use std::sync::mpsc::{self, Receiver, Sender, TryRecvError};
use std::thread::{self, JoinHandle};

/// A request to the thread.
enum Request<E: Engine> {
    Start(u64, E::Input),
    /// Changes the status after the current step: to running, paused or stopped.
    SetStatus(RunStatus),
    Step,
    Clear,
    Engine(E::Request),
}

/// The state of a run with the number of the run.
struct Published<S> {
    number: u64,
    snapshot: Arc<S>,
}

/// The handle of a thread that carries out runs of one kind, one at a time.
///
/// Dropping the handle ends the thread after its current step.
pub(in crate::session) struct BackgroundRun<E: Engine> {
    tracker: RunTracker,
    requests: Option<Sender<Request<E>>>,
    messages: Receiver<ThreadMessage<E::Report>>,
    published: Slot<Published<E::Snapshot>>,
    thread: Option<JoinHandle<()>>,
}

impl<E: Engine> fmt::Debug for BackgroundRun<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BackgroundRun")
            .field("kind", &E::KIND)
            .field("tracker", &self.tracker)
            .finish_non_exhaustive()
    }
}

impl<E: Engine> BackgroundRun<E> {
    /// Starts the thread. `start` makes the engine of a run; `wake` is called from the thread when
    /// there is something new to show.
    pub(in crate::session) fn spawn(
        wake: impl Fn() + Send + 'static,
        start: impl FnMut(E::Input, &EventSender<E::Report>) -> Result<E, String> + Send + 'static,
    ) -> io::Result<Self> {
        let (requests, inbox) = mpsc::channel();
        let (sender, messages) = mpsc::channel();
        let published = Slot::default();
        let worker = RunWorker {
            start,
            inbox,
            sender: EventSender::new(sender, wake),
            published: published.clone(),
            throttle: Throttle::new(E::INTERVAL),
            pool: None,
            run: None,
        };
        let thread = thread::Builder::new().name(E::THREAD.to_owned());
        let thread = thread.spawn(move || worker.serve())?;
        let (requests, thread) = (Some(requests), Some(thread));
        Ok(Self { tracker: RunTracker::default(), requests, messages, published, thread })
    }

    /// Starts a run in place of the one before.
    pub(in crate::session) fn start(&mut self, input: E::Input) {
        let number = self.tracker.start(E::KEEPS_PREVIOUS);
        self.send(Request::Start(number, input));
    }

    /// Pauses the run after its current step.
    pub(in crate::session) fn pause(&mut self) {
        self.request(RunStatus::Pausing);
    }

    /// Resumes a paused run.
    pub(in crate::session) fn resume(&mut self) {
        self.request(RunStatus::Starting);
    }

    /// Takes one step of a paused run.
    pub(in crate::session) fn step(&self) {
        self.send(Request::Step);
    }

    /// Ends the run after its current step; its results remain.
    pub(in crate::session) fn stop(&mut self) {
        self.request(RunStatus::Stopping);
    }

    /// Ends the run and dismisses its results.
    pub(in crate::session) fn clear(&mut self) {
        self.tracker.clear();
        self.send(Request::Clear);
    }

    /// Sends a request to the engine; without a run it is ignored.
    pub(in crate::session) fn send_request(&self, request: E::Request) {
        self.send(Request::Engine(request));
    }

    /// Sends a request to the engine after which the run takes steps again.
    pub(in crate::session) fn restart(&mut self, request: E::Request) {
        self.tracker.restart();
        self.send_request(request);
    }

    /// The events of the run since the last call.
    pub(in crate::session) fn drain_events(&mut self) -> Vec<RunEvent<E::Report>> {
        let messages = self.messages.try_iter();
        messages.filter_map(|message| self.tracker.receive(message)).collect()
    }

    /// The run as panels see it.
    pub(in crate::session) fn view(&self) -> RunView<E::Snapshot> {
        let id = |number| RunId { kind: E::KIND, number };
        RunView {
            id: self.tracker.number().map(id),
            status: self.tracker.status(),
            error: self.tracker.error().map(str::to_owned),
            snapshot: self.snapshot(),
        }
    }

    /// The latest state of the run that is shown.
    pub(in crate::session) fn snapshot(&self) -> Option<Arc<E::Snapshot>> {
        let published = self.published.latest()?;
        let is_current = self.tracker.current() == Some(published.number);
        is_current.then(|| Arc::clone(&published.snapshot))
    }

    /// The status of the run.
    pub(in crate::session) const fn status(&self) -> RunStatus {
        self.tracker.status()
    }

    /// True if a run was asked for that has not started yet.
    pub(in crate::session) const fn is_starting(&self) -> bool {
        self.tracker.is_starting()
    }

    fn request(&mut self, status: RunStatus) {
        if self.tracker.request(status) {
            self.send(Request::SetStatus(status.target()));
        }
    }

    /// The thread outlives every panic of its engine, so it receives every request.
    fn send(&self, request: Request<E>) {
        if let Some(requests) = &self.requests {
            requests.send(request).unwrap_or_default();
        }
    }
}

impl<E: Engine> Drop for BackgroundRun<E> {
    fn drop(&mut self) {
        self.requests = None;
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap_or_default();
        }
    }
}

/// The thread's side.
struct RunWorker<E: Engine, S> {
    start: S,
    inbox: Receiver<Request<E>>,
    sender: EventSender<E::Report>,
    published: Slot<Published<E::Snapshot>>,
    throttle: Throttle,
    /// The threads of the steps, made for the first run: the analyses of panels do not queue behind
    /// a step.
    pool: Option<ThreadPool>,
    run: Option<ActiveRun<E>>,
}

/// A run with its status.
struct ActiveRun<E> {
    number: u64,
    status: RunStatus,
    engine: E,
}

/// The next thing to do.
enum Next<E: Engine> {
    Handle(Request<E>),
    Step,
    End,
}

impl<E, S> RunWorker<E, S>
where
    E: Engine,
    S: FnMut(E::Input, &EventSender<E::Report>) -> Result<E, String>,
{
    /// Works until the handle is dropped.
    fn serve(mut self) {
        loop {
            match self.next() {
                Next::Handle(request) => self.handle(request),
                Next::Step => self.step(),
                Next::End => return self.close(),
            }
        }
    }

    fn next(&self) -> Next<E> {
        if self.status() != RunStatus::Running {
            return self.inbox.recv().map_or(Next::End, Next::Handle);
        }
        match self.inbox.try_recv() {
            Ok(request) => Next::Handle(request),
            Err(TryRecvError::Empty) => Next::Step,
            Err(TryRecvError::Disconnected) => Next::End,
        }
    }

    fn status(&self) -> RunStatus {
        self.run.as_ref().map_or(RunStatus::Idle, |run| run.status)
    }

    fn handle(&mut self, request: Request<E>) {
        match request {
            Request::Start(number, input) => self.start(number, input),
            Request::SetStatus(status) => {
                if self.status().is_active() && self.status() != status {
                    self.set_status(status);
                }
            }
            Request::Step => {
                if self.status() == RunStatus::Paused {
                    self.step();
                    self.show();
                }
            }
            Request::Clear => self.close(),
            Request::Engine(request) => self.handle_request(request),
        }
    }

    fn start(&mut self, number: u64, input: E::Input) {
        if !E::KEEPS_PREVIOUS {
            self.close();
        }
        let started = self.make_pool().and_then(|()| {
            let (start, sender) = (&mut self.start, &self.sender);
            catch_panic(|| start(input, sender))
        });
        match started {
            Ok(engine) => {
                self.close();
                let status = engine.initial_status();
                self.run = Some(ActiveRun { number, status, engine });
                self.set_status(status);
            }
            Err(why) => self.sender.send(ThreadMessage::Failed(number, why)),
        }
    }

    fn make_pool(&mut self) -> Result<(), String> {
        if self.pool.is_none() {
            let name = |i: usize| format!("{} {i}", E::THREAD);
            let pool = ThreadPoolBuilder::new().thread_name(name).build();
            self.pool = Some(pool.map_err(|why| why.to_string())?);
        }
        Ok(())
    }

    /// Takes a step; then the run continues, or has finished or failed.
    fn step(&mut self) {
        let (Some(run), Some(pool)) = (&mut self.run, &self.pool) else { return };
        match catch_panic(|| pool.install(|| run.engine.step())) {
            Ok(true) => self.set_status(RunStatus::Finished),
            Ok(false) if self.throttle.ready() => self.show(),
            Ok(false) => {}
            Err(why) => self.fail(why),
        }
    }

    fn handle_request(&mut self, request: E::Request) {
        let Some(run) = &mut self.run else { return };
        match catch_panic(|| run.engine.handle(request)) {
            Ok(Some(status)) => self.set_status(status),
            Ok(None) => self.show(),
            Err(why) => self.fail(why),
        }
    }

    /// Gives the run a status, publishes its state and reports it.
    fn set_status(&mut self, status: RunStatus) {
        let Some(run) = &mut self.run else { return };
        if let Err(why) = catch_panic(|| run.engine.on_status(status)) {
            return self.fail(why);
        }
        run.status = status;
        let number = run.number;
        self.publish();
        self.sender.send(ThreadMessage::Status(number, status));
    }

    fn fail(&mut self, why: String) {
        let Some(run) = &mut self.run else { return };
        run.status = RunStatus::Failed;
        let number = run.number;
        // What a failed engine still says of itself is of no consequence.
        catch_panic(|| run.engine.on_status(RunStatus::Failed)).unwrap_or_default();
        self.publish();
        self.sender.send(ThreadMessage::Failed(number, why));
    }

    fn show(&mut self) {
        self.publish();
        self.sender.wake();
    }

    /// Publishes the state of the run; after a panic it may have none, and the one before stays.
    fn publish(&mut self) {
        let Some(run) = &mut self.run else { return };
        if let Ok(snapshot) = catch_panic(|| Ok(run.engine.snapshot())) {
            self.published.set(Published { number: run.number, snapshot: Arc::new(snapshot) });
        }
    }

    /// Drops the run once its work is finished; what that reports is not lost.
    fn close(&mut self) {
        if let Some(mut run) = self.run.take() {
            let closed = catch_panic(|| {
                run.engine.close();
                Ok(())
            });
            if let Err(why) = closed {
                self.sender.send(ThreadMessage::Failed(run.number, why));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::run::status::RunKind;
    use std::convert::Infallible;
    use std::time::Duration;

    /// Counts its steps, and breaks at the third one.
    struct Toy {
        steps: usize,
    }

    impl Engine for Toy {
        const KIND: RunKind = RunKind::Pareto;
        const THREAD: &'static str = "toy";
        const INTERVAL: Duration = Duration::MAX;

        type Input = ();
        type Request = Infallible;
        type Report = Infallible;
        type Snapshot = usize;

        fn step(&mut self) -> Result<bool, String> {
            self.steps += 1;
            assert!(self.steps < 3, "the toy breaks");
            Ok(false)
        }

        fn handle(&mut self, request: Infallible) -> Result<Option<RunStatus>, String> {
            match request {}
        }

        fn snapshot(&mut self) -> usize {
            self.steps
        }
    }

    /// Waits for a status and returns the events until then.
    fn wait(run: &mut BackgroundRun<Toy>, status: RunStatus) -> Vec<RunEvent<Infallible>> {
        let mut events = Vec::new();
        while run.status() != status {
            thread::sleep(Duration::from_millis(1));
            events.extend(run.drain_events());
        }
        events
    }

    #[test]
    fn a_panic_fails_the_run_with_its_message_and_the_next_one_starts() -> io::Result<()> {
        let mut run = BackgroundRun::spawn(|| {}, |(), _| Ok(Toy { steps: 0 }))?;
        for number in 1..3 {
            run.start(());
            assert_eq!((run.status(), run.snapshot()), (RunStatus::Starting, None));
            let events = wait(&mut run, RunStatus::Failed);
            let error = "the computation failed: the toy breaks".to_owned();
            let running = RunEvent::Status(RunStatus::Running);
            assert_eq!(events, [running, RunEvent::Failed(error.clone())]);
            let RunView { id, status, error: shown, snapshot } = run.view();
            assert_eq!(id, Some(RunId { kind: RunKind::Pareto, number }));
            assert_eq!((status, shown), (RunStatus::Failed, Some(error)));
            assert_eq!(snapshot.as_deref(), Some(&3), "the state of the last step remains");
        }
        run.clear();
        assert_eq!((run.status(), run.view().snapshot), (RunStatus::Idle, None));
        Ok(())
    }
}
