//! The menu bar and its keys.

use eframe::egui::{
    Align, Button, Key, KeyboardShortcut, Layout, MenuBar, Modifiers, Theme, Ui, ViewportCommand,
};

use super::chooser::Purpose;
use super::dock::Dock;
use super::experiment;
use super::panels::Kind;
use super::wording::counted_from_one;
use crate::files::{self, Bundled};
use crate::session::{Command, View, blank};

/// What the menu asks for.
#[derive(Debug)]
pub(super) enum Wish {
    /// A change of the design.
    Do(Command),
    /// A lens that comes with the program.
    Bundled(&'static Bundled),
    /// A file has to be chosen first.
    Choose(Purpose),
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
pub(super) fn keys(ui: &Ui, view: &View, typing: bool) -> Vec<Wish> {
    let pressed = |key: &KeyboardShortcut| ui.input_mut(|input| input.consume_shortcut(key));
    let mut wishes = Vec::new();
    // A shortcut with Shift also contains the one without: the longer ones are asked first.
    if pressed(&SAVE_AS) {
        wishes.push(Wish::Choose(Purpose::Save));
    }
    if pressed(&SAVE) {
        wishes.push(save(view));
    }
    if pressed(&OPEN) {
        wishes.push(Wish::Choose(Purpose::Open));
    }
    if pressed(&EXPORT) {
        wishes.push(Wish::Choose(Purpose::ExportZemax));
    }
    if pressed(&NEW) {
        wishes.push(new());
    }
    if !typing && (pressed(&REDO) || pressed(&REDO_TOO)) {
        wishes.push(Wish::Do(Command::Redo));
    }
    if !typing && pressed(&UNDO) {
        wishes.push(Wish::Do(Command::Undo));
    }
    wishes
}

fn new() -> Wish {
    Wish::Do(Command::New(Box::new(blank())))
}

fn save(view: &View) -> Wish {
    if view.path.is_some() { Wish::Do(Command::Save(None)) } else { Wish::Choose(Purpose::Save) }
}

/// Shows the menu bar.
pub(super) fn bar(ui: &mut Ui, view: &View, dock: &mut Dock, wishes: &mut Vec<Wish>) {
    MenuBar::new().ui(ui, |ui| {
        ui.menu_button("File", |ui| file(ui, view, wishes));
        ui.menu_button("Edit", |ui| edit(ui, view, wishes));
        ui.menu_button("View", |ui| panels(ui, dock));
        ui.menu_button("Experiments", |ui| experiment::menu(ui, wishes));
        ui.separator();
        history_buttons(ui, view, wishes);
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

fn file(ui: &mut Ui, view: &View, wishes: &mut Vec<Wish>) {
    ui.set_min_width(210.0);
    if item(ui, "New", Some(&NEW)) {
        wishes.push(new());
    }
    if item(ui, "Open or import…", Some(&OPEN)) {
        wishes.push(Wish::Choose(Purpose::Open));
    }
    ui.menu_button("Bundled lenses", |ui| {
        for bundled in files::library() {
            if item(ui, bundled.title, None) {
                wishes.push(Wish::Bundled(bundled));
            }
        }
    });
    ui.separator();
    if item(ui, "Save", Some(&SAVE)) {
        wishes.push(save(view));
    }
    if item(ui, "Save as…", Some(&SAVE_AS)) {
        wishes.push(Wish::Choose(Purpose::Save));
    }
    if item(ui, "Export for Zemax…", Some(&EXPORT)) {
        wishes.push(Wish::Choose(Purpose::ExportZemax));
    }
    if item(ui, "Export a copy as JSON…", None) {
        wishes.push(Wish::Choose(Purpose::ExportJson));
    }
    ui.add_enabled_ui(view.fronts.run.is_some(), |ui| {
        if item(ui, "Export the front…", None) {
            wishes.push(Wish::Do(Command::ExportFront(None)));
        }
    });
    ui.separator();
    if item(ui, "Quit", None) {
        ui.ctx().send_viewport_cmd(ViewportCommand::Close);
    }
}

fn edit(ui: &mut Ui, view: &View, wishes: &mut Vec<Wish>) {
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
                wishes.push(Wish::Do(command));
            }
        });
    }
}

fn panels(ui: &mut Ui, dock: &mut Dock) {
    for kind in Kind::ALL {
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

fn history_buttons(ui: &mut Ui, view: &View, wishes: &mut Vec<Wish>) {
    let steps = [("Undo", &view.undo, Command::Undo), ("Redo", &view.redo, Command::Redo)];
    for (name, title, command) in steps {
        let button = ui.add_enabled(title.is_some(), Button::new(name));
        let hint = title.as_ref().map_or_else(
            || name.to_owned(),
            |title| format!("{name}: {}", counted_from_one(title)),
        );
        if button.on_hover_text(hint).clicked() {
            wishes.push(Wish::Do(command));
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
