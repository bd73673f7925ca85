//! The menu bar and its keys.

use egui::{
    Align, Atom, Atoms, Button, Checkbox, Key, KeyboardShortcut, Layout, MenuBar, Modifiers,
    RichText, ScrollArea, Theme, Ui,
};

use super::actions::Actions;
use super::candidate_bar::candidate_bar;
use super::command_palette::shown_at_least;
use super::experiment_window;
use super::menu_items::{self, MenuContext, MenuItem};
use super::panels::widgets::{hint_beside, hint_right_of};
use super::run_items::disabled_reason;
use crate::session::{Command, SessionView};

/// Redo has a second shortcut, which other programs use.
const REDO_TOO: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::Y);
/// The widths in points of the menu of views, whose panels have two columns, and of its settings.
const VIEW_WIDTH: f32 = 420.0;
const SETTINGS_WIDTH: f32 = 260.0;

/// Collects what shortcuts ask for. Undo and redo are left to a text field that is being edited.
pub(super) fn shortcuts(ui: &Ui, menus: &MenuContext<'_>, typing: bool, actions: &mut Actions) {
    let pressed = |key: &KeyboardShortcut| ui.input_mut(|input| input.consume_shortcut(key));
    let mut items = menus.commands();
    // A shortcut with Shift also contains the one without: the longer ones are asked first.
    items.sort_by_key(|item| !item.shortcut.is_some_and(|key| key.modifiers.shift));
    let selected = |item: &MenuItem| !(typing && item.yields_to_text);
    for item in items.into_iter().filter(selected) {
        if item.shortcut.as_ref().is_some_and(pressed) {
            actions.extend(item.action.map(shown_at_least));
        }
    }
    if !typing && pressed(&REDO_TOO) {
        actions.push(Command::Redo);
    }
}

/// Shows the menu bar.
pub(super) fn bar(ui: &mut Ui, menus: &MenuContext<'_>, actions: &mut Actions) {
    MenuBar::new().ui(ui, |ui| {
        ui.menu_button("File", |ui| file_menu(ui, menus, actions));
        ui.menu_button("Edit", |ui| show_items(ui, 260.0, menus.edit(), actions));
        ui.menu_button("Element", |ui| show_items(ui, 300.0, menus.element(), actions));
        ui.menu_button("View", |ui| view_menu(ui, menus, actions));
        ui.menu_button("Help", |ui| help_menu(ui, actions));
        ui.separator();
        undo_buttons(ui, menus.view, actions);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            theme_button(ui);
            candidate_bar(ui, menus, actions);
        });
    });
}

/// Shows items of a menu one below the other.
pub(super) fn show_items(ui: &mut Ui, width: f32, items: Vec<MenuItem>, actions: &mut Actions) {
    ui.set_min_width(width);
    for item in items {
        show_item(ui, item, actions);
    }
}

fn show_item(ui: &mut Ui, item: MenuItem, actions: &mut Actions) {
    if item.separated {
        ui.separator();
    }
    let mut button = Button::new(&item.title).selected(item.checked == Some(true));
    if let Some(key) = &item.shortcut {
        button = button.shortcut_text(ui.ctx().format_shortcut(key));
    }
    let response = ui.add_enabled(item.is_enabled(), button);
    let response = if item.is_enabled() {
        if item.hint.is_empty() { response } else { hint_beside(response, item.hint) }
    } else {
        response.on_disabled_hover_text(disabled_reason(&item))
    };
    if response.clicked() {
        actions.extend(item.action);
        ui.close();
    }
}

fn file_menu(ui: &mut Ui, menus: &MenuContext<'_>, actions: &mut Actions) {
    ui.set_min_width(210.0);
    let mut items = menus.file().into_iter();
    for item in items.by_ref().take(3) {
        show_item(ui, item, actions);
    }
    ui.add_enabled_ui(!menus.recent.is_empty(), |ui| {
        ui.menu_button("Recent files", |ui| show_items(ui, 320.0, menus.recent(), actions));
    });
    ui.menu_button("Bundled lenses", |ui| {
        ScrollArea::vertical().max_height(600.0).show(ui, |ui| {
            show_items(ui, 300.0, menu_items::bundled_lenses(), actions);
        });
    });
    items.for_each(|item| show_item(ui, item, actions));
}

fn view_menu(ui: &mut Ui, menus: &MenuContext<'_>, actions: &mut Actions) {
    let (panels, others): (Vec<_>, Vec<_>) =
        menus.view().into_iter().partition(|item| item.checked.is_some());
    panel_columns(ui, panels, actions);
    others.into_iter().for_each(|item| show_item(ui, item, actions));
    ui.separator();
    ui.menu_button("Settings", |ui| {
        ui.set_min_width(SETTINGS_WIDTH);
        let edge = ui.max_rect().right();
        menus.settings().into_iter().for_each(|item| show_switch(ui, item, edge, actions));
    });
}

/// Shows the panels in two columns, since one is higher than a window of 800 points.
fn panel_columns(ui: &mut Ui, mut panels: Vec<MenuItem>, actions: &mut Actions) {
    ui.set_width(VIEW_WIDTH);
    let edge = ui.max_rect().right();
    let others = panels.split_off(panels.len().div_ceil(2));
    ui.columns_const(|[left, right]| {
        panels.into_iter().for_each(|item| show_switch(left, item, edge, actions));
        others.into_iter().for_each(|item| show_switch(right, item, edge, actions));
    });
}

/// Shows an item that is on or off, with its mark; its explanation stands right of the edge of the menu.
fn show_switch(ui: &mut Ui, item: MenuItem, edge: f32, actions: &mut Actions) {
    let mut checked = item.checked == Some(true);
    let mut text = Atoms::new(item.title.as_str());
    if let Some(key) = &item.shortcut {
        text.push_right(Atom::grow());
        text.push_right(RichText::new(ui.ctx().format_shortcut(key)).weak());
    }
    let mut response = ui.add_enabled(item.is_enabled(), Checkbox::new(&mut checked, text));
    if !item.hint.is_empty() {
        response = hint_right_of(response, edge, item.hint);
    }
    if response.clicked() {
        actions.extend(item.action);
        ui.close();
    }
}

fn help_menu(ui: &mut Ui, actions: &mut Actions) {
    show_items(ui, 240.0, menu_items::help(), actions);
    ui.separator();
    ui.menu_button("Studies of the thesis", |ui| experiment_window::menu(ui, actions));
    ui.separator();
    ui.weak(concat!("Aplanat ", env!("CARGO_PKG_VERSION")));
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
    let (name, other) =
        if dark { ("Light theme", Theme::Light) } else { ("Dark theme", Theme::Dark) };
    let button = ui.button(name).accessible_name("Switch between dark and light");
    if button.on_hover_text("Switch between dark and light").clicked() {
        ui.ctx().set_theme(other);
    }
}
