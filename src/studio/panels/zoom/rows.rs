//! The rows of the table: names, focal lengths, and what varies: thicknesses, aperture, fields.

use egui::{Align, Button, Layout, RichText, ScrollArea, Ui};

use crate::lens::{
    Aperture, Edit, FieldKind, FieldPoint, Fields, Lens, Parameter, Quantity, SurfaceNumber,
    ZoomPosition,
};
use crate::paraxial::{Beam, first_order};
use crate::session::Command;
use crate::studio::actions::Actions;
use crate::studio::number;
use crate::studio::panels::edit_form::EditForm;
use crate::studio::panels::system::{aperture_kind, aperture_value, aperture_with_value};
use crate::studio::panels::zoom_name;
use crate::studio::text::capitalize;

/// The width of a number, in points.
const WIDTH: f32 = 82.0;
/// The largest share of the window's height that a list of a menu takes.
const MENU_SHARE: f32 = 0.7;

/// Shows the rows, a column for each position.
pub(super) fn ui(ui: &mut Ui, form: &mut EditForm<'_>) {
    header(ui, form);
    names(ui, form);
    let lens = form.view.lens.clone();
    for (surface, quantity) in varied_numbers(&lens) {
        number_row(ui, form, surface, quantity);
    }
    if lens.zoom.iter().any(|position| position.aperture.is_some()) {
        aperture(ui, form);
    }
    if lens.zoom.iter().any(|position| position.fields.is_some()) {
        fields(ui, form);
    }
    first_order_rows(ui, &lens);
}

/// The quantities of rows that vary.
fn varied_numbers(lens: &Lens) -> Vec<(usize, Quantity)> {
    let numbers = lens.zoom.iter().flat_map(|position| &position.numbers);
    let mut varied: Vec<_> = numbers.map(|own| (own.surface, own.quantity)).collect();
    varied.sort_unstable();
    varied.dedup();
    varied
}

/// The name of a number of a row, as in "thickness after surface 3", with its unit.
fn number_name(surface: usize, quantity: Quantity) -> (String, &'static str) {
    let number = SurfaceNumber::new(surface);
    match quantity {
        Quantity::Curvature => (format!("radius of surface {number}"), ", mm"),
        Quantity::Thickness | Quantity::SemiDiameter => {
            (format!("{quantity} surface {number}"), ", mm")
        }
        _ => (format!("{quantity} surface {number}"), ""),
    }
}

fn header(ui: &mut Ui, form: &mut EditForm<'_>) {
    ui.weak("Position");
    for zoom in 0..form.view.lens.zoom.len() {
        let shown = form.view.settings.zoom == zoom;
        let name = RichText::new((zoom + 1).to_string()).strong();
        let label = ui.selectable_label(shown, name);
        let label = label.accessible_name(format!("Show position {}", zoom + 1));
        if label.on_hover_text("Show this position in all panels").clicked() {
            form.actions.push(Command::ShowZoom(zoom));
        }
    }
    ui.end_row();
}

fn names(ui: &mut Ui, form: &mut EditForm<'_>) {
    ui.label("Name");
    let lens = form.view.lens.clone();
    for (at, position) in lens.zoom.iter().enumerate() {
        let name = format!("Name of position {}", at + 1);
        let renamed =
            |text: &str| ZoomPosition { name: text.trim().to_owned(), ..position.clone() };
        form.text(ui, &name, (&position.name, WIDTH), |text| {
            Ok(Edit::SetZoom { at, position: renamed(text) })
        })
        .on_hover_text(zoom_name(&lens, at));
    }
    ui.end_row();
}

fn number_row(ui: &mut Ui, form: &mut EditForm<'_>, surface: usize, quantity: Quantity) {
    let lens = form.view.lens.clone();
    let (name, unit) = number_name(surface, quantity);
    ui.label(format!("{}{unit}", capitalize(&name)));
    for zoom in 0..lens.zoom.len() {
        let cell = format!("{} at position {}", capitalize(&name), zoom + 1);
        let parameter = Parameter::at_zoom(surface, quantity, zoom);
        let value = lens.get(parameter).unwrap_or(0.0);
        if quantity == Quantity::Curvature {
            form.number(ui, &cell, (number::radius(value), WIDTH), |radius| {
                Edit::set_curvature(parameter, radius)
            });
        } else {
            form.number(ui, &cell, (value, WIDTH), |value| Edit::Set { parameter, value });
        }
    }
    same_button(ui, form, &format!("the {name}"), |lens| {
        let value = lens.get(Parameter::at_zoom(surface, quantity, 0));
        if let (Some(value), Some(row)) = (value, lens.surfaces.get_mut(surface)) {
            row.set(quantity, value);
        }
        for position in &mut lens.zoom {
            position.remove_number(surface, quantity);
        }
    });
    ui.end_row();
}

fn aperture(ui: &mut Ui, form: &mut EditForm<'_>) {
    let lens = form.view.lens.clone();
    ui.label(aperture_kind(lens.aperture).0);
    for (at, position) in lens.zoom.iter().enumerate() {
        let name = format!("Aperture of position {}", at + 1);
        let own = lens.aperture_at(at);
        let changed = |aperture: Aperture| Edit::SetZoom {
            at,
            position: ZoomPosition { aperture: Some(aperture), ..position.clone() },
        };
        form.number(ui, &name, (aperture_value(own), WIDTH), |value| {
            changed(aperture_with_value(own, value))
        })
        .on_hover_text(aperture_kind(own).0);
    }
    same_button(ui, form, "the aperture", |lens| {
        lens.zoom.iter_mut().for_each(|position| position.aperture = None);
    });
    ui.end_row();
}

fn fields(ui: &mut Ui, form: &mut EditForm<'_>) {
    let lens = form.view.lens.clone();
    let unit = if lens.fields.kind == FieldKind::Angle { "°" } else { "mm" };
    ui.label(format!("Largest field, {unit}"));
    for (at, position) in lens.zoom.iter().enumerate() {
        let name = format!("Largest field of position {}", at + 1);
        let fields = lens.fields_at(at);
        let largest = largest(fields);
        form.number(ui, &name, (largest, WIDTH), |value| {
            let fields = Some(scaled(fields, value, largest));
            Edit::SetZoom { at, position: ZoomPosition { fields, ..position.clone() } }
        })
        .on_hover_text("All fields of the position are scaled with it");
    }
    same_button(ui, form, "the fields", |lens| {
        lens.zoom.iter_mut().for_each(|position| position.fields = None);
    });
    ui.end_row();
}

fn largest(fields: &Fields) -> f64 {
    fields.values.iter().fold(0.0, |largest: f64, field| largest.max(field.x.hypot(field.y)))
}

/// The fields with another largest one; those that all lie on the axis become equal-area steps.
fn scaled(fields: &Fields, value: f64, largest: f64) -> Fields {
    if largest == 0.0 {
        return Fields::equal_area(fields.kind, value, fields.values.len());
    }
    let by = value / largest;
    let scale = |field: &FieldPoint| FieldPoint { x: by * field.x, y: by * field.y, ..*field };
    Fields { kind: fields.kind, values: fields.values.iter().map(scale).collect() }
}

/// Shows a button that makes something the same at all positions, as at the first one.
fn same_button(ui: &mut Ui, form: &mut EditForm<'_>, what: &str, change: impl Fn(&mut Lens)) {
    let button = ui.add(Button::new("×").small());
    let name = format!("Do not vary {what}");
    if button.accessible_name(&name).on_hover_text(&name).clicked() {
        let mut lens = Lens::clone(&form.view.lens);
        change(&mut lens);
        let varies = |parameter: &Parameter| {
            let Parameter { surface, quantity, zoom } = *parameter;
            zoom.is_none_or(|zoom| lens.is_own_at(zoom, surface, quantity))
        };
        let mut kept = lens.clone();
        kept.map_parameters(|parameter| Some(parameter).filter(varies));
        let title = format!("do not vary {what} between the zoom positions");
        form.actions.push(replaced(title, kept));
    }
}

/// The focal length and the f-number of each position, which cannot be typed.
fn first_order_rows(ui: &mut Ui, lens: &Lens) {
    let um = lens.wavelengths[lens.primary()].um;
    let data = |zoom: usize| {
        let system = lens.resolve(zoom, um).ok()?;
        first_order(&system, &Beam::for_lens(lens, zoom)).ok()
    };
    let data: Vec<_> = (0..lens.zoom.len()).map(data).collect();
    let text = |value: Option<f64>| {
        value.map_or_else(|| "none".to_owned(), |value| number::format_digits(value, 6))
    };
    for name in ["Focal length, mm", "Working f-number"] {
        ui.weak(name);
        for first in &data {
            let first = first.as_ref();
            let value = if name == "Working f-number" {
                first.and_then(|first| first.working_f_number)
            } else {
                first.and_then(|first| first.efl)
            };
            let layout = Layout::right_to_left(Align::Center);
            ui.with_layout(layout, |ui| ui.weak(text(value)));
        }
        ui.end_row();
    }
}

/// Shows the menu of everything that can vary between the positions and does not yet.
pub(super) fn vary_menu(ui: &mut Ui, lens: &Lens, actions: &mut Actions) {
    let of_rows = |quantity| (0..lens.surfaces.len()).map(|i| (i, quantity)).collect::<Vec<_>>();
    let menu = ui.menu_button("Vary", |ui| {
        ui.set_min_width(230.0);
        vary_submenu(ui, "Thickness", &of_rows(Quantity::Thickness), lens, actions);
        vary_submenu(ui, "Radius", &of_rows(Quantity::Curvature), lens, actions);
        ui.menu_button("Other number of a surface", |ui| {
            menu_list(ui, |ui| other_menus(ui, lens, actions));
        });
        ui.separator();
        let has = lens.zoom.iter().any(|position| position.aperture.is_some());
        vary_item(ui, ("Aperture", "aperture"), has, lens, actions, |lens, position| {
            position.aperture = Some(lens.aperture);
        });
        let has = lens.zoom.iter().any(|position| position.fields.is_some());
        vary_item(ui, ("Fields", "fields"), has, lens, actions, |lens, position| {
            position.fields = Some(lens.fields.clone());
        });
    });
    menu.response.on_hover_text("Choose what is different from position to position");
}

/// Shows a menu for each surface: all numbers in one list would be longer than the window.
fn other_menus(ui: &mut Ui, lens: &Lens, actions: &mut Actions) {
    for surface in 0..lens.surfaces.len() {
        let title = format!("Surface {}", SurfaceNumber::new(surface));
        vary_submenu(ui, &title, &other_numbers(lens, surface), lens, actions);
    }
}

/// Shows a menu of numbers of the rows.
fn vary_submenu(
    ui: &mut Ui,
    title: &str,
    numbers: &[(usize, Quantity)],
    lens: &Lens,
    actions: &mut Actions,
) {
    let varied = varied_numbers(lens);
    ui.menu_button(title, |ui| {
        menu_list(ui, |ui| {
            for number in numbers {
                vary_number(ui, *number, varied.contains(number), lens, actions);
            }
        });
    });
}

/// Shows the items of a menu, which scroll where the window is too low for them.
fn menu_list(ui: &mut Ui, show: impl FnOnce(&mut Ui)) {
    ui.set_min_width(230.0);
    let height = MENU_SHARE * ui.ctx().content_rect().height();
    ScrollArea::vertical().max_height(height).min_scrolled_height(height).show(ui, show);
}

fn vary_number(
    ui: &mut Ui,
    (surface, quantity): (usize, Quantity),
    varied: bool,
    lens: &Lens,
    actions: &mut Actions,
) {
    let (name, _) = number_name(surface, quantity);
    let comment = &lens.surfaces[surface].comment;
    let text = capitalize(&name);
    let text = if comment.is_empty() { text } else { format!("{text} ({comment})") };
    vary_item(ui, (&text, &name), varied, lens, actions, |lens, position| {
        if let Some(value) = lens.surfaces[surface].get(quantity) {
            position.set_number(surface, quantity, value);
        }
    });
}

/// The numbers of a row beside its radius and its thickness. The size of a stop that is the aperture
/// varies with that.
fn other_numbers(lens: &Lens, surface: usize) -> Vec<(usize, Quantity)> {
    let row = &lens.surfaces[surface];
    let is_aperture = row.stop && matches!(lens.aperture, Aperture::StopSemiDiameter(_));
    let is_other = |quantity: &Quantity| match quantity {
        Quantity::Curvature | Quantity::Thickness => false,
        Quantity::SemiDiameter => !is_aperture,
        _ => true,
    };
    let others = row.quantities().into_iter().filter(is_other);
    others.map(|quantity| (surface, quantity)).collect()
}

/// Shows an item with its text, and with the name of what it varies in an undo step.
fn vary_item(
    ui: &mut Ui,
    (text, name): (&str, &str),
    varied: bool,
    lens: &Lens,
    actions: &mut Actions,
    vary: impl Fn(&Lens, &mut ZoomPosition),
) {
    if ui.add_enabled(!varied, Button::new(text)).clicked() {
        let mut changed = lens.clone();
        changed.zoom.iter_mut().for_each(|position| vary(lens, position));
        let title = format!("vary the {name} between the zoom positions");
        actions.push(replaced(title, changed));
        ui.close();
    }
}

/// An edit of the zoom positions as one step with its own title: the lens is no other one by it.
fn replaced(title: String, lens: Lens) -> Edit {
    Edit::Sequence { title, edits: vec![Edit::Replace(Box::new(lens))] }
}
