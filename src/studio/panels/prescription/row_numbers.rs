//! The numbers of the rows: they stand still while the columns are scrolled beneath them, and hold the menu of
//! a row.

use egui::{Align, Button, Layout, Rangef, Rect, Response, RichText, Ui, UiBuilder};

use super::actions;
use super::cells::OBJECT;
use super::table::PrescriptionTable;
use crate::lens::Edit;
use crate::session::Command;
use crate::studio::menu::show_items;
use crate::studio::menu_items::element_items;
use crate::studio::panels::widgets::hint_beside;

/// The width of the column, in points.
pub(super) const WIDTH: f32 = 62.0;
/// The room at the left of a number, in points.
const INDENT: f32 = 6.0;

/// The place of a row that is shown.
#[derive(Debug, Clone, Copy)]
pub(super) struct RowPlace {
    /// The row as it is counted in the window.
    pub(super) index: usize,
    pub(super) y: Rangef,
}

/// The place of the column.
#[derive(Debug)]
pub(super) struct NumberColumn {
    /// The visible part of the table, with its header.
    pub(super) viewport: Rect,
    /// The heights between which rows are seen.
    pub(super) rows: Rangef,
    /// True if other columns pass beneath.
    pub(super) is_scrolled: bool,
}

impl NumberColumn {
    fn cell(&self, y: Rangef) -> Rect {
        let left = self.viewport.left();
        Rect::from_x_y_ranges(left..=left + WIDTH, y)
    }

    /// Covers the columns that pass beneath.
    fn paint_ground(&self, ui: &Ui) {
        if !self.is_scrolled {
            return;
        }
        let rect = self.cell(self.viewport.y_range());
        let visuals = ui.visuals();
        ui.painter().rect_filled(rect, 0.0, visuals.panel_fill);
        let line = visuals.widgets.noninteractive.bg_stroke;
        ui.painter().vline(rect.right(), rect.y_range(), line);
    }
}

impl PrescriptionTable<'_> {
    /// Shows the numbers of the rows at the left of what is seen of the table.
    pub(super) fn row_numbers(&mut self, ui: &mut Ui, column: &NumberColumn, rows: &[RowPlace]) {
        let layout = Layout::left_to_right(Align::Center);
        let header = column.cell(Rangef::new(column.viewport.top(), column.rows.min));
        // A table that has no room yet has no places.
        if !header.is_finite() {
            return;
        }
        column.paint_ground(ui);
        ui.scope_builder(UiBuilder::new().max_rect(header).layout(layout), |ui| {
            let hint = "Surface number: the object is 0, the first surface 1";
            row_name(ui, "Surf").on_hover_text(hint);
        });
        for row in rows {
            let cell = column.cell(row.y);
            ui.scope_builder(UiBuilder::new().max_rect(cell).layout(layout), |ui| {
                ui.shrink_clip_rect(column.cell(column.rows));
                self.row_number(ui, row.index, column.is_scrolled);
            });
        }
    }

    fn row_number(&mut self, ui: &mut Ui, row: usize, is_scrolled: bool) {
        let surface = row.checked_sub(1).filter(|surface| *surface < self.lens.surfaces.len());
        if is_scrolled && surface.is_some() && surface == self.view.selected {
            ui.painter().rect_filled(ui.max_rect(), 0.0, ui.visuals().selection.bg_fill);
        }
        match surface {
            Some(surface) => self.surface_name(ui, surface),
            None if row == OBJECT => {
                row_name(ui, "OBJ").on_hover_text("The object: row 0");
            }
            None => {
                row_name(ui, "IMA").on_hover_text("The image plane");
            }
        }
    }

    fn surface_name(&mut self, ui: &mut Ui, surface: usize) {
        let stop = self.lens.surfaces[surface].stop;
        let text = if stop { format!("{} STO", surface + 1) } else { (surface + 1).to_string() };
        let text = if stop { RichText::new(text).strong() } else { RichText::new(text) };
        let chosen = self.view.selected == Some(surface);
        let label = ui.selectable_label(chosen, text).accessible_name(row_label(surface));
        if label.clicked() || label.secondary_clicked() {
            self.actions.push(Command::Select(Some(surface)));
        }
        if self.candidate.is_some() {
            return;
        }
        label.context_menu(|ui| self.row_menu(ui, surface));
        label.on_hover_text(format!(
            "Surface {} of the window, which counts from 1; files count from 0: {surface} there. \
             Press the right button for what can be done with it.",
            surface + 1
        ));
    }

    fn row_menu(&mut self, ui: &mut Ui, surface: usize) {
        for action in actions::ALL {
            let edit = action.edit(&self.lens, surface);
            let button = Button::new(action.title());
            let item = ui.add_enabled(edit.is_some(), button);
            if hint_beside(item, action.hint()).clicked() {
                self.actions.extend(edit);
                ui.close();
            }
        }
        ui.menu_button("Element", |ui| {
            let items = element_items(&self.view.lens, Some(surface));
            show_items(ui, 260.0, items, self.actions);
        });
        ui.separator();
        let hyper = self.lens.surfaces[surface].hyperhemisphere;
        if ui.selectable_label(hyper, "Hyper-hemisphere").clicked() {
            self.actions.push(Edit::SetHyperhemisphere { surface, hyper: !hyper });
            ui.close();
        }
        super::shapes::menu(
            ui,
            &self.lens,
            surface,
            self.clear_semi_diameter(surface),
            self.actions,
        );
    }
}

fn row_name(ui: &mut Ui, text: &str) -> Response {
    ui.add_space(INDENT);
    ui.weak(text)
}

/// The accessible name of the number of a row.
fn row_label(surface: usize) -> String {
    format!("Row of surface {}", surface + 1)
}
