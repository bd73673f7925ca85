//! The fronts of a session: the one that is swept, those before it, and where the design stands.

use super::course::Course;
use super::judged::ScoredLens;
use super::sweeper::{Job, ParetoRun, Sweeper, Told};
use super::worker::RunStatus;
use crate::lens::Lens;
use crate::optimize::pareto::ParetoSettings;
use std::io;
use std::sync::Arc;

/// How many earlier runs are kept.
const MAX_EARLIER: usize = 8;

/// What is known about fronts.
#[derive(Debug, Clone, Default)]
pub struct ParetoView {
    /// The run in the background, or the last one.
    pub run: Option<Arc<ParetoRun>>,
    /// Whether one was asked for that has not begun yet.
    pub starting: bool,
    /// How the run will stand once its slice is done, where it was told so.
    pub pending: Option<RunStatus>,
    /// Runs before it, the oldest first.
    pub earlier: Vec<Arc<ParetoRun>>,
    /// The design among them; maybe as it was a moment ago.
    pub current_design: Option<Arc<ScoredLens>>,
    /// Why the last run could not begin or go on.
    pub error: Option<String>,
}

/// What a session keeps of its fronts.
#[derive(Debug)]
pub(super) struct ParetoState {
    sweeper: Sweeper,
    course: Course,
    earlier: Vec<Arc<ParetoRun>>,
    /// The design that was judged last.
    asked: Option<Arc<Lens>>,
}

impl ParetoState {
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        Ok(Self {
            sweeper: Sweeper::spawn(wake)?,
            course: Course::default(),
            earlier: Vec::new(),
            asked: None,
        })
    }

    pub(super) const fn sweeper(&self) -> &Sweeper {
        &self.sweeper
    }

    /// Begins a run; the one before it stays to compare with.
    pub(super) fn start(&mut self, lens: &Arc<Lens>, settings: ParetoSettings, compare: bool) {
        let worth = |run: &Arc<ParetoRun>| run.main.front.points().len() > 1;
        self.earlier.extend(self.run().filter(worth));
        let surplus = self.earlier.len().saturating_sub(MAX_EARLIER);
        self.earlier.drain(..surplus);
        let (number, lens) = (self.course.begin(), Arc::clone(lens));
        self.sweeper.start(Job { number, lens, settings, compare });
    }

    /// Lets the run stand otherwise once its slice is done; a run that has ended stays so.
    pub(super) fn stand(&mut self, standing: RunStatus) {
        let ended = self.run().is_some_and(|run| !run.is_active());
        if self.course.turn(standing, ended) {
            self.sweeper.stand(standing);
        }
    }

    /// Ends the run and forgets all of them.
    pub(super) fn clear(&mut self) {
        self.sweeper.clear();
        self.course.forget();
        self.earlier.clear();
        self.asked = None;
    }

    /// What happened since the last look to the run that is shown.
    pub(super) fn drain_events(&mut self) -> Vec<Told> {
        let mut told = self.sweeper.told();
        told.retain(|told| match told {
            Told::Now(number, _) | Told::Failed(number, _) => self.course.is(*number),
            Told::Written(..) | Told::NotWritten(_) => true,
        });
        for told in &told {
            match told {
                Told::Failed(_, why) => self.course.fails(why),
                Told::Now(_, now) => self.course.stands(*now),
                _ => {}
            }
        }
        told
    }

    /// Has the design judged, once for each, as long as there is a front to stand beside.
    pub(super) fn sync(&mut self, lens: &Arc<Lens>) {
        let known = self.asked.as_ref().is_some_and(|asked| Arc::ptr_eq(asked, lens));
        if self.course.is_there() && !known {
            self.asked = Some(Arc::clone(lens));
            self.sweeper.judge(Arc::clone(lens));
        }
    }

    pub(super) fn view(&self) -> ParetoView {
        let run = self.run();
        ParetoView {
            starting: self.course.is_starting(run.is_some()),
            run,
            pending: self.course.pending(),
            earlier: self.earlier.clone(),
            current_design: self.sweeper.judged().filter(|_| self.asked.is_some()),
            error: self.course.failed(),
        }
    }

    fn run(&self) -> Option<Arc<ParetoRun>> {
        self.sweeper.run().filter(|run| self.course.is(run.number))
    }
}
