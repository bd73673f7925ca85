//! The table of glasses: a click on a title sorts, a click on a row replaces a glass.

use egui::{
    Align, Button, Label, Layout, RichText, ScrollArea, Sense, Shape, Stroke, Ui, pos2, vec2,
};
use egui_extras::{Column, TableBuilder, TableRow};

use super::list::{GlassColumn, GlassOrder, ListedGlass};
use crate::lens::glass::Glass;

/// The height of a row, in points.
const ROW: f32 = 18.0;

/// The actions of a person in the table in one frame.
#[derive(Debug, Default)]
pub(super) struct TableOutcome {
    /// The title that was clicked.
    pub(super) sorted: Option<GlassColumn>,
    /// The glass under the pointer.
    pub(super) pointed: Option<ListedGlass>,
    /// The glass that was clicked.
    pub(super) clicked: Option<ListedGlass>,
}

/// Shows glasses in an order; `present` is the glass of the surface, and is scrolled to if asked for.
pub(super) fn table(
    ui: &mut Ui,
    listed: &[ListedGlass],
    order: GlassOrder,
    (present, follows): (Option<&'static Glass>, bool),
) -> TableOutcome {
    let mut outcome = TableOutcome::default();
    let is_present = |listed: &ListedGlass| present.is_some_and(|glass| glass == listed.glass);
    ui.spacing_mut().item_spacing = vec2(6.0, 0.0);
    ScrollArea::horizontal().auto_shrink([false, false]).show(ui, |ui| {
        let mut table = TableBuilder::new(ui)
            .id_salt("glasses")
            .sense(Sense::click())
            .striped(true)
            .animate_scrolling(false)
            .auto_shrink([false, false])
            .cell_layout(Layout::left_to_right(Align::Center));
        for column in GlassColumn::SHOWN {
            table = table.column(Column::exact(width(column)).clip(true));
        }
        if let Some(row) = listed.iter().position(is_present).filter(|_| follows) {
            table = table.scroll_to_row(row, None);
        }
        table.header(ROW + 2.0, |row| header(row, order, &mut outcome)).body(|body| {
            body.rows(ROW, listed.len(), |row| {
                let listed = listed[row.index()];
                glass_row(row, listed, is_present(&listed), &mut outcome);
            });
        });
    });
    outcome
}

const fn width(column: GlassColumn) -> f32 {
    match column {
        GlassColumn::Name => 98.0,
        GlassColumn::Maker => 70.0,
        GlassColumn::Index | GlassColumn::Status => 58.0,
        GlassColumn::Partial => 52.0,
        _ => 46.0,
    }
}

fn layout(column: GlassColumn) -> Layout {
    if column.is_text() {
        Layout::left_to_right(Align::Center)
    } else {
        Layout::right_to_left(Align::Center)
    }
}

fn header(mut row: TableRow<'_, '_>, order: GlassOrder, outcome: &mut TableOutcome) {
    for column in GlassColumn::SHOWN {
        row.col(|ui| {
            ui.with_layout(layout(column), |ui| {
                let text = RichText::new(column.title()).small().strong();
                let title = ui.add(Button::new(text).frame(false));
                let title = title.accessible_name(format!("Sort by {}", column.title()));
                if title.on_hover_text(column.hint()).clicked() {
                    outcome.sorted = Some(column);
                }
                if order.column == column {
                    direction(ui, order.descending);
                }
            });
        });
    }
}

/// A triangle that points up for a growing order, else down.
fn direction(ui: &mut Ui, descending: bool) {
    let (rect, _) = ui.allocate_exact_size(vec2(7.0, 5.0), Sense::hover());
    let (tip, base) =
        if descending { (rect.bottom(), rect.top()) } else { (rect.top(), rect.bottom()) };
    let corners =
        vec![pos2(rect.left(), base), pos2(rect.right(), base), pos2(rect.center().x, tip)];
    let color = ui.visuals().strong_text_color();
    ui.painter().add(Shape::convex_polygon(corners, color, Stroke::NONE));
}

fn glass_row(
    mut row: TableRow<'_, '_>,
    listed: ListedGlass,
    present: bool,
    outcome: &mut TableOutcome,
) {
    row.set_selected(present);
    let mut clicked = false;
    for column in GlassColumn::SHOWN {
        row.col(|ui| {
            ui.with_layout(layout(column), |ui| {
                let text = RichText::new(listed.text(column)).small();
                if column == GlassColumn::Name {
                    let name = ui.add(Button::new(text).frame(false).truncate());
                    clicked |= name.accessible_name(listed.glass.full_name()).clicked();
                } else {
                    ui.add(Label::new(text).truncate().selectable(false));
                }
            });
        });
    }
    let response = row.response();
    if response.hovered() || response.contains_pointer() {
        outcome.pointed = Some(listed);
    }
    if clicked || response.clicked() {
        outcome.clicked = Some(listed);
    }
}
