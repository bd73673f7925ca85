//! The studio: one session, the panels that show it, the menu, and the dialogs.

use std::path::{Path, PathBuf};
use std::time::Duration;

use eframe::{App, Storage};
use egui::{
    Align, CentralPanel, Context, Frame, Id, Label, Layout, Margin, Modal, Panel as Side, RawInput,
    Response, RichText, ScrollArea, Sense, Ui, ViewportCommand, vec2,
};

use super::actions::{Actions, UiAction};
use super::arrangement::Arrangement;
use super::dialogs::Dialogs;
use super::dock::Dock;
use super::draw::RenderBackend;
use super::dropped;
use super::element_dialog::place_for_element;
use super::experiment_window::ExperimentWindow;
use super::file_dialog::{FileDialog, FileRequest};
use super::input_order::InputQueue;
use super::menu;
use super::menu_items::{MenuContext, PanelState};
use super::panels::PanelKind;
use super::run_items::panel_of_run;
use super::stored_picture::StoredPicture;
use super::text::capitalize;
use super::unsaved::{PendingAction, PendingState};
use super::window::Persistence;
use crate::files;
use crate::files::{BundledLens, LibraryLens};
use crate::report::PaperKind;
use crate::session::{
    Analyses, AnalysisSettings, Command, ContrastPage, DocumentSource, FieldPage, GrinCommand,
    Message, PanelSetting, SceneFile, Session, SessionEvent, SessionView, Severity,
    StructureSearchCommand,
};

/// The key under which the arrangement of the panels is stored.
const DOCK: &str = "dock";

/// The key under which the scene of the picture is stored.
const PICTURE: &str = "picture";

/// The key under which the files that were opened last are stored.
const RECENT: &str = "recent files";
/// The time after which the arrangement of the panels and the recent files are stored, so that a program
/// that is killed loses little of them.
const SETTINGS_INTERVAL: Duration = Duration::from_secs(3);
/// The number of words of the name of a lens in that of its file.
const NAME_WORDS: usize = 6;
/// The number of those files.
const MAX_RECENT: usize = 12;

/// The content of the window.
#[derive(Debug)]
pub struct Studio {
    pub(super) session: Session,
    dock: Dock,
    pub(super) file_dialog: FileDialog,
    experiment_window: ExperimentWindow,
    dialogs: Dialogs,
    /// The files that were opened or saved last, the newest first.
    recent: Vec<PathBuf>,
    /// The folder of the file that was chosen last.
    folder: Option<PathBuf>,
    /// The file of the design in the frame before.
    path: Option<PathBuf>,
    persistence: Persistence,
    /// The action that waits until the user has decided about unsaved changes.
    pub(super) pending: Option<PendingState>,
    /// A message that does not fit into the status bar.
    message: Option<String>,
    input: InputQueue,
    title: String,
    /// True if the window closes without asking about unsaved changes.
    pub(super) closing: bool,
}

impl Studio {
    /// A studio on a session. `storage` holds the arrangement of the panels of an earlier window.
    pub fn new(
        session: Session,
        backend: RenderBackend,
        persistence: Persistence,
        storage: Option<&dyn Storage>,
    ) -> Self {
        let tree = storage.and_then(|storage| eframe::get_value(storage, DOCK));
        let picture: Option<StoredPicture> = storage.and_then(|s| eframe::get_value(s, PICTURE));
        let mut session = session;
        for command in picture.into_iter().flat_map(StoredPicture::commands) {
            session.apply(command);
        }
        Self {
            session,
            dock: Dock::new(backend, tree),
            file_dialog: FileDialog::default(),
            experiment_window: ExperimentWindow::default(),
            dialogs: Dialogs::default(),
            recent: storage.and_then(|s| eframe::get_value(s, RECENT)).unwrap_or_default(),
            folder: None,
            path: None,
            persistence,
            pending: None,
            message: None,
            input: InputQueue::default(),
            title: String::new(),
            closing: false,
        }
    }

    /// The session.
    pub const fn session(&self) -> &Session {
        &self.session
    }

    /// Lets the window close without asking about unsaved changes.
    pub const fn close_without_asking(&mut self) {
        self.closing = true;
    }

    /// The session, to run commands directly.
    pub const fn session_mut(&mut self) -> &mut Session {
        &mut self.session
    }

    /// Runs a command as if a panel had asked for it.
    pub fn apply(&mut self, context: &Context, command: Command) {
        let events = self.session.apply(command);
        self.on_events(events);
        context.request_repaint();
    }

    /// Shows the whole window and carries out the requests made in it.
    pub fn ui(&mut self, ui: &mut Ui) {
        let events = self.session.poll();
        self.on_events(events);
        let view = self.session.view();
        self.update_title(ui.ctx(), &view);
        self.remember_design(&view);
        let mut actions = Actions::default();
        let menus = menu_context(&self.dock, &self.dialogs, (&self.recent, &view), ui.ctx());
        if !self.waits_for_answer(ui.ctx()) {
            menu::shortcuts(ui, &menus, self.dock.is_typing(ui.ctx()), &mut actions);
        }
        bar_frame(ui, Side::top("menu"), |ui| menu::bar(ui, &menus, &mut actions));
        self.dialogs.ui(ui.ctx(), &menus, &mut actions);
        bar_frame(ui, Side::bottom("status"), |ui| {
            status_bar(ui, &view, &mut self.message, &mut actions);
        });
        CentralPanel::no_frame().show(ui, |ui| self.dock.ui(ui, &view, &mut actions));
        let context = ui.ctx().clone();
        self.receive_dropped_files(&context, &mut actions);
        self.experiment_window.ui(&context, view.experiment.as_deref(), &mut actions);
        self.dialogs(&context, &view);
        for action in actions {
            self.dispatch(&context, &view, action);
        }
    }

    /// True while a dialog has to be answered or closed before anything else is done: keys are its own,
    /// those that arrive in the frame in which it opens too.
    fn waits_for_answer(&self, context: &Context) -> bool {
        let is_modal = context.memory(|memory| memory.top_modal_layer().is_some());
        is_modal || self.pending.is_some() || self.message.is_some()
    }

    fn dispatch(&mut self, context: &Context, view: &SessionView, action: UiAction) {
        match action {
            UiAction::Run(command) => {
                // A run that was asked for by words is seen.
                let panel = panel_of_run(&command).filter(|_| self.dock.maximized().is_none());
                panel.into_iter().for_each(|kind| self.dock.bring_forward(kind));
                self.run_or_ask(context, PendingAction::Run(command), None);
            }
            UiAction::AskPath(request) => self.ask_path(context, view, request),
            UiAction::OpenBundled(bundled) => self.open_bundled(context, bundled),
            UiAction::OpenLibrary(lens, scale) => self.open_library_lens(context, lens, scale),
            UiAction::ShowDialog(kind) => {
                let menus = menu_context(&self.dock, &self.dialogs, (&self.recent, view), context);
                self.dialogs.open(kind, &menus);
                context.request_repaint();
            }
            UiAction::ShowPanel(kind) => {
                self.dock.show(kind);
                self.dock.put_keyboard_in(context, kind);
            }
            UiAction::StepPanel(step) => {
                let kind = self.dock.panel_beside(step);
                self.dock.put_keyboard_in(context, kind);
            }
            UiAction::TogglePanel(kind) => {
                self.dock.toggle(kind);
                if kind == PanelKind::Prescription && self.dock.is_visible(kind) {
                    self.dock.put_keyboard_in(context, kind);
                }
            }
            UiAction::MaximizePanel(kind) => self.dock.maximize(kind),
            UiAction::ArrangePanels(arrangement) => self.dock.arrange(arrangement),
            UiAction::WatchSearch(chain) => {
                self.dock.arrange(Arrangement::Search);
                self.apply(context, Command::Preview(None));
                let preview = StructureSearchCommand::Preview(Some(chain));
                self.apply(context, Command::StructureSearch(preview));
            }
            UiAction::SetTheme(theme) => context.set_theme(theme),
            UiAction::Quit => context.send_viewport_cmd(ViewportCommand::Close),
        }
    }

    /// Opens the files that were dropped on the window, or says by name why one cannot be opened.
    fn receive_dropped_files(&mut self, context: &Context, actions: &mut Actions) {
        let files = context.input(|input| input.raw.dropped_files.clone());
        let mut refused = Vec::new();
        for path in files.iter().map(|file| file.path().to_owned()) {
            match dropped::open_actions(&path) {
                Ok(asked) => actions.extend(asked),
                Err(why) => refused.push(why),
            }
        }
        // Each file that is refused is named.
        if !refused.is_empty() {
            self.message = Some(refused.join(" "));
        }
    }

    fn open_bundled(&mut self, context: &Context, bundled: &BundledLens) {
        match files::parse(bundled.text.as_bytes(), bundled.name) {
            Ok(opened) => {
                let command = Command::New(Box::new(opened.lens));
                self.run_or_ask(context, PendingAction::Run(command), None);
            }
            Err(why) => self.message = Some(why.to_string()),
        }
    }

    fn open_library_lens(&mut self, context: &Context, lens: &LibraryLens, scale: Option<f64>) {
        let opened = lens.open().map_err(|why| why.to_string());
        let opened = opened.and_then(|lens| match scale {
            Some(mm) => files::scale_to_focal_length(&lens, mm).map_err(|why| why.to_string()),
            None => Ok(lens),
        });
        match opened {
            Ok(lens) => {
                let command = Command::New(Box::new(lens));
                self.run_or_ask(context, PendingAction::Run(command), None);
            }
            Err(why) => self.message = Some(why),
        }
    }

    /// Asks for a path, starting from the most likely one.
    pub(super) fn ask_path(&mut self, context: &Context, view: &SessionView, request: FileRequest) {
        let near = self.in_folder(view, likely_path(view, request));
        self.file_dialog.ask(context, request, near.as_deref());
    }

    /// A whole path for a proposed one: that of a bare name is in the folder of the lens, or else in the
    /// one that was used last.
    fn in_folder(&self, view: &SessionView, path: Option<PathBuf>) -> Option<PathBuf> {
        let imported = view.imported.as_ref().map(|imported| imported.path.as_path());
        let file = view.path.as_deref().or(imported);
        let recent = self.recent.first().and_then(|path| path.parent());
        let folder = file.and_then(Path::parent).or(self.folder.as_deref()).or(recent);
        let path = path.map(|path| match folder {
            Some(folder) if path.file_name() == Some(path.as_os_str()) => folder.join(path),
            _ => path,
        });
        let path = path.or_else(|| folder.map(Path::to_owned))?;
        std::path::absolute(&path).ok().or(Some(path))
    }

    fn dialogs(&mut self, context: &Context, view: &SessionView) {
        if let Some((request, path)) = self.file_dialog.ui(context) {
            self.on_path_chosen(context, request, path);
        }
        let closing = context.input(|input| input.viewport().close_requested());
        if closing && !self.closing && self.would_discard(&PendingAction::Quit) {
            context.send_viewport_cmd(ViewportCommand::CancelClose);
            self.run_or_ask(context, PendingAction::Quit, None);
        }
        self.unsaved_dialog(context, view);
        self.show_message(context);
    }

    fn on_path_chosen(&mut self, context: &Context, request: FileRequest, path: PathBuf) {
        self.folder = std::path::absolute(&path).ok().and_then(|path| Some(path.parent()?.into()));
        let search = Command::StructureSearch;
        let command = match request {
            FileRequest::Open if dropped::is_search(&path) => {
                self.dock.show(PanelKind::Search);
                search(StructureSearchCommand::Follow(path))
            }
            FileRequest::Open => Command::Open(path),
            FileRequest::InsertLens => {
                let view = self.session.view();
                let at = place_for_element(&view.lens, view.selected);
                Command::InsertLens { path, at }
            }
            FileRequest::ExperimentFolder => Command::SaveExperiment(path),
            FileRequest::AddGlasses => Command::AddGlasses(path),
            FileRequest::SaveImportReport => Command::SaveImportReport(path),
            FileRequest::Save => Command::Save(Some(path)),
            FileRequest::ExportFront => Command::ExportPareto(path),
            FileRequest::OpenSearch => search(StructureSearchCommand::ResumeFrom(path)),
            FileRequest::SaveSearch => search(StructureSearchCommand::SaveTo(path)),
            FileRequest::ExportSearchLens(number) => {
                search(StructureSearchCommand::Export { number, path })
            }
            FileRequest::OpenField => Command::Grin(GrinCommand::OpenFile(path)),
            FileRequest::SaveField(nodes) => Command::Grin(GrinCommand::Save { path, nodes }),
            FileRequest::OpenScene => match SceneFile::read(&path) {
                Ok(file) => Command::Show(PanelSetting::SceneFile(file)),
                Err(why) => return self.message = Some(why.to_string()),
            },
            FileRequest::SavePicture => Command::SavePicture(path),
            FileRequest::ExportPaper(kind) => Command::ExportPaper { kind, path },
            FileRequest::ExportFigure(kind, _) => {
                Command::ExportPaper { kind: PaperKind::Figure(kind), path }
            }
            FileRequest::ExportZemax | FileRequest::ExportJson => Command::Export(path),
        };
        self.run_or_ask(context, PendingAction::Run(command), None);
    }

    /// Keeps a message that does not fit into the status bar for the dialog.
    fn on_events(&mut self, events: Vec<SessionEvent>) {
        for event in events {
            if let SessionEvent::Opened(path) = &event {
                self.remember(path);
                if self.dock.maximized().is_none() {
                    self.dock.bring_forward(PanelKind::Layout);
                }
                if self.session.view().imported.is_some() {
                    self.dock.show(PanelKind::ImportReport);
                }
            }
            if let SessionEvent::Message(message) = event
                && (message.text.lines().count() > 1 || message.severity == Severity::Error)
            {
                self.message = Some(message.text);
            }
        }
    }

    /// Remembers the file of the design when it has another one: opened, saved, or named at the start.
    fn remember_design(&mut self, view: &SessionView) {
        if view.path != self.path {
            self.path.clone_from(&view.path);
            if let Some(path) = &view.path {
                self.remember(path);
            }
        }
    }

    fn remember(&mut self, path: &Path) {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        self.recent.retain(|other| *other != path);
        self.recent.insert(0, path);
        self.recent.truncate(MAX_RECENT);
    }

    /// Shows a long message or an error until it is closed.
    fn show_message(&mut self, context: &Context) {
        let Some(text) = &self.message else { return };
        let mut read = false;
        let modal = Modal::new(Id::unique("report")).show(context, |ui| {
            let (words, table) = text.split_once('\n').unwrap_or((text, ""));
            ui.set_max_width(if table.is_empty() { 460.0 } else { 820.0 });
            ui.label(capitalize(words));
            if !table.is_empty() {
                let scroll = ScrollArea::both().max_height(440.0).min_scrolled_height(440.0);
                scroll.show(ui, |ui| {
                    let table = RichText::new(table).monospace();
                    ui.add(Label::new(table).extend().selectable(true));
                });
            }
            ui.add_space(8.0);
            ui.horizontal(|ui| {
                let ok = ui.button("OK");
                if ui.memory(|memory| memory.focused().is_none()) {
                    // Enter closes the message, too.
                    ok.request_focus();
                }
                read = ok.clicked();
                if ui.button("Copy").on_hover_text("Copy the whole text").clicked() {
                    ui.copy_text(text.clone());
                }
            });
        });
        if read || modal.should_close() {
            self.message = None;
        }
    }

    fn update_title(&mut self, context: &Context, view: &SessionView) {
        let mark = if view.dirty { "• " } else { "" };
        let file = view.path.as_ref().and_then(|path| path.file_name());
        let file = file.map(|name| format!(" ({})", name.to_string_lossy())).unwrap_or_default();
        let title = format!("{mark}{}{file} - Aplanat", view.lens.name);
        if title != self.title {
            context.send_viewport_cmd(ViewportCommand::Title(title.clone()));
            self.title = title;
        }
    }
}

impl App for Studio {
    fn raw_input_hook(&mut self, context: &Context, input: &mut RawInput) {
        if self.input.limit(input) {
            context.request_repaint();
        }
    }

    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        Self::ui(self, ui);
        // Settings are stored in a frame, and without input there is none.
        let is_changed = ui.input(|input| !input.events.is_empty());
        if is_changed && self.persistence == Persistence::Enabled {
            ui.ctx().request_repaint_after(SETTINGS_INTERVAL.saturating_mul(2));
        }
    }

    fn save(&mut self, storage: &mut dyn Storage) {
        if self.persistence == Persistence::Enabled {
            eframe::set_value(storage, DOCK, self.dock.tree());
            eframe::set_value(storage, RECENT, &self.recent);
            let picture = StoredPicture::of(&self.session.view().settings);
            eframe::set_value(storage, PICTURE, &picture);
        }
    }

    fn auto_save_interval(&self) -> Duration {
        SETTINGS_INTERVAL
    }

    fn persist_egui_memory(&self) -> bool {
        self.persistence == Persistence::Enabled
    }
}

/// The state on which the items of the menus depend.
fn menu_context<'a>(
    dock: &Dock,
    dialogs: &Dialogs,
    (recent, view): (&'a [PathBuf], &'a SessionView),
    context: &Context,
) -> MenuContext<'a> {
    let panels = PanelKind::ALL.map(|kind| PanelState {
        kind,
        title: dock.title(kind),
        is_open: dock.is_open(kind),
    });
    let front = dock.front();
    let maximized = dock.maximized().is_some();
    let (theme, has_preview) = (context.theme(), dialogs.has_preview());
    MenuContext { view, panels: panels.into(), front, maximized, recent, theme, has_preview }
}

/// The path with which a file dialog starts.
fn likely_path(view: &SessionView, request: FileRequest) -> Option<PathBuf> {
    let search = &view.structure_search;
    let checkpoint = || search.run.snapshot.as_ref().and_then(|run| run.checkpoint.path.clone());
    match request {
        FileRequest::ExportFront => {
            let beside = view.path.as_ref().map(|path| path.with_file_name("front"));
            Some(beside.unwrap_or_else(|| PathBuf::from("front")))
        }
        FileRequest::SavePicture => {
            let beside = view.path.as_ref().map(|path| path.with_extension("png"));
            Some(beside.unwrap_or_else(|| PathBuf::from("picture.png")))
        }
        FileRequest::ExportPaper(kind) => {
            let name = || named_file(&view.lens.name, "pdf");
            let beside = view.path.clone().unwrap_or_else(name);
            Some(beside.with_extension(kind.extensions().first().unwrap_or(&"pdf")))
        }
        FileRequest::ExportFigure(kind, format) => {
            let lens = named_file(&view.lens.name, "");
            let stem = lens.file_stem().unwrap_or(lens.as_os_str()).to_string_lossy();
            let name = PathBuf::from(format!("{stem} {}.{}", kind.name(), format.extension()));
            Some(view.path.as_ref().map(|path| path.with_file_name(&name)).unwrap_or(name))
        }
        FileRequest::OpenSearch => checkpoint().or_else(|| search.unfinished.clone()),
        FileRequest::SaveSearch => checkpoint().or_else(|| search.save_path.clone()),
        FileRequest::OpenField => open_field_path(view).map(Path::to_owned),
        FileRequest::SaveField(_) => {
            let beside = open_field_path(view).map(|path| path.with_extension("npz"));
            Some(beside.unwrap_or_else(|| PathBuf::from("field.npz")))
        }
        FileRequest::Save | FileRequest::ExportJson => {
            Some(view.path.clone().unwrap_or_else(|| named_file(&view.lens.name, "json")))
        }
        FileRequest::SaveImportReport => {
            let file = view.imported.as_ref().map(|imported| imported.path.with_extension("txt"));
            Some(file.unwrap_or_else(|| PathBuf::from("import.txt")))
        }
        FileRequest::ExportZemax => {
            let beside = view.path.as_ref().map(|path| path.with_extension("zmx"));
            Some(beside.unwrap_or_else(|| named_file(&view.lens.name, "zmx")))
        }
        _ => view.path.clone(),
    }
}

/// A file with the name of a lens, without the characters that some systems refuse. A decimal point stays.
fn named_file(name: &str, extension: &str) -> PathBuf {
    let letters: Vec<char> = name.chars().collect();
    let is_digit =
        |at: Option<usize>| at.and_then(|at| letters.get(at)).is_some_and(char::is_ascii_digit);
    let is_kept = |at: usize, c: char| {
        let is_point = c == '.' && is_digit(at.checked_sub(1)) && is_digit(Some(at + 1));
        c.is_alphanumeric() || matches!(c, ' ' | '-' | '_') || is_point
    };
    let kept = letters.iter().enumerate().map(|(at, c)| if is_kept(at, *c) { *c } else { ' ' });
    let name: String = kept.collect();
    let name = name.split_whitespace().take(NAME_WORDS).collect::<Vec<_>>().join(" ");
    let name = if name.is_empty() { "lens" } else { &name };
    PathBuf::from(format!("{name}.{extension}"))
}

/// The file of the gradient-index field that is open.
fn open_field_path(view: &SessionView) -> Option<&Path> {
    match &view.grin.run.snapshot.as_ref()?.document.source {
        DocumentSource::File(path) => Some(path),
        DocumentSource::Builtin(_) => None,
    }
}

fn bar_frame(ui: &mut Ui, side: Side, show: impl FnOnce(&mut Ui)) {
    let frame = Frame::new().fill(ui.visuals().panel_fill).inner_margin(Margin::symmetric(6, 3));
    side.frame(frame).show_separator_line(false).show(ui, show);
}

/// The line at the bottom: the last message, and the time of the analysis. A message that is clicked is
/// shown whole.
fn status_bar(ui: &mut Ui, view: &SessionView, shown: &mut Option<String>, actions: &mut Actions) {
    let size = vec2(ui.available_width(), ui.spacing().interact_size.y);
    // A long message ends where the texts at the right begin.
    ui.allocate_ui_with_layout(size, Layout::right_to_left(Align::Center), |ui| {
        ui.weak(timing_text(view))
            .on_hover_text("Time to compute all numbers of all panels after the last edit");
        if view.dirty {
            ui.separator();
            ui.weak("unsaved changes");
        }
        let left = Layout::left_to_right(Align::Center);
        ui.with_layout(left, |ui| messages(ui, view, shown, actions));
    });
}

/// The last message until something else is done, and a menu of all messages.
fn messages(ui: &mut Ui, view: &SessionView, shown: &mut Option<String>, actions: &mut Actions) {
    let messages = &view.messages;
    let Some(last) = messages.last() else {
        ui.weak("Ready");
        return;
    };
    ui.menu_button(format!("Messages ({})", messages.len()), |ui| {
        ui.set_min_width(420.0);
        ScrollArea::vertical().max_height(300.0).show(ui, |ui| {
            let clicked =
                messages.iter().rev().filter(|message| message_label(ui, message).clicked());
            if let Some(message) = clicked.last() {
                *shown = Some(message.text.clone());
                ui.close();
            }
        });
        if ui.button("Clear").clicked() {
            actions.push(Command::ClearMessages);
            ui.close();
        }
    });
    // An old message would contradict what was done since.
    if view.message_is_recent && message_label(ui, last).clicked() {
        *shown = Some(last.text.clone());
    }
}

fn message_label(ui: &mut Ui, message: &Message) -> Response {
    let visuals = ui.visuals();
    let color = match message.severity {
        Severity::Note => visuals.text_color(),
        Severity::Warning => visuals.warn_fg_color,
        Severity::Error => visuals.error_fg_color,
    };
    let line = message.text.lines().next().unwrap_or_default();
    let text = RichText::new(capitalize(line)).color(color);
    let label = Label::new(text).truncate().sense(Sense::click());
    ui.add(label).on_hover_text(capitalize(&message.text))
}

fn timing_text(view: &SessionView) -> String {
    let Some(results) = view.results.as_ref().filter(|_| view.is_current()) else {
        return "computing…".to_owned();
    };
    let found = results.analyses.as_ref().ok();
    match found.and_then(|found| pending_numbers(&view.settings, found)) {
        Some(name) => format!("computing the {name}…"),
        None => format!("all numbers in {:.1} ms", results.ms),
    }
}

/// The numbers that a visible panel waits for after the others are there.
fn pending_numbers(settings: &AnalysisSettings, found: &Analyses) -> Option<&'static str> {
    let shows_curves = settings.field_curves && settings.field_page == FieldPage::Curves;
    let waits = [
        (settings.shows_contrast(ContrastPage::Frequency) && found.contrasts.is_none(), "MTF"),
        (
            settings.shows_contrast(ContrastPage::Field) && found.field_contrast.is_none(),
            "MTF over the field",
        ),
        (
            settings.shows_contrast(ContrastPage::Focus) && found.focus_contrasts.is_none(),
            "MTF through focus",
        ),
        (settings.wavefronts && found.wavefronts.is_none(), "wavefronts"),
        (
            settings.wavefronts && settings.point_images && found.point_images.is_none(),
            "images of a point",
        ),
        (
            settings.wavefronts && settings.ray_images && found.ray_images.is_none(),
            "images of a point by rays",
        ),
        (shows_curves && found.field_curves.is_none(), "field curves"),
        (settings.spot_map && found.spot_map.is_none(), "spot over the field"),
        (settings.ghosts && found.ghosts.is_none(), "ghosts"),
        (settings.tolerances && found.as_built.is_none(), "tolerances"),
        (settings.picture && found.picture.is_none(), "picture"),
    ];
    waits.into_iter().find_map(|(waits, name)| waits.then_some(name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::analyze;

    #[test]
    fn numbers_that_a_visible_panel_waits_for_are_named() {
        let bundled = &files::bundled_lenses()[0];
        let lens = files::parse(bundled.text.as_bytes(), bundled.name).unwrap().lens;
        let settings = AnalysisSettings::default();
        let found = analyze(&lens, &settings).unwrap();
        assert_eq!(pending_numbers(&settings, &found), None);
        let shown = AnalysisSettings { ghosts: true, ..settings };
        assert_eq!(pending_numbers(&shown, &found), Some("ghosts"));
    }

    #[test]
    fn a_lens_without_a_file_proposes_its_name() {
        for (name, file) in [
            ("Double Gauss: 50/2", "Double Gauss 50 2.json"),
            ("  ..  ", "lens.json"),
            ("New lens, 35 mm f/2.8", "New lens 35 mm f 2.8.json"),
            ("a b c d e f g h", "a b c d e f.json"),
        ] {
            assert_eq!(named_file(name, "json"), PathBuf::from(file));
        }
    }
}
