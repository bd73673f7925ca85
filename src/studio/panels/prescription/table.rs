//! The table of the prescription.

use std::sync::Arc;

use egui::{
    Align, Button, Color32, Id, Key, Layout, Modifiers, Popup, PopupCloseBehavior, Response,
    RichText, ScrollArea, Ui, vec2,
};
use egui_extras::{Column as Width, TableBuilder, TableRow};

use super::badge::{self, ParameterStatus};
use super::{actions, glass};
use crate::lens::{Edit, Lens, Medium, Object, Parameter, Quantity, apply_edit};
use crate::math::expression::evaluate;
use crate::session::{Command, SessionView};
use crate::studio::actions::Actions;
use crate::studio::menu::show_items;
use crate::studio::menu_items::element_items;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};
use crate::studio::panels::design_results;
use crate::studio::text::capitalize;
use crate::studio::text_input::{EditBuffers, TextInput as Cell};

/// The height of a row, in points.
const ROW: f32 = 21.0;

/// A column of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum TableColumn {
    Radius,
    Thickness,
    Glass,
    SemiDiameter,
    Conic,
    Asphere(usize),
    Comment,
}

impl TableColumn {
    const fn title(self) -> &'static str {
        match self {
            Self::Radius => "Radius",
            Self::Thickness => "Thickness",
            Self::Glass => "Glass",
            Self::SemiDiameter => "Semi-diameter",
            Self::Conic => "Conic",
            Self::Asphere(0) => "r⁴",
            Self::Asphere(1) => "r⁶",
            Self::Asphere(2) => "r⁸",
            Self::Asphere(3) => "r¹⁰",
            Self::Asphere(4) => "r¹²",
            Self::Asphere(5) => "r¹⁴",
            Self::Asphere(_) => "r¹⁶",
            Self::Comment => "Remark",
        }
    }

    const fn hint(self) -> &'static str {
        match self {
            Self::Radius => {
                "Radius of curvature in mm, positive where the centre lies to the right; \
                 Infinity for a plane. The optimizer works on the curvature 1/R. \
                 Arithmetic starts from the old value: *2, /2, +5, - 3."
            }
            Self::Thickness => "Distance along the axis to the next surface, in mm",
            Self::Glass => "What fills the gap behind the surface; empty for air",
            Self::SemiDiameter => {
                "Rays that meet the surface farther from the axis than this are clipped here, \
                 in mm; empty where nothing is clipped. Most programs do not clip at a \
                 semi-diameter: an export says so."
            }
            Self::Conic => "Conic constant: 0 a sphere, -1 a paraboloid",
            Self::Asphere(_) => "Coefficient of the even asphere, in powers of mm",
            Self::Comment => "A remark on the surface",
        }
    }

    fn width(self) -> Width {
        match self {
            Self::Radius => Width::initial(94.0).at_least(70.0),
            Self::Thickness => Width::initial(90.0).at_least(70.0),
            Self::Glass => Width::initial(118.0).at_least(70.0),
            Self::SemiDiameter => Width::initial(106.0).at_least(70.0),
            Self::Conic => Width::initial(64.0).at_least(50.0),
            Self::Asphere(_) => Width::initial(112.0).at_least(60.0),
            Self::Comment => Width::remainder().at_least(60.0).clip(true),
        }
    }

    const fn has_badge(self) -> bool {
        !matches!(self, Self::Glass | Self::Comment)
    }

    /// The number in a row of this column; `None` for text.
    fn parameter(self, view: &SessionView, surface: usize) -> Option<Parameter> {
        let quantity = match self {
            Self::Radius => Quantity::Curvature,
            Self::Thickness => thickness_at(&view.lens, surface, view.settings.zoom),
            Self::SemiDiameter => Quantity::SemiDiameter,
            Self::Conic => Quantity::Conic,
            Self::Asphere(term) => Quantity::Asphere(term),
            Self::Glass | Self::Comment => return None,
        };
        Some(Parameter::new(surface, quantity))
    }
}

/// The gap as it is at a zoom position: its own number where it has one there.
fn thickness_at(lens: &Lens, surface: usize, zoom: usize) -> Quantity {
    let own = lens.zoom.get(zoom).is_some_and(|position| {
        position.thicknesses.iter().any(|thickness| thickness.surface == surface)
    });
    if own { Quantity::ZoomThickness(zoom) } else { Quantity::Thickness }
}

/// The name of a number.
pub(super) fn parameter_name(parameter: Parameter) -> String {
    let what = match parameter.quantity {
        Quantity::Curvature => "Radius",
        Quantity::Thickness | Quantity::ZoomThickness(_) => "Thickness",
        Quantity::SemiDiameter => "Semi-diameter",
        Quantity::Conic => "Conic",
        Quantity::Index => "Index",
        Quantity::Grin(_) => "Gradient",
        Quantity::Asphere(term) => TableColumn::Asphere(term).title(),
    };
    format!("{what} of surface {}", parameter.surface + 1)
}

/// The table for one frame.
pub(super) struct PrescriptionTable<'a> {
    pub(super) view: &'a SessionView,
    pub(super) buffers: &'a mut EditBuffers,
    pub(super) actions: &'a mut Actions,
}

impl PrescriptionTable<'_> {
    pub(super) fn show(mut self, ui: &mut Ui) {
        let columns = columns(&self.view.lens);
        ui.spacing_mut().item_spacing = vec2(0.0, 0.0);
        ScrollArea::horizontal().auto_shrink([false, false]).show(ui, |ui| {
            let mut table = TableBuilder::new(ui)
                .id_salt(columns.len())
                .resizable(true)
                .auto_shrink([false, false])
                .cell_layout(Layout::left_to_right(Align::Center))
                .column(Width::exact(62.0));
            for column in &columns {
                table = table.column(column.width());
            }
            let rows = self.view.lens.surfaces.len() + 2;
            table.header(ROW, |row| header(row, &columns)).body(|body| {
                body.rows(ROW, rows, |row| self.row(row, &columns));
            });
        });
    }

    fn row(&mut self, mut row: TableRow<'_, '_>, columns: &[TableColumn]) {
        let index = row.index();
        if index == 0 {
            self.object_row(&mut row, columns);
        } else if index > self.view.lens.surfaces.len() {
            self.image_row(&mut row, columns);
        } else {
            self.surface_row(&mut row, index - 1, columns);
        }
    }

    fn object_row(&mut self, row: &mut TableRow<'_, '_>, columns: &[TableColumn]) {
        row.col(|ui| {
            row_name(ui, "OBJ").on_hover_text("The object: row 0");
        });
        for column in columns {
            row.col(|ui| match column {
                TableColumn::Thickness => self.object_distance_cell(ui),
                TableColumn::Glass => self.object_medium_cell(ui),
                _ => {}
            });
        }
    }

    fn image_row(&self, row: &mut TableRow<'_, '_>, columns: &[TableColumn]) {
        row.col(|ui| {
            row_name(ui, "IMA").on_hover_text("The image plane");
        });
        for column in columns {
            row.col(|ui| match column {
                TableColumn::Radius => read_only_cell(ui, "Infinity", badge::WIDTH),
                TableColumn::SemiDiameter => {
                    let reached = self.reached_text(self.view.lens.surfaces.len());
                    read_only_cell(ui, &reached, badge::WIDTH);
                }
                _ => {}
            });
        }
    }

    fn surface_row(&mut self, row: &mut TableRow<'_, '_>, surface: usize, columns: &[TableColumn]) {
        row.set_selected(self.view.selected == Some(surface));
        row.col(|ui| self.surface_name(ui, surface));
        for column in columns {
            row.col(|ui| {
                if let Some(tint) = tint(ui, &self.view.lens.surfaces[surface].medium) {
                    ui.painter().rect_filled(ui.max_rect(), 0.0, tint);
                }
                self.cell(ui, *column, surface);
            });
        }
    }

    fn cell(&mut self, ui: &mut Ui, column: TableColumn, surface: usize) {
        match column {
            TableColumn::Glass => self.glass_cell(ui, surface),
            TableColumn::Comment => self.comment_cell(ui, surface),
            _ => self.number_cell(ui, column, surface),
        }
    }

    fn surface_name(&mut self, ui: &mut Ui, surface: usize) {
        let stop = self.view.lens.surfaces[surface].stop;
        let text = if stop { format!("{} STO", surface + 1) } else { (surface + 1).to_string() };
        let text = if stop { RichText::new(text).strong() } else { RichText::new(text) };
        let chosen = self.view.selected == Some(surface);
        let label = ui.selectable_label(chosen, text).accessible_name(row_label(surface));
        if label.clicked() || label.secondary_clicked() {
            self.actions.push(Command::Select(Some(surface)));
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
            let edit = action.edit(&self.view.lens, surface);
            let button = Button::new(action.title());
            if ui.add_enabled(edit.is_some(), button).on_hover_text(action.hint()).clicked() {
                self.actions.extend(edit);
                ui.close();
            }
        }
        ui.menu_button("Element", |ui| {
            let items = element_items(&self.view.lens, Some(surface));
            show_items(ui, 260.0, items, self.actions);
        });
        ui.separator();
        let hyper = self.view.lens.surfaces[surface].hyperhemisphere;
        if ui.selectable_label(hyper, "Hyper-hemisphere").clicked() {
            self.actions.push(Edit::SetHyperhemisphere { surface, hyper: !hyper });
            ui.close();
        }
    }

    fn number_cell(&mut self, ui: &mut Ui, column: TableColumn, surface: usize) {
        let Some(parameter) = column.parameter(self.view, surface) else { return };
        let limit = column == TableColumn::SemiDiameter;
        let (name, shown) = (parameter_name(parameter), self.value_text(parameter));
        let hint = if limit { self.reached_text(surface) } else { String::new() };
        let cell = Cell { hint: &hint, ..Cell::in_table(&name, &shown, Align::Max) };
        let place = (column, surface);
        let lens = Arc::clone(&self.view.lens);
        let response = self.text_cell(ui, place, cell, |text| typed_edit(&lens, parameter, text));
        // A rim that is not written has nothing to vary.
        if self.view.lens.get(parameter).is_some() || !limit {
            badge::show(ui, &self.view.lens, parameter, self.buffers, self.actions);
            self.toggle_by_key(ui, &response, parameter);
        }
        if limit {
            response.on_hover_text(column.hint());
        }
    }

    /// The text of a number cell: the radius for a curvature, the solved gap if there is an image
    /// solve.
    fn value_text(&self, parameter: Parameter) -> String {
        let value = self.view.lens.get(parameter);
        match parameter.quantity {
            Quantity::Curvature => number::format_number(number::radius(value.unwrap_or(0.0))),
            Quantity::SemiDiameter => value.map(number::format_number).unwrap_or_default(),
            _ => {
                let solved = matches!(
                    ParameterStatus::of(&self.view.lens, parameter),
                    ParameterStatus::ImageSolve(_)
                );
                let gap = solved.then(|| self.traced_gap(parameter.surface)).flatten();
                number::format_number(gap.or(value).unwrap_or(0.0))
            }
        }
    }

    /// The gap behind a surface as it was traced.
    fn traced_gap(&self, surface: usize) -> Option<f64> {
        let model = &design_results(self.view)?.ray_model.value;
        model.channels[model.primary].system.surfaces.get(surface).map(|s| s.thickness)
    }

    /// The largest height at which the drawn rays meet a surface.
    fn reached_text(&self, surface: usize) -> String {
        let numbers = design_results(self.view).filter(|_| self.view.is_current());
        let reached = numbers.and_then(|n| n.layout.value.ray_heights.get(surface).copied());
        reached.map(|height| format!("{height:.3}")).unwrap_or_default()
    }

    fn toggle_by_key(&mut self, ui: &Ui, field: &Response, parameter: Parameter) {
        let keys = Modifiers::COMMAND | Modifiers::SHIFT;
        if field.has_focus() && ui.input_mut(|input| input.consume_key(keys, Key::V)) {
            let decides = ParameterStatus::of(&self.view.lens, parameter);
            self.actions.push(badge::toggle_edit(decides, parameter));
        }
    }

    fn glass_cell(&mut self, ui: &mut Ui, surface: usize) {
        let medium = &self.view.lens.surfaces[surface].medium;
        let (name, shown) =
            (format!("Glass of surface {}", surface + 1), glass::format_medium(medium));
        let cell = Cell::in_table(&name, &shown, Align::Min);
        let edit = move |text: &str| Edit::SetMedium { surface, medium: glass::parse_medium(text) };
        let field = self.text_cell(ui, (TableColumn::Glass, surface), cell, |text| Ok(edit(text)));
        self.suggest_glasses(&field, edit);
        field.on_hover_text(glass::describe_medium(medium));
    }

    /// Proposes glasses below a cell into which a name is typed.
    fn suggest_glasses(&mut self, field: &Response, edit: impl Fn(&str) -> Edit) {
        let typing = self.buffers.text(field.id).filter(|_| field.has_focus());
        let proposals = typing.map(glass::suggestions).unwrap_or_default();
        if proposals.is_empty() {
            return;
        }
        let popup = Popup::from_response(field).close_behavior(PopupCloseBehavior::IgnoreClicks);
        popup.show(|ui| {
            for name in proposals {
                // Taken as the button goes down: its release comes after the typing has ended.
                if ui.selectable_label(false, &name).is_pointer_button_down_on() {
                    self.buffers.accept(field.id);
                    self.actions.push(edit(&name));
                }
            }
        });
    }

    fn comment_cell(&mut self, ui: &mut Ui, surface: usize) {
        let shown = self.view.lens.surfaces[surface].comment.clone();
        let name = format!("Remark on surface {}", surface + 1);
        let cell = Cell::in_table(&name, &shown, Align::Min);
        let edit = |text: &str| Ok(Edit::SetComment { surface, text: text.to_owned() });
        self.text_cell(ui, (TableColumn::Comment, surface), cell, edit);
    }

    fn object_distance_cell(&mut self, ui: &mut Ui) {
        let old = match self.view.lens.object {
            Object::Infinity => f64::INFINITY,
            Object::Finite(distance) => distance,
        };
        let shown = number::format_number(old);
        let cell = Cell::in_table("Object distance", &shown, Align::Max);
        let object = |distance: f64| {
            if distance.is_infinite() { Object::Infinity } else { Object::Finite(distance) }
        };
        let edit = |text: &str| {
            let distance = evaluate(text, old).map_err(|why| why.to_string())?;
            Ok(Edit::SetObject(object(distance)))
        };
        self.text_cell(ui, (TableColumn::Thickness, OBJECT), cell, edit);
    }

    fn object_medium_cell(&mut self, ui: &mut Ui) {
        let shown = glass::format_medium(&self.view.lens.object_medium);
        let cell = Cell::in_table("Medium of the object", &shown, Align::Min);
        let edit = |text: &str| Ok(Edit::SetObjectMedium(glass::parse_medium(text)));
        self.text_cell(ui, (TableColumn::Glass, OBJECT), cell, edit);
    }

    /// Shows a cell: its text becomes an edit, if the lens stays valid.
    fn text_cell(
        &mut self,
        ui: &mut Ui,
        (column, row): (TableColumn, usize),
        cell: Cell<'_>,
        edit: impl Fn(&str) -> Result<Edit, String>,
    ) -> Response {
        let id = cell_id(column, row);
        let badge_width = if column.has_badge() { badge::WIDTH } else { 0.0 };
        let size = vec2(ui.available_width() - badge_width, ui.available_height());
        let layout = Layout::left_to_right(Align::Center);
        let entry = ui.allocate_ui_with_layout(size, layout, |ui| self.buffers.show(ui, id, cell));
        let entry = entry.inner;
        // Consumed, so that the next cell does not end its typing by the same key.
        let left = entry.response.lost_focus();
        let enter = left && ui.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Enter));
        let fits = match entry.submitted {
            Some(text) => self.try_edit(id, edit(&text)),
            None => true,
        };
        if enter {
            let below = if row == OBJECT { 0 } else { row + 1 };
            let next = if fits { cell_id(column, below) } else { id };
            ui.memory_mut(|memory| memory.request_focus(next));
        }
        entry.response
    }

    /// Asks for an edit if the lens stays valid; otherwise the cell shows the reason.
    fn try_edit(&mut self, id: Id, edit: Result<Edit, String>) -> bool {
        let tried = edit.and_then(|edit| {
            let lens = apply_edit(&self.view.lens, &edit);
            lens.map(|_| edit).map_err(|why| why.to_string())
        });
        match tried {
            Ok(edit) => {
                self.buffers.accept(id);
                self.actions.extend([Command::Edit(edit), Command::CommitEdit]);
                true
            }
            Err(why) => {
                self.buffers.reject(id, capitalize(&why));
                false
            }
        }
    }
}

/// The row of the object, in place of the index of a surface.
const OBJECT: usize = usize::MAX;

/// The field of the first radius.
pub(super) fn first_radius_field() -> Id {
    cell_id(TableColumn::Radius, 0)
}

fn cell_id(column: TableColumn, row: usize) -> Id {
    Id::unique(("prescription cell", column, row))
}

/// The edit of a text that was typed into the cell of a number: a curvature is typed as a radius,
/// and an empty or infinite semi-diameter removes the limit.
fn typed_edit(lens: &Lens, parameter: Parameter, text: &str) -> Result<Edit, String> {
    let (surface, value) = (parameter.surface, lens.get(parameter));
    let number = |old: f64| evaluate(text, old).map_err(|why| why.to_string());
    let number_or_infinity =
        |old: f64| if text.trim().is_empty() { Ok(f64::INFINITY) } else { number(old) };
    match parameter.quantity {
        Quantity::Curvature => {
            let radius = number_or_infinity(number::radius(value.unwrap_or(0.0)))?;
            Ok(Edit::set_radius(surface, radius))
        }
        Quantity::SemiDiameter => {
            let size = number_or_infinity(value.unwrap_or(f64::INFINITY))?;
            Ok(Edit::SetSemiDiameter { surface, value: (size != f64::INFINITY).then_some(size) })
        }
        _ => Ok(Edit::Set { parameter, value: number(value.unwrap_or(0.0))? }),
    }
}

/// The columns of a lens: asphere columns only if it has aspheres.
fn columns(lens: &Lens) -> Vec<TableColumn> {
    let mut columns = vec![
        TableColumn::Radius,
        TableColumn::Thickness,
        TableColumn::Glass,
        TableColumn::SemiDiameter,
        TableColumn::Conic,
    ];
    let terms = lens.surfaces.iter().map(|row| row.asphere.len()).max().unwrap_or(0);
    columns.extend((0..terms).map(TableColumn::Asphere));
    columns.push(TableColumn::Comment);
    columns
}

fn header(mut row: TableRow<'_, '_>, columns: &[TableColumn]) {
    row.col(|ui| {
        ui.add_space(6.0);
        ui.weak("Surf").on_hover_text("Surface number: the object is 0, the first surface 1");
    });
    for column in columns {
        row.col(|ui| {
            let badge_width = if column.has_badge() { badge::WIDTH } else { 0.0 };
            let left = matches!(column, TableColumn::Glass | TableColumn::Comment);
            let layout = if left {
                Layout::left_to_right(Align::Center)
            } else {
                Layout::right_to_left(Align::Center)
            };
            ui.with_layout(layout, |ui| {
                ui.add_space(badge_width + 5.0);
                ui.weak(column.title()).on_hover_text(column.hint());
            });
        });
    }
}

fn row_name(ui: &mut Ui, text: &str) -> Response {
    ui.add_space(6.0);
    ui.weak(text)
}

/// The accessible name of the number of a row.
fn row_label(surface: usize) -> String {
    format!("Row of surface {}", surface + 1)
}

/// Shows a value that cannot be edited.
fn read_only_cell(ui: &mut Ui, text: &str, badge_width: f32) {
    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
        ui.add_space(badge_width + 5.0);
        ui.weak(text);
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
