//! The session itself: what it holds, how it carries out commands, and what panels see of it.

mod candidate;
mod document;
mod drag;
mod element;
mod found_lens;
mod journaling;
mod live_goal;
mod runs;

use super::analysis::{
    AnalysisRequest, AnalysisResults, AnalysisSettings, AnalysisWorker, EffectTiming,
    spawn_analysis,
};
use super::command::{Command, PanelSetting};
use super::drag::DragState;
use super::experiment::{ExperimentStatus, ExperimentWorker};
use super::grin_design::GrinState;
use super::history::{DesignHistory, VersionOrigin};
use super::live_merit::{LiveMerit, MeritReport, MeritRequest};
use super::optimization::{OptimizationEngine, OptimizationRequest, OptimizerFactory};
use super::pareto::ParetoState;
use super::proposal::MeritProposal;
use super::run::{BackgroundRun, RunId, RunKind, RunStatus};
use super::score::DesignScore;
use super::specified_design::SpecifiedDesignState;
use super::structure_search::StructureSearchState;
use super::view::{KeptLens, Message, SessionView, Severity};
use crate::effects::{Effect, EffectOverride};
use crate::experiments::{self, Effort, ExperimentReport};
use crate::files::{ImportSettings, ImportedFile};
use crate::lens::Lens;
use crate::merit::Goal;
use crate::optimize;
use journaling::Journaling;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// An event of a session.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SessionEvent {
    /// The design or a setting has changed; the view has this version.
    Changed(u64),
    /// A lens was read from this file.
    Opened(PathBuf),
    /// Something was written to this file or folder.
    Saved(PathBuf),
    /// A background run has another status.
    Run(RunKind, RunStatus),
    /// There is a message to the user.
    Message(Message),
}

/// The seed of the order in which glasses are exchanged.
const GLASS_SEED: u64 = 0;
/// The maximum number of messages that are stored.
const MAX_MESSAGES: usize = 200;
/// The maximum number of rays of each field in the layout.
const MAX_RAYS: usize = 2000;

/// One open design.
#[derive(Debug)]
pub struct Session {
    lens: Arc<Lens>,
    version: u64,
    history: DesignHistory,
    journaling: Journaling,
    path: Option<PathBuf>,
    /// The file of another program that the design was read from.
    imported: Option<Arc<ImportedFile>>,
    /// The choices with which foreign files are opened.
    import_settings: ImportSettings,
    /// The lens as it is in its file.
    saved: Arc<Lens>,
    /// The merit function of a design that has none of its own.
    proposal: Arc<MeritProposal>,
    settings: AnalysisSettings,
    /// The surface that every panel highlights.
    selected: Option<usize>,
    messages: Arc<Vec<Message>>,
    /// True if nothing was done since the last message.
    message_is_recent: bool,
    /// The number of lenses that were opened or begun.
    document: u64,
    analysis: AnalysisWorker,
    optimization: BackgroundRun<OptimizationEngine>,
    pareto: ParetoState,
    structure_search: StructureSearchState,
    grin: GrinState,
    specified_design: SpecifiedDesignState,
    experiment: ExperimentWorker,
    design_score: DesignScore,
    drag: DragState,
    live_merit: LiveMerit,
    /// The lens that a panel shows in place of the design.
    preview_lens: Option<Arc<Lens>>,
    /// The origin of that lens.
    preview_title: String,
    /// True if a candidate is shown; false while the design is shown in spite of one.
    shows_candidate: bool,
    /// The candidates that were kept beside the design.
    kept: Arc<Vec<KeptLens>>,
    /// Analyzes that lens, or the one that a run shows.
    preview_analysis: AnalysisWorker,
    /// Evaluates its merit.
    preview_merit: LiveMerit,
    /// The merit of the candidate before.
    outdated_merit: Option<Arc<MeritReport>>,
    /// The lens whose analysis was requested last.
    preview_request: Option<PreviewRequest>,
    /// The version of the analyses of one source.
    preview_version: u64,
    events: Vec<SessionEvent>,
}

/// The source of a lens that is shown in place of the design.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PreviewSource {
    /// A panel.
    Panel,
    /// A background run.
    Run(RunId),
}

/// A lens that is shown in place of the design, with what its numbers depend on.
#[derive(Debug)]
struct PreviewRequest {
    source: PreviewSource,
    lens: Arc<Lens>,
    settings: AnalysisSettings,
    /// The merit function of the design, by which its merit is told.
    goal: Option<Arc<Goal>>,
}

impl Session {
    /// Opens a design; `wake` is called from other threads when there is something new to show.
    ///
    /// # Errors
    /// A lens that cannot be used, or a system that cannot start a thread.
    pub fn new(lens: Lens, wake: impl Fn() + Send + Clone + 'static) -> io::Result<Self> {
        let start = |request: &OptimizationRequest| {
            let OptimizationRequest { method, lens, goal, tolerance, glasses } = request;
            let Some(glasses) = glasses else {
                let started = optimize::start(*method, lens, goal, *tolerance);
                return started.map_err(|why| why.to_string());
            };
            let glasses = glasses.iter().copied();
            let started =
                optimize::start_exchanging(*method, lens, goal, *tolerance, glasses, GLASS_SEED);
            started.map_err(|why| why.to_string())
        };
        Self::with_optimizer(lens, Box::new(start), wake)
    }

    /// The same with other optimizers.
    ///
    /// # Errors
    /// As [`Session::new`].
    pub fn with_optimizer(
        lens: Lens,
        factory: Box<OptimizerFactory>,
        wake: impl Fn() + Send + Clone + 'static,
    ) -> io::Result<Self> {
        lens.check().map_err(io::Error::other)?;
        let lens = Arc::new(lens);
        let proposal = MeritProposal::of(&lens);
        let optimize = move |request, _: &_| OptimizationEngine::start(&factory, request);
        let origin = VersionOrigin::first("opened", Arc::clone(&proposal));
        let session = Self {
            saved: Arc::clone(&lens),
            history: DesignHistory::new(Arc::clone(&lens), origin),
            journaling: Journaling::default(),
            lens,
            version: 1,
            path: None,
            imported: None,
            import_settings: ImportSettings::default(),
            proposal,
            settings: AnalysisSettings::default(),
            selected: None,
            messages: Arc::default(),
            message_is_recent: false,
            document: 0,
            analysis: spawn_analysis(EffectTiming::Measured, wake.clone())?,
            optimization: BackgroundRun::spawn(wake.clone(), optimize)?,
            pareto: ParetoState::spawn(wake.clone())?,
            structure_search: StructureSearchState::spawn(wake.clone())?,
            grin: GrinState::spawn(wake.clone())?,
            specified_design: SpecifiedDesignState::spawn(wake.clone())?,
            experiment: ExperimentWorker::spawn(wake.clone())?,
            design_score: DesignScore::spawn(wake.clone())?,
            drag: DragState::spawn(wake.clone())?,
            live_merit: LiveMerit::spawn(wake.clone())?,
            preview_lens: None,
            preview_title: String::new(),
            shows_candidate: true,
            kept: Arc::default(),
            preview_analysis: spawn_analysis(EffectTiming::Skipped, wake.clone())?,
            preview_merit: LiveMerit::spawn(wake)?,
            outdated_merit: None,
            preview_request: None,
            preview_version: 0,
            events: Vec::new(),
        };
        session.request_analysis();
        Ok(session)
    }

    /// Carries out a command and returns the events so far.
    pub fn apply(&mut self, command: Command) -> Vec<SessionEvent> {
        if !command.continues_drag() {
            self.end_drag();
        }
        self.carry_out(command);
        self.poll()
    }

    fn carry_out(&mut self, command: Command) {
        match command {
            Command::Edit(edit) => self.edit(&edit),
            Command::LimitByStop => self.limit_by_stop(),
            Command::ScaleToFocalLength(focal_length) => self.scale_to_focal_length(focal_length),
            Command::InsertLens { path, at } => self.insert_lens(&path, at),
            Command::CommitEdit => self.history.commit(),
            Command::DragHandle { handle, value, rim } => self.drag_handle(handle, value, rim),
            Command::EndDrag => self.end_drag(),
            Command::CancelDrag => self.cancel_drag(),
            Command::SetDragSettings(settings) => self.set_drag_settings(settings),
            Command::Undo => self.undo(),
            Command::Redo => self.redo(),
            Command::GoTo(id) => self.go_to(id),
            Command::NameVersion { id, name } => self.name_version(id, &name),
            Command::Rewind { version, step } => self.rewind(version, step),
            Command::New(lens) => self.replace_design(*lens, None),
            Command::Begin(starting) => self.begin(&starting),
            Command::Open(path) => self.open(&path),
            Command::SetVignetting(choice) => self.import_settings.vignetting = choice,
            Command::Save(path) => self.save(path),
            Command::Export(path) => self.export(&path),
            Command::ExportPaper { kind, path } => self.export_paper(kind, &path),
            Command::SaveImportReport(path) => self.save_import_report(&path),
            Command::AddGlasses(path) => self.add_glasses(&path),
            Command::Optimize { method, goal, glasses } => self.optimize(method, goal, glasses),
            Command::Pause => self.optimization.pause(),
            Command::Resume => self.optimization.resume(),
            Command::Step => self.optimization.step(),
            Command::Stop => self.optimization.stop(),
            Command::AcceptResult => self.accept_result(),
            Command::DiscardResult => self.discard_result(),
            Command::StartPareto { settings, compare } => self.start_pareto(settings, compare),
            Command::PausePareto => self.pareto.run.pause(),
            Command::ResumePareto => self.pareto.run.resume(),
            Command::StopPareto => self.pareto.run.stop(),
            Command::ClearPareto => self.clear_pareto(),
            Command::ExportPareto(folder) => self.export_pareto(folder),
            Command::StructureSearch(command) => self.structure_search_command(command),
            Command::Grin(command) => self.grin_command(command),
            Command::SpecifiedDesign(command) => self.specified_design_command(command),
            Command::Preview(lens) => self.preview(lens),
            Command::AcceptPreview => self.accept_preview(),
            Command::AcceptCandidate => self.accept_candidate(),
            Command::KeepCandidate => self.keep_candidate(),
            Command::DiscardCandidate => self.discard_candidate(),
            Command::ShowCandidate(shown) => self.shows_candidate = shown,
            Command::SetTolerance(tolerance) => self.set_tolerance(tolerance),
            Command::ShowZoom(zoom) => self.show_zoom(zoom),
            Command::SetEffect(effect, choice) => self.set_effect(effect, choice),
            Command::SavePicture(path) => self.save_picture(&path),
            Command::StartExperiment { id, effort } => self.start_experiment(&id, effort),
            Command::CancelExperiment => self.experiment.cancel(),
            Command::DismissExperiment => self.experiment.dismiss(),
            Command::SaveExperiment(folder) => self.save_experiment(&folder),
            Command::Select(surface) => self.selected = surface,
            Command::ClearMessages => self.messages = Arc::default(),
            Command::Show(setting) => self.show(setting),
        }
    }

    fn show(&mut self, setting: PanelSetting) {
        // A panel that comes to the front contradicts no message.
        let is_recent = self.message_is_recent;
        self.change_settings(|settings| match setting {
            PanelSetting::Rays(rays) => settings.rays = rays.min(MAX_RAYS),
            PanelSetting::Pupils(shown) => settings.pupils = shown,
            PanelSetting::Contrasts(shown) => settings.contrasts = shown,
            PanelSetting::Wavefronts(shown) => settings.wavefronts = shown,
            PanelSetting::PointImages(shown) => settings.point_images = shown,
            PanelSetting::Fans(shown) => settings.fans = shown,
            PanelSetting::PathFans(shown) => settings.path_fans = shown,
            PanelSetting::FieldCurves(shown) => settings.field_curves = shown,
            PanelSetting::FieldPage(page) => settings.field_page = page,
            PanelSetting::ContrastPage(page) => settings.contrast_page = page,
            PanelSetting::ContrastFrequency(nu) => settings.contrast_frequency = nu,
            PanelSetting::ContrastAccuracy(shown) => settings.contrast_accuracy = shown,
            PanelSetting::PointSpreadAccuracy(shown) => {
                settings.point_spread_accuracy = shown;
            }
            PanelSetting::PictureAccuracy(shown) => settings.picture_accuracy = shown,
            PanelSetting::RayImages(shown) => settings.ray_images = shown,
            PanelSetting::Footprints(shown) => settings.footprints = shown,
            PanelSetting::SpotMap(shown) => settings.spot_map = shown,
            PanelSetting::Ghosts(shown) => settings.ghosts = shown,
            PanelSetting::Coating(coating) => settings.coating = coating,
            PanelSetting::Ghost(pair) => settings.ghost = pair,
            PanelSetting::Picture(shown) => settings.picture = shown,
            PanelSetting::Scene(scene) => (settings.scene, settings.scene_file) = (scene, None),
            PanelSetting::SceneFile(file) => settings.scene_file = Some(file),
            PanelSetting::PictureOptions(options) => settings.picture_options = *options,
            PanelSetting::PictureErrors(shown) => settings.picture_errors = shown,
            PanelSetting::PicturePoints(shown) => settings.picture_points = shown,
            PanelSetting::Tolerances(shown) => settings.tolerances = shown,
            PanelSetting::ToleranceGrade(grade) => settings.grade = grade,
            PanelSetting::GoodRms(rms) => settings.good_rms = rms,
            PanelSetting::ToleranceFrequency(nu) => settings.tolerance_frequency = nu,
            PanelSetting::Loosest(goal) => settings.loosest = goal,
            PanelSetting::PupilWavelength(wavelength) => settings.pupil_wavelength = wavelength,
            PanelSetting::WavefrontLight(light) => settings.wavefront_light = light,
        });
        self.message_is_recent = is_recent;
    }

    fn set_effect(&mut self, effect: Effect, choice: EffectOverride) {
        self.change_settings(|settings| settings.overrides.set(effect, choice));
    }

    /// The events since the last call, those of background threads included.
    pub fn poll(&mut self) -> Vec<SessionEvent> {
        self.receive_run_events();
        self.journal_runs();
        self.sync_merit();
        let is_compared = self.pareto.run.view().id.is_some() || self.structure_search.is_shown();
        self.design_score.sync(&self.lens, is_compared);
        self.grin.sync();
        self.sync_drag();
        self.sync_preview();
        std::mem::take(&mut self.events)
    }

    /// A snapshot for panels.
    pub fn view(&self) -> SessionView {
        SessionView {
            lens: Arc::clone(&self.lens),
            version: self.version,
            results: self.analysis.latest(),
            optimization: self.optimization.view(),
            pareto: self.pareto.view(),
            structure_search: self.structure_search.view(),
            grin: self.grin.view(),
            specified_design: self.specified_design.view(),
            design_score: self.design_score.latest(),
            preview_lens: self.preview_lens.clone(),
            candidate: self.candidate(),
            kept: Arc::clone(&self.kept),
            preview_results: self.preview_results(),
            preview_merit: self.candidate_merit(),
            experiment: self.experiment.run(),
            drag: self.drag.view(),
            messages: Arc::clone(&self.messages),
            history: Arc::clone(self.history.nodes()),
            version_id: self.history.present(),
            message_is_recent: self.message_is_recent,
            document: self.document,
            undo: self.history.undo_title().map(str::to_owned),
            redo: self.history.redo_title().map(str::to_owned),
            path: self.path.clone(),
            imported: self.imported.clone(),
            vignetting: self.import_settings.vignetting,
            goal: self.goal(),
            merit: self.merit_report(),
            dirty: self.is_dirty(),
            settings: self.settings.clone(),
            selected: self.selected.filter(|surface| *surface < self.lens.surfaces.len()),
        }
    }

    /// The design.
    pub fn lens(&self) -> &Arc<Lens> {
        &self.lens
    }

    /// The file of the design.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// The newest analyses, maybe of an earlier version.
    pub fn results(&self) -> Option<Arc<AnalysisResults>> {
        self.analysis.latest()
    }

    /// True if the design differs from its file.
    pub fn is_dirty(&self) -> bool {
        !Arc::ptr_eq(&self.lens, &self.saved) && self.lens != self.saved
    }

    /// Requests the analysis of the lens that is shown in place of the design, if it is another one.
    fn sync_preview(&mut self) {
        // A chain of a search has no lens for a moment now and then: its last analysis stays valid.
        let Some((source, lens)) = self.previewed() else { return };
        let last = self.preview_request.as_ref();
        let same_source = last.is_some_and(|last| last.source == source);
        let same_lens = last
            .is_some_and(|last| Arc::ptr_eq(&last.lens, &lens) && last.settings == self.settings);
        let goal = self.goal();
        let same_goal = last.is_some_and(|last| last.goal == goal);
        if same_source && same_lens && same_goal {
            return;
        }
        if !same_source || !same_goal || source == PreviewSource::Panel {
            self.outdated_merit = self.preview_merit.latest();
        }
        if let Some(goal) = goal.clone() {
            let (lens, design) = (Arc::clone(&lens), Arc::clone(&self.lens));
            let tolerance = self.settings.tolerance;
            self.preview_merit.request(MeritRequest { lens, design, goal, tolerance });
        }
        self.preview_version += u64::from(!same_source);
        let (version, settings) = (self.preview_version, self.settings.clone());
        self.preview_analysis.request(AnalysisRequest {
            version,
            lens: Arc::clone(&lens),
            settings: settings.clone(),
        });
        self.preview_request = Some(PreviewRequest { source, lens, settings, goal });
    }

    /// The analyses of the lens that is shown in place of the design, maybe of one step before.
    fn preview_results(&self) -> Option<Arc<AnalysisResults>> {
        if !self.shows_candidate {
            return None;
        }
        let chain = self.structure_search.previewed_run().filter(|_| self.preview_lens.is_none());
        let source = match chain {
            Some(id) => PreviewSource::Run(id),
            None => self.previewed()?.0,
        };
        let is_current = self.preview_request.as_ref().is_some_and(|last| last.source == source);
        let latest = self.preview_analysis.latest().filter(|_| is_current);
        latest.filter(|results| results.version == self.preview_version)
    }

    /// Makes all analyses so far outdated.
    fn invalidate(&mut self) {
        self.version += 1;
        self.message_is_recent = false;
        self.request_analysis();
        self.events.push(SessionEvent::Changed(self.version));
    }

    fn request_analysis(&self) {
        self.analysis.request(AnalysisRequest {
            version: self.version,
            lens: Arc::clone(&self.lens),
            settings: self.settings.clone(),
        });
        // While a handle is dragged, its slopes come with the merit.
        if let Some(goal) = self.goal().filter(|_| self.drag.handle().is_none()) {
            let [lens, design] = [&self.lens; 2].map(Arc::clone);
            let tolerance = self.settings.tolerance;
            self.live_merit.request(MeritRequest { lens, design, goal, tolerance });
        }
    }

    /// Posts a message to the user.
    fn post(&mut self, severity: Severity, text: impl Into<String>) {
        let message = Message { severity, text: text.into() };
        let messages = Arc::make_mut(&mut self.messages);
        if messages.len() >= MAX_MESSAGES {
            messages.remove(0);
        }
        messages.push(message.clone());
        self.message_is_recent = true;
        self.events.push(SessionEvent::Message(message));
    }

    fn start_experiment(&mut self, id: &str, effort: Effort) {
        match experiments::find(id) {
            Some(experiment) => self.experiment.start(experiment, effort),
            None => self.post(Severity::Warning, format!("there is no experiment `{id}`")),
        }
    }

    fn save_experiment(&mut self, folder: &Path) {
        let run = self.experiment.run();
        let Some(ExperimentStatus::Done(report)) = run.as_deref().map(|run| &run.status) else {
            let text = "there is no experiment whose results could be saved";
            return self.post(Severity::Warning, text);
        };
        let mut report = ExperimentReport::clone(report);
        let made = std::fs::create_dir_all(folder).map_err(|why| why.to_string());
        let written = made.and_then(|()| report.write(folder).map_err(|why| why.to_string()));
        match written {
            Ok(()) => {
                let (id, count) = (report.id, report.files.len());
                let folder = folder.display();
                let text = format!("experiment {id}: {count} files written to {folder}");
                self.post(Severity::Note, text);
            }
            Err(why) => self.post(Severity::Error, why),
        }
    }

    fn set_tolerance(&mut self, tolerance: f64) {
        if tolerance > 0.0 && tolerance < 1.0 {
            self.change_settings(|settings| settings.tolerance = tolerance);
        } else {
            let text = format!("the tolerance is {tolerance}; expected a number between 0 and 1");
            self.post(Severity::Warning, text);
        }
    }

    fn show_zoom(&mut self, zoom: usize) {
        let count = self.lens.zoom_positions();
        if zoom < count {
            self.change_settings(|settings| settings.zoom = zoom);
        } else {
            let text = format!("there is no zoom position {zoom}; the lens has {count}");
            self.post(Severity::Warning, text);
        }
    }

    /// Changes a setting; setting it to the same value changes nothing.
    fn change_settings(&mut self, change: impl FnOnce(&mut AnalysisSettings)) {
        let before = self.settings.clone();
        change(&mut self.settings);
        if self.settings != before {
            self.invalidate();
        }
    }
}
