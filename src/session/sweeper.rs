//! A front that is swept in the background: orders in, news out, and dropping the handle ends the
//! thread.
//!
//! The sweep works on its own copy of the lens and never touches the design. What it has found sits
//! in a newest-value slot; a panic inside ends the sweep and not the session.

use super::background::{Background, Outbox, Work, guarded, pool};
use super::clock::{Throttle, Timed, time};
use super::judged::ScoredLens;
use super::slot::Slot;
use super::worker::RunStatus;
use crate::lens::Lens;
use crate::merit::PupilEdge;
use crate::optimize::pareto::{Front, ParetoPoint, ParetoSettings, ParetoSweep, SweepProgress};
use crate::report::ParetoReport;
use rayon::ThreadPool;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// The time between two looks of the window, at least.
const BETWEEN: Duration = Duration::from_millis(100);

/// A front on its way, or as it was left.
#[derive(Debug, Clone)]
pub struct ParetoRun {
    /// Which of the session it is, counted from 1.
    pub number: u64,
    /// How it stands.
    pub status: RunStatus,
    /// What it was told.
    pub settings: ParetoSettings,
    /// Whether the same search follows with pupils that the derivatives keep as they are.
    pub compare: bool,
    /// The design from which it began.
    pub lens: Arc<Lens>,
    /// The same as the sweep judges it: limited by its stop.
    pub start: Arc<ParetoPoint>,
    /// What was found.
    pub main: ParetoPass,
    /// What is found with kept pupils; `None` before that begins.
    pub biased: Option<ParetoPass>,
}

/// One sweep of a run.
#[derive(Debug, Clone)]
pub struct ParetoPass {
    /// The front so far.
    pub front: Arc<Front>,
    /// Spot in mm and light in mm² of every lens that was looked at.
    pub evaluated: Arc<Vec<[f64; 2]>>,
    /// The hypervolume of the front against twice the spot of the lens at the start.
    pub hypervolume: f64,
    /// Steps so far, over all chains; those that a descent did not need count as taken.
    pub done: usize,
    /// Steps in all.
    pub total: usize,
    /// The time that they took, in seconds, pauses apart.
    pub seconds: f64,
    /// What was given up and why, the last one.
    pub rejection: Option<String>,
}

impl ParetoRun {
    /// Whether it goes on or can.
    pub fn is_active(&self) -> bool {
        self.status.is_active()
    }

    /// The sweep that runs, or ran last.
    pub fn current_pass(&self) -> &ParetoPass {
        self.biased.as_ref().unwrap_or(&self.main)
    }

    /// The part that is done, 0 to 1.
    pub fn fraction_done(&self) -> f64 {
        let legs = 1 + usize::from(self.compare);
        let done = self.main.done + self.biased.as_ref().map_or(0, |leg| leg.done);
        done as f64 / (legs * self.main.total).max(1) as f64
    }

    /// The same as files need it.
    fn survey(&self) -> ParetoReport<'_> {
        ParetoReport {
            name: &self.lens.name,
            start: &self.start,
            front: &self.main.front,
            tried: &self.main.evaluated,
            biased: self.biased.as_ref().map(|leg| &*leg.front),
        }
    }
}

impl ParetoPass {
    fn new(sweep: &dyn ParetoEngine) -> Self {
        let mut leg = Self {
            front: Arc::default(),
            evaluated: Arc::default(),
            hypervolume: 0.0,
            done: 0,
            total: 0,
            seconds: 0.0,
            rejection: None,
        };
        leg.look(sweep);
        leg
    }

    /// Takes over what a sweep has found.
    fn look(&mut self, sweep: &dyn ParetoEngine) {
        self.front = Arc::new(sweep.front().clone());
        self.evaluated = Arc::new(sweep.tried().to_vec());
        self.hypervolume = self.front.relative_hypervolume(sweep.start());
    }

    /// Takes over what a slice has told.
    fn count(&mut self, slice: SweepProgress, ms: f64) {
        self.seconds += 1e-3 * ms;
        self.done = slice.done;
        self.total = slice.total;
        self.rejection = slice.refused.or(self.rejection.take());
    }
}

/// What happened to a sweep; each carries its number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Told {
    Now(u64, RunStatus),
    Failed(u64, String),
    Written(PathBuf, usize),
    NotWritten(String),
}

/// What a run is to do.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) number: u64,
    pub(super) lens: Arc<Lens>,
    pub(super) settings: ParetoSettings,
    pub(super) compare: bool,
}

/// What a sweep is told.
#[derive(Debug)]
enum Order {
    Start(Job),
    Stand(RunStatus),
    Clear,
    Write(PathBuf),
    Judge(Arc<Lens>),
}

/// What finds a front: the engine, or what a test puts in its place.
trait ParetoEngine: Send {
    fn step(&mut self) -> SweepProgress;
    fn start(&self) -> &ParetoPoint;
    fn front(&self) -> &Front;
    fn tried(&self) -> &[[f64; 2]];
}

impl ParetoEngine for ParetoSweep {
    fn step(&mut self) -> SweepProgress {
        Self::step(self)
    }

    fn start(&self) -> &ParetoPoint {
        &self.start
    }

    fn front(&self) -> &Front {
        Self::front(self)
    }

    fn tried(&self) -> &[[f64; 2]] {
        Self::evaluated(self)
    }
}

type Begin = dyn Fn(&Lens, &ParetoSettings) -> Result<Box<dyn ParetoEngine>, String> + Send;

/// The handle of the thread that sweeps.
#[derive(Debug)]
pub(super) struct Sweeper {
    thread: Background<Order, Told>,
    run: Slot<ParetoRun>,
    judged: Slot<ScoredLens>,
}

impl Sweeper {
    /// Starts the thread. `wake` is called from it when there is something new to look at.
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let begin = |lens: &Lens, settings: &ParetoSettings| {
            let sweep = ParetoSweep::new(lens, settings).map_err(|why| why.to_string())?;
            Ok(Box::new(sweep) as Box<dyn ParetoEngine>)
        };
        Self::with(Box::new(begin), wake)
    }

    fn with(begin: Box<Begin>, wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        let (run, judged) = (Slot::default(), Slot::default());
        let pool = pool("front")?;
        let (shown, judgements) = (run.clone(), judged.clone());
        let desk = |outbox| {
            let pace = Throttle::new(BETWEEN);
            Desk { outbox, shown, judged: judgements, begin, pool, pace, run: None }
        };
        Ok(Self { thread: Background::spawn("front", wake, desk)?, run, judged })
    }

    pub(super) fn start(&self, job: Job) {
        self.thread.tell(Order::Start(job));
    }

    /// Holds the sweep, lets it go on or ends it, after its slice.
    pub(super) fn stand(&self, standing: RunStatus) {
        self.thread.tell(Order::Stand(standing));
    }

    /// Ends the sweep and forgets it.
    pub(super) fn clear(&self) {
        self.thread.tell(Order::Clear);
    }

    /// Writes the front as it is into a folder.
    pub(super) fn write(&self, folder: PathBuf) {
        self.thread.tell(Order::Write(folder));
    }

    /// Asks what a design is worth beside the front.
    pub(super) fn judge(&self, lens: Arc<Lens>) {
        self.thread.tell(Order::Judge(lens));
    }

    /// How far the sweep is.
    pub(super) fn run(&self) -> Option<Arc<ParetoRun>> {
        self.run.latest()
    }

    /// The design that was judged last.
    pub(super) fn judged(&self) -> Option<Arc<ScoredLens>> {
        self.judged.latest()
    }

    /// What happened since the last look.
    pub(super) fn told(&self) -> Vec<Told> {
        self.thread.news()
    }
}

/// What the thread works with.
struct Desk {
    outbox: Outbox<Told>,
    shown: Slot<ParetoRun>,
    judged: Slot<ScoredLens>,
    begin: Box<Begin>,
    /// Threads of its own: numbers of panels do not queue behind a slice.
    pool: ThreadPool,
    pace: Throttle,
    run: Option<Run>,
}

/// A run under way or ended.
struct Run {
    sweep: Box<dyn ParetoEngine>,
    state: ParetoRun,
}

impl Work for Desk {
    type Order = Order;

    fn is_running(&self) -> bool {
        self.run.as_ref().is_some_and(|run| run.state.status == RunStatus::Running)
    }

    fn obey(&mut self, order: Order) {
        match order {
            Order::Start(job) => self.start(job),
            Order::Stand(standing) => {
                if self.run.as_ref().is_some_and(|run| run.state.is_active()) {
                    self.stand(standing);
                }
            }
            Order::Clear => self.run = None,
            Order::Write(folder) => self.write(&folder),
            Order::Judge(lens) => {
                self.judged.set(ScoredLens::new(lens));
                self.outbox.wake();
            }
        }
    }

    /// Goes on for a slice; then the next leg follows, or the end.
    fn advance(&mut self) {
        let Some(run) = &mut self.run else { return };
        let finished = match guarded(|| Ok(run.step(&self.pool))) {
            Ok(finished) => finished,
            Err(why) => return self.give_up(why),
        };
        if finished && run.state.compare && run.state.biased.is_none() {
            let settings =
                ParetoSettings { pupil: PupilEdge::Frozen, ..run.state.settings.clone() };
            run.look();
            match guarded(|| (self.begin)(&run.state.lens, &settings)) {
                Ok(sweep) => {
                    run.state.biased = Some(ParetoPass::new(sweep.as_ref()));
                    run.sweep = sweep;
                }
                Err(why) => self.give_up(why),
            }
        } else if finished {
            self.stand(RunStatus::Finished);
        } else if self.pace.ready() {
            self.shown.set(run.look());
            self.outbox.wake();
        }
    }
}

impl Desk {
    fn start(&mut self, job: Job) {
        let Job { number, lens, settings, compare } = job;
        match guarded(|| (self.begin)(&lens, &settings)) {
            Ok(sweep) => {
                let start = Arc::new(sweep.start().clone());
                let main = ParetoPass::new(sweep.as_ref());
                let standing = RunStatus::Running;
                let compare = compare && settings.pupil != PupilEdge::Frozen;
                let state = ParetoRun {
                    number,
                    status: standing,
                    settings,
                    compare,
                    lens,
                    start,
                    main,
                    biased: None,
                };
                self.run = Some(Run { sweep, state });
                self.stand(standing);
            }
            Err(why) => {
                self.run = None;
                self.outbox.emit(Told::Failed(number, why));
            }
        }
    }

    /// Lets the sweep stand otherwise, shows it and says so.
    fn stand(&mut self, standing: RunStatus) {
        let Some(run) = &mut self.run else { return };
        run.state.status = standing;
        let number = run.state.number;
        self.shown.set(run.look());
        self.outbox.emit(Told::Now(number, standing));
    }

    fn give_up(&mut self, why: String) {
        let Some(run) = &mut self.run else { return };
        run.state.status = RunStatus::Stopped;
        let number = run.state.number;
        self.shown.set(run.state.clone());
        self.outbox.emit(Told::Failed(number, why));
    }

    fn write(&mut self, folder: &Path) {
        let Some(run) = &mut self.run else {
            return self
                .outbox
                .emit(Told::NotWritten("there is no front to export yet".to_owned()));
        };
        let told = match run.look().survey().write(folder) {
            Ok(files) => Told::Written(folder.to_owned(), files.len()),
            Err(why) => Told::NotWritten(why.to_string()),
        };
        self.outbox.emit(told);
    }
}

impl Run {
    /// What is shown of the sweep that runs.
    fn leg(&mut self) -> &mut ParetoPass {
        self.state.biased.as_mut().unwrap_or(&mut self.state.main)
    }

    /// Takes over what the sweep has found.
    fn look(&mut self) -> ParetoRun {
        let leg = self.state.biased.as_mut().unwrap_or(&mut self.state.main);
        leg.look(self.sweep.as_ref());
        self.state.clone()
    }

    /// Whether the slice was the last one.
    fn step(&mut self, pool: &ThreadPool) -> bool {
        let sweep = &mut self.sweep;
        let Timed { value: slice, ms } = time(|| pool.install(|| sweep.step()));
        let finished = slice.finished;
        self.leg().count(slice, ms);
        finished
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::blank;
    use crate::session::judged::score;

    /// Breaks at its third step.
    struct Breaks {
        start: ParetoPoint,
        front: Front,
        steps: usize,
    }

    impl ParetoEngine for Breaks {
        fn step(&mut self) -> SweepProgress {
            self.steps += 1;
            assert!(self.steps < 3, "the toy breaks");
            SweepProgress { done: self.steps, total: 9, joined: 0, refused: None, finished: false }
        }

        fn start(&self) -> &ParetoPoint {
            &self.start
        }

        fn front(&self) -> &Front {
            &self.front
        }

        fn tried(&self) -> &[[f64; 2]] {
            &[]
        }
    }

    #[test]
    fn a_panic_ends_the_sweep_and_is_told_and_the_next_one_runs() -> io::Result<()> {
        let begin = |lens: &Lens, _: &ParetoSettings| {
            let start = score(lens)?;
            let mut front = Front::default();
            front.insert(start.clone());
            Ok(Box::new(Breaks { start, front, steps: 0 }) as Box<dyn ParetoEngine>)
        };
        let sweeper = Sweeper::with(Box::new(begin), || {})?;
        for number in 1..3 {
            let (lens, settings) = (Arc::new(blank()), ParetoSettings::default());
            sweeper.start(Job { number, lens, settings, compare: false });
            let told: Vec<Told> = sweeper.thread.news.iter().take(2).collect();
            let failed = Told::Failed(number, "the search failed: the toy breaks".to_owned());
            assert_eq!(told, [Told::Now(number, RunStatus::Running), failed]);
            let run = sweeper.run().map(|run| (run.number, run.status, run.main.done));
            assert_eq!(run, Some((number, RunStatus::Stopped, 2)), "what was found stays");
        }
        Ok(())
    }
}
