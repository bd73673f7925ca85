//! Typing a path where the desktop has no dialog.

use std::path::{Path, PathBuf};

use aplanat::studio::file_dialog::{FileDialog, FileRequest};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;

type State = (FileDialog, Option<(FileRequest, PathBuf)>);

fn harness(purpose: FileRequest, near: &str) -> Harness<'static, State> {
    let mut chooser = FileDialog::default();
    chooser.ask_in_window(purpose, Some(Path::new(near)));
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
fn a_typed_path_is_returned_after_confirmation() {
    let mut harness = harness(FileRequest::Save, "");
    harness.run();
    harness.get_by_label("Path").type_text("better");
    harness.run();
    assert_eq!(harness.state().1, None, "nothing is chosen while one types");
    harness.get_by_label("OK").click();
    harness.run();
    assert_eq!(harness.state().1, Some((FileRequest::Save, PathBuf::from("better.json"))));
    assert!(harness.query_by_label("OK").is_none(), "the question is gone");
}

/// As in the dialogs of a desktop the folder and the extension stay.
#[test]
fn what_is_typed_first_replaces_the_name_of_the_file() {
    let mut harness = harness(FileRequest::Save, "/home/designs/New lens.json");
    harness.run();
    for letter in ["m", "i", "n", "e"] {
        harness.event(egui::Event::Text(letter.to_owned()));
        harness.step();
    }
    harness.get_by_label("OK").click();
    harness.run();
    let path = PathBuf::from("/home/designs/mine.json");
    assert_eq!(harness.state().1, Some((FileRequest::Save, path)));
}

#[test]
fn a_confirmation_can_be_cancelled() {
    let mut harness = harness(FileRequest::Open, "lens.json");
    harness.run();
    harness.get_by_label("Cancel").click();
    harness.run();
    assert_eq!(harness.state().1, None);
    assert!(harness.query_by_label("OK").is_none());
}

#[test]
fn a_typed_path_of_an_existing_file_asks_before_it_is_replaced() {
    let path = std::env::temp_dir().join(format!("aplanat-existing-{}.json", std::process::id()));
    std::fs::write(&path, "{}").unwrap();
    let mut harness = harness(FileRequest::Save, path.to_str().unwrap());
    harness.run();
    harness.get_by_label("OK").click();
    harness.run();
    assert_eq!(harness.state().1, None);
    harness.get_by_label_contains("exists already");
    harness.get_by_label("Replace the file").click();
    harness.run();
    assert_eq!(harness.state().1, Some((FileRequest::Save, path.clone())));
    std::fs::remove_file(path).unwrap();
}
