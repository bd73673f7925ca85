//! The errors of making in a list: the half range and the distribution of each, and its share in the growth
//! of the spot.

use egui::{Button, ComboBox, Grid, RichText, Ui};

use super::BESIDE;
use super::shares::share_bar;
use super::sheet_editor::{DraggedNumber, NumberField, SheetEditor, remove_button};
use super::text::{DISTRIBUTIONS, error_name, shown_unit, surfaces, title};
use crate::lens::{ErrorDistribution, Perturbation, Tolerance};
use crate::studio::form::named_list;
use crate::studio::panels::widgets::hint_beside;

/// The list.
#[derive(Debug, Default)]
pub(super) struct ErrorList {
    /// The error whose half range is being changed.
    changing: DraggedNumber<usize>,
}

/// The width of the list of distributions, in points.
const DISTRIBUTION: f32 = 64.0;

impl ErrorList {
    /// The errors, that with the largest share after refocusing first; in their own order without shares.
    pub(super) fn show(
        &mut self,
        ui: &mut Ui,
        (shares, semi_diameters): (Option<&[[f64; 2]]>, &[f64]),
        editable: bool,
        editor: &mut SheetEditor<'_>,
    ) {
        let mut order: Vec<usize> = (0..editor.sheet.errors.len()).collect();
        if let Some(shares) = shares {
            order.sort_by(|a, b| shares[*b][1].total_cmp(&shares[*a][1]));
        }
        // Where there is little room, the bars of the fixed image plane are numbers.
        let wide = ui.available_width() > BESIDE;
        Grid::new("errors of making").num_columns(7).striped(true).show(ui, |ui| {
            for (title, hint) in COLUMNS {
                hint_beside(ui.weak(title), hint);
            }
            ui.end_row();
            for i in order {
                self.error_row(ui, (i, semi_diameters), editable, editor);
                match shares.and_then(|shares| shares.get(i)) {
                    Some([fixed, refocused]) if wide => {
                        share_bar(ui, *fixed);
                        share_bar(ui, *refocused);
                    }
                    Some([fixed, refocused]) => {
                        ui.label(RichText::new(format!("{:.1} %", 100.0 * fixed)).small());
                        share_bar(ui, *refocused);
                    }
                    None => {
                        ui.label("");
                        ui.label("");
                    }
                }
                let name = error_name(editor.sheet.errors[i].error);
                if editable && remove_button(ui, &name) {
                    editor.change(|sheet| sheet.remove_error(i));
                }
                ui.end_row();
            }
        });
    }

    fn error_row(
        &mut self,
        ui: &mut Ui,
        (i, semi_diameters): (usize, &[f64]),
        editable: bool,
        editor: &mut SheetEditor<'_>,
    ) {
        let tolerance = editor.sheet.errors[i];
        let Perturbation { kind, first, .. } = tolerance.error;
        let name = Button::new(RichText::new(title(kind)).small()).frame(false);
        if ui.add(name).on_hover_text("Highlights the surface in every panel").clicked() {
            editor.select(first);
        }
        ui.label(RichText::new(surfaces(tolerance.error)).small());
        ui.add_enabled_ui(editable, |ui| self.half_range(ui, (i, semi_diameters), editor));
        ui.add_enabled_ui(editable, |ui| {
            let name = format!("Distribution of {}", error_name(tolerance.error));
            if let Some(chosen) = distribution(ui, &name, tolerance.distribution) {
                editor.change(|sheet| sheet.errors[i].distribution = chosen);
            }
        });
    }

    /// The half range of an error; a changed one becomes a tolerance of the lens.
    fn half_range(
        &mut self,
        ui: &mut Ui,
        (i, semi_diameters): (usize, &[f64]),
        editor: &mut SheetEditor<'_>,
    ) {
        let Tolerance { error, half_range, .. } = editor.sheet.errors[i];
        let (factor, unit) = shown_unit(error, semi_diameters);
        let stored = factor * half_range;
        let name = format!("Half range of {}", error_name(error));
        let field =
            NumberField { name: &name, unit, least: 0.0, most: f64::MAX, speed: 0.02 * stored };
        if let Some(value) = self.changing.show(ui, i, stored, &field) {
            editor.change(|sheet| sheet.errors[i].half_range = value / factor);
        }
    }
}

/// Shows a distribution; another one if it was chosen.
fn distribution(ui: &mut Ui, name: &str, own: ErrorDistribution) -> Option<ErrorDistribution> {
    let found = DISTRIBUTIONS.iter().find(|(kind, ..)| *kind == own);
    let short = found.map_or("", |(_, short, _)| *short);
    let combo = ComboBox::from_id_salt(name).width(DISTRIBUTION);
    let mut chosen = None;
    let list = combo.selected_text(RichText::new(short).small()).show_ui(ui, |ui| {
        for (kind, _, title) in DISTRIBUTIONS {
            if ui.selectable_label(kind == own, title).clicked() {
                chosen = Some(kind);
            }
        }
    });
    named_list(ui, list, name);
    chosen.filter(|kind| *kind != own)
}

/// The columns of the errors with their explanations.
const COLUMNS: [(&str, &str); 6] = [
    ("Error", "The error of making"),
    ("Surfaces", "The surfaces that it concerns, counted from 1"),
    ("±", "Half of the permitted range; drag it or type another one, which the lens then keeps"),
    ("Distribution", "How the error is distributed within its range"),
    ("Fixed", "Its share in the growth of the expected mean square spot at the fixed image plane"),
    ("Refocused", "Its share after each lens is refocused"),
];
