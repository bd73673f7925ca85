//! The menu bar and its keys.

use eframe::egui::{
    Align, Button, Key, KeyboardShortcut, Layout, MenuBar, Modifiers, Theme, Ui, ViewportCommand,
};

use super::chooser::FileRequest;
use super::dock::Dock;
use super::experiment;
use super::panels::PanelKind;
use super::wording::counted_from_one;
use crate::files::{self, BundledLens};
use crate::lens::blank;
use crate::session::{Command, SessionView};

/// What the menu asks for.
#[derive(Debug)]
pub(super) enum UiAction {
    /// A change of the design.
    Run(Command),
    /// A lens that comes with the program.
    Bundled(&'static BundledLens),
    /// A file has to be chosen first.
    AskPath(FileRequest),
}

const fn control(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::COMMAND, key)
}

const fn control_shift(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::COMMAND.plus(Modifiers::SHIFT), key)
}

const NEW: KeyboardShortcut = control(Key::N);
const OPEN: KeyboardShortcut = control(Key::O);
const SAVE: KeyboardShortcut = control(Key::S);
const SAVE_AS: KeyboardShortcut = control_shift(Key::S);
const EXPORT: KeyboardShortcut = control(Key::E);
const UNDO: KeyboardShortcut = control(Key::Z);
const REDO: KeyboardShortcut = control_shift(Key::Z);
const REDO_TOO: KeyboardShortcut = control(Key::Y);

/// What the keys ask for. Undo and redo are left to a field while something is typed into it.
pub(super) fn shortcut_actions(ui: &Ui, view: &SessionView, typing: bool) -> Vec<UiAction> {
    let pressed = |key: &KeyboardShortcut| ui.input_mut(|input| input.consume_shortcut(key));
    let mut wishes = Vec::new();
    // A shortcut with Shift also contains the one without: the longer ones are asked first.
    if pressed(&SAVE_AS) {
        wishes.push(UiAction::AskPath(FileRequest::Save));
    }
    if pressed(&SAVE) {
        wishes.push(save_action(view));
    }
    if pressed(&OPEN) {
        wishes.push(UiAction::AskPath(FileRequest::Open));
    }
    if pressed(&EXPORT) {
        wishes.push(UiAction::AskPath(FileRequest::ExportZemax));
    }
    if pressed(&NEW) {
        wishes.push(new_lens_action());
    }
    if !typing && (pressed(&REDO) || pressed(&REDO_TOO)) {
        wishes.push(UiAction::Run(Command::Redo));
    }
    if !typing && pressed(&UNDO) {
        wishes.push(UiAction::Run(Command::Undo));
    }
    wishes
}

fn new_lens_action() -> UiAction {
    UiAction::Run(Command::New(Box::new(blank())))
}

fn save_action(view: &SessionView) -> UiAction {
    if view.path.is_some() {
        UiAction::Run(Command::Save(None))
    } else {
        UiAction::AskPath(FileRequest::Save)
    }
}

/// Shows the menu bar.
pub(super) fn bar(ui: &mut Ui, view: &SessionView, dock: &mut Dock, wishes: &mut Vec<UiAction>) {
    MenuBar::new().ui(ui, |ui| {
        ui.menu_button("File", |ui| file_menu(ui, view, wishes));
        ui.menu_button("Edit", |ui| edit_menu(ui, view, wishes));
        ui.menu_button("View", |ui| view_menu(ui, dock));
        ui.menu_button("Experiments", |ui| experiment::menu(ui, wishes));
        ui.separator();
        undo_buttons(ui, view, wishes);
        ui.with_layout(Layout::right_to_left(Align::Center), theme_button);
    });
}

fn item(ui: &mut Ui, text: &str, key: Option<&KeyboardShortcut>) -> bool {
    let mut button = Button::new(text);
    if let Some(key) = key {
        button = button.shortcut_text(ui.ctx().format_shortcut(key));
    }
    let clicked = ui.add(button).clicked();
    if clicked {
        ui.close();
    }
    clicked
}

fn file_menu(ui: &mut Ui, view: &SessionView, wishes: &mut Vec<UiAction>) {
    ui.set_min_width(210.0);
    if item(ui, "New", Some(&NEW)) {
        wishes.push(new_lens_action());
    }
    if item(ui, "Open or import…", Some(&OPEN)) {
        wishes.push(UiAction::AskPath(FileRequest::Open));
    }
    ui.menu_button("Bundled lenses", |ui| {
        for bundled in files::bundled_lenses() {
            if item(ui, bundled.title, None) {
                wishes.push(UiAction::Bundled(bundled));
            }
        }
    });
    ui.separator();
    if item(ui, "Save", Some(&SAVE)) {
        wishes.push(save_action(view));
    }
    if item(ui, "Save as…", Some(&SAVE_AS)) {
        wishes.push(UiAction::AskPath(FileRequest::Save));
    }
    if item(ui, "Export for Zemax…", Some(&EXPORT)) {
        wishes.push(UiAction::AskPath(FileRequest::ExportZemax));
    }
    if item(ui, "Export a copy as JSON…", None) {
        wishes.push(UiAction::AskPath(FileRequest::ExportJson));
    }
    ui.add_enabled_ui(view.pareto.run.is_some(), |ui| {
        if item(ui, "Export the front…", None) {
            wishes.push(UiAction::Run(Command::ExportPareto(None)));
        }
    });
    ui.separator();
    if item(ui, "Quit", None) {
        ui.ctx().send_viewport_cmd(ViewportCommand::Close);
    }
}

fn edit_menu(ui: &mut Ui, view: &SessionView, wishes: &mut Vec<UiAction>) {
    ui.set_min_width(260.0);
    let steps =
        [("Undo", &view.undo, UNDO, Command::Undo), ("Redo", &view.redo, REDO, Command::Redo)];
    for (name, title, key, command) in steps {
        let text = title.as_ref().map_or_else(
            || name.to_owned(),
            |title| format!("{name}: {}", counted_from_one(title)),
        );
        ui.add_enabled_ui(title.is_some(), |ui| {
            if item(ui, &text, Some(&key)) {
                wishes.push(UiAction::Run(command));
            }
        });
    }
}

fn view_menu(ui: &mut Ui, dock: &mut Dock) {
    for kind in PanelKind::ALL {
        let mut open = dock.is_open(kind);
        if ui.checkbox(&mut open, dock.title(kind)).clicked() {
            dock.toggle(kind);
        }
    }
    ui.separator();
    if item(ui, "Usual arrangement", None) {
        dock.reset();
    }
    ui.separator();
    let theme = ui.ctx().theme();
    for (other, name) in [(Theme::Dark, "Dark theme"), (Theme::Light, "Light theme")] {
        if ui.radio(theme == other, name).clicked() {
            ui.ctx().set_theme(other);
            ui.close();
        }
    }
}

fn undo_buttons(ui: &mut Ui, view: &SessionView, wishes: &mut Vec<UiAction>) {
    let steps = [("Undo", &view.undo, Command::Undo), ("Redo", &view.redo, Command::Redo)];
    for (name, title, command) in steps {
        let button = ui.add_enabled(title.is_some(), Button::new(name));
        let hint = title.as_ref().map_or_else(
            || name.to_owned(),
            |title| format!("{name}: {}", counted_from_one(title)),
        );
        if button.on_hover_text(hint).clicked() {
            wishes.push(UiAction::Run(command));
        }
    }
}

fn theme_button(ui: &mut Ui) {
    let dark = ui.visuals().dark_mode;
    let (sign, other) = if dark { ("Light", Theme::Light) } else { ("Dark", Theme::Dark) };
    let button = ui.button(sign).accessible_name("Switch between dark and light");
    if button.on_hover_text("Switch between dark and light").clicked() {
        ui.ctx().set_theme(other);
    }
}
