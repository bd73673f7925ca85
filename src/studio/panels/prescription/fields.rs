//! The cells of the table that are edited, each with its badge.

use egui::{
    Align, Key, Layout, Modifiers, Popup, PopupCloseBehavior, Response, RichText, Ui, vec2,
};

use super::badge::{self, ParameterStatus};
use super::cells::{CellPlace, OBJECT};
use super::clipboard::cells;
use super::columns::TableColumn;
use super::glass;
use super::table::{PrescriptionTable, room_in};
use crate::lens::{Edit, Parameter};
use crate::session::Command;
use crate::studio::number;
use crate::studio::panels::valid_edit;
use crate::studio::text::capitalize;
use crate::studio::text_input::TextInput;

impl PrescriptionTable<'_> {
    pub(super) fn editable_cell(&mut self, ui: &mut Ui, place: CellPlace) {
        let field = self.text_field(ui, place);
        if place.column == TableColumn::Glass {
            self.suggest_glasses(&field, place);
        }
        let lens = &self.lens;
        let parameter = place
            .surface()
            .and_then(|surface| place.column.parameter(lens, self.view.settings.zoom, surface));
        if let Some(parameter) = parameter.filter(|_| place.row != OBJECT) {
            let clear = self.shown_clear(place);
            badge::show(ui, lens, parameter, clear, self.buffers, self.actions);
            self.toggle_by_key(ui, &field, parameter, clear);
        }
        if let Some(hint) = self.cell_hint(place) {
            field.on_hover_text(hint);
        }
    }

    /// The semi-diameter that an automatic one shows; `None` in other columns.
    pub(super) fn shown_clear(&self, place: CellPlace) -> Option<f64> {
        let surface = place.surface().filter(|_| place.column == TableColumn::SemiDiameter)?;
        self.clear_semi_diameter(surface).filter(|height| *height > 0.0)
    }

    fn cell_hint(&self, place: CellPlace) -> Option<String> {
        match (place.column, place.surface()) {
            (TableColumn::Glass, surface) => {
                let medium = match surface {
                    Some(surface) => &self.lens.surfaces[surface].medium,
                    None => &self.lens.object_medium,
                };
                Some(glass::describe_medium(medium))
            }
            (TableColumn::SemiDiameter | TableColumn::Obstruction | TableColumn::Apertures, _) => {
                Some(place.column.hint().to_owned())
            }
            _ => None,
        }
    }

    /// Shows the text of a cell: what is typed becomes an edit, if the lens stays valid.
    fn text_field(&mut self, ui: &mut Ui, place: CellPlace) -> Response {
        let zoom = self.view.settings.zoom;
        let (name, shown) =
            (place.name(&self.lens, zoom), self.shown_text(place, room_in(ui, place)));
        let hint = self.shown_clear(place).map(number::format_number).unwrap_or_default();
        let align = if place.column.is_text() { Align::Min } else { Align::Max };
        let field = TextInput { hint: &hint, ..TextInput::in_table(&name, &shown, align) };
        let badge_width = if place.column.has_badge() { badge::WIDTH } else { 0.0 };
        let rect = ui.max_rect();
        let size = vec2(ui.available_width() - badge_width, ui.available_height());
        let layout = Layout::left_to_right(Align::Center);
        let show = |ui: &mut Ui| self.buffers.show(ui, place.id(), field);
        let entry = ui.allocate_ui_with_layout(size, layout, show).inner;
        self.cursor.record(place, rect, entry.response.has_focus());
        if entry.response.gained_focus() {
            self.entered = Some(rect);
        }
        if entry.response.gained_focus() && place.surface() != self.view.selected {
            // Commands for an element mean that of the cursor.
            self.actions.push(Command::Select(place.surface()));
        }
        let fits = match entry.submitted {
            Some(text) => self.try_edit(place, &text),
            None => true,
        };
        if entry.response.lost_focus() {
            self.leave(ui, place, fits);
        }
        entry.response
    }

    /// Moves the cursor after Enter, and back into a cell whose text was refused.
    fn leave(&mut self, ui: &Ui, place: CellPlace, fits: bool) {
        let (up, escape) = ui.input(|i| (i.modifiers.shift, i.key_pressed(Key::Escape)));
        if ui.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Enter)) {
            let row = if up { place.row.saturating_sub(1) } else { place.row + 1 };
            let next = CellPlace { row, ..place };
            let goes = fits && next.is_editable(&self.lens);
            self.cursor.move_to(if goes { next } else { place });
        } else if escape || (!fits && self.cursor.is_moving()) {
            self.cursor.move_to(place);
        }
    }

    /// Asks for an edit if the lens stays valid; otherwise the cell shows the reason.
    fn try_edit(&mut self, place: CellPlace, text: &str) -> bool {
        let edit = place.edit(&self.lens, self.view.settings.zoom, text);
        match edit.and_then(|edit| valid_edit(&self.lens, edit)) {
            Ok(edit) => {
                self.buffers.accept(place.id());
                self.actions.extend([Command::Edit(edit), Command::CommitEdit]);
                true
            }
            Err(why) => {
                self.buffers.reject(place.id(), capitalize(&why));
                false
            }
        }
    }

    fn toggle_by_key(
        &mut self,
        ui: &Ui,
        field: &Response,
        parameter: Parameter,
        clear: Option<f64>,
    ) {
        let keys = Modifiers::COMMAND | Modifiers::SHIFT;
        if field.has_focus() && ui.input_mut(|input| input.consume_key(keys, Key::V)) {
            let status = ParameterStatus::of(&self.lens, parameter);
            if let Some(edit) = self.range_toggle(matches!(status, ParameterStatus::Variable(_))) {
                return self.actions.push(edit);
            }
            if status == ParameterStatus::Automatic {
                let surface = parameter.surface;
                let fix = clear.map(|size| Edit::SetSemiDiameter { surface, value: Some(size) });
                return self.actions.extend(fix);
            }
            self.actions.push(badge::toggle_edit(status, parameter));
        }
    }

    /// The edit that makes all numbers of a range of cells variable, or fixed; `None` if no range is
    /// chosen.
    fn range_toggle(&self, fix: bool) -> Option<Edit> {
        let (rows, columns) = self.cursor.range(self.grid())?;
        let cells = cells(&rows, &columns).filter(|place| place.row != OBJECT);
        let zoom = self.view.settings.zoom;
        let number = |place: CellPlace| place.column.parameter(&self.lens, zoom, place.surface()?);
        let numbers: Vec<Parameter> = cells.filter_map(number).collect();
        let edit = |parameter: &Parameter| {
            let status = ParameterStatus::of(&self.lens, *parameter);
            let changes = match status {
                ParameterStatus::Variable(_) => fix,
                ParameterStatus::Fixed | ParameterStatus::Clipping => !fix,
                _ => false,
            };
            changes.then(|| badge::toggle_edit(status, *parameter))
        };
        let edits: Vec<Edit> = numbers.iter().filter_map(edit).collect();
        let title = format!("{} {} numbers", if fix { "fix" } else { "vary" }, edits.len());
        (numbers.len() > 1).then_some(Edit::Sequence { title, edits })
    }

    /// Proposes glasses below a cell into which a name is typed.
    fn suggest_glasses(&mut self, field: &Response, place: CellPlace) {
        let typing = self.buffers.text(field.id).filter(|_| field.has_focus());
        let proposals = typing.map(glass::suggestions).unwrap_or_default();
        if proposals.is_empty() {
            return;
        }
        let popup = Popup::from_response(field).close_behavior(PopupCloseBehavior::IgnoreClicks);
        popup.show(|ui| {
            for (i, proposal) in proposals.iter().enumerate() {
                let line = RichText::new(glass::proposal_line(proposal)).monospace();
                let label = ui.selectable_label(self.cursor.proposal == Some(i), line);
                // Taken as the button goes down: its release comes after the typing has ended.
                if label.accessible_name(proposal.full_name()).is_pointer_button_down_on() {
                    self.buffers.accept(field.id);
                    let edit = place.edit(&self.lens, 0, &proposal.full_name());
                    self.actions.extend(edit.ok());
                }
            }
        });
    }
}
