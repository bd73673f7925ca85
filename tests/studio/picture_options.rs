//! The options of a picture: each is a setting, and the picture is taken with it.

use aplanat::analysis::Coating;
use aplanat::lens::Lens;
use aplanat::picture::BuiltInScene;
use aplanat::session::{
    AnalysisSettings, Command, PanelSetting, PictureEffect, PictureFocus, PictureOptions,
    ScenePicture, Session,
};
use aplanat::studio::panels::PicturePanel;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use std::time::Duration;

use crate::harness::{PanelState, double_gauss, panel_harness, view};

type Bench = Harness<'static, PanelState<PicturePanel>>;

fn press(harness: &mut Bench, label: &str) {
    harness.get_by_label(label).click();
    harness.run_steps(4);
}

/// The options that the panel has asked for last.
fn asked(harness: &Bench) -> PictureOptions {
    let last = harness.state().commands.iter().rev().find_map(|command| match command {
        Command::Show(PanelSetting::PictureOptions(options)) => Some((**options).clone()),
        _ => None,
    });
    last.unwrap_or_default()
}

/// The fine picture of a lens with some options.
fn taken(
    lens: Lens,
    scene: BuiltInScene,
    options: &PictureOptions,
) -> Result<ScenePicture, String> {
    let mut session = Session::new(lens, || {}).unwrap();
    session.apply(Command::Show(PanelSetting::Scene(scene)));
    session.apply(Command::Show(PanelSetting::PictureOptions(Box::new(options.clone()))));
    session.apply(Command::Show(PanelSetting::Picture(true)));
    for _ in 0..6000 {
        session.poll();
        let picture = session.results().and_then(|found| {
            let analyses = found.analyses.as_ref().ok()?;
            analyses.picture.clone().filter(|_| found.settings.picture_options == *options)
        });
        match picture.as_ref().map(|picture| &picture.value) {
            Some(Ok(picture)) if picture.error.is_some() => return Ok(picture.clone()),
            Some(Err(why)) => return Err(why.clone()),
            _ => std::thread::sleep(Duration::from_millis(50)),
        }
    }
    panic!("no fine picture");
}

#[test]
fn options_are_folded_and_become_settings() {
    let mut harness = panel_harness(PicturePanel::default(), view());
    harness.run_steps(3);
    assert!(harness.query_by_label("Exact").is_none());
    press(&mut harness, "Camera");
    press(&mut harness, "Exact");
    assert_eq!(asked(&harness), PictureOptions { exact: true, ..PictureOptions::default() });
    press(&mut harness, "Exposure given");
    assert!(asked(&harness).seconds.is_some());
    press(&mut harness, "Camera");
    harness.run_steps(20);
    press(&mut harness, "Coating and effects");
    harness.run_steps(20);
    press(&mut harness, "Diffraction");
    assert_eq!(asked(&harness).left_out, [PictureEffect::Diffraction]);
}

/// Bare glass loses light and reflects ghosts, which the table of effects has with their numbers.
#[test]
fn a_coating_puts_losses_into_the_picture_and_its_table() {
    let options = PictureOptions {
        coating: Some(Coating::Bare),
        effects: true,
        tolerance: 0.05,
        ..PictureOptions::default()
    };
    let picture = taken(double_gauss(), BuiltInScene::White, &options).unwrap();
    let gates = picture.gates.clone().unwrap();
    let gate = |name: &str| gates.iter().find(|gate| gate.effect == name).unwrap().clone();
    assert!(gate("losses").on && gate("losses").number.is_some(), "{gates:?}");
    assert!(gate("ghosts").number.is_some_and(|change| change > 0.0), "{gates:?}");
    let used: Vec<_> = picture.shares.iter().map(|share| share.effect).collect();
    assert_eq!(used, ["sampling", "diffraction", "losses", "ghosts"]);
    // The panel lists them.
    let settings = AnalysisSettings {
        picture: true,
        scene: BuiltInScene::White,
        picture_options: options,
        ..AnalysisSettings::default()
    };
    let mut shown = view();
    let mut results = (*shown.results.clone().unwrap()).clone();
    let timed = aplanat::session::Timed { value: Ok(picture), ms: 1.0 };
    results.analyses.as_mut().unwrap().picture = Some(std::sync::Arc::new(timed));
    (shown.results, shown.settings) = (Some(std::sync::Arc::new(results)), settings);
    let mut harness = panel_harness(PicturePanel::default(), shown);
    harness.run_steps(3);
    press(&mut harness, "Coating and effects");
    harness.run_steps(20);
    harness.get_by_label("Polarisation");
    harness.get_by_label_contains("sampling: ");
}

/// A group that cannot focus is refused by name, and moving the image plane focuses.
#[test]
fn the_focus_is_that_of_the_options() {
    let near = PictureOptions { focus: PictureFocus::ImagePlane(800.0), ..Default::default() };
    let picture = taken(double_gauss(), BuiltInScene::White, &near).unwrap();
    assert_eq!((picture.focus, picture.breathing), (Some(800.0), None));
    let wrong = PictureFocus::Group { distance: 800.0, first: 5, last: 2 };
    let wrong = PictureOptions { focus: wrong, ..Default::default() };
    let refused = taken(double_gauss(), BuiltInScene::White, &wrong).unwrap_err();
    assert!(refused.contains("focus group"), "{refused}");
}
