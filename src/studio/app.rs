//! The studio: one session, the panels that show it, the menu, and the questions before something
//! would be lost.

use std::path::{Path, PathBuf};

use eframe::egui::{
    Align, CentralPanel, Context, Frame, Id, Label, Layout, Margin, Modal, Panel as Side, Response,
    RichText, ScrollArea, Ui, ViewportCommand,
};
use eframe::{App, Storage};

use super::chooser::{Chooser, Purpose};
use super::dock::Dock;
use super::draw::Backing;
use super::experiment::Bench;
use super::menu::{self, Wish};
use super::shell::Memory;
use super::unsaved::{Then, Waiting};
use super::wording::{capital, counted_from_one};
use crate::files;
use crate::session::{Command, Event, Explore, Form, Message, Origin, Session, Severity, View};

/// Under which name the arrangement of the panels is remembered.
const DOCK: &str = "dock";

/// All of the window.
#[derive(Debug)]
pub struct Studio {
    pub(super) session: Session,
    dock: Dock,
    pub(super) chooser: Chooser,
    bench: Bench,
    memory: Memory,
    /// What waits for the answer to whether changes may be lost.
    pub(super) waiting: Option<Waiting>,
    /// A message too long for the line at the bottom.
    report: Option<String>,
    title: String,
    /// The window closes although changes are lost.
    pub(super) leaving: bool,
}

impl Studio {
    /// A studio on a session. `left` is where the last window has left the panels.
    pub fn new(
        session: Session,
        backing: Backing,
        memory: Memory,
        left: Option<&dyn Storage>,
    ) -> Self {
        let tree = left.and_then(|storage| eframe::get_value(storage, DOCK));
        Self {
            session,
            dock: Dock::new(backing, tree),
            chooser: Chooser::default(),
            bench: Bench::default(),
            memory,
            waiting: None,
            report: None,
            title: String::new(),
            leaving: false,
        }
    }

    /// What the studio works on.
    pub const fn session(&self) -> &Session {
        &self.session
    }

    /// Lets the window close although changes are lost.
    pub const fn leave_without_asking(&mut self) {
        self.leaving = true;
    }

    /// The same, to be told commands directly.
    pub const fn session_mut(&mut self) -> &mut Session {
        &mut self.session
    }

    /// Does what a command says, as a panel would ask for it.
    pub fn apply(&mut self, context: &Context, command: Command) {
        let events = self.session.apply(command);
        self.hear(events);
        context.request_repaint();
    }

    /// Shows the whole window and does what is wished in it.
    pub fn ui(&mut self, ui: &mut Ui) {
        let events = self.session.poll();
        self.hear(events);
        let view = self.session.view();
        self.name_window(ui.ctx(), &view);
        let mut wishes = menu::keys(ui, &view, self.dock.is_typing(ui.ctx()));
        bar_frame(ui, Side::top("menu"), |ui| menu::bar(ui, &view, &mut self.dock, &mut wishes));
        bar_frame(ui, Side::bottom("status"), |ui| Self::status(ui, &view, &mut wishes));
        let mut commands = Vec::new();
        CentralPanel::no_frame().show(ui, |ui| self.dock.ui(ui, &view, &mut commands));
        wishes.extend(commands.into_iter().map(Wish::Do));
        let context = ui.ctx().clone();
        self.bench.ui(&context, view.trial.as_deref(), &mut wishes);
        self.dialogs(&context, &view);
        for wish in wishes {
            self.fulfil(&context, &view, wish);
        }
    }

    fn fulfil(&mut self, context: &Context, view: &View, wish: Wish) {
        match wish {
            Wish::Do(Command::ExportFront(None)) => {
                let folder = view.path.as_deref().map(|path| path.with_file_name("front"));
                let folder = folder.unwrap_or_else(|| PathBuf::from("front"));
                self.chooser.ask(context, Purpose::ExportFront, Some(&folder));
            }
            Wish::Do(Command::Explore(wish)) => self.explore(context, view, wish),
            Wish::Do(Command::Form(Form::Open(None))) => {
                self.chooser.ask(context, Purpose::OpenField, opened(view));
            }
            Wish::Do(Command::Form(Form::Save { path: None, nodes })) => {
                self.choose_field(context, view, nodes);
            }
            Wish::Choose(purpose) => self.chooser.ask(context, purpose, view.path.as_deref()),
            Wish::Bundled(bundled) => match files::parse(bundled.text.as_bytes(), bundled.name) {
                Ok(opened) => {
                    let command = Command::New(Box::new(opened.lens));
                    self.attempt(context, Then::Do(command), None);
                }
                Err(why) => self.report = Some(why.to_string()),
            },
            Wish::Do(command) => self.attempt(context, Then::Do(command), None),
        }
    }

    /// Asks for the file of the field.
    pub(super) fn choose_field(&mut self, context: &Context, view: &View, nodes: usize) {
        let field = opened(view).map(|path| path.with_extension("npz"));
        let field = field.unwrap_or_else(|| PathBuf::from("field.npz"));
        self.chooser.ask(context, Purpose::SaveField(nodes), Some(&field));
    }

    /// Does what is asked of a search, a file being chosen first where one is needed.
    fn explore(&mut self, context: &Context, view: &View, wish: Explore) {
        let known = &view.explorations;
        let saved = known.run.as_ref().and_then(|run| run.checkpoint.path.as_deref());
        match wish {
            Explore::GoOn(None) => {
                let near = saved.or(known.left.as_deref());
                self.chooser.ask(context, Purpose::OpenSearch, near);
            }
            Explore::SaveTo(None) => {
                let near = saved.or(known.place.as_deref());
                self.chooser.ask(context, Purpose::SaveSearch, near);
            }
            Explore::Export { number, path: None } => {
                let near = view.path.as_deref();
                self.chooser.ask(context, Purpose::ExportFound(number), near);
            }
            wish => self.apply(context, Command::Explore(wish)),
        }
    }

    fn dialogs(&mut self, context: &Context, view: &View) {
        if let Some((purpose, path)) = self.chooser.ui(context) {
            self.chosen(context, purpose, path);
        }
        let closing = context.input(|input| input.viewport().close_requested());
        if closing && !self.leaving && self.loses(&Then::Quit) {
            context.send_viewport_cmd(ViewportCommand::CancelClose);
            self.attempt(context, Then::Quit, None);
        }
        self.question(context, view);
        self.show_report(context);
    }

    fn chosen(&mut self, context: &Context, purpose: Purpose, path: PathBuf) {
        match purpose {
            Purpose::Open => self.attempt(context, Then::Do(Command::Open(path)), None),
            Purpose::ExperimentFolder => self.apply(context, Command::SaveExperiment(path)),
            Purpose::Save => self.apply(context, Command::Save(Some(path))),
            Purpose::ExportFront => self.apply(context, Command::ExportFront(Some(path))),
            Purpose::OpenSearch => {
                self.apply(context, Command::Explore(Explore::GoOn(Some(path))));
            }
            Purpose::SaveSearch => {
                self.apply(context, Command::Explore(Explore::SaveTo(Some(path))));
            }
            Purpose::ExportFound(number) => {
                let path = Some(path);
                self.apply(context, Command::Explore(Explore::Export { number, path }));
            }
            Purpose::OpenField => {
                let command = Command::Form(Form::Open(Some(path)));
                self.attempt(context, Then::Do(command), None);
            }
            Purpose::SaveField(nodes) => {
                let path = Some(path);
                self.apply(context, Command::Form(Form::Save { path, nodes }));
            }
            Purpose::ExportZemax | Purpose::ExportJson => {
                self.apply(context, Command::Export(path));
            }
        }
    }

    /// Notes what is too much for the line at the bottom.
    fn hear(&mut self, events: Vec<Event>) {
        for event in events {
            if let Event::Said(message) = event
                && (message.text.lines().count() > 1 || message.severity == Severity::Error)
            {
                self.report = Some(message.text);
            }
        }
    }

    /// Shows a report or an error until it is closed.
    fn show_report(&mut self, context: &Context) {
        let Some(text) = &self.report else { return };
        let mut read = false;
        let modal = Modal::new(Id::unique("report")).show(context, |ui| {
            let (words, table) = text.split_once('\n').unwrap_or((text, ""));
            ui.set_max_width(if table.is_empty() { 460.0 } else { 820.0 });
            ui.label(capital(&counted_from_one(words)));
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
            self.report = None;
        }
    }

    fn name_window(&mut self, context: &Context, view: &View) {
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
    fn status(ui: &mut Ui, view: &View, wishes: &mut Vec<Wish>) {
        ui.horizontal(|ui| {
            messages(ui, &view.messages, wishes);
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                ui.weak(freshness(view))
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
        if self.memory == Memory::Kept {
            eframe::set_value(storage, DOCK, self.dock.tree());
        }
    }

    fn persist_egui_memory(&self) -> bool {
        self.memory == Memory::Kept
    }
}

/// The file of the gradient-index field that is open.
fn opened(view: &View) -> Option<&Path> {
    match &view.forming.run.as_ref()?.subject.origin {
        Origin::File(path) => Some(path),
        Origin::Builtin(_) => None,
    }
}

fn bar_frame(ui: &mut Ui, side: Side, show: impl FnOnce(&mut Ui)) {
    let frame = Frame::new().fill(ui.visuals().panel_fill).inner_margin(Margin::symmetric(6, 3));
    side.frame(frame).show_separator_line(false).show(ui, show);
}

/// The last message, and a button for those before it.
fn messages(ui: &mut Ui, messages: &[Message], wishes: &mut Vec<Wish>) {
    let Some(last) = messages.last() else {
        ui.weak("Ready");
        return;
    };
    ui.menu_button(format!("Messages ({})", messages.len()), |ui| {
        ui.set_min_width(420.0);
        ScrollArea::vertical().max_height(300.0).show(ui, |ui| {
            messages.iter().rev().for_each(|message| drop(said(ui, message)));
        });
        if ui.button("Forget all").clicked() {
            wishes.push(Wish::Do(Command::ClearMessages));
            ui.close();
        }
    });
    said(ui, last);
}

fn said(ui: &mut Ui, message: &Message) -> Response {
    let visuals = ui.visuals();
    let color = match message.severity {
        Severity::Note => visuals.text_color(),
        Severity::Warning => visuals.warn_fg_color,
        Severity::Error => visuals.error_fg_color,
    };
    let line = message.text.lines().next().unwrap_or_default();
    let text = RichText::new(capital(&counted_from_one(line))).color(color);
    ui.add(Label::new(text).truncate()).on_hover_text(capital(&counted_from_one(&message.text)))
}

fn freshness(view: &View) -> String {
    match &view.results {
        Some(results) if view.is_current() => format!("all numbers in {:.1} ms", results.ms),
        _ => "computing…".to_owned(),
    }
}
