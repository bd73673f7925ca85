//! The list of keyboard shortcuts.

use egui::{Align2, Context, Grid, Id, ScrollArea, Ui, Window, vec2};

use super::menu_items::MenuContext;

/// Keys that belong to the table of surfaces and to the drawings.
const OTHERS: [(&str, &str, &str); 23] = [
    ("Table", "Arrows", "Go to the next cell"),
    ("Table", "Shift+arrows", "Choose a range of cells"),
    ("Table", "F2", "Edit the text of a cell instead of replacing it"),
    ("Table", "Ctrl+C, Ctrl+X", "Copy or cut the chosen cells, for a spreadsheet too"),
    ("Table", "Ctrl+V", "Paste cells"),
    ("Table", "Enter", "Accept what is typed and go down"),
    ("Table", "Shift+Enter", "Accept what is typed and go up"),
    ("Table", "Tab", "Accept what is typed and go to the right"),
    ("Table", "Escape", "Discard what is typed"),
    ("Table", "Insert", "Insert a surface in front of the selected one"),
    ("Table", "Delete", "Delete the selected surface"),
    ("Table", "Ctrl+Shift+V", "Make the number with the cursor variable, or fix it"),
    ("Drawing", "Left, Right", "Select the previous or the next surface"),
    ("Drawing", "+, -", "Bring it nearer, or further away"),
    ("Drawing", "Home, double click", "Show the whole lens"),
    ("Handle", "Tab", "Go to the next handle of the selected surface or of the lens"),
    ("Handle", "Arrows", "Move the handle"),
    ("Handle", "Shift+arrows", "Move it in small steps"),
    ("Handle", "Digits, Enter", "Type its value, and set it"),
    ("Handle", "Escape", "Take the drag back, or leave the handle"),
    ("Handle", "Shift, Ctrl, Alt", "While dragging: fine, to round numbers, bend the element"),
    ("Handle", "Enter", "End the drag as one undo step"),
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
        .default_size(vec2(540.0, 520.0));
    window.show(context, |ui| {
        let scroll = ScrollArea::vertical().auto_shrink([false, false]);
        scroll.show(ui, |ui| list(ui, menus));
    });
    open
}

fn list(ui: &mut Ui, menus: &MenuContext<'_>) {
    let grid = Grid::new("shortcuts").num_columns(3).striped(true).spacing([18.0, 4.0]);
    grid.show(ui, |ui| {
        for item in menus.commands() {
            if let Some(key) = item.shortcut {
                row(ui, item.menu, &ui.ctx().format_shortcut(&key), &item.title);
            }
        }
        for (place, key, meaning) in OTHERS {
            row(ui, place, key, meaning);
        }
    });
}

fn row(ui: &mut Ui, place: &str, key: &str, meaning: &str) {
    ui.weak(place);
    ui.strong(key);
    ui.label(meaning);
    ui.end_row();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_of_the_table_and_of_handles_are_listed() {
        let has = |place: &str, key: &str| {
            OTHERS.iter().any(|(other, keys, _)| *other == place && keys.contains(key))
        };
        for key in ["F2", "Ctrl+C", "Ctrl+V", "Shift+arrows", "Shift+Enter"] {
            assert!(has("Table", key), "{key}");
        }
        for key in ["Arrows", "Shift+arrows", "Digits", "Escape"] {
            assert!(has("Handle", key), "{key}");
        }
    }
}
