//! The table of the prescription: rows, headers, and the cells that are only read.

use std::sync::Arc;

use egui::{
    Align, Color32, Id, Label, Layout, Rect, RichText, Role, ScrollArea, Sense, Stroke, Ui,
    WidgetInfo, vec2,
};
use egui_extras::{TableBuilder, TableRow};

use super::badge;
use super::candidate::Candidate;
use super::cells::CellPlace;
use super::columns::TableColumn;
use super::cursor::{CellCursor, CellGrid};
use super::row_numbers::{self, NumberColumn, RowPlace};
use crate::lens::{Lens, Medium};
use crate::session::{Analyses, SessionView};
use crate::studio::actions::Actions;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};
use crate::studio::text_input::EditBuffers;

/// The height of a row, in points.
const ROW: f32 = 21.0;
/// The room at the right of a cell without a badge, and at the left of text, in points.
pub(super) const MARGIN: f32 = 5.0;
/// The width of a digit, in points.
const CHARACTER: f32 = 7.2;
/// The characters of a number that a narrow column cuts rather than leaves out.
const MIN_ROOM: usize = 5;

/// The table for one frame.
pub(super) struct PrescriptionTable<'a> {
    pub(super) view: &'a SessionView,
    /// The lens that is shown: the design or a candidate.
    pub(super) lens: Arc<Lens>,
    /// The analyses of that lens, maybe of a moment before.
    pub(super) analyses: Option<&'a Analyses>,
    /// The candidate that is shown in place of the design; its cells cannot be edited.
    pub(super) candidate: Option<Candidate<'a>>,
    pub(super) columns: &'a [TableColumn],
    pub(super) buffers: &'a mut EditBuffers,
    pub(super) cursor: &'a mut CellCursor,
    pub(super) actions: &'a mut Actions,
    /// The place of the cell that the cursor has come to.
    pub(super) entered: Option<Rect>,
}

impl PrescriptionTable<'_> {
    pub(super) fn show(mut self, ui: &mut Ui) {
        let columns = self.columns;
        ui.spacing_mut().item_spacing = vec2(0.0, 0.0);
        let mut places = Vec::new();
        let area = ScrollArea::horizontal().auto_shrink([false, false]).show(ui, |ui| {
            let mut table = TableBuilder::new(ui)
                .id_salt(columns.len())
                .resizable(true)
                .animate_scrolling(false)
                .auto_shrink([false, false])
                .cell_layout(Layout::left_to_right(Align::Center))
                .column(egui_extras::Column::exact(row_numbers::WIDTH));
            for column in columns {
                table = table.column(column.width());
            }
            if let Some(row) = self.cursor.scroll_target() {
                table = table.scroll_to_row(row, None);
            }
            let rows = self.lens.surfaces.len() + 2;
            let body = table.header(ROW, |row| header(row, columns)).body(|body| {
                body.rows(ROW, rows, |row| places.extend(self.row(row)));
            });
            if let Some(cell) = self.entered {
                // Beside the numbers of the rows, which would hide it. Inside the table that would scroll
                // its rows alone.
                ui.scroll_to_rect(cell.with_min_x(cell.left() - row_numbers::WIDTH), None);
            }
            body
        });
        let column = NumberColumn {
            viewport: area.inner_rect,
            rows: area.inner.inner_rect.y_range(),
            is_scrolled: area.state.clamped_offset().x > 0.0,
        };
        self.row_numbers(ui, &column, &places);
    }

    pub(super) fn grid(&self) -> CellGrid<'_> {
        CellGrid { columns: self.columns, lens: &self.lens }
    }

    /// Shows a row but for its number, and returns the place of that.
    fn row(&mut self, mut row: TableRow<'_, '_>) -> Option<RowPlace> {
        let index = row.index();
        let surface = index.checked_sub(1).filter(|surface| *surface < self.lens.surfaces.len());
        let chosen = surface.is_some() && surface == self.view.selected;
        row.set_selected(chosen);
        let mut number = Rect::NOTHING;
        row.col(|ui| number = ui.max_rect());
        for column in self.columns {
            row.col(|ui| {
                if chosen {
                    // Grey would not stand out from the selection.
                    ui.visuals_mut().weak_text_color = ui.visuals().override_text_color;
                }
                let tint =
                    surface.and_then(|surface| tint(ui, &self.lens.surfaces[surface].medium));
                if let Some(tint) = tint {
                    ui.painter().rect_filled(ui.max_rect(), 0.0, tint);
                }
                self.cell(ui, CellPlace::new(index, *column));
            });
        }
        // A row that only takes room has no place.
        number.is_finite().then(|| RowPlace { index, y: number.y_range() })
    }

    fn cell(&mut self, ui: &mut Ui, place: CellPlace) {
        if place.row > self.lens.surfaces.len() {
            self.image_cell(ui, place.column);
        } else if let Some(candidate) = &self.candidate {
            let text = self.shown_text(place, room_in(ui, place));
            candidate.cell(ui, place, (&text, self.shown_clear(place)), self.view.settings.zoom);
        } else if place.is_editable(&self.lens) {
            if self.cursor.is_in_range(self.grid(), place) {
                let fill = ui.visuals().selection.bg_fill.gamma_multiply(0.7);
                ui.painter().rect_filled(ui.max_rect(), 0.0, fill);
                self.range_border(ui, place);
            }
            self.editable_cell(ui, place);
        } else if place.column == TableColumn::Tolerances {
            self.tolerance_cell(ui, place);
        }
    }

    /// The half ranges of a surface, which are changed elsewhere.
    fn tolerance_cell(&self, ui: &mut Ui, place: CellPlace) {
        let text = place.text(&self.lens, self.view.settings.zoom, number::format_number);
        if text.is_empty() {
            return;
        }
        ui.add_space(MARGIN);
        let label = Label::new(RichText::new(&text).small()).truncate().sense(Sense::hover());
        let label = ui.add(label).on_hover_text(&text);
        let name = format!("{}: {text}", place.name(&self.lens, self.view.settings.zoom));
        label.widget_info(|| WidgetInfo::labeled(Role::Label, true, &name));
    }

    /// The border of the range, which stands out in the row that is selected too.
    fn range_border(&self, ui: &Ui, place: CellPlace) {
        let [left, right, top, bottom] = self.cursor.range_ends(self.grid(), place);
        let rect = ui.max_rect().shrink(0.5);
        let stroke = Stroke::new(1.0, ui.visuals().strong_text_color());
        let painter = ui.painter();
        for (ends, x) in [(left, rect.left()), (right, rect.right())] {
            if ends {
                painter.vline(x, rect.y_range(), stroke);
            }
        }
        for (ends, y) in [(top, rect.top()), (bottom, rect.bottom())] {
            if ends {
                painter.hline(rect.x_range(), y, stroke);
            }
        }
    }

    fn image_cell(&self, ui: &mut Ui, column: TableColumn) {
        match column {
            TableColumn::Radius => read_only_cell(ui, "Infinity", badge::WIDTH),
            TableColumn::SemiDiameter => {
                let reached = self.clear_semi_diameter(self.lens.surfaces.len());
                let text = reached.map(|height| format!("{height:.3}")).unwrap_or_default();
                read_only_cell(ui, &text, badge::WIDTH);
            }
            _ => {}
        }
    }

    /// The text of a cell as it is shown, with numbers that fit into some characters: a solved gap as
    /// it was traced.
    pub(super) fn shown_text(&self, place: CellPlace, room: usize) -> String {
        let show = |value| number::format_within(value, room);
        let text = place.text(&self.lens, self.view.settings.zoom, show);
        let last = place.surface().is_some_and(|s| s + 1 == self.lens.surfaces.len());
        if place.column == TableColumn::Thickness && last && self.lens.image_solve.is_some() {
            let gap = place.surface().and_then(|surface| self.traced_gap(surface));
            return gap.map_or(text, show);
        }
        text
    }

    /// The gap behind a surface as it was traced.
    fn traced_gap(&self, surface: usize) -> Option<f64> {
        let model = &self.analyses?.ray_model.value;
        model.channels[model.primary].system.surfaces.get(surface).map(|s| s.thickness)
    }

    /// The semi-diameter that the rays of all fields and zoom positions need at a surface, in mm.
    pub(super) fn clear_semi_diameter(&self, surface: usize) -> Option<f64> {
        let heights = &self.analyses?.semi_diameters.value;
        heights.get(surface).copied().filter(|_| heights.len() == self.lens.surfaces.len() + 1)
    }
}

/// The field of the first radius.
pub(super) fn first_radius_field() -> Id {
    CellPlace::new(1, TableColumn::Radius).id()
}

/// The characters of a number that fit into a cell.
pub(super) fn room_in(ui: &Ui, place: CellPlace) -> usize {
    let badge = if place.column.has_badge() { badge::WIDTH } else { 0.0 };
    let width = ui.max_rect().width() - badge - 2.0 * MARGIN;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let characters = (width / CHARACTER) as usize;
    characters.max(MIN_ROOM)
}

fn header(mut row: TableRow<'_, '_>, columns: &[TableColumn]) {
    row.col(|_| {});
    for column in columns {
        row.col(|ui| {
            let badge_width = if column.has_badge() { badge::WIDTH } else { 0.0 };
            let layout = if column.is_text() {
                Layout::left_to_right(Align::Center)
            } else {
                Layout::right_to_left(Align::Center)
            };
            ui.with_layout(layout, |ui| {
                ui.add_space(badge_width + MARGIN);
                ui.weak(column.title()).on_hover_text(column.hint());
            });
        });
    }
}

/// Shows a value that cannot be edited.
fn read_only_cell(ui: &mut Ui, text: &str, badge_width: f32) {
    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
        ui.add_space(badge_width + MARGIN);
        let label = Label::new(RichText::new(text).weak()).truncate().sense(Sense::hover());
        ui.add(label);
    });
}

/// The tint of a row: blue for glass, green for a mirror.
fn tint(ui: &Ui, medium: &Medium) -> Option<Color32> {
    let palette = Palette::for_visuals(ui.visuals());
    let [r, g, b, _] = match medium {
        Medium::Air => return None,
        Medium::Mirror => palette.mirror,
        Medium::Glass(_) | Medium::Model { .. } | Medium::Index(_) | Medium::Grin(_) => {
            palette.glass
        }
    };
    Some(color32([r, g, b, 30]))
}
