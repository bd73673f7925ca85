//! Compensators: what is adjusted in each lens after assembly, how far, and what of it is used.

use egui::{Grid, RichText, Ui};

use super::add_error::{ADJUSTED, SurfaceRange, adjusted_choices, surface_fields};
use super::sheet_editor::{DraggedNumber, NumberField, SheetEditor, remove_button};
use super::text::{part_name, travel_unit};
use crate::lens::{AdjustedPart, Compensator, Perturbation};
use crate::session::AsBuiltLens;
use crate::studio::form::choice;
use crate::studio::number;
use crate::studio::panels::widgets::hint_beside;
use crate::tolerance::{AdjustmentTravel, NominalLens, adjustments, perturb};

/// The list of compensators with a form that adds one.
#[derive(Debug, Default)]
pub(super) struct CompensatorList {
    changing: DraggedNumber<usize>,
    /// The kind of an added one, by its place among the parts that can be adjusted.
    kind: usize,
    surfaces: SurfaceRange,
}

/// The travel of an added compensator and of a focus that becomes limited, in mm and in radians.
const TRAVEL: [f64; 2] = [0.1, 0.003];
/// The share of lenses at the end of a travel above which it is marked.
const MANY: f64 = 0.01;

impl CompensatorList {
    /// Shows the compensators, the focus first.
    pub(super) fn show(
        &mut self,
        ui: &mut Ui,
        made: &AsBuiltLens,
        editable: bool,
        editor: &mut SheetEditor<'_>,
    ) {
        Grid::new("compensators").num_columns(5).striped(true).show(ui, |ui| {
            for (title, hint) in COLUMNS {
                hint_beside(ui.weak(title), hint);
            }
            ui.end_row();
            for own in adjustments(editor.sheet).into_iter().enumerate() {
                self.row(ui, own, made, editable, editor);
                ui.end_row();
            }
        });
        if editable {
            self.form(ui, &made.nominal, editor);
        }
    }

    fn row(
        &mut self,
        ui: &mut Ui,
        (i, own): (usize, Compensator),
        made: &AsBuiltLens,
        editable: bool,
        editor: &mut SheetEditor<'_>,
    ) {
        ui.label(RichText::new(part_name(own.part)).small());
        ui.add_enabled_ui(editable, |ui| self.travel(ui, (i, own), editor));
        let found = made.analysis.travels.iter().find(|found| found.part == own.part);
        used(ui, found);
        if i > 0 && editable && remove_button(ui, &part_name(own.part)) {
            editor.change(|sheet| sheet.compensators.retain(|other| other.part != own.part));
        }
    }

    /// The travel of a compensator; that of the focus may be without an end.
    fn travel(
        &mut self,
        ui: &mut Ui,
        (i, Compensator { part, travel }): (usize, Compensator),
        editor: &mut SheetEditor<'_>,
    ) {
        let (factor, unit) = travel_unit(part);
        ui.horizontal(|ui| {
            if part == AdjustedPart::Focus {
                let mut is_limited = travel.is_finite();
                let hint = "Limits the adjustment of the focus";
                if ui.checkbox(&mut is_limited, "limited").on_hover_text(hint).changed() {
                    let limit = is_limited.then_some(TRAVEL[0]);
                    editor.change(|sheet| sheet.focus_travel = limit);
                }
                if !travel.is_finite() {
                    return;
                }
            }
            let name = format!("Travel of {}", part_name(part));
            let stored = factor * travel;
            let field =
                NumberField { name: &name, unit, least: 0.0, most: f64::MAX, speed: 0.02 * stored };
            if let Some(value) = self.changing.show(ui, i, stored, &field) {
                editor.change(|sheet| match i.checked_sub(1) {
                    None => sheet.focus_travel = Some(value / factor),
                    Some(place) => sheet.compensators[place].travel = value / factor,
                });
            }
        });
    }

    fn form(&mut self, ui: &mut Ui, nominal: &NominalLens, editor: &mut SheetEditor<'_>) {
        ui.horizontal_wrapped(|ui| {
            ui.label("Add a compensator:");
            choice(ui, "Kind of the added compensator", &mut self.kind, &adjusted_choices());
            let part = ADJUSTED[self.kind.min(ADJUSTED.len() - 1)];
            if let Some(Perturbation { kind, .. }) = part.in_lens() {
                let one = !kind.moves_a_body();
                surface_fields(ui, "added compensator", &mut self.surfaces, (one, editor.lens));
            }
            let hint = "Adds it with a small travel to either side";
            if ui.button("Add the compensator").on_hover_text(hint).clicked() {
                self.add(part, nominal, editor);
            }
        });
    }

    fn add(&self, part: AdjustedPart, nominal: &NominalLens, editor: &mut SheetEditor<'_>) {
        let (first, last) = self.surfaces;
        let part = match part {
            AdjustedPart::Lens(own) => AdjustedPart::Lens(Perturbation { first, last, ..own }),
            other => other,
        };
        if editor.sheet.compensators.iter().any(|own| own.part == part) {
            return editor.refuse("this compensator is in the list already; change its travel");
        }
        let in_lens: Vec<(Perturbation, f64)> =
            part.in_lens().map(|own| (own, 0.0)).into_iter().collect();
        if let Err(why) = perturb(nominal, &in_lens) {
            return editor.refuse(&why.to_string());
        }
        let travel = TRAVEL[usize::from(part.is_angle())];
        editor.change(|sheet| sheet.set_compensator(Compensator { part, travel }));
    }
}

/// The adjustments of lenses: mean, deviation, and the share at the end of the travel.
fn used(ui: &mut Ui, found: Option<&AdjustmentTravel>) {
    let Some(own) = found else {
        ui.label("");
        ui.label("");
        return;
    };
    let (factor, unit) = travel_unit(own.part);
    let shown = |value: f64| format!("{}{unit}", number::format_digits(factor * value, 3));
    let found = own.real.unwrap_or(own.form);
    ui.label(format!("{} ± {}", shown(found.mean), shown(found.deviation)));
    let visuals = ui.visuals();
    let color = if found.at_stop > MANY { visuals.warn_fg_color } else { visuals.text_color() };
    ui.label(RichText::new(format!("{:.1} %", 100.0 * found.at_stop)).color(color));
}

/// The columns of the compensators with their explanations.
const COLUMNS: [(&str, &str); 4] = [
    ("Compensator", "What is adjusted in each lens after assembly"),
    ("Travel", "The largest adjustment to either side; compensators are kept in the lens file"),
    ("Adjustment", "Its mean and its standard deviation"),
    ("At its stop", "The share of lenses at the end of the travel, where the rest remains"),
];
