//! A candidate in the table: the lens of a run in place of the design, with what it changes.

use egui::{Align, Label, Layout, RichText, Role, Sense, Ui, WidgetInfo};

use super::badge;
use super::cells::CellPlace;
use super::columns::TableColumn;
use super::table::MARGIN;
use crate::lens::Lens;
use crate::studio::number;

/// The candidate that the table shows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate<'a> {
    pub(super) lens: &'a Lens,
    pub(super) design: &'a Lens,
}

impl Candidate<'_> {
    /// Shows a cell of the candidate, marked if the design has another value there. `clear` is the
    /// semi-diameter that the rays need, for an automatic one.
    pub(super) fn cell(
        self,
        ui: &mut Ui,
        place: CellPlace,
        (text, clear): (&str, Option<f64>),
        zoom: usize,
    ) {
        let old = self.old_text(place, zoom);
        let color = ui.visuals().warn_fg_color;
        if old.is_some() {
            ui.painter().rect_filled(ui.max_rect(), 0.0, color.gamma_multiply(0.16));
        }
        let automatic = clear.filter(|_| text.is_empty()).map(number::format_number);
        let text = automatic.as_deref().unwrap_or(text);
        let mut shown = RichText::new(text);
        if old.is_some() {
            shown = shown.color(color);
        } else if automatic.is_some() {
            shown = shown.weak();
        }
        let layout = if place.column.is_text() {
            Layout::left_to_right(Align::Center)
        } else {
            Layout::right_to_left(Align::Center)
        };
        let name = place.name(self.lens, zoom);
        ui.with_layout(layout, |ui| {
            self.badge(ui, place, &format!("{name} of the candidate"), zoom);
            ui.add_space(MARGIN);
            let label = ui.add(Label::new(shown).truncate().sense(Sense::hover()));
            // The mark of a changed cell is a colour: its name says it too.
            let change = old.as_ref().map(|old| format!(". {old}")).unwrap_or_default();
            let name = format!("{name} of the candidate: {text}{change}");
            label.widget_info(|| WidgetInfo::labeled(Role::Label, true, &name));
            if let Some(old) = old {
                label.on_hover_text(old);
            }
        });
    }

    /// The badge of a number, or its room.
    fn badge(self, ui: &mut Ui, place: CellPlace, name: &str, zoom: usize) {
        if !place.column.has_badge() {
            return;
        }
        let surface = place.surface().filter(|surface| *surface < self.lens.surfaces.len());
        let number = surface.and_then(|surface| place.column.parameter(self.lens, zoom, surface));
        match number.filter(|_| place.is_editable(self.lens)) {
            Some(number) => {
                // The room at the right that the badge of an edited cell leaves.
                ui.add_space(badge::GAP);
                badge::show_fixed(ui, self.lens, number, name);
            }
            None => ui.add_space(badge::WIDTH),
        }
    }

    /// The text of the design in place of a changed cell; `None` for an unchanged one.
    fn old_text(self, place: CellPlace, zoom: usize) -> Option<String> {
        let rows = self.design.surfaces.len();
        if place.row > rows {
            return Some("The design has no such surface.".to_owned());
        }
        let values = [self.lens, self.design].map(|lens| place.text(lens, zoom, |v| v.to_string()));
        let [new, old] = &values;
        // The last gap of a solve follows the others; what it was is not written in the lens.
        let solved = place.column == TableColumn::Thickness
            && place.row == rows
            && self.design.image_solve.is_some();
        if new == old || solved {
            return None;
        }
        let old = place.text(self.design, zoom, number::format_number);
        let old = if old.is_empty() { "empty".to_owned() } else { old };
        Some(format!("In the design: {old}"))
    }
}
