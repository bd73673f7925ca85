//! The panel of tolerances: it proposes a class, keeps it in the lens, and lets each number be changed.

use std::sync::Arc;

use aplanat::files;
use aplanat::lens::{Edit, Lens, ToleranceSheet};
use aplanat::session::{
    AnalysisResults, Command, PanelSetting, SessionView, Timed, predict_as_built,
};
use aplanat::studio::panels::TolerancesPanel;
use aplanat::tolerance::ToleranceGrade;
use egui::Key;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use crate::harness::{PanelState, panel_harness, view_of};

fn achromat() -> Lens {
    let found = files::bundled_lenses().iter().find(|lens| lens.name == "achromat_ac254_100");
    let bundled = found.unwrap();
    files::parse(bundled.text.as_bytes(), bundled.name).unwrap().lens
}

/// The panel on a lens whose tolerances have been computed.
fn tolerances(lens: Lens) -> Harness<'static, PanelState<TolerancesPanel>> {
    let view = view_of(lens);
    let found = view.results.as_ref().unwrap();
    let mut results: AnalysisResults = (**found).clone();
    let made = predict_as_built(&results.lens, &results.settings);
    let analyses = results.analyses.as_mut().unwrap();
    analyses.as_built = Some(Arc::new(Timed { value: made, ms: 1.0 }));
    let view = SessionView { results: Some(Arc::new(results)), ..view };
    let mut harness = panel_harness(TolerancesPanel::default(), view);
    harness.run();
    harness
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
    let before = {
        let view = &harness.state().view;
        let analyses = view.results.as_ref().unwrap().analyses.as_ref().unwrap();
        analyses.as_built.as_ref().unwrap().value.as_ref().unwrap().sheet.clone()
    };
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
