//! The fronts of a session: the one that is swept, those before it, and where the design stands.

use super::judged::Judged;
use super::sweeper::{FrontRun, Job, Sweeper, Told};
use super::worker::Standing;
use crate::lens::Lens;
use crate::optimize::pareto::Settings;
use std::io;
use std::sync::Arc;

/// How many earlier runs are kept.
const EARLIER: usize = 8;

/// What is known about fronts.
#[derive(Debug, Clone, Default)]
pub struct Fronts {
    /// The run in the background, or the last one.
    pub run: Option<Arc<FrontRun>>,
    /// Whether one was asked for that has not begun yet.
    pub starting: bool,
    /// How the run will stand once its slice is done, where it was told so.
    pub pending: Option<Standing>,
    /// Runs before it, the oldest first.
    pub earlier: Vec<Arc<FrontRun>>,
    /// The design among them; maybe as it was a moment ago.
    pub here: Option<Arc<Judged>>,
    /// Why the last run could not begin or go on.
    pub failed: Option<String>,
}

/// What a session keeps of its fronts.
#[derive(Debug)]
pub(super) struct FrontDesk {
    sweeper: Sweeper,
    /// How many runs were begun.
    count: u64,
    /// The last run, if it is not forgotten.
    number: Option<u64>,
    earlier: Vec<Arc<FrontRun>>,
    failed: Option<String>,
    pending: Option<Standing>,
    /// The design that was judged last.
    asked: Option<Arc<Lens>>,
}

impl FrontDesk {
    pub(super) fn spawn(wake: impl Fn() + Send + 'static) -> io::Result<Self> {
        Ok(Self {
            sweeper: Sweeper::spawn(wake)?,
            count: 0,
            number: None,
            earlier: Vec::new(),
            failed: None,
            pending: None,
            asked: None,
        })
    }

    pub(super) const fn sweeper(&self) -> &Sweeper {
        &self.sweeper
    }

    /// Begins a run; the one before it stays to compare with.
    pub(super) fn start(&mut self, lens: &Arc<Lens>, settings: Settings, compare: bool) {
        let worth = |run: &Arc<FrontRun>| run.main.front.designs().len() > 1;
        self.earlier.extend(self.run().filter(worth));
        let surplus = self.earlier.len().saturating_sub(EARLIER);
        self.earlier.drain(..surplus);
        self.count += 1;
        self.number = Some(self.count);
        self.failed = None;
        self.pending = None;
        let lens = Arc::clone(lens);
        self.sweeper.start(Job { number: self.count, lens, settings, compare });
    }

    /// Lets the run stand otherwise once its slice is done; a run that has ended stays so.
    pub(super) fn stand(&mut self, standing: Standing) {
        let ended = self.run().is_some_and(|run| !run.is_under_way());
        if self.number.is_some() && self.failed.is_none() && !ended {
            self.pending = Some(standing);
            self.sweeper.stand(standing);
        }
    }

    /// Ends the run and forgets all of them.
    pub(super) fn clear(&mut self) {
        self.sweeper.clear();
        self.number = None;
        self.earlier.clear();
        self.pending = None;
        self.failed = None;
        self.asked = None;
    }

    /// What happened since the last look to the run that is shown.
    pub(super) fn told(&mut self) -> Vec<Told> {
        let mut told = self.sweeper.told();
        told.retain(|told| match told {
            Told::Now(number, _) | Told::Failed(number, _) => Some(*number) == self.number,
            Told::Written(..) | Told::NotWritten(_) => true,
        });
        for told in &told {
            match told {
                Told::Failed(_, why) => {
                    self.failed = Some(why.clone());
                    self.pending = None;
                }
                // What it stands as now may be older than what it was told since.
                Told::Now(_, now) if Some(*now) == self.pending || !now.can_go_on() => {
                    self.pending = None;
                }
                _ => {}
            }
        }
        told
    }

    /// Has the design judged, once for each, as long as there is a front to stand beside.
    pub(super) fn keep_up(&mut self, lens: &Arc<Lens>) {
        let known = self.asked.as_ref().is_some_and(|asked| Arc::ptr_eq(asked, lens));
        if self.number.is_some() && !known {
            self.asked = Some(Arc::clone(lens));
            self.sweeper.judge(Arc::clone(lens));
        }
    }

    pub(super) fn view(&self) -> Fronts {
        let run = self.run();
        Fronts {
            starting: self.number.is_some() && run.is_none() && self.failed.is_none(),
            run,
            pending: self.pending,
            earlier: self.earlier.clone(),
            here: self.sweeper.judged().filter(|_| self.asked.is_some()),
            failed: self.failed.clone(),
        }
    }

    fn run(&self) -> Option<Arc<FrontRun>> {
        self.sweeper.run().filter(|run| Some(run.number) == self.number)
    }
}
