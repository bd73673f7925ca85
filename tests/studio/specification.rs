//! The panel of a lens from a specification: it fills, refuses, starts, shows and opens.

use std::sync::Arc;
use std::time::Duration;

use aplanat::search::design::{DesignSettings, LensSpecification};
use aplanat::session::{
    Command, RunStatus, Session, SessionView, SpecificationRequest, SpecifiedDesign,
    SpecifiedDesignCommand, SpecifiedDesignView,
};
use aplanat::studio::panels::SpecificationPanel;
use egui::Key;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use crate::harness::{PanelState, double_gauss, panel_harness};

type PanelHarness = Harness<'static, PanelState<SpecificationPanel>>;

fn view() -> SessionView {
    SessionView { lens: Arc::new(double_gauss()), ..SessionView::default() }
}

fn panel(view: SessionView) -> PanelHarness {
    let mut harness = panel_harness(SpecificationPanel::default(), view);
    harness.run();
    harness
}

fn press(harness: &mut PanelHarness, label: &str) {
    harness.get_by_label(label).click();
    harness.run();
}

fn enter(harness: &mut PanelHarness, label: &str, text: &str) {
    harness.get_by_label(label).focus();
    harness.run();
    harness.get_by_label(label).type_text(text);
    harness.run();
    harness.key_press(Key::Enter);
    harness.run();
}

fn started(harness: &PanelHarness) -> &SpecificationRequest {
    let commands = &harness.state().commands;
    let [Command::SpecifiedDesign(SpecifiedDesignCommand::Start(request))] = &commands[..] else {
        panic!("{commands:?}");
    };
    request
}

#[test]
fn three_numbers_suffice_and_the_rest_is_filled_and_shown() {
    let mut harness = panel(view());
    for text in ["125 mm (2.5 focal lengths)", "0 mm (none)", "2 % (hardly visible)"] {
        harness.get_by_label(text);
    }
    harness.get_by_label_contains("Also taken: fields in °: 0, 14, 20");
    press(&mut harness, "Design a lens");
    let expected = LensSpecification {
        focal_length_mm: Some(50.0),
        f_number: Some(2.8),
        half_field_deg: Some(20.0),
        ..LensSpecification::default()
    };
    let request = started(&harness);
    assert_eq!(request.specification, expected);
    assert_eq!(request.settings, DesignSettings::with_seed(1));
}

#[test]
fn limits_are_stated_in_their_units() {
    let mut harness = panel(view());
    enter(&mut harness, "Focal length of the specification", "80");
    for limit in ["Diameter at most", "Distortion at most", "Illumination at least"] {
        press(&mut harness, limit);
    }
    enter(&mut harness, "Diameter at most:", "60");
    enter(&mut harness, "Distortion at most:", "1");
    enter(&mut harness, "Illumination at least:", "25");
    press(&mut harness, "Elements at most");
    enter(&mut harness, "Elements at most:", "5");
    enter(&mut harness, "Glasses of the specification", "SCHOTT N-BK7, SCHOTT N-SF5");
    press(&mut harness, "Design a lens");
    let spec = &started(&harness).specification;
    assert_eq!((spec.focal_length_mm, spec.max_semi_diameter_mm), (Some(80.0), Some(30.0)));
    assert_eq!(spec.max_abs_distortion, Some(0.01));
    assert_eq!(spec.min_relative_illumination, Some(vec![0.25; 3]));
    assert_eq!(spec.max_elements, Some(5));
    let json = serde_json::to_value(&spec.glasses).unwrap();
    assert_eq!(json, serde_json::json!(["SCHOTT N-BK7", "SCHOTT N-SF5"]));
}

#[test]
fn what_no_lens_can_do_is_refused_in_the_panel_and_starts_nothing() {
    let mut harness = panel(view());
    harness.get_by_label("50 mm, f/2.8, 20° from the axis, at most 4 elements");
    // Key by key: a 0 alone is refused, and the number goes on.
    harness.get_by_label("Aperture value of the specification").focus();
    harness.run();
    for key in ["0", ".", "4"] {
        harness.event(egui::Event::Text(key.to_owned()));
        harness.run();
    }
    harness.get_by_label_contains("No lens can do that: f/0.4; an image in air");
    harness.key_press(Key::Enter);
    harness.run();
    press(&mut harness, "Design a lens");
    assert!(harness.state().commands.is_empty());
    enter(&mut harness, "Aperture value of the specification", "4");
    press(&mut harness, "Back focus at least");
    press(&mut harness, "Track at most");
    enter(&mut harness, "Back focus at least:", "70");
    enter(&mut harness, "Track at most:", "60");
    harness.get_by_label_contains("a back focus of 70 mm within a track of 60 mm");
    enter(&mut harness, "Track at most:", "90");
    press(&mut harness, "Glasses of the specification");
    enter(&mut harness, "Glasses of the specification", "N-BK99");
    harness.get_by_label_contains("glasses: found `N-BK99`");
}

/// A design of one element that has ended, or waits after its first lens.
fn designed(minutes: f64, end: RunStatus) -> SpecifiedDesignView {
    let mut session = Session::new(double_gauss(), || {}).unwrap();
    let specification = LensSpecification {
        focal_length_mm: Some(50.0),
        f_number: Some(8.0),
        half_field_deg: Some(2.0),
        max_elements: Some(1),
        ..LensSpecification::default()
    };
    let settings = DesignSettings { starts: [1, 1], ..DesignSettings::with_seed(3) };
    let request = Box::new(SpecificationRequest { specification, settings, minutes });
    session.apply(SpecifiedDesignCommand::Start(request).into());
    for _ in 0..30_000 {
        session.poll();
        let design = session.view().specified_design;
        if design.run.status == end {
            return design;
        }
        let has_lens = |run: &Arc<SpecifiedDesign>| run.best_lens.is_some();
        if end == RunStatus::Paused && design.run.snapshot.as_ref().is_some_and(has_lens) {
            session.apply(SpecifiedDesignCommand::Pause.into());
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    panic!("the design never ended");
}

#[test]
fn a_design_is_watched_paused_and_stopped() {
    let specified_design = designed(60.0, RunStatus::Paused);
    let mut harness = panel(SessionView { specified_design, ..view() });
    harness.get_by_label_contains("Best so far: ");
    harness.get_by_label_contains(" gradients, ");
    for label in ["Resume", "Stop", "Clear"] {
        press(&mut harness, label);
    }
    let expected = [
        SpecifiedDesignCommand::Resume,
        SpecifiedDesignCommand::Stop,
        SpecifiedDesignCommand::Clear,
    ];
    assert_eq!(harness.state().commands, expected.map(Command::SpecifiedDesign));
}

#[test]
fn the_lenses_at_the_end_tell_their_numbers_and_open_as_designs() {
    let specified_design = designed(1e-6, RunStatus::Finished);
    let snapshot = specified_design.run.snapshot.clone().unwrap();
    let best = &snapshot.lenses[0];
    let mut harness = panel(SessionView { specified_design, ..view() });
    harness.get_by_label("Best");
    for (name, unit) in [("RMS over the fields", " µm"), ("Light", " mm²"), ("Length", " mm")] {
        assert!(harness.query_all_by_label(name).next().is_some(), "{name}");
        assert!(harness.query_all_by_label_contains(unit).next().is_some(), "{name}");
    }
    assert!(harness.query_all_by_label("Keeps every limit").next().is_some());
    press(&mut harness, "Open the best lens");
    let expected = Command::New(Box::new(best.designed.lens.clone()));
    assert_eq!(harness.state().commands, [expected]);
}

#[test]
fn a_design_that_was_left_can_be_resumed_or_dismissed() {
    let specified_design =
        SpecifiedDesignView { unfinished: Some("a.design.json".into()), ..Default::default() };
    let mut harness = panel(SessionView { specified_design, ..view() });
    press(&mut harness, "Resume the design");
    press(&mut harness, "Dismiss it");
    let expected =
        [SpecifiedDesignCommand::ResumeUnfinished, SpecifiedDesignCommand::DismissUnfinished];
    assert_eq!(harness.state().commands, expected.map(Command::SpecifiedDesign));
}
