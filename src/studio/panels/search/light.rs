//! The share of its light that each field has to retain: one for all, or one for each.

use egui::{DragValue, Ui};

use crate::lens::{FieldPoint, Lens};
use crate::studio::panels::field_name;

/// One share for all fields, or one for each of them; more than nothing, 1 for as much as at the start.
pub(super) fn shares(ui: &mut Ui, light: &mut Vec<f64>, lens: &Lens) {
    let fields = common_fields(lens);
    match_length(light, fields.len());
    ui.vertical(|ui| {
        ui.horizontal(|ui| {
            if let [all] = &mut light[..] {
                share(
                    ui,
                    "Least light",
                    all,
                    "Every field retains at least this share of its \
                    light",
                );
            }
            ui.weak("of the light at the start");
        });
        if fields.len() > 1 {
            let mut each = light.len() > 1;
            let hint = "Set the share of each field separately";
            if ui.checkbox(&mut each, "each field separately").on_hover_text(hint).changed() {
                *light = if each { vec![light[0]; fields.len()] } else { vec![mean(light)] };
            }
        }
        if light.len() > 1 {
            ui.horizontal_wrapped(|ui| field_shares(ui, light, &fields, lens));
        }
    });
}

/// As many shares as a lens has fields, or one, as a search wants them.
pub(super) fn matching_fields(mut light: Vec<f64>, lens: &Lens) -> Vec<f64> {
    match_length(&mut light, common_fields(lens).len());
    light
}

fn field_shares(ui: &mut Ui, light: &mut [f64], fields: &[FieldPoint], lens: &Lens) {
    for (value, field) in light.iter_mut().zip(fields) {
        let name = field_name(lens.fields.kind, *field);
        share(
            ui,
            &format!("Least light at {name}"),
            value,
            "This field retains at least this \
            share of its light",
        );
        ui.weak(format!("at {name}"));
    }
}

fn share(ui: &mut Ui, name: &str, value: &mut f64, hint: &str) {
    let mut percent = 100.0 * *value;
    let drag = DragValue::new(&mut percent).range(0.1..=1000.0).speed(0.5).suffix(" %");
    let drag = ui.add(drag.max_decimals(1)).on_hover_text(hint);
    if drag.accessible_name(name).changed() {
        *value = percent / 100.0;
    }
}

/// The fields of a lens that has the same ones at all zoom positions; none of any other.
fn common_fields(lens: &Lens) -> Vec<FieldPoint> {
    let own = &lens.fields;
    let same = (0..lens.zoom_positions()).all(|zoom| lens.fields_at(zoom) == own);
    if same { own.values.clone() } else { Vec::new() }
}

/// Shares of a lens with another number of fields count for all alike.
fn match_length(light: &mut Vec<f64>, fields: usize) {
    if light.is_empty() || (light.len() > 1 && light.len() != fields) {
        *light = vec![mean(light)];
    }
}

fn mean(light: &[f64]) -> f64 {
    if light.is_empty() { 1.0 } else { light.iter().sum::<f64>() / light.len() as f64 }
}
