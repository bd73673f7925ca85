//! The command palette: every command, panel, lens, file and setting, found by words.

use egui::{
    Align, Align2, Button, Context, Event, Id, Key, Layout, Modal, Modifiers, ScrollArea, TextEdit,
    Ui, vec2,
};

use super::actions::{Actions, UiAction};
use super::form::dialog_frame;
use super::menu_items::{MenuContext, MenuItem};
use super::run_items::disabled_reason;
use super::text_input::place_cursor_at_end;

/// The number of items that are listed at most.
const MAX_ITEMS: usize = 60;
/// The greatest height of the list, in points.
const LIST_HEIGHT: f32 = 380.0;

/// The text and the selection.
#[derive(Debug, Default)]
pub(super) struct CommandPalette {
    text: String,
    selected: usize,
    /// The reason why what was asked for last is not possible now.
    refusal: Option<String>,
}

impl CommandPalette {
    /// Shows the palette; true once it is closed.
    pub(super) fn ui(
        &mut self,
        context: &Context,
        menus: &MenuContext<'_>,
        actions: &mut Actions,
    ) -> bool {
        let mut chosen = None;
        let id = Id::unique("command palette");
        let area = Modal::default_area(id).anchor(Align2::CENTER_TOP, vec2(0.0, 70.0));
        let modal = Modal::new(id).area(area).frame(dialog_frame(context)).show(context, |ui| {
            ui.set_width(560.0);
            chosen = self.contents(ui, menus);
        });
        let done = chosen.is_some();
        actions.extend(chosen.and_then(|item| item.action).map(shown_at_least));
        done || modal.should_close()
    }

    fn contents(&mut self, ui: &mut Ui, menus: &MenuContext<'_>) -> Option<MenuItem> {
        let (down, up, enter) = ui.input_mut(|input| {
            let mut pressed = |key| input.consume_key(Modifiers::NONE, key);
            (pressed(Key::ArrowDown), pressed(Key::ArrowUp), pressed(Key::Enter))
        });
        let id = Id::unique("words of the command palette");
        let early = self.take_early_text(ui, id);
        let line = TextEdit::singleline(&mut self.text)
            .id(id)
            .hint_text("A command, panel, lens, file, setting…")
            .desired_width(f32::INFINITY);
        let field = ui.add(line).accessible_name("Find a command");
        field.request_focus();
        if field.changed() || early {
            (self.selected, self.refusal) = (0, None);
        }
        let items = found(menus.all(), &self.text);
        let last = items.len().saturating_sub(1);
        self.selected = (self.selected + usize::from(down)).min(last);
        self.selected = self.selected.saturating_sub(usize::from(up));
        if down || up {
            self.refusal = None;
        }
        ui.add_space(4.0);
        if items.is_empty() {
            ui.weak("Nothing has these words.");
            return None;
        }
        if let Some(refusal) = &self.refusal {
            ui.colored_label(ui.visuals().warn_fg_color, refusal);
        }
        let pressed = self.list(ui, &items, down || up);
        let chosen = if enter { Some(self.selected) } else { pressed };
        let chosen = items.into_iter().nth(chosen?)?;
        if !chosen.is_enabled() {
            self.refusal = Some(disabled_reason(&chosen));
            return None;
        }
        Some(chosen)
    }

    /// Takes what is typed before the field can: in the first frame the palette is only measured. True
    /// if there was something.
    fn take_early_text(&mut self, ui: &Ui, field: Id) -> bool {
        if ui.is_enabled() && ui.memory(|memory| memory.has_focus(field)) {
            return false;
        }
        let before = self.text.len();
        ui.input(|input| {
            for event in &input.events {
                if let Event::Text(text) = event {
                    self.text.push_str(text);
                }
            }
        });
        let is_longer = self.text.len() > before;
        if is_longer {
            // What the field takes next follows it.
            place_cursor_at_end(ui.ctx(), field);
        }
        is_longer
    }

    /// Shows the items; the index of one that was pressed.
    fn list(&self, ui: &mut Ui, items: &[MenuItem], moved: bool) -> Option<usize> {
        let mut pressed = None;
        // A list that follows a shorter one has its full height too.
        let scroll =
            ScrollArea::vertical().max_height(LIST_HEIGHT).min_scrolled_height(LIST_HEIGHT);
        scroll.auto_shrink([false, true]).show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 1.0;
            for (i, item) in items.iter().enumerate() {
                let row = show_item(ui, item, i == self.selected);
                if moved && i == self.selected {
                    row.scroll_to_me(None);
                }
                if row.clicked() {
                    pressed = Some(i);
                }
            }
        });
        pressed
    }
}

/// The action of an item that was asked for by the keyboard: a panel is shown, and not hidden because it is
/// open.
pub(super) fn shown_at_least(action: UiAction) -> UiAction {
    match action {
        UiAction::TogglePanel(kind) => UiAction::ShowPanel(kind),
        other => other,
    }
}

fn show_item(ui: &mut Ui, item: &MenuItem, selected: bool) -> egui::Response {
    let shortcut = item.shortcut.map(|key| ui.ctx().format_shortcut(&key)).unwrap_or_default();
    let button = Button::new(format!("{}: {}", item.menu, item.title))
        .selected(selected)
        .frame_when_inactive(selected)
        .truncate()
        .shortcut_text(shortcut);
    let size = vec2(ui.available_width(), 22.0);
    let layout = Layout::left_to_right(Align::Center).with_main_justify(true);
    let row =
        ui.allocate_ui_with_layout(size, layout, |ui| ui.add_enabled(item.is_enabled(), button));
    let row = row.inner;
    let row =
        if item.is_enabled() { row } else { row.on_disabled_hover_text(disabled_reason(item)) };
    if item.hint.is_empty() { row } else { row.on_hover_text(item.hint) }
}

/// The items that have all words of a text: those that can be asked for first, and among them those
/// with this very title and those that begin with it. A title counts with its menu too, as it is listed.
pub(super) fn found(items: Vec<MenuItem>, text: &str) -> Vec<MenuItem> {
    let text = text.to_lowercase();
    let is_between = |c: char| c.is_whitespace() || c == ':';
    let words: Vec<&str> = text.split(is_between).filter(|word| !word.is_empty()).collect();
    let name =
        |item: &MenuItem| format!("{} {} {}", item.title, item.menu, item.hint).to_lowercase();
    let fits = |item: &MenuItem| {
        let name = name(item);
        words.iter().all(|word| name.contains(word))
    };
    let mut items: Vec<MenuItem> = items.into_iter().filter(fits).collect();
    let rank = |item: &MenuItem| {
        let title = item.title.to_lowercase();
        let titles = [title.clone(), format!("{}: {title}", item.menu.to_lowercase())];
        let is = titles.iter().any(|title| title == text.trim());
        let begins = titles.iter().any(|title| title.starts_with(text.trim()));
        let has = words.iter().all(|word| title.contains(word));
        (!item.is_enabled(), !is, !begins, !has)
    };
    items.sort_by_key(rank);
    items.truncate(MAX_ITEMS);
    items
}
