//! The prescription: a row per surface, a cell per number, and a badge with the status of the
//! number.
//!
//! Rows are counted as designers do: the object is row 0, the first surface row 1, the image the
//! last one. An edit that would make the lens invalid is rejected: its text remains in the cell
//! with the reason, and the lens is unchanged.

mod actions;
mod badge;
mod glass;
mod table;
mod variables;

use egui::{Button, Context, Frame, Id, Key, Margin, Panel as SidePanel, RichText, Ui};

use super::Panel;
use crate::session::SessionView;
use crate::studio::actions::Actions;
use crate::studio::text_input::{EditBuffers, error_color};
use actions::RowAction;
use table::PrescriptionTable;

/// The panel.
#[derive(Debug, Default)]
pub struct PrescriptionPanel {
    buffers: EditBuffers,
}

impl Panel for PrescriptionPanel {
    fn title(&self) -> &'static str {
        "Prescription"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        keys(ui, view, actions);
        toolbar(ui, view, actions);
        self.error_line(ui);
        PrescriptionTable { view, buffers: &mut self.buffers, actions }.show(ui);
    }

    fn is_typing(&self, context: &Context) -> bool {
        self.buffers.is_typing(context)
    }
}

/// The field of the first radius.
pub(in crate::studio) fn first_radius_field() -> Id {
    table::first_radius_field()
}

impl PrescriptionPanel {
    /// The last text that was refused, where it can be read in full.
    fn error_line(&self, ui: &mut Ui) {
        let Some(why) = self.buffers.last_error() else { return };
        let frame = Frame::new().inner_margin(Margin::symmetric(4, 2));
        SidePanel::bottom("complaint").frame(frame).show_separator_line(false).show(ui, |ui| {
            ui.label(RichText::new(why).color(error_color(ui)));
        });
    }
}

/// Insert and Delete work on the selected row while no text is being edited.
fn keys(ui: &Ui, view: &SessionView, actions: &mut Actions) {
    let Some(row) = view.selected.filter(|_| !ui.ctx().egui_wants_keyboard_input()) else {
        return;
    };
    for (key, action) in [(Key::Delete, RowAction::Remove), (Key::Insert, RowAction::InsertBefore)]
    {
        if ui.input(|input| input.key_pressed(key)) {
            actions.extend(action.edit(&view.lens, row));
        }
    }
}

fn toolbar(ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
    let lens = &view.lens;
    ui.horizontal(|ui| {
        for action in actions::ALL {
            let edit = view.selected.and_then(|row| action.edit(lens, row));
            let button = ui.add_enabled(edit.is_some(), Button::new(action.title()).small());
            let button = button.on_hover_text(action.hint());
            let button = button.on_disabled_hover_text("Select a row by its number first.");
            if let Some(edit) = edit.filter(|_| button.clicked()) {
                actions.push(edit);
            }
        }
        variables::menu(ui, lens, actions);
    });
}
