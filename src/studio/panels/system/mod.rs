//! The system: everything of a lens that is not a surface.

mod beam;
mod fields;
mod wavelengths;

pub(super) use beam::{
    kind_of as aperture_kind, value as aperture_value, with_value as aperture_with_value,
};

use egui::{Align, Context, Layout, ScrollArea, Ui, UiBuilder, vec2};

use super::Panel;
use super::edit_form::{EditForm, heading};
use crate::lens::Edit;
use crate::session::SessionView;
use crate::studio::actions::Actions;
use crate::studio::text_input::EditBuffers;
use fields::EqualAreaSteps;

/// The width in points from which the groups stand in two columns.
const TWO_COLUMNS: f32 = 540.0;
/// The width in points of the names of the texts, whose fields begin below each other.
const NAMES: f32 = 46.0;

/// The panel.
#[derive(Debug, Default)]
pub struct SystemPanel {
    buffers: EditBuffers,
    steps: EqualAreaSteps,
}

impl Panel for SystemPanel {
    fn title(&self) -> &'static str {
        "System"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Self { buffers, steps } = self;
        let mut form = EditForm { view, buffers, actions };
        form.error_line(ui);
        ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
            if ui.available_width() < TWO_COLUMNS {
                beam::ui(ui, &mut form);
                fields::ui(ui, &mut form, steps);
                wavelengths::ui(ui, &mut form);
                return texts(ui, &mut form);
            }
            let (area, gap) = (ui.available_rect_before_wrap(), 18.0);
            let (mut left, mut right) = area.split_left_right_at_fraction(0.5);
            left.max.x -= 0.5 * gap;
            right.min.x += 0.5 * gap;
            let lower = ui.scope_builder(UiBuilder::new().max_rect(left), |ui| {
                beam::ui(ui, &mut form);
                texts(ui, &mut form);
                ui.min_rect().bottom()
            });
            let other = ui.scope_builder(UiBuilder::new().max_rect(right), |ui| {
                fields::ui(ui, &mut form, steps);
                wavelengths::ui(ui, &mut form);
                ui.min_rect().bottom()
            });
            ui.advance_cursor_after_rect(area.with_max_y(lower.inner.max(other.inner)));
        });
    }

    fn is_typing(&self, context: &Context) -> bool {
        self.buffers.is_typing(context)
    }
}

/// The name of the text that may be long.
const NOTES: &str = "Notes";

/// The name of a text of the lens, the text, and the edit that sets it.
type LensText<'a> = (&'static str, &'a str, fn(String) -> Edit);

/// The name of the lens, its source and the notes on it.
fn texts(ui: &mut Ui, form: &mut EditForm<'_>) {
    heading(ui, "Lens");
    let lens = &form.view.lens;
    let texts: [LensText<'_>; 3] = [
        ("Name", &lens.name, Edit::SetName),
        ("Source", &lens.source, Edit::SetSource),
        (NOTES, &lens.notes, Edit::SetNotes),
    ];
    for (name, shown, edit) in texts {
        ui.horizontal(|ui| {
            let size = vec2(NAMES, ui.spacing().interact_size.y);
            ui.allocate_ui_with_layout(size, Layout::left_to_right(Align::Center), |ui| {
                ui.set_min_width(NAMES);
                ui.label(name);
            });
            let width = ui.available_width();
            let accessible = format!("{name} of the lens");
            let edit = |text: &str| Ok(edit(text.to_owned()));
            let entry = if name == NOTES {
                form.paragraph(ui, &accessible, (shown, width), edit)
            } else {
                form.text(ui, &accessible, (shown, width), edit)
            };
            if !shown.is_empty() {
                // A long one is cut in its field.
                entry.on_hover_text(shown);
            }
        });
    }
}
