//! Sweeps of the Pareto front of sharpness and light in the background, on a copy of the design.

use super::clock::{Timed, time};
use super::run::{BackgroundRun, Engine, EventSender, RunEvent, RunKind, RunStatus, RunView};
use crate::lens::Lens;
use crate::merit::PupilEdge;
use crate::optimize::pareto::{
    Front, ParetoPoint, ParetoSettings, ParetoSweep, SweepProgress, as_built_term,
};
use crate::report::ParetoReport;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// The maximum number of earlier runs that are retained.
const MAX_EARLIER: usize = 8;

/// The state of a sweep.
#[derive(Debug, Clone)]
pub struct ParetoRun {
    /// The settings of the sweep.
    pub settings: ParetoSettings,
    /// True if a second pass follows whose derivatives keep the pupils frozen.
    pub compare: bool,
    /// The design that the sweep started from.
    pub lens: Arc<Lens>,
    /// The same lens as the sweep evaluates it, limited by its stop.
    pub start: Arc<ParetoPoint>,
    /// The first pass.
    pub main: ParetoPass,
    /// The pass with frozen pupils; `None` before it starts.
    pub biased: Option<ParetoPass>,
}

/// One pass of a sweep.
#[derive(Debug, Clone)]
pub struct ParetoPass {
    /// The front so far.
    pub front: Arc<Front>,
    /// The radius in mm and the light in mm² of every lens that was evaluated.
    pub evaluated: Arc<Vec<[f64; 2]>>,
    /// The hypervolume of the front, relative to twice the spot and the light of the first lens.
    pub hypervolume: f64,
    /// The number of steps so far over all chains; steps that a descent did not need count as done.
    pub done: usize,
    /// The number of steps in all.
    pub total: usize,
    /// The time of the steps without pauses, in seconds.
    pub seconds: f64,
    /// The last reason for which a descent was given up.
    pub rejection: Option<String>,
}

impl ParetoRun {
    /// The pass that runs, or ran last.
    pub fn current_pass(&self) -> &ParetoPass {
        self.biased.as_ref().unwrap_or(&self.main)
    }

    /// The fraction of the steps that is done, 0 to 1.
    pub fn fraction_done(&self) -> f64 {
        let passes = 1 + usize::from(self.compare);
        let done = self.main.done + self.biased.as_ref().map_or(0, |pass| pass.done);
        done as f64 / (passes * self.main.total).max(1) as f64
    }

    fn report(&self) -> ParetoReport<'_> {
        ParetoReport {
            name: &self.lens.name,
            wavelengths: &self.lens.wavelengths,
            start: &self.start,
            front: &self.main.front,
            tried: &self.main.evaluated,
            biased: self.biased.as_ref().map(|pass| &*pass.front),
        }
    }
}

impl ParetoPass {
    fn new(sweep: &ParetoSweep) -> Self {
        let mut pass = Self {
            front: Arc::default(),
            evaluated: Arc::default(),
            hypervolume: 0.0,
            done: 0,
            total: 0,
            seconds: 0.0,
            rejection: None,
        };
        pass.update(sweep);
        pass
    }

    fn update(&mut self, sweep: &ParetoSweep) {
        self.front = Arc::new(sweep.front().clone());
        self.evaluated = Arc::new(sweep.evaluated().to_vec());
        self.hypervolume = sweep.hypervolume();
    }

    fn add_progress(&mut self, progress: SweepProgress, ms: f64) {
        self.seconds += 1e-3 * ms;
        self.done = progress.done;
        self.total = progress.total;
        self.rejection = progress.refused.or(self.rejection.take());
    }
}

/// A specification of a sweep.
#[derive(Debug)]
pub(super) struct ParetoRequest {
    lens: Arc<Lens>,
    settings: ParetoSettings,
    compare: bool,
}

/// The outcome of writing the files of a front.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum ParetoExport {
    /// The folder and the number of files.
    Written {
        /// The folder.
        folder: PathBuf,
        /// The number of files that were written.
        files: usize,
        /// The number of files of an earlier front that remain.
        stale: usize,
    },
    /// The reason of the failure.
    Failed(String),
}

/// A sweep, pass after pass.
pub(super) struct ParetoEngine {
    sweep: ParetoSweep,
    state: ParetoRun,
    sender: EventSender<ParetoExport>,
}

impl ParetoEngine {
    fn start(request: ParetoRequest, sender: &EventSender<ParetoExport>) -> Result<Self, String> {
        let ParetoRequest { lens, settings, compare } = request;
        let sweep = ParetoSweep::new(&lens, &settings).map_err(|why| why.to_string())?;
        let state = ParetoRun {
            // Weighted sums, which hold the rays fixed, know lenses as designed alone.
            compare: compare
                && settings.pupil != PupilEdge::Frozen
                && as_built_term(&lens, &settings).is_none(),
            settings,
            lens,
            start: Arc::new(sweep.start.clone()),
            main: ParetoPass::new(&sweep),
            biased: None,
        };
        Ok(Self { sweep, state, sender: sender.clone() })
    }

    fn start_biased_pass(&mut self) -> Result<(), String> {
        self.state.main.update(&self.sweep);
        let settings = self.state.settings.biased();
        let sweep = ParetoSweep::new(&self.state.lens, &settings).map_err(|why| why.to_string())?;
        self.state.biased = Some(ParetoPass::new(&sweep));
        self.sweep = sweep;
        Ok(())
    }

    fn current_pass(&mut self) -> &mut ParetoPass {
        self.state.biased.as_mut().unwrap_or(&mut self.state.main)
    }
}

impl Engine for ParetoEngine {
    const KIND: RunKind = RunKind::Pareto;
    const THREAD: &'static str = "pareto";
    const INTERVAL: Duration = Duration::from_millis(100);

    type Input = ParetoRequest;
    /// The folder to write the front into.
    type Request = PathBuf;
    type Report = ParetoExport;
    type Snapshot = ParetoRun;

    fn step(&mut self) -> Result<bool, String> {
        let Timed { value: progress, ms } = time(|| self.sweep.step());
        let finished = progress.finished;
        self.current_pass().add_progress(progress, ms);
        if finished && self.state.compare && self.state.biased.is_none() {
            self.start_biased_pass()?;
            return Ok(false);
        }
        Ok(finished)
    }

    fn handle(&mut self, folder: PathBuf) -> Result<Option<RunStatus>, String> {
        let snapshot = self.snapshot();
        let written = snapshot.report().write(&folder);
        self.sender.report(match written {
            Ok(files) => ParetoExport::Written {
                stale: snapshot.report().stale_files(&folder).len(),
                files: files.len(),
                folder,
            },
            Err(why) => ParetoExport::Failed(why.to_string()),
        });
        Ok(None)
    }

    fn snapshot(&mut self) -> ParetoRun {
        let pass = self.state.biased.as_mut().unwrap_or(&mut self.state.main);
        pass.update(&self.sweep);
        self.state.clone()
    }
}

/// The Pareto fronts of a session as panels see them.
#[derive(Debug, Clone, Default)]
pub struct ParetoView {
    /// The latest run.
    pub run: RunView<ParetoRun>,
    /// Earlier runs to compare with, the oldest first.
    pub earlier: Vec<RunView<ParetoRun>>,
}

/// The Pareto fronts of a session.
#[derive(Debug)]
pub(super) struct ParetoState {
    pub(super) run: BackgroundRun<ParetoEngine>,
    earlier: Vec<RunView<ParetoRun>>,
}

impl ParetoState {
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        Ok(Self { run: BackgroundRun::spawn(wake, ParetoEngine::start)?, earlier: Vec::new() })
    }

    /// True if a lens is on a front of the latest run or of an earlier one.
    pub(super) fn has_found(&self, lens: &Lens) -> bool {
        let latest = self.run.view();
        let runs = self.earlier.iter().chain([&latest]).filter_map(|run| run.snapshot.as_deref());
        let passes = runs.flat_map(|run| std::iter::once(&run.main).chain(&run.biased));
        passes.flat_map(|pass| pass.front.points()).any(|point| point.lens == *lens)
    }

    /// Starts a sweep; the one before it is retained to compare with.
    pub(super) fn start(&mut self, lens: &Arc<Lens>, settings: ParetoSettings, compare: bool) {
        let last = self.run.view();
        if last.snapshot.as_ref().is_some_and(|run| run.main.front.points().len() > 1) {
            self.earlier.push(last);
        }
        let surplus = self.earlier.len().saturating_sub(MAX_EARLIER);
        self.earlier.drain(..surplus);
        self.run.start(ParetoRequest { lens: Arc::clone(lens), settings, compare });
    }

    /// Ends the sweep and dismisses all fronts.
    pub(super) fn clear(&mut self) {
        self.run.clear();
        self.earlier.clear();
    }

    /// Writes the front into a folder.
    pub(super) fn export(&self, folder: PathBuf) -> Result<(), String> {
        if self.run.snapshot().is_none() {
            return Err("there is no front to export yet".to_owned());
        }
        self.run.send_request(folder);
        Ok(())
    }

    pub(super) fn drain_events(&mut self) -> Vec<RunEvent<ParetoExport>> {
        self.run.drain_events()
    }

    pub(super) fn view(&self) -> ParetoView {
        ParetoView { run: self.run.view(), earlier: self.earlier.clone() }
    }
}
