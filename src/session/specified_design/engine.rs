//! The engine of a design from a specification. A step is a round, or the finish of the lenses.

use super::SpecificationRequest;
use super::saved::{DesignFile, SavedDesign};
use super::snapshot::SpecifiedDesign;
use crate::search::design::{DesignRun, LensRequirements};
use crate::session::clock::{Timed, time};
use crate::session::run::{Engine, EventSender, RunKind, RunStatus};
use std::convert::Infallible;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// A design to start or to resume.
#[derive(Debug)]
pub(super) enum SpecificationStart {
    /// A new design, saved to a file if there is one.
    New { request: Box<SpecificationRequest>, path: Option<PathBuf> },
    /// The design of a file.
    Saved(PathBuf),
}

/// A design with the flag that ends its round.
#[derive(Debug)]
pub(super) struct SpecificationInput {
    pub(super) start: SpecificationStart,
    pub(super) stop: Arc<AtomicBool>,
}

/// The reason why a design cannot be saved; the design goes on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::session) struct DesignNotSaved(pub(in crate::session) String);

/// A design with its state and its file.
pub(super) struct SpecificationEngine {
    run: DesignRun,
    state: SpecifiedDesign,
    stop: Arc<AtomicBool>,
    file: Option<DesignFile>,
    /// True after a failure to save, which is reported once.
    has_failed: bool,
    sender: EventSender<DesignNotSaved>,
}

impl SpecificationEngine {
    pub(super) fn start(
        input: SpecificationInput,
        sender: &EventSender<DesignNotSaved>,
    ) -> Result<Self, String> {
        let (request, run, seconds, file) = match input.start {
            SpecificationStart::New { request, path } => {
                let completed = LensRequirements::complete(&request.specification);
                let (asked, _) = completed.map_err(|why| why.to_string())?;
                let run = DesignRun::new(&asked, &request.settings);
                (*request, run, 0.0, path.map(DesignFile::new).transpose())
            }
            SpecificationStart::Saved(path) => {
                let (file, saved) = DesignFile::open(path)?;
                (saved.request, saved.run, saved.seconds, Ok(Some(file)))
            }
        };
        if !(request.minutes > 0.0 && request.minutes.is_finite()) {
            return Err(format!("found {} minutes; expected more than 0", request.minutes));
        }
        let state = SpecifiedDesign::new(request, &run, seconds).map_err(|why| why.to_string())?;
        let (stop, sender) = (input.stop, sender.clone());
        let mut engine = Self { run, state, stop, file: None, has_failed: false, sender };
        match file {
            Ok(file) => engine.file = file,
            Err(why) => engine.report_not_saved(&why),
        }
        engine.save();
        Ok(engine)
    }

    /// Saves the design, if there is a file for it and it is not to end.
    fn save(&mut self) {
        let goes_on = !self.stop.load(Ordering::Relaxed);
        let Some(file) = self.file.as_ref().filter(|_| goes_on) else { return };
        let saved = SavedDesign {
            request: (*self.state.request).clone(),
            seconds: self.state.seconds,
            run: self.run.clone(),
        };
        match file.write(&saved) {
            Ok(()) => self.state.resumable = Some(file.path.clone()),
            Err(why) => self.report_not_saved(&why),
        }
    }

    fn report_not_saved(&mut self, why: &str) {
        if !std::mem::replace(&mut self.has_failed, true) {
            let text = format!("the design from a specification is not saved: {why}");
            self.sender.report(DesignNotSaved(text));
        }
    }

    fn finish(&mut self) -> Result<(), String> {
        self.state.offer(self.run.finish(&self.stop));
        self.state.is_finishing = false;
        if self.state.lenses.is_empty() {
            return Err("no start led to a lens; loosen a limit, or allow more elements".to_owned());
        }
        Ok(())
    }
}

impl Engine for SpecificationEngine {
    const KIND: RunKind = RunKind::SpecifiedDesign;
    const THREAD: &'static str = "specification";
    /// Every step is shown: a round takes seconds.
    const INTERVAL: Duration = Duration::ZERO;

    type Input = SpecificationInput;
    type Request = Infallible;
    type Report = DesignNotSaved;
    type Snapshot = SpecifiedDesign;

    fn step(&mut self) -> Result<bool, String> {
        if self.state.is_finishing {
            return self.finish().map(|()| true);
        }
        let used = self.state.share_used();
        let round = || used < 1.0 && self.run.advance(used, &self.stop);
        let Timed { value: goes_on, ms } = time(round);
        self.state.update(&self.run);
        // A round that was ended depends on time: it is not saved, and the request to stop follows.
        if !self.stop.load(Ordering::Relaxed) {
            self.state.seconds += 1e-3 * ms;
            self.state.is_finishing = !goes_on;
            self.save();
        }
        Ok(false)
    }

    fn on_status(&mut self, status: RunStatus) -> Result<(), String> {
        if status == RunStatus::Stopped && self.state.lenses.is_empty() {
            self.state.is_finishing = false;
            self.state.offer(self.run.finish_best());
        }
        Ok(())
    }

    fn handle(&mut self, request: Infallible) -> Result<Option<RunStatus>, String> {
        match request {}
    }

    fn snapshot(&mut self) -> SpecifiedDesign {
        self.state.clone()
    }
}
