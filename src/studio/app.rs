//! The studio: one session, the panels that show it, the menu, and the questions before something
//! would be lost.

use std::path::{Path, PathBuf};

use eframe::egui::{
    Align, CentralPanel, Context, Frame, Id, Label, Layout, Margin, Modal, Panel as Side, Response,
    RichText, ScrollArea, Ui, ViewportCommand,
};
use eframe::{App, Storage};

use super::chooser::{FileDialog, FileRequest};
use super::dock::Dock;
use super::draw::RenderBackend;
use super::experiment::ExperimentWindow;
use super::menu::{self, UiAction};
use super::shell::Persistence;
use super::unsaved::{PendingAction, PendingState};
use super::wording::{capitalize, counted_from_one};
use crate::files;
use crate::session::{
    Command, DocumentSource, GrinCommand, Message, Session, SessionEvent, SessionView, Severity,
    StructureSearchCommand,
};

/// Under which name the arrangement of the panels is remembered.
const DOCK: &str = "dock";

/// All of the window.
#[derive(Debug)]
pub struct Studio {
    pub(super) session: Session,
    dock: Dock,
    pub(super) file_dialog: FileDialog,
    experiment_window: ExperimentWindow,
    persistence: Persistence,
    /// What waits for the answer to whether changes may be lost.
    pub(super) pending: Option<PendingState>,
    /// A message too long for the line at the bottom.
    message: Option<String>,
    title: String,
    /// The window closes although changes are lost.
    pub(super) closing: bool,
}

impl Studio {
    /// A studio on a session. `unfinished` is where the last window has left the panels.
    pub fn new(
        session: Session,
        backing: RenderBackend,
        memory: Persistence,
        left: Option<&dyn Storage>,
    ) -> Self {
        let tree = left.and_then(|storage| eframe::get_value(storage, DOCK));
        Self {
            session,
            dock: Dock::new(backing, tree),
            file_dialog: FileDialog::default(),
            experiment_window: ExperimentWindow::default(),
            persistence: memory,
            pending: None,
            message: None,
            title: String::new(),
            closing: false,
        }
    }

    /// What the studio works on.
    pub const fn session(&self) -> &Session {
        &self.session
    }

    /// Lets the window close although changes are lost.
    pub const fn close_without_asking(&mut self) {
        self.closing = true;
    }

    /// The same, to be told commands directly.
    pub const fn session_mut(&mut self) -> &mut Session {
        &mut self.session
    }

    /// Does what a command says, as a panel would ask for it.
    pub fn apply(&mut self, context: &Context, command: Command) {
        let events = self.session.apply(command);
        self.on_events(events);
        context.request_repaint();
    }

    /// Shows the whole window and does what is wished in it.
    pub fn ui(&mut self, ui: &mut Ui) {
        let events = self.session.poll();
        self.on_events(events);
        let view = self.session.view();
        self.update_title(ui.ctx(), &view);
        let mut wishes = menu::shortcut_actions(ui, &view, self.dock.is_typing(ui.ctx()));
        bar_frame(ui, Side::top("menu"), |ui| menu::bar(ui, &view, &mut self.dock, &mut wishes));
        bar_frame(ui, Side::bottom("status"), |ui| Self::status_bar(ui, &view, &mut wishes));
        let mut commands = Vec::new();
        CentralPanel::no_frame().show(ui, |ui| self.dock.ui(ui, &view, &mut commands));
        wishes.extend(commands.into_iter().map(UiAction::Run));
        let context = ui.ctx().clone();
        self.experiment_window.ui(&context, view.experiment.as_deref(), &mut wishes);
        self.dialogs(&context, &view);
        for wish in wishes {
            self.dispatch(&context, &view, wish);
        }
    }

    fn dispatch(&mut self, context: &Context, view: &SessionView, wish: UiAction) {
        match wish {
            UiAction::Run(Command::ExportPareto(None)) => {
                let folder = view.path.as_deref().map(|path| path.with_file_name("front"));
                let folder = folder.unwrap_or_else(|| PathBuf::from("front"));
                self.file_dialog.ask(context, FileRequest::ExportFront, Some(&folder));
            }
            UiAction::Run(Command::StructureSearch(wish)) => {
                self.dispatch_search(context, view, wish)
            }
            UiAction::Run(Command::Grin(GrinCommand::OpenFile(None))) => {
                self.file_dialog.ask(context, FileRequest::OpenField, open_field_path(view));
            }
            UiAction::Run(Command::Grin(GrinCommand::Save { path: None, nodes })) => {
                self.ask_field_path(context, view, nodes);
            }
            UiAction::AskPath(purpose) => {
                self.file_dialog.ask(context, purpose, view.path.as_deref())
            }
            UiAction::Bundled(bundled) => match files::parse(bundled.text.as_bytes(), bundled.name)
            {
                Ok(opened) => {
                    let command = Command::New(Box::new(opened.lens));
                    self.run_or_ask(context, PendingAction::Run(command), None);
                }
                Err(why) => self.message = Some(why.to_string()),
            },
            UiAction::Run(command) => self.run_or_ask(context, PendingAction::Run(command), None),
        }
    }

    /// Asks for the file of the field.
    pub(super) fn ask_field_path(&mut self, context: &Context, view: &SessionView, nodes: usize) {
        let field = open_field_path(view).map(|path| path.with_extension("npz"));
        let field = field.unwrap_or_else(|| PathBuf::from("field.npz"));
        self.file_dialog.ask(context, FileRequest::SaveField(nodes), Some(&field));
    }

    /// Does what is asked of a search, a file being chosen first where one is needed.
    fn dispatch_search(
        &mut self,
        context: &Context,
        view: &SessionView,
        wish: StructureSearchCommand,
    ) {
        let known = &view.structure_search;
        let saved = known.run.as_ref().and_then(|run| run.checkpoint.path.as_deref());
        match wish {
            StructureSearchCommand::ResumeFrom(None) => {
                let near = saved.or(known.unfinished.as_deref());
                self.file_dialog.ask(context, FileRequest::OpenSearch, near);
            }
            StructureSearchCommand::SaveTo(None) => {
                let near = saved.or(known.save_path.as_deref());
                self.file_dialog.ask(context, FileRequest::SaveSearch, near);
            }
            StructureSearchCommand::Export { number, path: None } => {
                let near = view.path.as_deref();
                self.file_dialog.ask(context, FileRequest::ExportSearchLens(number), near);
            }
            wish => self.apply(context, Command::StructureSearch(wish)),
        }
    }

    fn dialogs(&mut self, context: &Context, view: &SessionView) {
        if let Some((purpose, path)) = self.file_dialog.ui(context) {
            self.on_path_chosen(context, purpose, path);
        }
        let closing = context.input(|input| input.viewport().close_requested());
        if closing && !self.closing && self.would_discard(&PendingAction::Quit) {
            context.send_viewport_cmd(ViewportCommand::CancelClose);
            self.run_or_ask(context, PendingAction::Quit, None);
        }
        self.unsaved_dialog(context, view);
        self.show_message(context);
    }

    fn on_path_chosen(&mut self, context: &Context, purpose: FileRequest, path: PathBuf) {
        match purpose {
            FileRequest::Open => {
                self.run_or_ask(context, PendingAction::Run(Command::Open(path)), None)
            }
            FileRequest::ExperimentFolder => self.apply(context, Command::SaveExperiment(path)),
            FileRequest::Save => self.apply(context, Command::Save(Some(path))),
            FileRequest::ExportFront => self.apply(context, Command::ExportPareto(Some(path))),
            FileRequest::OpenSearch => {
                self.apply(
                    context,
                    Command::StructureSearch(StructureSearchCommand::ResumeFrom(Some(path))),
                );
            }
            FileRequest::SaveSearch => {
                self.apply(
                    context,
                    Command::StructureSearch(StructureSearchCommand::SaveTo(Some(path))),
                );
            }
            FileRequest::ExportSearchLens(number) => {
                let path = Some(path);
                self.apply(
                    context,
                    Command::StructureSearch(StructureSearchCommand::Export { number, path }),
                );
            }
            FileRequest::OpenField => {
                let command = Command::Grin(GrinCommand::OpenFile(Some(path)));
                self.run_or_ask(context, PendingAction::Run(command), None);
            }
            FileRequest::SaveField(nodes) => {
                let path = Some(path);
                self.apply(context, Command::Grin(GrinCommand::Save { path, nodes }));
            }
            FileRequest::ExportZemax | FileRequest::ExportJson => {
                self.apply(context, Command::Export(path));
            }
        }
    }

    /// Notes what is too much for the line at the bottom.
    fn on_events(&mut self, events: Vec<SessionEvent>) {
        for event in events {
            if let SessionEvent::Said(message) = event
                && (message.text.lines().count() > 1 || message.severity == Severity::Error)
            {
                self.message = Some(message.text);
            }
        }
    }

    /// Shows a report or an error until it is closed.
    fn show_message(&mut self, context: &Context) {
        let Some(text) = &self.message else { return };
        let mut read = false;
        let modal = Modal::new(Id::unique("report")).show(context, |ui| {
            let (words, table) = text.split_once('\n').unwrap_or((text, ""));
            ui.set_max_width(if table.is_empty() { 460.0 } else { 820.0 });
            ui.label(capitalize(&counted_from_one(words)));
            if !table.is_empty() {
                ScrollArea::both().max_height(440.0).show(ui, |ui| {
                    let table = RichText::new(counted_from_one(table)).monospace();
                    ui.add(Label::new(table).extend().selectable(true));
                });
            }
            ui.add_space(8.0);
            read = ui.button("OK").clicked();
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

    /// The line at the bottom: the last message, and how old the numbers are.
    fn status_bar(ui: &mut Ui, view: &SessionView, wishes: &mut Vec<UiAction>) {
        ui.horizontal(|ui| {
            messages(ui, &view.messages, wishes);
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                ui.weak(timing_text(view))
                    .on_hover_text("How long all numbers of all panels took after the last change");
                if view.dirty {
                    ui.separator();
                    ui.weak("unsaved changes");
                }
            });
        });
    }
}

impl App for Studio {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        Self::ui(self, ui);
    }

    fn save(&mut self, storage: &mut dyn Storage) {
        if self.persistence == Persistence::Enabled {
            eframe::set_value(storage, DOCK, self.dock.tree());
        }
    }

    fn persist_egui_memory(&self) -> bool {
        self.persistence == Persistence::Enabled
    }
}

/// The file of the gradient-index field that is open.
fn open_field_path(view: &SessionView) -> Option<&Path> {
    match &view.grin.run.as_ref()?.document.source {
        DocumentSource::File(path) => Some(path),
        DocumentSource::Builtin(_) => None,
    }
}

fn bar_frame(ui: &mut Ui, side: Side, show: impl FnOnce(&mut Ui)) {
    let frame = Frame::new().fill(ui.visuals().panel_fill).inner_margin(Margin::symmetric(6, 3));
    side.frame(frame).show_separator_line(false).show(ui, show);
}

/// The last message, and a button for those before it.
fn messages(ui: &mut Ui, messages: &[Message], wishes: &mut Vec<UiAction>) {
    let Some(last) = messages.last() else {
        ui.weak("Ready");
        return;
    };
    ui.menu_button(format!("Messages ({})", messages.len()), |ui| {
        ui.set_min_width(420.0);
        ScrollArea::vertical().max_height(300.0).show(ui, |ui| {
            messages.iter().rev().for_each(|message| drop(message_label(ui, message)));
        });
        if ui.button("Forget all").clicked() {
            wishes.push(UiAction::Run(Command::ClearMessages));
            ui.close();
        }
    });
    message_label(ui, last);
}

fn message_label(ui: &mut Ui, message: &Message) -> Response {
    let visuals = ui.visuals();
    let color = match message.severity {
        Severity::Note => visuals.text_color(),
        Severity::Warning => visuals.warn_fg_color,
        Severity::Error => visuals.error_fg_color,
    };
    let line = message.text.lines().next().unwrap_or_default();
    let text = RichText::new(capitalize(&counted_from_one(line))).color(color);
    ui.add(Label::new(text).truncate()).on_hover_text(capitalize(&counted_from_one(&message.text)))
}

fn timing_text(view: &SessionView) -> String {
    match &view.results {
        Some(results) if view.is_current() => format!("all numbers in {:.1} ms", results.ms),
        _ => "computing…".to_owned(),
    }
}
