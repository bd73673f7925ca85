//! The search as other programs see it: its keys, its refusals, and runs that are killed.

use super::cli::{Scratch, done, done_json, has_keys, refused};
use serde_json::Value;
use std::process::{Command, Stdio};
use std::time::Duration;

const LENS: &str = "lenses/cooke_triplet_100_f27.json";

/// The result without what tells the time, or where it was taken up again.
fn lasting(mut report: Value) -> Value {
    for key in ["ms", "figures_ms", "resumed", "gradients"] {
        report[key] = Value::Null;
    }
    report
}

/// Kills a search at moments that have nothing to do with what it does, again and again; what it
/// comes to in the end is what it would have come to undisturbed.
#[test]
fn a_search_that_is_killed_twenty_times_ends_as_if_it_had_not_been() {
    let base = ["search", LENS, "--seed", "3", "--chains", "2", "--iterations", "1200"];
    let whole = done_json(&base, "");
    let checkpoint = Scratch::new("killed.json");
    let mut killed = 0;
    for round in 0..20_u64 {
        let mut child = Command::new(env!("CARGO_BIN_EXE_aplanat"))
            .args(base)
            .args(["--checkpoint", checkpoint.path(), "--checkpoint-every", "0"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // 20 to 276 ms, spread by a multiplier that is prime to the range.
        std::thread::sleep(Duration::from_millis(20 + (round * 97) % 257));
        child.kill().unwrap();
        killed += usize::from(child.wait().unwrap().code().is_none());
    }
    assert!(killed > 0, "it was never killed in time");
    let arguments = [&base[..], &["--checkpoint", checkpoint.path()]].concat();
    let resumed = done_json(&arguments, "");
    assert_eq!(lasting(resumed), lasting(whole));
}

#[test]
fn a_checkpoint_of_another_search_is_refused() {
    let checkpoint = Scratch::new("other.json");
    let base = ["search", LENS, "--iterations", "40", "--checkpoint", checkpoint.path()];
    has_keys(&done_json(&base, ""), &["ended", "resumed", "best", "start", "reservoir"]);
    let again = done_json(&base, "");
    assert_eq!((again["resumed"].clone(), again["gradients"].clone()), (true.into(), 0.into()));
    let more = [&base[..], &["--seed", "9"]].concat();
    refused(2, &more, "", &["another search", "settings.seed"]);
    let goal = [&base[..], &["--light", "0.9"]].concat();
    refused(2, &goal, "", &["another search", "landscape.goal"]);
    let mut lens = base;
    lens[1] = "lenses/tessar_50_f28.json";
    refused(2, &lens, "", &["another search", "landscape"]);
}

#[test]
fn search_says_what_is_wrong_with_its_arguments() {
    let wrong = |arguments: &[&str], words: &[&str]| {
        refused(2, &[&["search", LENS], arguments].concat(), "", words);
    };
    wrong(&["--minutes", "0"], &["--minutes", "more than 0"]);
    wrong(&["--iterations", "0"], &["--iterations", "1 or more"]);
    wrong(&["--elements", "8..4"], &["smaller one first"]);
    wrong(&["--forbid", "paint"], &["add-singlet", "move-stop"]);
    wrong(&["--max-diameter", "-3"], &["--max-diameter", "more than 0"]);
    wrong(&["--open", "0"], &["--open", "more than 0"]);
    wrong(&["--heights", "0,7"], &["--heights", "--focal-length"]);
    wrong(&["--focal-length", "0"], &["--focal-length", "other than 0"]);
    wrong(&["--light", "-1"], &["--light", "more than 0"]);
    wrong(&["--temperature", "cold"], &["0 or more", "infinite"]);
    wrong(&["--chains", "0"], &["chains", "1 or more"]);
    wrong(&["--reservoir", "0"], &["reservoir", "1 or more"]);
    wrong(&["--gamma", "2"], &["gamma", "0 to 1"]);
    wrong(&["--c", "-1"], &["setting c", "0 or more"]);
    wrong(&["--steps", "0"], &["steps", "1 or more"]);
    wrong(&["--error", "0"], &["more than 0"]);
    wrong(&["--method", "brute", "--minutes", "1"], &["gradients", "brute force"]);
    wrong(&["--out", "lens.txt"], &[".txt", ".json"]);
    wrong(&["--checkpoint", "no/such/run.json"], &["no such folder"]);
    wrong(&["--wavelength", "0"], &["--wavelength", "more than 0"]);
    let rules = Scratch::with("rules.json", r#"{"glasses": ["SCHOTT N-BK77"]}"#);
    wrong(&["--rules", rules.path()], &["N-BK77"]);
    let rules = Scratch::with("rules-key.json", r#"{"elephants": 3}"#);
    wrong(&["--rules", rules.path()], &["elephants"]);
}

#[test]
fn a_search_writes_its_lens_and_its_reservoir() {
    let (out, folder) = (Scratch::new("found.json"), Scratch::new("reservoir"));
    let text = done(
        &[
            "search",
            LENS,
            "--iterations",
            "400",
            "--out",
            out.path(),
            "--reservoir-dir",
            folder.path(),
            "--free",
            "--open",
            "25",
        ],
        "",
    );
    for word in ["focal length", "light, mm^2", "reservoir", "mutation", "generations"] {
        assert!(text.contains(word), "{text}");
    }
    aplanat::files::open(&out.0).unwrap().lens.check().unwrap();
    let count = std::fs::read_dir(folder.path()).unwrap().count();
    assert!(count > 0);
    std::fs::remove_dir_all(folder.path()).unwrap();
}

#[test]
fn samplers_race() {
    let report = done_json(&["measure", "search", LENS, "--seconds", "0.2", "--seeds", "1"], "");
    for rows in [&report["methods"], &report["tolerances"]] {
        for row in rows.as_array().unwrap() {
            let marks = row["marks"].as_array().unwrap();
            assert_eq!(marks.len(), 4);
            assert!(marks.iter().all(|mark| mark["best"].as_f64().is_some()));
        }
    }
    refused(2, &["measure", "search", LENS, "--seconds", "0"], "", &["--seconds"]);
    refused(2, &["measure", "search", LENS, "--seeds", "0"], "", &["--seeds"]);
}
