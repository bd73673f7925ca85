//! The panel of tolerances: it proposes a class, keeps it in the lens, and lets each number be changed.

use std::sync::Arc;

use aplanat::files;
use aplanat::lens::{
    AdjustedPart, Edit, ErrorDistribution, Lens, PerturbationKind, ToleranceSheet,
};
use aplanat::report::{FurtherColumns, PaperKind, tolerance_sheet, tolerance_table};
use aplanat::session::{
    AnalysisResults, AnalysisSettings, AsBuiltLens, Command, LoosestGoal, PanelSetting,
    SessionView, Timed, confirm_as_built, predict_as_built,
};
use aplanat::studio::file_dialog::FileRequest;
use aplanat::studio::panels::TolerancesPanel;
use aplanat::tolerance::{FocusTreatment, ToleranceGrade};
use egui::Key;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use crate::harness::{PanelState, sized_harness, view_of};

fn bundled(name: &str) -> Lens {
    let bundled = files::bundled_lenses().iter().find(|lens| lens.name == name).unwrap();
    files::parse(bundled.text.as_bytes(), bundled.name).unwrap().lens
}

fn achromat() -> Lens {
    bundled("achromat_ac254_100")
}

/// The panel on a lens with some settings that is made like this.
fn panel_of(
    lens: Lens,
    settings: AnalysisSettings,
    make: impl FnOnce(&Lens, &AnalysisSettings) -> Result<AsBuiltLens, String>,
) -> Harness<'static, PanelState<TolerancesPanel>> {
    let view = view_of(lens);
    let found = view.results.as_ref().unwrap();
    let mut results: AnalysisResults = (**found).clone();
    let made = make(&results.lens, &settings);
    let analyses = results.analyses.as_mut().unwrap();
    analyses.as_built = Some(Arc::new(Timed { value: made, ms: 1.0 }));
    let view = SessionView { results: Some(Arc::new(results)), settings, ..view };
    let mut harness = sized_harness(TolerancesPanel::default(), view, [900.0, 1500.0]);
    harness.run();
    harness
}

/// The panel on a lens whose tolerances have been computed.
fn tolerances(lens: Lens) -> Harness<'static, PanelState<TolerancesPanel>> {
    panel_of(lens, AnalysisSettings::default(), predict_as_built)
}

/// The same with lenses whose rays were traced.
fn confirmed(
    lens: Lens,
    loosest: Option<LoosestGoal>,
) -> Harness<'static, PanelState<TolerancesPanel>> {
    let settings = AnalysisSettings { tolerance: 1e-2, loosest, ..AnalysisSettings::default() };
    panel_of(lens, settings, confirm_as_built)
}

/// The lens as it is made that the panel shows.
fn made(harness: &Harness<'_, PanelState<TolerancesPanel>>) -> AsBuiltLens {
    let results = harness.state().view.results.as_ref().unwrap();
    let analyses = results.analyses.as_ref().unwrap();
    analyses.as_built.as_ref().unwrap().value.clone().unwrap()
}

fn sheet_of(commands: &[Command]) -> Option<ToleranceSheet> {
    commands.iter().find_map(|command| match command {
        Command::Edit(Edit::SetTolerances(sheet)) => sheet.clone(),
        _ => None,
    })
}

#[test]
fn a_class_of_tolerances_is_proposed_and_kept_on_request() {
    let mut harness = tolerances(achromat());
    for text in [
        "As designed",
        "90 % of the lenses, at most",
        "Share of lenses against their RMS over the fields",
    ] {
        harness.get_by_label(text);
    }
    harness.get_by_label("Keep in the lens").click();
    harness.run();
    let sheet = sheet_of(&harness.state().commands).unwrap();
    // Three surfaces with power, irregularity and two tilts, two gaps, two glasses with index and
    // Abbe number, one element with two decentres and two tilts.
    assert_eq!(sheet.errors.len(), 3 * 4 + 2 + 2 * 2 + 4);
    let lens = Lens { tolerances: Some(sheet), ..achromat() };
    let mut harness = tolerances(lens);
    harness.get_by_label("Remove").click();
    harness.run();
    assert_eq!(harness.state().commands, [Command::Edit(Edit::SetTolerances(None))]);
}

#[test]
fn a_half_range_is_typed_and_becomes_that_of_the_lens() {
    let mut harness = tolerances(achromat());
    let before = made(&harness).sheet;
    harness.get_by_label("Half range of Thickness 1").focus();
    harness.run();
    harness.get_by_label("Half range of Thickness 1").type_text("20");
    harness.run();
    harness.key_press(Key::Enter);
    harness.run();
    let after = sheet_of(&harness.state().commands).unwrap();
    for (old, new) in before.errors.iter().zip(&after.errors) {
        let changed = old.error.kind.name() == "thickness" && old.error.first == 0;
        let wanted = if changed { 0.02 } else { old.half_range };
        assert!((new.half_range - wanted).abs() < 1e-12, "{:?}", new.error);
    }
}

#[test]
fn the_class_and_the_limit_of_good_lenses_are_settings() {
    let mut harness = tolerances(achromat());
    harness.get_by_label("Good up to").click();
    harness.run();
    let asked = harness
        .state()
        .commands
        .iter()
        .any(|command| matches!(command, Command::Show(PanelSetting::GoodRms(Some(limit))) if *limit > 0.0));
    assert!(asked);
    harness.get_by_label("Care in making").click();
    harness.run();
    harness.get_by_label("Commercial").click();
    harness.run();
    let wanted = Command::Show(PanelSetting::ToleranceGrade(ToleranceGrade::Commercial));
    assert!(harness.state().commands.contains(&wanted));
}

#[test]
fn the_contrast_of_lenses_as_made_stands_beside_that_of_the_design() {
    let settings = AnalysisSettings {
        tolerance: 1e-2,
        tolerance_frequency: Some(30.0),
        ..AnalysisSettings::default()
    };
    let mut harness = panel_of(achromat(), settings, confirm_as_built);
    for text in ["MTF at 30 cycles/mm as designed", "MTF expected as made"] {
        harness.get_by_label(text);
    }
    let contrast = made(&harness).contrast.unwrap().unwrap();
    for (i, expected) in contrast.expected.unwrap().into_iter().enumerate() {
        let [nominal, real] = [contrast.nominal[i], contrast.real.mean[i]];
        assert!(0.0 < real && real < nominal && nominal < 1.0, "{contrast:?}");
        let allowed = 3.0 * contrast.real.error[i] + 0.02;
        assert!((real - expected).abs() < allowed, "{contrast:?}");
    }
    harness.get_by_label("MTF at").click();
    harness.run();
    let wanted = Command::Show(PanelSetting::ToleranceFrequency(None));
    assert!(harness.state().commands.contains(&wanted));
}

#[test]
fn real_lenses_have_a_histogram_and_the_worst_of_them_is_opened() {
    let mut harness = confirmed(achromat(), None);
    for text in ["Histogram of the RMS of 500 lenses, refocused", "By element", "By kind"] {
        harness.get_by_label(text);
    }
    // All surfaces belong to one element; the last gap is air.
    harness.get_by_label("Element 1–3");
    harness.get_by_label("Element decentre");
    harness.get_by_label("Open the worst lens").click();
    harness.run();
    let made = made(&harness);
    let worst = made.worst.unwrap().unwrap();
    let squares = made.analysis.real.iter().filter_map(|lens| Some(lens.mean_square?[1]));
    let largest = squares.fold(0.0, f64::max).sqrt();
    assert!((worst.stated_rms - largest).abs() < 1e-15);
    let opened = harness.state().commands.iter().find_map(|command| match command {
        Command::Preview(lens) => lens.clone(),
        _ => None,
    });
    let opened = opened.unwrap();
    assert_eq!(*opened, worst.lens);
    assert!(opened.name.ends_with("worst of 500") && opened.tolerances.is_none());
    assert!(opened.surfaces.iter().any(|row| row.tilt != [0.0; 2] || row.break_before.is_some()));
}

fn click<P: aplanat::studio::panels::Panel>(harness: &mut Harness<'_, PanelState<P>>, label: &str) {
    harness.get_by_label(label).click();
    harness.run();
}

/// The last tolerances that the panel has asked for.
fn last_sheet(harness: &Harness<'_, PanelState<TolerancesPanel>>) -> ToleranceSheet {
    let commands: Vec<Command> = harness.state().commands.iter().rev().cloned().collect();
    sheet_of(&commands).unwrap()
}

#[test]
fn errors_are_added_changed_and_removed() {
    let mut harness = tolerances(achromat());
    let before = made(&harness).sheet;
    click(&mut harness, "Distribution of Thickness 1");
    click(&mut harness, "Uniform");
    let changed = last_sheet(&harness);
    let differ = before.errors.iter().zip(&changed.errors).filter(|(old, new)| old != new);
    let differ: Vec<_> = differ.map(|(_, new)| new).collect();
    assert_eq!(differ.len(), 1);
    assert_eq!(differ[0].distribution, ErrorDistribution::Uniform);
    assert_eq!(differ[0].error.kind, PerturbationKind::Thickness);
    click(&mut harness, "Remove Thickness 1");
    assert_eq!(last_sheet(&harness).errors.len(), before.errors.len() - 1);
    // An error that is there already is refused, another one is added.
    click(&mut harness, "Add the error");
    harness.get_by_label("This error is in the list already; change its half range");
    click(&mut harness, "Kind of the added error");
    click(&mut harness, "Conic constant");
    click(&mut harness, "Add the error");
    let added = last_sheet(&harness);
    assert_eq!(added.errors.len(), before.errors.len() + 1);
    let last = added.errors.last().unwrap();
    assert!(last.error.kind == PerturbationKind::Conic && last.half_range > 0.0);
}

#[test]
fn compensators_are_added_with_a_travel_and_the_focus_is_limited() {
    let mut harness = tolerances(achromat());
    click(&mut harness, "Add the compensator");
    let sheet = last_sheet(&harness);
    assert_eq!(sheet.compensators[0].part, AdjustedPart::SensorTiltX);
    assert!(sheet.compensators[0].travel > 0.0);
    click(&mut harness, "limited");
    assert_eq!(last_sheet(&harness).focus_travel, Some(0.1));
    let mut harness = tolerances(Lens { tolerances: Some(sheet), ..achromat() });
    harness.get_by_label("Travel of Sensor tilt x");
    click(&mut harness, "Remove Sensor tilt x");
    assert!(last_sheet(&harness).compensators.is_empty());
}

#[test]
fn errors_of_one_barrel_are_correlated() {
    let mut harness = tolerances(bundled("cooke_triplet_100_f27"));
    click(&mut harness, "Correlations (0)");
    click(&mut harness, "Correlate them");
    let sheet = last_sheet(&harness);
    let correlation = &sheet.correlations[0];
    assert_eq!((correlation.errors.len(), correlation.coefficient), (3, 0.5));
    let kinds = correlation.errors.iter().map(|i| sheet.errors[*i].error.kind);
    assert!(kinds.into_iter().all(|kind| kind == PerturbationKind::ElementDecenterY));
}

#[test]
fn the_loosest_tolerances_are_asked_for_and_applied() {
    let mut harness = tolerances(achromat());
    click(&mut harness, "Loosest tolerances");
    click(&mut harness, "Find them");
    let asked = harness.state().commands.iter().find_map(|command| match command {
        Command::Show(PanelSetting::Loosest(goal)) => *goal,
        _ => None,
    });
    let Some(LoosestGoal::Yield { rms, share }) = asked else { panic!("{asked:?}") };
    assert!(rms > 0.0 && (share - 0.9).abs() < 1e-12);
    let mut harness = confirmed(achromat(), asked);
    let found = made(&harness).loosest.unwrap().unwrap();
    assert!((found.good.unwrap()[0] - 0.9).abs() < 0.01, "{:?}", found.good);
    click(&mut harness, "Loosest tolerances");
    click(&mut harness, "Apply");
    assert_eq!(last_sheet(&harness), found.sheet);
    click(&mut harness, "Apply the classes");
    let by_class = last_sheet(&harness);
    assert_eq!(by_class, found.by_class());
    let pairs = by_class.errors.iter().zip(&found.sheet.errors);
    assert!(pairs.into_iter().all(|(class, own)| class.half_range <= own.half_range));
}

#[test]
fn what_the_panel_shows_is_written_as_a_table_and_as_charts() {
    let mut harness = confirmed(achromat(), None);
    click(&mut harness, "CSV…");
    click(&mut harness, "PNG…");
    let kinds = [PaperKind::ToleranceTable, PaperKind::ToleranceCharts];
    assert_eq!(harness.state().requests, kinds.map(FileRequest::ExportPaper));
    let made = made(&harness);
    let (further, order) = (FurtherColumns::default(), FocusTreatment::Refocused);
    let table = tolerance_table(&made.sheet, &made.analysis, &further, order).unwrap();
    assert_eq!(table.lines().count(), 1 + made.sheet.errors.len());
    let columns = table.lines().map(|line| line.split(',').count());
    assert!(columns.into_iter().all(|count| count == 13), "{table}");
    let sheet = tolerance_sheet("achromat", &made.sheet, &made.analysis).unwrap();
    assert!(sheet.canvas().png().unwrap().starts_with(b"\x89PNG"));
}
