//! Fields of a panel that edit the lens: what is typed becomes an edit once it is accepted, and stays
//! with the reason where the lens would not be valid.

use egui::{Align, Color32, Id, Layout as Arrange, Response, RichText, TextStyle, Ui, vec2};

use super::valid_edit;
use crate::lens::Edit;
use crate::math::expression::evaluate;
use crate::session::{Command, SessionView};
use crate::studio::actions::Actions;
use crate::studio::number;
use crate::studio::text::capitalize;
use crate::studio::text_input::{EditBuffers, InputPlacement, TextInput, error_color};

/// The digits of a number in a form.
const DIGITS: i32 = 7;
/// The width of a field beside its text, in points.
const TEXT_MARGIN: f32 = 10.0;

/// The fields of a panel for one frame.
pub(super) struct EditForm<'a> {
    pub(super) view: &'a SessionView,
    pub(super) buffers: &'a mut EditBuffers,
    pub(super) actions: &'a mut Actions,
}

impl EditForm<'_> {
    /// Shows a text of this width in points. `name` is its accessible name, different from all others.
    pub(super) fn text(
        &mut self,
        ui: &mut Ui,
        name: &str,
        (shown, width): (&str, f32),
        edit: impl Fn(&str) -> Result<Edit, String>,
    ) -> Response {
        // A text that has several lines is shown as such.
        let has_lines = shown.contains('\n');
        let placement = if has_lines { InputPlacement::Paragraph } else { InputPlacement::Form };
        let input = TextInput { name, value: shown, hint: "", align: Align::Min, placement };
        self.field(ui, input, width, edit)
    }

    /// The same for a text that may be long: one that does not fit into a line is broken into several.
    pub(super) fn paragraph(
        &mut self,
        ui: &mut Ui,
        name: &str,
        (shown, width): (&str, f32),
        edit: impl Fn(&str) -> Result<Edit, String>,
    ) -> Response {
        let font = TextStyle::Body.resolve(ui.style());
        let line = ui.painter().layout_no_wrap(shown.to_owned(), font, Color32::WHITE);
        if line.size().x + TEXT_MARGIN <= width {
            return self.text(ui, name, (shown, width), edit);
        }
        let placement = InputPlacement::Paragraph;
        let input = TextInput { name, value: shown, hint: "", align: Align::Min, placement };
        self.field(ui, input, width, edit)
    }

    /// Shows a number of this width in points; arithmetic as in the table is understood.
    pub(super) fn number(
        &mut self,
        ui: &mut Ui,
        name: &str,
        (value, width): (f64, f32),
        edit: impl Fn(f64) -> Edit,
    ) -> Response {
        let shown = number::format_digits(value, DIGITS);
        let placement = InputPlacement::Form;
        let input = TextInput { name, value: &shown, hint: "", align: Align::Max, placement };
        self.field(ui, input, width, |text| {
            evaluate(text, value).map(&edit).map_err(|why| why.to_string())
        })
    }

    fn field(
        &mut self,
        ui: &mut Ui,
        input: TextInput<'_>,
        width: f32,
        edit: impl Fn(&str) -> Result<Edit, String>,
    ) -> Response {
        let id = Id::unique(("edit form", input.name));
        let size = vec2(width, ui.spacing().interact_size.y);
        let layout = Arrange::left_to_right(Align::Center);
        let entry = ui.allocate_ui_with_layout(size, layout, |ui| self.buffers.show(ui, id, input));
        if let Some(text) = entry.inner.submitted {
            self.try_edit(id, edit(&text));
        }
        entry.inner.response
    }

    /// Asks for an edit if the lens stays valid; otherwise the field shows the reason.
    fn try_edit(&mut self, id: Id, edit: Result<Edit, String>) {
        match edit.and_then(|edit| valid_edit(&self.view.lens, edit)) {
            Ok(edit) => {
                self.buffers.accept(id);
                self.actions.extend([Command::Edit(edit), Command::CommitEdit]);
            }
            Err(why) => self.buffers.reject(id, capitalize(&why)),
        }
    }

    /// Shows why the last text cannot be accepted.
    pub(super) fn error_line(&self, ui: &mut Ui) {
        if let Some(why) = self.buffers.last_error() {
            ui.label(RichText::new(why).color(error_color(ui)));
        }
    }
}

/// Shows the heading of a group of fields.
pub(super) fn heading(ui: &mut Ui, text: &str) {
    ui.add_space(4.0);
    ui.label(RichText::new(text).strong());
}
