//! Files written by the first version of the program open, and are written back with the same keys.

use crate::cli::{Scratch, aplanat, done_json};
use aplanat::files::{json, read_volume};
use aplanat::lens::{Lens, Medium, Quantity};
use aplanat::merit::Goal;
use aplanat::search::SearchRules;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::path::Path;

fn text(name: &str) -> String {
    std::fs::read_to_string(format!("tests/files/{name}")).unwrap()
}

/// Reads a value and checks that it is written with the keys and numbers of the file.
fn read_and_write<T: DeserializeOwned + Serialize>(name: &str) -> T {
    let text = text(name);
    let value: T = json::read_json(&text, name).unwrap();
    let written = serde_json::to_value(&value).unwrap();
    assert_eq!(written, serde_json::from_str::<Value>(&text).unwrap(), "{name}");
    value
}

#[test]
fn an_old_lens_file_is_written_back_to_the_byte() {
    let text = text("old_lens.json");
    let lens: Lens = json::read(&text, "old_lens.json").unwrap();
    assert_eq!(json::write(&lens), text);
    assert_eq!((lens.zoom.len(), lens.pickups.len(), lens.variables.len()), (2, 1, 8));
    assert!(matches!(lens.surfaces[4].medium, Medium::Grin(_)));
    assert!(lens.surfaces[7].hyperhemisphere);
    assert_eq!(lens.image_solve, Some(0.1));
    let gap = lens.variables[5].parameter;
    assert_eq!((gap.quantity, gap.zoom), (Quantity::Thickness, Some(1)));
}

#[test]
fn an_old_goal_and_old_rules_keep_their_keys() {
    let goal: Goal = read_and_write("old_goal.json");
    assert_eq!(goal.terms.len(), 17);
    let rules: SearchRules = read_and_write("old_rules.json");
    assert_eq!(rules.weights.len(), 2);
}

#[test]
fn old_volumes_are_read() {
    let volume = read_volume(Path::new("tests/files/old_volume.npz")).unwrap();
    assert_eq!(volume.values.len(), volume.grid.counts().iter().product::<usize>());
    let raw = read_volume(Path::new("tests/files/old_volume.json")).unwrap();
    assert_eq!((raw.values[0], raw.values[7]), (1.5, 1.5 + 0.001 * 70.0));
}

#[test]
fn old_grin_tasks_keep_their_keys() {
    let tasks: Vec<Value> = serde_json::from_str(&text("old_grin_tasks.json")).unwrap();
    assert_eq!(tasks.len(), 7);
    for task in tasks {
        assert_eq!(done_json(&["grin", "-", "--show"], &task.to_string()), task);
    }
}

#[test]
fn an_old_checkpoint_is_resumed() {
    let checkpoint = Scratch::with("old-checkpoint.json", &text("old_checkpoint.json"));
    let lens = "lenses/cooke_triplet_100_f27.json";
    let rules = "tests/files/old_rules.json";
    let base = ["search", lens, "--rules", rules, "--checkpoint", checkpoint.path()];
    let idle = done_json(&[&base[..], &["--iterations", "12"]].concat(), "");
    assert_eq!((&idle["resumed"], &idle["gradients_in_all"]), (&true.into(), &12.into()));
    // The best lens is judged anew by the rays of this version, and moved to where its limits hold: it has lost
    // nothing beyond the errors that its terms state.
    let best = idle["merit_best"].as_f64().unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    let stated = |term: &Value| number(&term["weight"]) * number(&term["after"]["error"]);
    let error: f64 = idle["terms"].as_array().unwrap().iter().map(stated).sum();
    assert!(best < 0.024163391142644257 + error && error < 2e-2 * best, "{best} ± {error}");
    assert_eq!(idle["best_breaks"], json!([]));
    let refused = |report: &Value, kind: &str| {
        let rows = report["mutations"].as_array().unwrap();
        rows.iter().find(|row| row["kind"] == kind).unwrap()["refused"].clone()
    };
    // Earlier versions recorded the reasons as text: the count remains, under its own name.
    assert_eq!(refused(&idle, "split"), json!({"other": 1}));
    // It goes on by the method of its time, which was damped least squares.
    let other = [&base[..], &["--iterations", "40", "--descent", "trust-region"]].concat();
    let output = aplanat(&other, "");
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        output.status.code() == Some(2) && errors.contains("landscape.local.method"),
        "{errors}"
    );
    let more = done_json(&[&base[..], &["--iterations", "40"]].concat(), "");
    assert_eq!((&more["resumed"], &more["gradients"]), (&true.into(), &28.into()));
}

/// A merit that the lens does not have is corrected.
#[test]
fn an_old_checkpoint_with_a_wrong_digit_tells_the_truth() {
    let mut file: Value = serde_json::from_str(&text("old_checkpoint.json")).unwrap();
    file["run"]["best"]["loss"] = json!(0.0024163391142644257);
    let checkpoint = Scratch::with("wrong-digit.json", &file.to_string());
    let lens = "lenses/cooke_triplet_100_f27.json";
    let rules = "tests/files/old_rules.json";
    let base = ["search", lens, "--rules", rules, "--checkpoint", checkpoint.path()];
    let idle = done_json(&[&base[..], &["--iterations", "12"]].concat(), "");
    let terms = idle["terms"].as_array().unwrap();
    let part =
        |term: &Value| term["weight"].as_f64().unwrap() * term["after"]["value"].as_f64().unwrap();
    let (sum, best) = (terms.iter().map(part).sum::<f64>(), idle["merit_best"].as_f64().unwrap());
    assert!((sum / best - 1.0).abs() < 1e-9, "{sum} {best}");
}
