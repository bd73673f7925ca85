//! Typing a path where the desktop has no dialog.

use std::path::{Path, PathBuf};

use aplanat::studio::chooser::{Chooser, Purpose};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

type State = (Chooser, Option<(Purpose, PathBuf)>);

fn harness(purpose: Purpose, near: &str) -> Harness<'static, State> {
    let mut chooser = Chooser::default();
    chooser.ask_for_path(purpose, Some(Path::new(near)));
    Harness::new_ui_state(
        |ui, (chooser, chosen): &mut State| {
            if let Some(choice) = chooser.ui(ui.ctx()) {
                *chosen = Some(choice);
            }
        },
        (chooser, None),
    )
}

#[test]
fn a_typed_path_is_given_once_confirmed() {
    let mut harness = harness(Purpose::Save, "");
    harness.run();
    harness.get_by_label("Path").type_text("better");
    harness.run();
    assert_eq!(harness.state().1, None, "nothing is chosen while one types");
    harness.get_by_label("OK").click();
    harness.run();
    assert_eq!(harness.state().1, Some((Purpose::Save, PathBuf::from("better.json"))));
    assert!(harness.query_by_label("OK").is_none(), "the question is gone");
}

#[test]
fn a_question_can_be_left_unanswered() {
    let mut harness = harness(Purpose::Open, "lens.json");
    harness.run();
    harness.get_by_label("Cancel").click();
    harness.run();
    assert_eq!(harness.state().1, None);
    assert!(harness.query_by_label("OK").is_none());
}
