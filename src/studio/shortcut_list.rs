//! The list of keyboard shortcuts.

use egui::{Align2, Context, Grid, Id, ScrollArea, Window, vec2};

use super::menu_items::MenuContext;

/// Keys that belong to the table of surfaces and to the drawings.
const OTHERS: [(&str, &str, &str); 8] = [
    ("Table", "Enter", "Accept what is typed and go down"),
    ("Table", "Tab", "Accept what is typed and go to the right"),
    ("Table", "Escape", "Discard what is typed"),
    ("Table", "Insert", "Insert a surface in front of the selected one"),
    ("Table", "Delete", "Delete the selected surface"),
    ("Table", "Ctrl+Shift+V", "Make the number with the cursor variable, or fix it"),
    ("Drawing", "Double click", "Show the whole lens"),
    ("Edit", "Ctrl+Y", "Redo"),
];

/// Shows the list; false once it is closed.
pub(super) fn ui(context: &Context, menus: &MenuContext<'_>) -> bool {
    let mut open = true;
    let window = Window::new("Keyboard shortcuts")
        .id(Id::unique("shortcuts"))
        .open(&mut open)
        .collapsible(false)
        .pivot(Align2::CENTER_CENTER)
        .default_pos(context.content_rect().center())
        .default_size(vec2(460.0, 520.0));
    window.show(context, |ui| {
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            let grid = Grid::new("shortcuts").num_columns(3).striped(true).spacing([18.0, 4.0]);
            grid.show(ui, |ui| {
                for item in menus.commands() {
                    let Some(key) = item.shortcut else { continue };
                    ui.weak(item.menu);
                    ui.strong(ui.ctx().format_shortcut(&key));
                    ui.label(item.title);
                    ui.end_row();
                }
                for (place, key, meaning) in OTHERS {
                    ui.weak(place);
                    ui.strong(key);
                    ui.label(meaning);
                    ui.end_row();
                }
            });
        });
    });
    open
}
