//! The report on the foreign file that the lens was read from: what was lost, locked or approximated, and
//! numbers to compare with the program that wrote the file.

use egui::{CollapsingHeader, Color32, Grid, Label, RichText, ScrollArea, Ui};

use super::widgets::{ActionButton, action_buttons};
use super::{Panel, zoom_name};
use crate::files::{
    ConversionOutcome, ConversionReport, ConversionRow, ImportedFile, SelfCheck, StatedNumber,
    VignettingChoice,
};
use crate::lens::Lens;
use crate::session::{Command, SessionView};
use crate::studio::actions::Actions;
use crate::studio::file_dialog::FileRequest;
use crate::studio::number;
use crate::studio::text::capitalize;

/// The digits of the numbers to compare.
const DIGITS: i32 = 7;
/// The outcomes that a person has to know, the most important one first.
const IMPORTANT: [ConversionOutcome; 3] =
    [ConversionOutcome::Dropped, ConversionOutcome::Locked, ConversionOutcome::Approximated];
/// The outcomes whose rows are folded.
const FOLDED: [ConversionOutcome; 2] = [ConversionOutcome::Preserved, ConversionOutcome::Used];

/// The panel.
#[derive(Debug)]
pub struct ImportReportPanel;

impl Panel for ImportReportPanel {
    fn title(&self) -> &'static str {
        "Import report"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Some(imported) = view.imported.as_deref() else {
            ui.weak(
                "This lens comes from no file of another program. When one is opened, this panel lists \
                 what was lost, locked or approximated.",
            );
            return;
        };
        header(ui, imported, actions);
        ScrollArea::both().auto_shrink([false, false]).show(ui, |ui| {
            numbers(ui, &view.lens, imported);
            ui.add_space(6.0);
            important(ui, &imported.report);
            for outcome in FOLDED {
                folded(ui, &imported.report, outcome);
            }
        });
    }
}

/// The name of the file, the counts, the buttons, and the choice on vignetting factors.
fn header(ui: &mut Ui, imported: &ImportedFile, actions: &mut Actions) {
    let name = imported.path.file_name().unwrap_or(imported.path.as_os_str());
    let path = imported.path.display().to_string();
    ui.strong(name.to_string_lossy()).on_hover_text(path);
    ui.label(imported.report.counts());
    ui.horizontal_wrapped(|ui| {
        let hint = "Copy the whole report as text";
        if ui.button("Copy").on_hover_text(hint).clicked() {
            ui.copy_text(imported.to_string());
        }
        let save = ActionButton::new("Save…", true, FileRequest::SaveImportReport);
        action_buttons(ui, [save.hint("Save the whole report as text")], actions);
        if let Some(present) = imported.vignetting {
            ui.separator();
            vignetting(ui, imported, present, actions);
        }
    });
}

/// The treatments of the vignetting factors of the file; another one opens the file again.
fn vignetting(
    ui: &mut Ui,
    imported: &ImportedFile,
    present: VignettingChoice,
    actions: &mut Actions,
) {
    ui.label("Vignetting:");
    for choice in VignettingChoice::ALL {
        let hint = match choice {
            VignettingChoice::Rims => {
                "Open the file again: its apertures clip, its factors are left out"
            }
            VignettingChoice::Factors => {
                "Open the file again: every surface is as wide as the rays at the edges of the \
                 vignetting factors need it"
            }
        };
        let label = ui.selectable_label(choice == present, choice.name()).on_hover_text(hint);
        let label = label.accessible_name(format!("Vignetting by {}", choice.name()));
        if label.clicked() && choice != present {
            let open = Command::Open(imported.path.clone());
            actions.extend([Command::SetVignetting(choice), open]);
        }
    }
}

/// The rows of the numbers to compare: name, value, and error if it has one.
const NUMBERS: [(&str, NumberOf); 8] = [
    ("Focal length, mm", |check| (check.efl, None)),
    ("Back focal length, mm", |check| (check.bfl, None)),
    ("F-number", |check| (check.f_number, None)),
    ("Paraxial image height, mm", |check| (check.image_height, None)),
    ("Track to the image, mm", |check| (Some(check.total_track), None)),
    ("RMS spot on axis, µm", |check| (check.rms_spot_um[0], check.rms_spot_error_um[0])),
    ("RMS spot at 0.7 field, µm", |check| (check.rms_spot_um[1], check.rms_spot_error_um[1])),
    ("RMS spot at full field, µm", |check| (check.rms_spot_um[2], check.rms_spot_error_um[2])),
];

/// A number of a check with its error.
type NumberOf = fn(&SelfCheck) -> (Option<f64>, Option<f64>);

/// The numbers to compare, and those that the file states itself.
fn numbers(ui: &mut Ui, lens: &Lens, imported: &ImportedFile) {
    if imported.checks.is_empty() {
        ui.weak("No numbers to compare: a glass has no index at the wavelengths of the lens.");
    } else {
        let hint =
            "Of the lens as it was opened. Rays for the spots fill the paraxial entrance pupil.";
        ui.label("To compare with the program that wrote the file, at the primary wavelength:")
            .on_hover_text(hint);
        Grid::new("import checks").striped(true).spacing([12.0, 2.0]).show(ui, |ui| {
            check_rows(ui, lens, &imported.checks);
        });
    }
    if !imported.stated.is_empty() {
        ui.add_space(6.0);
        let hint = "Computed by the other program from its rays; the same rays here, without rims";
        ui.label("Numbers of the file that follow from the lens:").on_hover_text(hint);
        Grid::new("import numbers").striped(true).spacing([12.0, 2.0]).show(ui, |ui| {
            stated_rows(ui, &imported.stated);
        });
    }
}

fn check_rows(ui: &mut Ui, lens: &Lens, checks: &[SelfCheck]) {
    if checks.len() > 1 {
        ui.weak("Zoom position");
        for check in checks {
            ui.weak(zoom_name(lens, check.zoom));
        }
        ui.end_row();
    }
    for (name, number_of) in NUMBERS {
        ui.label(name);
        for check in checks {
            let (value, error) = number_of(check);
            ui.label(value.map_or("none".to_owned(), |value| match error {
                Some(error) => number::with_error(value, error),
                None => number::format_digits(value, DIGITS),
            }));
        }
        ui.end_row();
    }
}

fn stated_rows(ui: &mut Ui, stated: &[StatedNumber]) {
    for head in ["Number, mm", "In the file", "Here"] {
        ui.weak(head);
    }
    ui.end_row();
    for own in stated {
        ui.label(capitalize(&own.what));
        ui.label(number::format_digits(own.file_mm, DIGITS));
        let found = own.found_mm.map(|found| number::format_digits(found, DIGITS));
        ui.label(found.unwrap_or_else(|| "a ray is lost".to_owned()));
        ui.end_row();
    }
}

/// The rows that a person has to know.
fn important(ui: &mut Ui, report: &ConversionReport) {
    let listed = || IMPORTANT.iter().flat_map(|outcome| report.rows_with(*outcome));
    if listed().next().is_none() {
        ui.label("Nothing was dropped, locked or approximated.");
        return;
    }
    Grid::new("import losses").striped(true).spacing([12.0, 2.0]).show(ui, |ui| {
        listed().for_each(|row| report_row(ui, row));
    });
}

/// The rows of an outcome that affect no ray or are exact.
fn folded(ui: &mut Ui, report: &ConversionReport, outcome: ConversionOutcome) {
    let count = report.count(outcome);
    if count == 0 {
        return;
    }
    let title = format!("{count} {}", outcome.name());
    CollapsingHeader::new(title).id_salt(outcome.name()).show(ui, |ui| {
        Grid::new(outcome.name()).striped(true).spacing([12.0, 2.0]).show(ui, |ui| {
            report.rows_with(outcome).for_each(|row| report_row(ui, row));
        });
    });
}

/// One row: outcome, line, text and note.
fn report_row(ui: &mut Ui, row: &ConversionRow) {
    let color = color(ui, row.outcome);
    ui.label(RichText::new(row.outcome.name()).color(color));
    let line = row.line.map(|line| format!("line {line}"));
    ui.weak(line.unwrap_or_default());
    let text: String = row.text.chars().take(LONGEST).collect();
    ui.add(Label::new(RichText::new(text).monospace().small()).selectable(true));
    ui.label(row.note.as_str());
    ui.end_row();
}

/// The number of characters of a line of the file that are shown.
const LONGEST: usize = 60;

fn color(ui: &Ui, outcome: ConversionOutcome) -> Color32 {
    let visuals = ui.visuals();
    match outcome {
        ConversionOutcome::Dropped | ConversionOutcome::Locked => visuals.error_fg_color,
        ConversionOutcome::Approximated => visuals.warn_fg_color,
        ConversionOutcome::Preserved | ConversionOutcome::Used => visuals.weak_text_color(),
    }
}
