//! Limits of a search: manufacturing, light of the fields, and settings of the descents.

use egui::{ComboBox, DragValue, Grid, RichText, Ui};

use super::setup::{drag, length, optional};
use crate::lens::{FieldPoint, Lens};
use crate::search::lens_landscape::{DescentSettings, SearchPlan};
use crate::search::{SearchMethod, SearchRules, SearchSettings, Termination};
use crate::studio::form::named_list;
use crate::studio::panels::field_name;

/// The limits of the factory.
pub(super) fn limits_section(ui: &mut Ui, rules: &mut SearchRules) {
    ui.collapsing("Manufacturing limits", |ui| {
        let text = "Of these and the limits of the merit function, the tighter ones hold.";
        ui.label(RichText::new(text).small().weak());
        Grid::new("factory").num_columns(2).spacing([8.0, 3.0]).show(ui, |ui| {
            let ranges = [
                ("Glass on the axis", "glass on the axis", &mut rules.glass_center),
                ("Air on the axis", "air on the axis", &mut rules.air_center),
            ];
            for (title, name, [min, max]) in ranges {
                ui.weak(title);
                ui.horizontal(|ui| {
                    length(ui, &format!("Least {name}"), min, 0.0..=*max);
                    ui.weak("to");
                    length(ui, &format!("Most {name}"), max, *min..=10_000.0);
                });
                ui.end_row();
            }
            let edges = [
                ("Glass at the rim", "Least glass at the rim", &mut rules.glass_edge),
                ("Air at the rim", "Least air at the rim", &mut rules.air_edge),
            ];
            for (title, name, value) in edges {
                ui.weak(title);
                length(ui, name, value, 0.0..=1000.0);
                ui.end_row();
            }
            ui.weak("Steepness");
            let hint = "The largest curvature times semi-diameter; 1 is a hemisphere";
            drag(ui, "Steepness", &mut rules.steepness, 0.01..=1.0, 0.005, hint);
            ui.end_row();
            optional_limits(ui, rules);
        });
    });
}

fn optional_limits(ui: &mut Ui, rules: &mut SearchRules) {
    let limits = [
        ("Semi-diameter", "Largest semi-diameter", &mut rules.semi_diameter, 50.0),
        ("Total track", "Longest track", &mut rules.track, 200.0),
        ("Back focus", "Shortest back focus", &mut rules.back_focus, 20.0),
    ];
    for (title, name, value, mut usual) in limits {
        ui.weak(title);
        let hint = "If it is not set, the value of the starting lens is the limit";
        let what = format!("{name} set");
        optional(ui, "set", value, &mut usual, hint, |ui, value| {
            length(ui, &what, value, 0.0..=100_000.0);
        });
        ui.end_row();
    }
}

const ENDS: [(Termination, &str, &str); 3] = [
    (Termination::Ratio, "by density", "Descents from bad lenses end early (algorithm 1)"),
    (Termination::Relative, "by improvement", RELATIVE),
    (Termination::Clocks, "by two clocks", "Competing clocks (section 4.4.1)"),
];

const RELATIVE: &str = "The rate of improvement counts, not the merit at the start";

/// The settings of the descents that the chosen method depends on.
pub(super) fn descents_section(ui: &mut Ui, plan: &mut SearchPlan) {
    ui.collapsing("Descents and retained lenses", |ui| {
        Grid::new("descents").num_columns(2).spacing([8.0, 3.0]).show(ui, |ui| {
            let settings = &mut plan.settings;
            if settings.method == SearchMethod::Restore {
                restore_rows(ui, settings);
            }
            if matches!(settings.method, SearchMethod::Restore | SearchMethod::Metropolis) {
                ui.weak("Longest descent");
                let hint = "Maximum moves per descent";
                drag(ui, "Longest descent", &mut settings.longest, 1..=1_000_000, 1.0, hint);
                ui.end_row();
            }
            retained_row(ui, settings);
            if settings.method != SearchMethod::Metropolis {
                steps_row(ui, &mut plan.local.steps);
            }
            merit_rows(ui, &mut plan.local);
        });
    });
}

/// The settings of algorithm 1.
fn restore_rows(ui: &mut Ui, settings: &mut SearchSettings) {
    termination_row(ui, &mut settings.termination);
    ui.weak("C");
    drag(ui, "C", &mut settings.c, 0.0..=10.0, 0.002, "A larger value makes descents shorter");
    ui.end_row();
    ui.weak("γ");
    let hint = "The probability that a descent starts from a random lens instead of a retained one";
    drag(ui, "Gamma", &mut settings.gamma, 0.0..=1.0, 0.002, hint);
    ui.end_row();
}

fn termination_row(ui: &mut Ui, chosen: &mut Termination) {
    ui.weak("Descents end");
    let name = ENDS.iter().find(|(end, ..)| end == chosen).map_or("", |(_, name, _)| name);
    let combo = ComboBox::from_id_salt("termination").selected_text(name).show_ui(ui, |ui| {
        for (end, name, hint) in ENDS {
            ui.selectable_value(chosen, end, name).on_hover_text(hint);
        }
    });
    named_list(ui, combo, "How descents end");
    ui.end_row();
}

fn retained_row(ui: &mut Ui, settings: &mut SearchSettings) {
    ui.weak("Retained lenses");
    ui.horizontal(|ui| {
        let hint = "The number of lenses that are retained";
        let mut capacity = settings.reservoir_capacity();
        if drag(ui, "Retained lenses", &mut capacity, 1..=100, 0.05, hint) {
            settings.reservoir = Some(capacity);
        }
        if settings.method == SearchMethod::IteratedLocalSearch {
            let hint =
                "Retain different minima of one pattern of glass and air, not only the best one";
            ui.checkbox(&mut settings.minima, "several of each pattern").on_hover_text(hint);
        }
        if !settings.retains_minima() {
            let hint = "At most one of each pattern of glass and air";
            ui.checkbox(&mut settings.one_per_topology, "one of each pattern").on_hover_text(hint);
        }
    });
    ui.end_row();
}

fn steps_row(ui: &mut Ui, steps: &mut usize) {
    ui.weak("Steps per move");
    drag(ui, "Steps per move", steps, 1..=1000, 0.1, "Gradient steps per move");
    ui.end_row();
}

fn merit_rows(ui: &mut Ui, local: &mut DescentSettings) {
    ui.weak("Spot tolerance");
    ui.horizontal(|ui| {
        let mut percent = 100.0 * local.tolerance;
        let hint = "The relative error of the radius of a spot: smaller costs more rays";
        if drag(ui, "Error of spots", &mut percent, 1e-3..=50.0, 0.01, hint) {
            local.tolerance = percent / 100.0;
        }
        ui.weak("%");
    });
    ui.end_row();
    ui.weak("Also variable");
    ui.horizontal(|ui| {
        let hint = "Semi-diameters are variable";
        ui.checkbox(&mut local.semi_diameters, "semi-diameters").on_hover_text(hint);
        let hint = "Indices of model glasses are variable; catalogue glasses are not";
        ui.checkbox(&mut local.indices, "model glasses").on_hover_text(hint);
    });
    ui.end_row();
}

/// One share for all fields, or one for each of them; more than nothing, 1 for as much as at the start.
pub(super) fn shares(ui: &mut Ui, light: &mut Vec<f64>, lens: &Lens) {
    let fields = common_fields(lens);
    match_length(light, fields.len());
    ui.vertical(|ui| {
        ui.horizontal(|ui| {
            if let [all] = &mut light[..] {
                let hint = "Every field retains at least this share of its light";
                share(ui, "Least light", all, hint);
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

/// As many shares as a lens has fields, or one for all of them.
pub(super) fn matching_fields(mut light: Vec<f64>, lens: &Lens) -> Vec<f64> {
    match_length(&mut light, common_fields(lens).len());
    light
}

fn field_shares(ui: &mut Ui, light: &mut [f64], fields: &[FieldPoint], lens: &Lens) {
    for (value, field) in light.iter_mut().zip(fields) {
        let name = field_name(lens.fields.kind, *field);
        let hint = "This field retains at least this share of its light";
        share(ui, &format!("Least light at {name}"), value, hint);
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
