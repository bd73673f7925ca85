//! The menu bar and its keys.

use egui::{
    Align, Button, Key, KeyboardShortcut, Layout, MenuBar, Modifiers, Theme, Ui, ViewportCommand,
};

use super::actions::{Actions, UiAction};
use super::dock::Dock;
use super::experiment_window;
use super::file_dialog::FileRequest;
use super::panels::PanelKind;
use crate::files::{self};
use crate::lens::blank;
use crate::session::{Command, SessionView};

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

/// Collects what shortcuts ask for. Undo and redo are left to a text field that is being edited.
pub(super) fn shortcuts(ui: &Ui, view: &SessionView, typing: bool, actions: &mut Actions) {
    let pressed = |key: &KeyboardShortcut| ui.input_mut(|input| input.consume_shortcut(key));
    // A shortcut with Shift also contains the one without: the longer ones are asked first.
    if pressed(&SAVE_AS) {
        actions.push(FileRequest::Save);
    }
    if pressed(&SAVE) {
        actions.push(save_action(view));
    }
    if pressed(&OPEN) {
        actions.push(FileRequest::Open);
    }
    if pressed(&EXPORT) {
        actions.push(FileRequest::ExportZemax);
    }
    if pressed(&NEW) {
        actions.push(new_lens());
    }
    if !typing && (pressed(&REDO) || pressed(&REDO_TOO)) {
        actions.push(Command::Redo);
    }
    if !typing && pressed(&UNDO) {
        actions.push(Command::Undo);
    }
}

fn new_lens() -> Command {
    Command::New(Box::new(blank()))
}

fn save_action(view: &SessionView) -> UiAction {
    if view.path.is_some() { Command::Save(None).into() } else { FileRequest::Save.into() }
}

/// Shows the menu bar.
pub(super) fn bar(ui: &mut Ui, view: &SessionView, dock: &mut Dock, actions: &mut Actions) {
    MenuBar::new().ui(ui, |ui| {
        ui.menu_button("File", |ui| file_menu(ui, view, actions));
        ui.menu_button("Edit", |ui| edit_menu(ui, view, actions));
        ui.menu_button("View", |ui| view_menu(ui, dock));
        ui.menu_button("Experiments", |ui| experiment_window::menu(ui, actions));
        ui.separator();
        undo_buttons(ui, view, actions);
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

fn file_menu(ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
    ui.set_min_width(210.0);
    if item(ui, "New", Some(&NEW)) {
        actions.push(new_lens());
    }
    if item(ui, "Open or import…", Some(&OPEN)) {
        actions.push(FileRequest::Open);
    }
    ui.menu_button("Bundled lenses", |ui| {
        for bundled in files::bundled_lenses() {
            if item(ui, bundled.title, None) {
                actions.push(UiAction::OpenBundled(bundled));
            }
        }
    });
    ui.separator();
    if item(ui, "Save", Some(&SAVE)) {
        actions.push(save_action(view));
    }
    if item(ui, "Save as…", Some(&SAVE_AS)) {
        actions.push(FileRequest::Save);
    }
    if item(ui, "Export for Zemax…", Some(&EXPORT)) {
        actions.push(FileRequest::ExportZemax);
    }
    if item(ui, "Export a copy as JSON…", None) {
        actions.push(FileRequest::ExportJson);
    }
    ui.add_enabled_ui(view.pareto.run.snapshot.is_some(), |ui| {
        if item(ui, "Export the Pareto front…", None) {
            actions.push(FileRequest::ExportFront);
        }
    });
    ui.separator();
    if item(ui, "Quit", None) {
        ui.ctx().send_viewport_cmd(ViewportCommand::Close);
    }
}

fn edit_menu(ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
    ui.set_min_width(260.0);
    let steps =
        [("Undo", &view.undo, UNDO, Command::Undo), ("Redo", &view.redo, REDO, Command::Redo)];
    for (name, title, key, command) in steps {
        let text =
            title.as_ref().map_or_else(|| name.to_owned(), |title| format!("{name}: {title}"));
        ui.add_enabled_ui(title.is_some(), |ui| {
            if item(ui, &text, Some(&key)) {
                actions.push(command);
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
    if item(ui, "Default arrangement", None) {
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

fn undo_buttons(ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
    let steps = [("Undo", &view.undo, Command::Undo), ("Redo", &view.redo, Command::Redo)];
    for (name, title, command) in steps {
        let button = ui.add_enabled(title.is_some(), Button::new(name));
        let hint =
            title.as_ref().map_or_else(|| name.to_owned(), |title| format!("{name}: {title}"));
        if button.on_hover_text(hint).clicked() {
            actions.push(command);
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
