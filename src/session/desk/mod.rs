//! The session itself: what each command does.

mod exploring;
mod forming;

use super::analyst::{AnalysisResults, Analyst, EffectTiming, Request};
use super::command::Command;
use super::explorations::StructureSearchState;
use super::forming::GrinState;
use super::fronts::ParetoState;
use super::history::UndoStack;
use super::laboratory::{ExperimentStatus, ExperimentWorker};
use super::sweeper::Told;
use super::view::{AnalysisSettings, Message, SessionView, Severity};
use super::worker::{
    News, OptimizationRequest, OptimizationSnapshot, OptimizerFactory, RunStatus, Worker,
};
use crate::experiments::{self, Effort, ExperimentReport};
use crate::files;
use crate::lens::{Edit, Lens, apply_edit};
use crate::merit::Goal;
use crate::optimize;
use crate::optimize::DescentMethod;
use crate::pupil::limited_by_stop;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What happened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SessionEvent {
    /// The design or a setting is another; the view has this version.
    Changed(u64),
    /// A lens was read from this file.
    Opened(PathBuf),
    /// The lens was written to this file.
    Saved(PathBuf),
    /// A search began.
    SearchStarted,
    /// It is held.
    SearchPaused,
    /// It goes on.
    SearchResumed,
    /// It was ended; its result can be taken.
    SearchStopped,
    /// It ended by itself; its result can be taken.
    SearchFinished,
    /// The sweep of a front stands so.
    Front(RunStatus),
    /// The search over structure stands so.
    Explored(RunStatus),
    /// A gradient-index field was opened, or the search for it stands so.
    Formed(RunStatus),
    /// Something to tell the person.
    Said(Message),
}

/// What tells the numbers of searches over structure from those of other searches.
const EXPLORED: u64 = 1 << 63;
/// How many messages are kept.
const MESSAGES: usize = 200;

/// One open design.
#[derive(Debug)]
pub struct Session {
    lens: Arc<Lens>,
    version: u64,
    history: UndoStack,
    path: Option<PathBuf>,
    /// The lens as its file has it.
    saved: Arc<Lens>,
    settings: AnalysisSettings,
    /// The surface that every panel points out.
    selected: Option<usize>,
    messages: Vec<Message>,
    analyst: Analyst,
    worker: Worker,
    fronts: ParetoState,
    explorations: StructureSearchState,
    forming: GrinState,
    /// A lens that is shown in place of the design.
    candidate: Option<Arc<Lens>>,
    /// Computes the numbers of that lens, or of the one that the search shows.
    follower: Analyst,
    /// That lens, and what the numbers were asked for with.
    followed: Option<(Arc<Lens>, AnalysisSettings)>,
    laboratory: ExperimentWorker,
    /// How many searches were begun.
    searches: u64,
    /// The last search, if its result is neither taken nor thrown away.
    search: Option<u64>,
    events: Vec<SessionEvent>,
}

impl Session {
    /// Opens a design; `wake` is called from other threads when there is something new to look at.
    ///
    /// # Errors
    /// A lens that cannot be used, or a system that can start no thread.
    pub fn new(lens: Lens, wake: impl Fn() + Send + Clone + 'static) -> io::Result<Self> {
        let start = |task: &OptimizationRequest| {
            let started = optimize::start(task.method, &task.lens, &task.goal, task.tolerance);
            started.map_err(|why| why.to_string())
        };
        Self::with_optimizer(lens, Box::new(start), wake)
    }

    /// The same with another way to begin searches.
    ///
    /// # Errors
    /// As [`Session::new`].
    pub fn with_optimizer(
        lens: Lens,
        start: Box<OptimizerFactory>,
        wake: impl Fn() + Send + Clone + 'static,
    ) -> io::Result<Self> {
        lens.check().map_err(io::Error::other)?;
        let lens = Arc::new(lens);
        let session = Self {
            saved: Arc::clone(&lens),
            lens,
            version: 1,
            history: UndoStack::default(),
            path: None,
            settings: AnalysisSettings::default(),
            selected: None,
            messages: Vec::new(),
            analyst: Analyst::spawn(EffectTiming::Measured, wake.clone())?,
            follower: Analyst::spawn(EffectTiming::Skipped, wake.clone())?,
            followed: None,
            laboratory: ExperimentWorker::spawn(wake.clone())?,
            worker: Worker::spawn(start, wake.clone())?,
            fronts: ParetoState::spawn(wake.clone())?,
            explorations: StructureSearchState::spawn(wake.clone())?,
            forming: GrinState::spawn(wake)?,
            candidate: None,
            searches: 0,
            search: None,
            events: Vec::new(),
        };
        session.ask();
        Ok(session)
    }

    /// Does what a command says and tells what happened.
    pub fn apply(&mut self, command: Command) -> Vec<SessionEvent> {
        match command {
            Command::Edit(edit) => self.edit(&edit),
            Command::LimitByStop => self.limit_by_stop(),
            Command::CommitEdit => self.history.commit(),
            Command::Undo => self.undo(),
            Command::Redo => self.redo(),
            Command::New(lens) => self.start_with(*lens, None),
            Command::Open(path) => self.open(&path),
            Command::Save(path) => self.save(path),
            Command::Export(path) => self.export(&path),
            Command::Optimize { method, goal } => self.optimize(method, goal),
            Command::Pause => self.worker.pause(),
            Command::Resume => self.worker.resume(),
            Command::Step => self.worker.step(),
            Command::Stop => self.worker.stop(),
            Command::AcceptResult => self.take(),
            Command::DiscardResult => self.discard(),
            Command::StartPareto { settings, compare } => {
                self.fronts.start(&self.lens, settings, compare);
            }
            Command::PausePareto => self.fronts.stand(RunStatus::Paused),
            Command::ResumePareto => self.fronts.stand(RunStatus::Running),
            Command::StopPareto => self.fronts.stand(RunStatus::Stopped),
            Command::ClearPareto => self.fronts.clear(),
            Command::ExportPareto(folder) => self.export_front(folder),
            Command::StructureSearch(wish) => self.explore(wish),
            Command::Grin(wish) => self.form(wish),
            Command::Preview(lens) => self.candidate = lens.map(|lens| Arc::new(*lens)),
            Command::AcceptPreview => self.take_preview(),
            Command::SetTolerance(tolerance) => self.set_tolerance(tolerance),
            Command::ShowZoom(zoom) => self.show_zoom(zoom),
            Command::ShowRays(rays) => self.set_up(|settings| settings.rays = rays.min(MOST_RAYS)),
            Command::SetEffect(effect, choice) => self.set_up(|s| s.overrides.set(effect, choice)),
            Command::ShowPupils(shown) => self.set_up(|settings| settings.pupils = shown),
            Command::ShowPupilWavelength(wavelength) => {
                self.set_up(|settings| settings.pupil_wavelength = wavelength);
            }
            Command::StartExperiment { id, effort } => self.experiment(&id, effort),
            Command::CancelExperiment => self.laboratory.cancel(),
            Command::DismissExperiment => self.laboratory.dismiss(),
            Command::SaveExperiment(folder) => self.save_experiment(&folder),
            Command::Select(surface) => self.selected = surface,
            Command::ClearMessages => self.messages.clear(),
        }
        self.poll()
    }

    /// What happened since the last call, in the background too.
    pub fn poll(&mut self) -> Vec<SessionEvent> {
        for news in self.worker.news() {
            self.hear(news);
        }
        for told in self.fronts.drain_events() {
            self.hear_front(told);
        }
        self.fronts.sync(&self.lens);
        for told in self.explorations.drain_events() {
            self.hear_exploration(told);
        }
        self.explorations.sync(&self.lens);
        for told in self.forming.drain_events() {
            self.hear_forming(told);
        }
        self.forming.sync();
        self.follow();
        std::mem::take(&mut self.events)
    }

    /// A snapshot for panels.
    pub fn view(&self) -> SessionView {
        SessionView {
            lens: Arc::clone(&self.lens),
            version: self.version,
            results: self.analyst.results(),
            optimization: self.search(),
            pareto: self.fronts.view(),
            structure_search: self.explorations.view(),
            grin: self.forming.view(),
            preview_lens: self.candidate.clone(),
            preview_results: self.preview(),
            experiment: self.laboratory.run(),
            messages: self.messages.clone(),
            undo: self.history.undo_title().map(str::to_owned),
            redo: self.history.redo_title().map(str::to_owned),
            path: self.path.clone(),
            dirty: self.is_dirty(),
            settings: self.settings.clone(),
            selected: self.selected.filter(|surface| *surface < self.lens.surfaces.len()),
        }
    }

    /// The design.
    pub fn lens(&self) -> &Arc<Lens> {
        &self.lens
    }

    /// The newest numbers, maybe of an older version.
    pub fn results(&self) -> Option<Arc<AnalysisResults>> {
        self.analyst.results()
    }

    /// Whether the design differs from its file.
    pub fn is_dirty(&self) -> bool {
        !Arc::ptr_eq(&self.lens, &self.saved) && self.lens != self.saved
    }

    fn search(&self) -> Option<Arc<OptimizationSnapshot>> {
        self.worker.search().filter(|search| Some(search.number) == self.search)
    }

    /// The lens that is shown in place of the design, and what numbers of it are known by: the
    /// number of the search that it belongs to, or 0.
    fn followed(&self) -> Option<(u64, Arc<Lens>)> {
        let explored =
            || self.explorations.previewed().map(|(number, lens)| (EXPLORED | number, lens));
        let search =
            || self.search().map(|search| (search.number, Arc::clone(search.displayed_lens())));
        self.candidate.clone().map(|lens| (0, lens)).or_else(explored).or_else(search)
    }

    /// Asks for the numbers of that lens, if it is another one by now.
    fn follow(&mut self) {
        let Some((version, lens)) = self.followed() else {
            self.followed = None;
            return;
        };
        let settings = &self.settings;
        let known = self.followed.as_ref();
        if known.is_some_and(|(old, with)| Arc::ptr_eq(old, &lens) && with == settings) {
            return;
        }
        self.followed = Some((Arc::clone(&lens), settings.clone()));
        self.follower.ask(Request { version, lens, settings: settings.clone() });
    }

    /// The numbers of the lens that is shown in place of the design, if there are any yet.
    fn preview(&self) -> Option<Arc<AnalysisResults>> {
        let (number, _) = self.followed()?;
        self.follower.results().filter(|results| results.version == number)
    }

    fn edit(&mut self, edit: &Edit) {
        match apply_edit(&self.lens, edit) {
            Ok(lens) if lens == *self.lens => {}
            Ok(lens) => {
                self.history.push(Arc::clone(&self.lens), edit.title(), edit.cell());
                self.show(Arc::new(lens));
            }
            Err(why) => self.say(Severity::Warning, why.to_string()),
        }
    }

    fn limit_by_stop(&mut self) {
        let limited = limited_by_stop(&self.lens).map_err(|why| why.to_string());
        let limited = limited.and_then(|lens| {
            let replace = Edit::Replace(Box::new(lens));
            apply_edit(&self.lens, &replace).map_err(|why| why.to_string())
        });
        match limited {
            Ok(lens) => {
                let title = "limit the beam by the stop".to_owned();
                self.history.push(Arc::clone(&self.lens), title, None);
                self.show(Arc::new(lens));
            }
            Err(why) => self.say(Severity::Warning, why),
        }
    }

    fn undo(&mut self) {
        if let Some(lens) = self.history.undo(&self.lens) {
            self.show(lens);
        }
    }

    fn redo(&mut self) {
        if let Some(lens) = self.history.redo(&self.lens) {
            self.show(lens);
        }
    }

    /// Makes another lens the design.
    fn show(&mut self, lens: Arc<Lens>) {
        self.settings.zoom = self.settings.zoom.min(lens.zoom_positions() - 1);
        self.lens = lens;
        self.candidate = None;
        self.renew();
    }

    /// Makes everything that was computed so far old.
    fn renew(&mut self) {
        self.version += 1;
        self.ask();
        self.events.push(SessionEvent::Changed(self.version));
    }

    fn ask(&self) {
        self.analyst.ask(Request {
            version: self.version,
            lens: Arc::clone(&self.lens),
            settings: self.settings.clone(),
        });
    }

    fn say(&mut self, severity: Severity, text: String) {
        let message = Message { severity, text };
        if self.messages.len() >= MESSAGES {
            self.messages.remove(0);
        }
        self.messages.push(message.clone());
        self.events.push(SessionEvent::Said(message));
    }

    /// Replaces the design by another one with a history of its own.
    fn start_with(&mut self, lens: Lens, path: Option<PathBuf>) {
        if let Err(why) = lens.check() {
            return self.say(Severity::Error, why.to_string());
        }
        self.discard();
        self.fronts.clear();
        let lens = Arc::new(lens);
        self.history = UndoStack::default();
        self.saved = Arc::clone(&lens);
        self.path = path;
        self.settings.zoom = 0;
        self.settings.pupil_wavelength = None;
        self.selected = None;
        self.show(lens);
    }

    fn open(&mut self, path: &Path) {
        match files::open(path) {
            Ok(opened) => {
                // A foreign file is not written to under its own name without asking.
                let own = (opened.format == files::LensFormat::Native).then(|| path.to_owned());
                self.start_with(opened.lens, own);
                if let Some(report) = opened.report {
                    self.say(Severity::Note, format!("imported {}\n{report}", path.display()));
                }
                self.events.push(SessionEvent::Opened(path.to_owned()));
            }
            Err(why) => self.say(Severity::Error, why.to_string()),
        }
    }

    fn save(&mut self, path: Option<PathBuf>) {
        let Some(path) = path.or_else(|| self.path.clone()) else {
            let text = "the lens has no file yet; choose where to save it";
            return self.say(Severity::Warning, text.to_owned());
        };
        match files::save(&self.lens, &path) {
            Ok(saved) if saved.format == files::LensFormat::Native => {
                self.saved = Arc::clone(&self.lens);
                self.path = Some(path.clone());
                self.events.push(SessionEvent::Saved(path));
            }
            // A foreign file may hold less than the lens, which stays unsaved.
            Ok(saved) => self.exported(&path, saved),
            Err(why) => self.say(Severity::Error, why.to_string()),
        }
    }

    fn export(&mut self, path: &Path) {
        match files::save(&self.lens, path) {
            Ok(saved) => self.exported(path, saved),
            Err(why) => self.say(Severity::Error, why.to_string()),
        }
    }

    /// Says what a written file holds and what it could not hold.
    fn exported(&mut self, path: &Path, saved: files::SaveReport) {
        let head = Some(format!("exported to {}", path.display()));
        let proof = saved.proof.map(|p| p.to_string());
        let parts = [head, proof, saved.report.map(|r| r.to_string())];
        self.say(Severity::Note, parts.into_iter().flatten().collect::<Vec<_>>().join("\n"));
        self.events.push(SessionEvent::Saved(path.to_owned()));
    }

    fn optimize(&mut self, method: DescentMethod, goal: Goal) {
        self.discard();
        self.candidate = None;
        self.searches += 1;
        self.search = Some(self.searches);
        let (lens, tolerance) = (Arc::clone(&self.lens), self.settings.tolerance);
        self.worker.start(self.searches, OptimizationRequest { method, lens, goal, tolerance });
    }

    /// Makes the best lens of the search the design, as one step.
    fn take(&mut self) {
        let Some(search) = self.search() else {
            return self
                .say(Severity::Warning, "there is no search whose result to take".to_owned());
        };
        match carried(&search, &self.lens) {
            Ok(lens) => {
                self.history.push(
                    Arc::clone(&self.lens),
                    "take the search's lens".to_owned(),
                    None,
                );
                self.discard();
                self.show(Arc::new(lens));
            }
            Err(why) => self.say(Severity::Warning, why),
        }
    }

    /// Makes the lens that is shown in place of the design the design. It keeps the design's
    /// variables, where it can: a sweep frees more than a person did.
    fn take_preview(&mut self) {
        let Some(candidate) = self.candidate.take() else {
            let text = "there is no lens in place of the design to take";
            return self.say(Severity::Warning, text.to_owned());
        };
        let own = Lens { variables: self.lens.variables.clone(), ..Lens::clone(&candidate) };
        let lens = if own.check().is_ok() { own } else { Lens::clone(&candidate) };
        match lens.check() {
            Ok(()) => {
                let title = "take a lens of the front".to_owned();
                self.history.push(Arc::clone(&self.lens), title, None);
                self.show(Arc::new(lens));
            }
            Err(why) => self.say(Severity::Warning, why.to_string()),
        }
    }

    fn export_front(&mut self, folder: Option<PathBuf>) {
        let Some(folder) = folder else {
            let text = "choose a folder to export the front to";
            return self.say(Severity::Warning, text.to_owned());
        };
        self.fronts.sweeper().write(folder);
    }

    fn hear_front(&mut self, told: Told) {
        match told {
            Told::Now(_, standing) => self.events.push(SessionEvent::Front(standing)),
            Told::Failed(_, why) => {
                self.say(Severity::Error, format!("no front: {why}"));
                self.events.push(SessionEvent::Front(RunStatus::Stopped));
            }
            Told::Written(folder, files) => {
                let text = format!("{files} files of the front written to {}", folder.display());
                self.say(Severity::Note, text);
                self.events.push(SessionEvent::Saved(folder));
            }
            Told::NotWritten(why) => self.say(Severity::Error, why),
        }
    }

    /// Saves searches over structure in a folder from now on, where they have no other place, and
    /// offers to go on with the one that was left there.
    pub fn set_save_folder(&mut self, folder: impl Into<PathBuf>) {
        self.explorations.set_save_folder(folder.into());
    }

    fn discard(&mut self) {
        self.worker.stop();
        self.search = None;
    }

    fn hear(&mut self, news: News) {
        let (number, event) = match news {
            News::Started(number) => (number, SessionEvent::SearchStarted),
            News::Paused(number) => (number, SessionEvent::SearchPaused),
            News::Resumed(number) => (number, SessionEvent::SearchResumed),
            News::Stopped(number) => (number, SessionEvent::SearchStopped),
            News::Finished(number) => (number, SessionEvent::SearchFinished),
            News::Failed(number, why) => {
                if Some(number) == self.search {
                    self.say(Severity::Error, why);
                }
                (number, SessionEvent::SearchStopped)
            }
        };
        if Some(number) == self.search {
            self.events.push(event);
        }
    }

    fn experiment(&mut self, id: &str, effort: Effort) {
        match experiments::find(id) {
            Some(study) => self.laboratory.start(study, effort),
            None => self.say(Severity::Warning, format!("there is no experiment `{id}`")),
        }
    }

    fn save_experiment(&mut self, folder: &Path) {
        let trial = self.laboratory.run();
        let Some(ExperimentStatus::Done(report)) = trial.as_deref().map(|trial| &trial.status)
        else {
            let text = "there is no experiment whose results could be saved";
            return self.say(Severity::Warning, text.to_owned());
        };
        let mut report = ExperimentReport::clone(report);
        let made = std::fs::create_dir_all(folder).map_err(|why| why.to_string());
        let written = made.and_then(|()| report.write(folder).map_err(|why| why.to_string()));
        match written {
            Ok(()) => {
                let (id, count) = (report.id, report.files.len());
                let folder = folder.display();
                let text = format!("experiment {id}: {count} files written to {folder}");
                self.say(Severity::Note, text);
            }
            Err(why) => self.say(Severity::Error, why),
        }
    }

    fn set_tolerance(&mut self, tolerance: f64) {
        if tolerance > 0.0 && tolerance < 1.0 {
            self.set_up(|settings| settings.tolerance = tolerance);
        } else {
            let text = format!("the tolerance is {tolerance}; expected a number between 0 and 1");
            self.say(Severity::Warning, text);
        }
    }

    fn show_zoom(&mut self, zoom: usize) {
        let count = self.lens.zoom_positions();
        if zoom < count {
            self.set_up(|settings| settings.zoom = zoom);
        } else {
            self.say(Severity::Warning, format!("there is no zoom position {zoom} of {count}"));
        }
    }

    /// Changes a setting; the same setting again changes nothing.
    fn set_up(&mut self, change: impl FnOnce(&mut AnalysisSettings)) {
        let before = self.settings.clone();
        change(&mut self.settings);
        if self.settings != before {
            self.renew();
        }
    }
}

/// More rays of a field than this are a solid area.
const MOST_RAYS: usize = 2000;

/// The best lens of a search; where the design was edited meanwhile, the design with the numbers
/// that the search changed.
fn carried(search: &OptimizationSnapshot, design: &Arc<Lens>) -> Result<Lens, String> {
    let best = &search.best;
    if Arc::ptr_eq(&search.request.lens, design) {
        return Ok(Lens::clone(best));
    }
    let same_rows =
        best.surfaces.len() == design.surfaces.len() && best.zoom.len() == design.zoom.len();
    if !same_rows {
        return Err("the design has other surfaces now than when the search began".to_owned());
    }
    let mut lens = Lens::clone(design);
    for variable in &search.request.lens.variables {
        if let Some(value) = best.get(variable.parameter) {
            lens.set(variable.parameter, value);
        }
    }
    let lens = apply_edit(&lens, &Edit::SetName(design.name.clone()));
    lens.map_err(|why| format!("the result does not fit the design as it is now: {why}"))
}

impl OptimizationSnapshot {
    /// The lens to look at: the current one while it searches, the best one afterwards.
    pub fn displayed_lens(&self) -> &Arc<Lens> {
        if self.is_active() { &self.current } else { &self.best }
    }

    /// Whether it takes steps or can go on.
    pub fn is_active(&self) -> bool {
        self.status.is_active()
    }
}
