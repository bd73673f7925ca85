//! The report on a foreign file: it appears with the file, and its text is copied and saved.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use aplanat::files::{self, ImportedFile, VignettingChoice};
use aplanat::session::{Command, SessionView};
use aplanat::studio::Studio;
use aplanat::studio::file_dialog::FileRequest;
use aplanat::studio::panels::ImportReportPanel;
use egui::{Key, Modifiers, OutputCommand};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use crate::harness::panel_harness;
use crate::window::{settle, window};

const FILE: &str = "tests/files/achromat.zmx";

fn open(harness: &mut Harness<'_, Studio>, path: &str) {
    let context = harness.ctx.clone();
    harness.state_mut().apply(&context, Command::Open(PathBuf::from(path)));
    settle(harness);
}

fn imported(path: &str) -> ImportedFile {
    files::open(path).unwrap().imported_from(Path::new(path)).unwrap()
}

fn view() -> SessionView {
    let lens = Arc::new(files::open(FILE).unwrap().lens);
    SessionView { lens, imported: Some(Arc::new(imported(FILE))), ..SessionView::default() }
}

/// The text that a click on a button copies.
fn copied<S>(harness: &mut Harness<'_, S>, button: &str) -> Option<String> {
    harness.get_by_label(button).click();
    for _ in 0..3 {
        harness.step();
        let commands = &harness.output().platform_output.commands;
        let text = commands.iter().find_map(|command| match command {
            OutputCommand::CopyText(text) => Some(text.clone()),
            _ => None,
        });
        if text.is_some() {
            return text;
        }
    }
    None
}

#[test]
fn a_foreign_file_opens_with_its_report() {
    let mut harness = window();
    assert!(harness.query_by_label("achromat.zmx").is_none());
    open(&mut harness, FILE);
    harness.get_by_label("achromat.zmx");
    let counts = imported(FILE).report.counts();
    harness.get_by_label(&counts);
    harness.get_by_label("Back focal length, mm");
    harness.get_by_label_contains("VCYN 0 0.05 0.1");
    assert!(harness.query_by_label("COAT AR").is_none(), "what is preserved is folded");
    assert!(harness.query_by_label("GCAT SCHOTT").is_none(), "what is used is folded");
    // A lens of the native format has no report.
    open(&mut harness, "lenses/tessar_50_f28.json");
    assert!(harness.query_by_label("achromat.zmx").is_none());
    harness.get_by_label_contains("comes from no file of another program");
}

#[test]
fn the_report_is_found_again_by_the_palette() {
    let mut harness = window();
    open(&mut harness, FILE);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::K);
    harness.run_steps(3);
    harness.get_by_label("Find a command").type_text("history");
    harness.run_steps(3);
    harness.key_press(Key::Enter);
    harness.run_steps(3);
    assert!(harness.query_by_label("achromat.zmx").is_none(), "another panel is in front");
    harness.key_press_modifiers(Modifiers::COMMAND, Key::K);
    harness.run_steps(3);
    harness.get_by_label("Find a command").type_text("import report");
    harness.run_steps(3);
    harness.key_press(Key::Enter);
    harness.run_steps(3);
    harness.get_by_label("achromat.zmx");
}

#[test]
fn the_whole_report_is_copied_and_saved_as_text() {
    let mut harness = panel_harness(ImportReportPanel, view());
    harness.run();
    let text = copied(&mut harness, "Copy").unwrap();
    assert_eq!(text, imported(FILE).to_string());
    assert!(text.contains("GCAT SCHOTT") && text.contains("efl 80.58"), "{text}");
    harness.get_by_label("Save…").click();
    harness.run();
    assert_eq!(harness.state().requests, [FileRequest::SaveImportReport]);
}

#[test]
fn used_lines_unfold() {
    let mut harness = panel_harness(ImportReportPanel, view());
    harness.run();
    let used = imported(FILE).report.count(files::ConversionOutcome::Used);
    harness.get_by_label(&format!("{used} used")).click();
    harness.run_steps(30);
    harness.get_by_label("GCAT SCHOTT");
}

/// The file has an automatic semi-diameter at its last surface.
#[test]
fn numbers_of_the_file_stand_beside_those_of_the_program() {
    let mut harness = panel_harness(ImportReportPanel, view());
    harness.run();
    harness.get_by_label("Semi-diameter of surface 3");
    harness.get_by_label("8.6");
}

#[test]
fn the_other_treatment_of_vignetting_opens_the_file_again() {
    let mut harness = panel_harness(ImportReportPanel, view());
    harness.run();
    harness.get_by_label("Vignetting by factors").click();
    harness.run();
    let expected =
        [Command::SetVignetting(VignettingChoice::Factors), Command::Open(PathBuf::from(FILE))];
    assert_eq!(harness.state().commands, expected);
}
