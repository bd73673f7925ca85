//! The fronts of a session: the one that is swept, those before it, and where the design stands.

use super::sweeper::{FrontRun, Job, Judged, Sweeper, Told};
use crate::lens::Lens;
use crate::optimize::pareto::Settings;
use std::io;
use std::path::PathBuf;
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
        let lens = Arc::clone(lens);
        self.sweeper.start(Job { number: self.count, lens, settings, compare });
    }

    /// Ends the run and forgets all of them.
    pub(super) fn clear(&mut self) {
        self.sweeper.clear();
        self.number = None;
        self.earlier.clear();
        self.failed = None;
        self.asked = None;
    }

    pub(super) fn write(&self, folder: PathBuf) {
        self.sweeper.write(folder);
    }

    /// What happened since the last look to the run that is shown.
    pub(super) fn told(&mut self) -> Vec<Told> {
        let mut told = self.sweeper.told();
        told.retain(|told| match told {
            Told::Now(number, _) | Told::Failed(number, _) => Some(*number) == self.number,
            Told::Written(..) | Told::NotWritten(_) => true,
        });
        for told in &told {
            if let Told::Failed(_, why) = told {
                self.failed = Some(why.clone());
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
            earlier: self.earlier.clone(),
            here: self.sweeper.judged().filter(|_| self.asked.is_some()),
            failed: self.failed.clone(),
        }
    }

    fn run(&self) -> Option<Arc<FrontRun>> {
        self.sweeper.run().filter(|run| Some(run.number) == self.number)
    }
}
