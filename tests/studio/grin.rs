//! The panel of the gradient-index slice, driven by its accessibility labels, on real sessions.

use std::time::Duration;

use aplanat::grin_design::{SlicePlane, SpatialAxis};
use aplanat::lens::blank;
use aplanat::session::{
    Command, GrinCommand, GrinView, RunStatus, Session, SessionView, SliceQuantity, SliceSettings,
};
use aplanat::studio::draw::RenderBackend;
use aplanat::studio::file_dialog::FileRequest;
use aplanat::studio::panels::GrinPanel;
use egui::accesskit::Role;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

use crate::harness::{PanelState, panel_harness};

type Bench = Harness<'static, PanelState<GrinPanel>>;

fn panel(forming: GrinView) -> Bench {
    let view = SessionView { grin: forming, ..SessionView::default() };
    let mut harness = panel_harness(GrinPanel::new(RenderBackend::Software), view);
    harness.run();
    harness
}

fn press(harness: &mut Bench, name: &str) {
    harness.get_by_label(name).click();
    harness.run();
}

/// The commands for the field.
fn asked(harness: &Bench) -> Vec<GrinCommand> {
    let commands = harness.state().commands.iter();
    let asked = commands.filter_map(|command| match command {
        Command::Grin(form) => Some(form.clone()),
        _ => None,
    });
    asked.collect()
}

/// Waits until a session knows enough.
fn wait(session: &mut Session, what: &str, enough: impl Fn(&GrinView) -> bool) {
    for _ in 0..30_000 {
        session.poll();
        if enough(&session.view().grin) {
            return;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    panic!("{what} never happened");
}

/// True if everything that is shown of the field has been computed.
fn is_seen(forming: &GrinView) -> bool {
    let GrinView { run, slice: Some(slice), analysis: Some(sighting), .. } = forming else {
        return false;
    };
    let Some(run) = &run.snapshot else { return false };
    let (Ok(slice), Ok(sighting)) = (slice.as_ref(), sighting.as_ref()) else { return false };
    let media = [&slice.field, &sighting.field];
    if run.document.task.is_some() && forming.pictures.is_none() {
        return false;
    }
    media.into_iter().all(|medium| std::sync::Arc::ptr_eq(medium, &run.field))
}

/// A task that is open, looked at, and maybe worked on to its end.
fn opened(name: &str, to_its_end: bool) -> GrinView {
    let mut session = Session::new(blank(), || {}).unwrap();
    session.apply(Command::Grin(GrinCommand::SetActive(true)));
    session.apply(Command::Grin(GrinCommand::OpenBuiltin(name.to_owned())));
    wait(&mut session, "the opening", |forming| forming.run.snapshot.is_some());
    if to_its_end {
        session.apply(Command::Grin(GrinCommand::Start));
        wait(&mut session, "the end", |forming| forming.run.status == RunStatus::Finished);
    }
    wait(&mut session, "the view", is_seen);
    session.view().grin
}

#[test]
fn without_a_task_the_panel_shows_instructions() {
    let mut harness = panel(GrinView::default());
    harness.get_by_label_contains("Open a task and press Optimize");
    assert_eq!(harness.state().commands, []);
    assert!(harness.query_by_label("Optimize").is_none());
    press(&mut harness, "Luneburg lens as a function of the radius");
    press(&mut harness, "Open file…");
    assert_eq!(asked(&harness), [GrinCommand::OpenBuiltin("luneburg-radial".into())]);
    assert_eq!(harness.state().requests, [FileRequest::OpenField]);

    let mut failed = GrinView::default();
    failed.run.error = Some("a.json: found a lens".into());
    panel(failed).get_by_label("A.json: found a lens");
    let opening = GrinView { opening: true, ..GrinView::default() };
    panel(opening).get_by_label("Opening…");
}

#[test]
fn a_grin_design_is_run_turned_and_saved_by_buttons() {
    let ready = opened("luneburg-radial", false);
    let sight = ready.slice_settings;
    let mut harness = panel(ready.clone());
    harness.get_by_label_contains("Ready: at most 120 steps, 6, 9 nodes");
    harness.get_by_label_contains("at y = 0 mm: index");
    harness.get_by_label("focus: 11 rays");
    harness.get_by_label_contains("64 rays, none excluded");
    harness.get_by_label_contains("halving it moves 64 exits by at most");
    for button in ["Optimize", "Save volume…", "x", "Close"] {
        press(&mut harness, button);
    }
    let turned = SliceSettings { plane: SlicePlane { axis: SpatialAxis::X, depth: 0.0 }, ..sight };
    assert_eq!(
        asked(&harness),
        [GrinCommand::Start, GrinCommand::SetSlice(turned), GrinCommand::Close]
    );
    assert_eq!(harness.state().requests, [FileRequest::SaveField(65)]);

    let mut harness = panel(ready.clone());
    harness.get_by_role_and_label(Role::Slider, "Depth of the slice").set_value_accesskit(0.25);
    harness.run();
    let moved = asked(&harness);
    let [
        GrinCommand::SetSlice(SliceSettings {
            plane: SlicePlane { axis: SpatialAxis::Y, depth },
            ..
        }),
    ] = &moved[..]
    else {
        panic!("{moved:?}");
    };
    assert!((depth - 0.25).abs() < 1e-9, "{depth}");

    for (standing, buttons) in [
        (RunStatus::Running, [("Pause", GrinCommand::Pause), ("Stop", GrinCommand::Stop)]),
        (RunStatus::Paused, [("Resume", GrinCommand::Resume), ("Stop", GrinCommand::Stop)]),
    ] {
        let mut held = opened("luneburg-radial", true);
        held.run.status = standing;
        for (button, form) in buttons {
            let mut harness = panel(held.clone());
            press(&mut harness, "Optimize");
            press(&mut harness, button);
            assert_eq!(asked(&harness), [form], "it is under way already");
        }
    }
}

#[test]
fn a_designed_field_shows_values_curves_and_positions() {
    let found = opened("luneburg-radial", true);
    let mut harness = panel(found);
    harness.get_by_label_contains("Finished: step ");
    harness.get_by_label_contains("relative error ");
    harness.get_by_label_contains("rays forward and back in ");
    harness.get_by_label("Start over");
    press(&mut harness, "Loss");
    harness.get_by_label_contains("Loss against ");
    press(&mut harness, "Profile");
    harness.get_by_label("Index along r");
    press(&mut harness, "Images");
    assert!(harness.query_by_label("Index along r").is_some(), "this task makes no image");

    let slice = harness.get_by_label_contains("at y = 0 mm: index").rect();
    harness.get_by_label_contains("Hover to read the field");
    harness.get_by_label_contains("at y = 0 mm: index").click();
    harness.run();
    harness.get_by_label_contains("index 1.40");
    assert!(slice.width() > 300.0 && slice.height() > 300.0, "{slice}");
    press(&mut harness, "Unpin");
    assert!(harness.query_by_label("Unpin").is_none());

    harness.get_by_label("Quantity of the slice").click();
    harness.run();
    press(&mut harness, SliceQuantity::Error.name());
    let [GrinCommand::SetSlice(sight)] = asked(&harness)[..] else {
        panic!("{:?}", asked(&harness))
    };
    assert_eq!(sight.quantity, SliceQuantity::Error);
}

#[test]
fn images_are_shown_beside_their_targets() {
    let rendered = opened("display", false);
    // While a design takes steps there are only the images of its loss.
    let mut harness = panel(GrinView { pictures: None, ..rendered.clone() });
    harness.get_by_label("face: 11 rays");
    press(&mut harness, "Images");
    assert_eq!(harness.get_all_by_label_contains("dB PSNR, 16384 rays, none excluded").count(), 2);
    let mut harness = panel(rendered);
    press(&mut harness, "Images");
    for view in ["face", "letter"] {
        let text = format!("{view}: ");
        let shown = harness.get_all_by_label_contains(&text).map(|node| format!("{node:?}"));
        let shown = shown.collect::<String>();
        for part in [" ± ", "dB PSNR", "100.00 ± 0.00 % of the light", "% of the mean", "0 lost"]
        {
            assert!(shown.contains(part), "{shown}: no {part}");
        }
    }
    harness.get_by_label_contains("Images in ");
    for view in ["face", "letter"] {
        for what in ["target", "result"] {
            harness.get_by_label(&format!("Image of {view}: {what}"));
        }
    }
}
