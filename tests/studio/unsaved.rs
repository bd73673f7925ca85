//! Unsaved changes are not discarded without confirmation.

use std::time::Duration;

use aplanat::lens::blank;
use aplanat::session::{Command, GrinCommand, GrinRun, RunStatus, Session};
use aplanat::studio::Studio;
use aplanat::studio::draw::RenderBackend;
use aplanat::studio::window::Persistence;
use egui::accesskit::Role;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

type Window = Harness<'static, Studio>;

fn run(harness: &Window) -> Option<std::sync::Arc<GrinRun>> {
    harness.state().session().view().grin.run.snapshot
}

fn wait(harness: &mut Window, what: &str, so: impl Fn(&Window) -> bool) {
    for _ in 0..20_000 {
        harness.step();
        if so(harness) {
            return harness.run_steps(2);
        }
        std::thread::sleep(Duration::from_millis(3));
    }
    panic!("{what} never happened");
}

fn tell(harness: &mut Window, form: GrinCommand) {
    harness.state_mut().session_mut().apply(Command::Grin(form));
}

/// A window in which a field has been formed.
fn formed() -> Window {
    let session = Session::new(blank(), || {}).unwrap();
    let studio = Studio::new(session, RenderBackend::Software, Persistence::Disabled, None);
    let builder = Harness::builder().with_size([1280.0, 800.0]);
    let mut harness = builder.build_ui_state(|ui, studio: &mut Studio| studio.ui(ui), studio);
    harness.get_by_label("GRIN slice").click();
    tell(&mut harness, GrinCommand::OpenBuiltin("luneburg-radial".to_owned()));
    wait(&mut harness, "the opening", |harness| run(harness).is_some());
    assert!(!run(&harness).unwrap().is_unsaved(), "nothing has been formed yet");
    tell(&mut harness, GrinCommand::Start);
    let status = |harness: &Window| harness.state().session().view().grin.run.status;
    let is_done = |harness: &Window| status(harness) == RunStatus::Finished;
    wait(&mut harness, "the end", is_done);
    assert!(run(&harness).unwrap().is_unsaved());
    harness
}

fn press(harness: &mut Window, name: &str) {
    harness.get_by_role_and_label(Role::Button, name).click();
    harness.run_steps(3);
}

#[test]
fn an_unsaved_field_is_not_discarded_without_confirmation() {
    let mut harness = formed();
    press(&mut harness, "Start over");
    harness.get_by_label("Save the field first?");
    press(&mut harness, "Cancel");
    assert!(harness.query_by_label("Save the field first?").is_none());
    assert!(run(&harness).unwrap().is_unsaved(), "it is still there");
    press(&mut harness, "Start over");
    press(&mut harness, "Don't save");
    assert!(harness.query_by_label("Save the field first?").is_none());
    wait(&mut harness, "the beginning", |harness| {
        harness.state().session().view().grin.run.status != RunStatus::Starting
    });
}

#[test]
fn a_saved_field_is_replaced_without_confirmation() {
    let mut harness = formed();
    let path = std::env::temp_dir().join(format!("aplanat-{}-field.npz", std::process::id()));
    tell(&mut harness, GrinCommand::Save { path: path.clone(), nodes: 5 });
    wait(&mut harness, "the file", |harness| !run(harness).unwrap().is_unsaved());
    std::fs::remove_file(path).unwrap();
    press(&mut harness, "Start over");
    assert!(harness.query_by_label("Save the field first?").is_none());
}
