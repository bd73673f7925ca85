//! Errors that are not independent: those of elements in one barrel, or of surfaces of one mould.

use egui::{Grid, RichText, Ui};

use super::add_error::{SurfaceRange, surface_fields};
use super::sheet_editor::{DraggedNumber, NumberField, SheetEditor, remove_button};
use super::text::{error_name, place, title};
use crate::lens::{ErrorCorrelation, PerturbationKind, ToleranceSheet};
use crate::studio::form::choice;

/// The list of correlations with a form that adds one.
#[derive(Debug)]
pub(super) struct CorrelationList {
    changing: DraggedNumber<usize>,
    kind: PerturbationKind,
    surfaces: SurfaceRange,
}

impl Default for CorrelationList {
    fn default() -> Self {
        let kind = PerturbationKind::ElementDecenterY;
        Self { changing: DraggedNumber::default(), kind, surfaces: (0, usize::MAX) }
    }
}

/// The coefficient of an added correlation.
const COEFFICIENT: f64 = 0.5;

impl CorrelationList {
    /// Shows the correlations, and the form where they can be changed.
    pub(super) fn show(&mut self, ui: &mut Ui, editable: bool, editor: &mut SheetEditor<'_>) {
        Grid::new("correlations").num_columns(3).striped(true).show(ui, |ui| {
            for (i, own) in editor.sheet.correlations.iter().enumerate() {
                let (short, all) = names(editor.sheet, own);
                ui.label(RichText::new(&short).small()).on_hover_text(all);
                let name = format!("Coefficient of {short}");
                let field =
                    NumberField { name: &name, unit: "", least: -1.0, most: 1.0, speed: 0.01 };
                let show = |ui: &mut Ui| self.changing.show(ui, i, own.coefficient, &field);
                if let Some(value) = ui.add_enabled_ui(editable, show).inner {
                    editor.change(|sheet| sheet.correlations[i].coefficient = value);
                }
                if editable && remove_button(ui, &format!("the correlation of {short}")) {
                    editor.change(|sheet| drop(sheet.correlations.remove(i)));
                }
                ui.end_row();
            }
        });
        if editable {
            self.form(ui, editor);
        }
    }

    fn form(&mut self, ui: &mut Ui, editor: &mut SheetEditor<'_>) {
        ui.horizontal_wrapped(|ui| {
            ui.label("Correlate:");
            let kinds = PerturbationKind::ALL.map(|kind| (kind, title(kind)));
            choice(ui, "Kind of the correlated errors", &mut self.kind, &kinds);
            self.surfaces.1 = self.surfaces.1.min(editor.lens.surfaces.len().saturating_sub(1));
            surface_fields(ui, "correlated errors", &mut self.surfaces, (false, editor.lens));
            let hint = "All errors of this kind between these surfaces get one coefficient of \
                        correlation, as those of elements in one barrel: the share of the variance that \
                        is common to them";
            if ui.button("Correlate them").on_hover_text(hint).clicked() {
                let errors = within(editor.sheet, self.kind, self.surfaces);
                if errors.len() < 2 {
                    return editor.refuse("fewer than two errors of this kind lie there");
                }
                let added = ErrorCorrelation { errors, coefficient: COEFFICIENT };
                editor.change(|sheet| sheet.correlations.push(added));
            }
        });
    }
}

/// The numbers of the errors of a kind within some surfaces.
fn within(sheet: &ToleranceSheet, kind: PerturbationKind, (from, to): SurfaceRange) -> Vec<usize> {
    let errors = sheet.errors.iter().enumerate();
    let fits = errors.filter(|(_, own)| {
        own.error.kind == kind && own.error.first >= from && own.error.last <= to
    });
    fits.map(|(i, _)| i).collect()
}

/// The errors of a correlation in a few words, and all of them.
fn names(sheet: &ToleranceSheet, own: &ErrorCorrelation) -> (String, String) {
    let errors: Vec<_> =
        own.errors.iter().filter_map(|i| Some(sheet.errors.get(*i)?.error)).collect();
    let all = errors.iter().map(|error| error_name(*error)).collect::<Vec<_>>().join(", ");
    let kind = errors.first().map(|error| error.kind);
    let same = errors.iter().all(|error| Some(error.kind) == kind);
    let short = match kind {
        Some(kind) if same => {
            let places: Vec<String> =
                errors.iter().map(|error| place((error.first, error.last))).collect();
            format!("{} {}", title(kind), places.join(", "))
        }
        _ => format!("{} errors", errors.len()),
    };
    (short, all)
}
