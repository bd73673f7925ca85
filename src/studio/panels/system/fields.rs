//! The field points.

use egui::{Button, ComboBox, DragValue, Grid, Ui};

use super::beam::own_positions;
use crate::lens::{Edit, FieldKind, FieldPoint, Fields, Object};
use crate::session::{Analyses, SessionView};
use crate::studio::form::named_list;
use crate::studio::form::number_field;
use crate::studio::panels::design_results;
use crate::studio::panels::edit_form::{EditForm, heading};

/// The kinds of fields with their titles and units.
const KINDS: [(FieldKind, &str, &str); 3] = [
    (FieldKind::Angle, "Angle", "°"),
    (FieldKind::ObjectHeight, "Object height", "mm"),
    (FieldKind::ImageHeight, "Paraxial image height", "mm"),
];
/// The name of a number of a field, its value and width, and what sets it.
type FieldColumn = (&'static str, (f64, f32), fn(&mut FieldPoint, f64));
/// The width of a coordinate of seven digits with its sign, in points.
const NUMBER: f32 = 78.0;
/// The width of a weight, in points.
const WEIGHT: f32 = 48.0;

/// The number of field points that can be made at once.
const MAX_STEPS: usize = 20;

/// The field points that a button makes.
#[derive(Debug, Clone, Copy)]
pub(super) struct EqualAreaSteps {
    count: usize,
    /// The largest one; `None` for that of the lens.
    largest: Option<f64>,
}

impl Default for EqualAreaSteps {
    fn default() -> Self {
        Self { count: 3, largest: None }
    }
}

/// Shows the group of fields.
pub(super) fn ui(ui: &mut Ui, form: &mut EditForm<'_>, steps: &mut EqualAreaSteps) {
    heading(ui, "Fields");
    ui.horizontal(|ui| {
        kind(ui, form);
        add_button(ui, form);
    });
    table(ui, form);
    equal_area(ui, form, steps);
    let own = own_positions(&form.view.lens, |position| position.fields.is_some());
    if !own.is_empty() {
        ui.weak(format!("{own} of its own, see Zoom positions"));
    }
}

fn kind(ui: &mut Ui, form: &mut EditForm<'_>) {
    let lens = &form.view.lens;
    let chosen = lens.fields.kind;
    let title = KINDS.iter().find(|(kind, ..)| *kind == chosen).map_or("", |(_, title, _)| title);
    let combo = ComboBox::from_id_salt("field kind").selected_text(title).width(150.0);
    let shown = combo.show_ui(ui, |ui| {
        for (kind, title, _) in KINDS {
            let possible = kind != FieldKind::ObjectHeight || lens.object != Object::Infinity;
            let item = ui.add_enabled_ui(possible, |ui| ui.selectable_label(kind == chosen, title));
            let item = item.inner.on_disabled_hover_text("The object is at infinity.");
            if item.clicked() && kind != chosen {
                form.actions.push(Edit::SetFields(converted(form.view, kind)));
            }
        }
    });
    named_list(ui, shown, "Field kind");
}

/// The fields as another quantity, by first-order optics where the lens has it.
fn converted(view: &SessionView, kind: FieldKind) -> Fields {
    let lens = &view.lens;
    let first = design_results(view).map(Analyses::first_order);
    let efl = first.and_then(|first| first.efl);
    let magnification = first.and_then(|first| first.magnification);
    let distance = match lens.object {
        Object::Infinity => None,
        Object::Finite(distance) => Some(distance),
    };
    // The tangent of the angle, or the height in the object, that belongs to an image height of 1.
    let per_image_height = match (distance, efl, magnification) {
        (None, Some(f), _) => Some(1.0 / f),
        (Some(_), _, Some(m)) => Some(1.0 / m),
        _ => None,
    };
    let convert = |value: f64| -> Option<f64> {
        // Tangents for an object at infinity, object heights for one at a distance.
        let object = match (lens.fields.kind, distance) {
            (FieldKind::Angle, None) => value.to_radians().tan(),
            (FieldKind::Angle, Some(d)) => value.to_radians().tan() * d,
            (FieldKind::ObjectHeight, _) => value,
            (FieldKind::ImageHeight, _) => value * per_image_height?.abs(),
        };
        Some(match (kind, distance) {
            (FieldKind::Angle, None) => object.atan().to_degrees(),
            (FieldKind::Angle, Some(d)) => (object / d).atan().to_degrees(),
            (FieldKind::ObjectHeight, _) => object,
            (FieldKind::ImageHeight, _) => object / per_image_height?.abs(),
        })
    };
    let values = lens.fields.values.iter().map(|field| {
        let point = convert(field.x).zip(convert(field.y));
        point.map_or(*field, |(x, y)| FieldPoint { x, y, ..*field })
    });
    Fields { kind, values: values.collect() }
}

fn table(ui: &mut Ui, form: &mut EditForm<'_>) {
    let fields = form.view.lens.fields.clone();
    let unit = KINDS.iter().find(|(kind, ..)| *kind == fields.kind).map_or("", |(.., unit)| unit);
    Grid::new("fields").num_columns(5).min_col_width(8.0).spacing([6.0, 3.0]).show(ui, |ui| {
        for heading in ["", &format!("x, {unit}"), &format!("y, {unit}"), "Weight", ""] {
            ui.weak(heading);
        }
        ui.end_row();
        for (i, field) in fields.values.iter().enumerate() {
            let numbers: [FieldColumn; 3] = [
                ("x", (field.x, NUMBER), |field, value| field.x = value),
                ("y", (field.y, NUMBER), |field, value| field.y = value),
                ("weight", (field.weight, WEIGHT), |field, value| field.weight = value),
            ];
            ui.weak((i + 1).to_string());
            for (what, value, set) in numbers {
                let name = format!("Field {} {what}", i + 1);
                form.number(ui, &name, value, |value| {
                    let mut changed = fields.clone();
                    set(&mut changed.values[i], value);
                    Edit::SetFields(changed)
                });
            }
            if delete_button(ui, &format!("Delete field {}", i + 1), fields.values.len() > 1) {
                let mut changed = fields.clone();
                changed.values.remove(i);
                form.actions.push(Edit::SetFields(changed));
            }
            ui.end_row();
        }
    });
}

/// Shows a small button that deletes a row; true if it was pressed.
pub(super) fn delete_button(ui: &mut Ui, name: &str, enabled: bool) -> bool {
    let button = ui.add_enabled(enabled, Button::new("×").small()).accessible_name(name);
    button.on_hover_text(name).on_disabled_hover_text("The last one stays.").clicked()
}

fn add_button(ui: &mut Ui, form: &mut EditForm<'_>) {
    if ui.button("Add field").on_hover_text("Like the last one, to be changed").clicked() {
        let mut more = form.view.lens.fields.clone();
        let last = more.values.last().copied();
        more.values.push(last.unwrap_or(FieldPoint { x: 0.0, y: 0.0, weight: 1.0 }));
        form.actions.push(Edit::SetFields(more));
    }
}

/// Fields from the axis to a largest one in steps of equal area.
fn equal_area(ui: &mut Ui, form: &mut EditForm<'_>, steps: &mut EqualAreaSteps) {
    let fields = &form.view.lens.fields;
    let present = fields.values.iter().fold(0.0, |largest: f64, f| largest.max(f.x.hypot(f.y)));
    let mut largest = steps.largest.unwrap_or(present);
    ui.horizontal(|ui| {
        ui.label("Up to");
        let unit = if fields.kind == FieldKind::Angle { "°" } else { " mm" };
        if number_field(ui, "Largest equal-area field", &mut largest, unit).changed() {
            steps.largest = Some(largest);
        }
        ui.label("in");
        let count = DragValue::new(&mut steps.count).range(2..=MAX_STEPS).speed(0.05);
        ui.add(count).accessible_name("Number of equal-area fields");
        let make = ui.add_enabled(largest > 0.0, Button::new("equal-area steps"));
        let make = make.on_hover_text(
            "Replace all fields by so many, from the axis to this one along y, in rings of equal \
             area",
        );
        let make = make.on_disabled_hover_text("Type the largest field first.");
        if make.clicked() {
            let made = Fields::equal_area(fields.kind, largest, steps.count);
            form.actions.push(Edit::SetFields(made));
            steps.largest = None;
        }
    });
}
