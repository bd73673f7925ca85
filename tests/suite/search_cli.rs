//! The search command from outside: its keys, its errors, and runs that are killed.

use super::cli::{Scratch, done, done_json, has_keys, refused};
use aplanat::files;
use aplanat::merit::{Goal, Term, TermScope, WeightedTerm};
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
fn a_search_killed_twenty_times_ends_with_the_same_result() {
    for method in ["iterated", "restore"] {
        kill_search(method);
    }
}

fn kill_search(method: &str) {
    const TRIPLET: &str = "lenses/cooke_triplet_100_f27.json";
    let options = ["--seed", "3", "--chains", "2", "--iterations", "600"];
    let base = [&["search", TRIPLET, "--method", method][..], &options].concat();
    let whole = done_json(&base, "");
    let checkpoint = Scratch::new(&format!("killed-{method}.json"));
    let mut killed = 0;
    for round in 0..20_u64 {
        let mut child = Command::new(env!("CARGO_BIN_EXE_aplanat"))
            .args(&base)
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
    assert_eq!(
        again["nothing_to_do"],
        "nothing to do: 40 of 40 gradients are made; raise --iterations"
    );
    assert_eq!(again["gradients_in_all"], 40);
    assert!(done(&base, "").contains("nothing to do: 40 of 40"));
    let sampler = [&base[..], &["--method", "restore"]].concat();
    refused(
        2,
        &sampler,
        "",
        &["another search", "method is \"iterated\" there and \"restore\" here"],
    );
    let more = [&base[..], &["--seed", "9"]].concat();
    refused(2, &more, "", &["another search", "settings.seed is 1 there and 9 here"]);
    let chains = [&base[..], &["--chains", "2"]].concat();
    refused(2, &chains, "", &["another search", "chains is 4 there and 2 here"]);
    let goal = [&base[..], &["--light", "0.9"]].concat();
    refused(2, &goal, "", &["another search", "landscape.goal", "light is 1.0 there and 0.9 here"]);
    let mut lens = base;
    lens[1] = "lenses/tessar_50_f28.json";
    let names = ["from another lens", "landscape.start.name", "Triplet 100", "Tessar 50"];
    refused(2, &lens, "", &[&["another search"][..], &names[..]].concat());
    let raised = done_json(&[&base[..3], &["100"], &base[4..]].concat(), "");
    assert_eq!(
        (raised["gradients"].clone(), raised["nothing_to_do"].clone()),
        (60.into(), Value::Null)
    );
}

#[test]
fn search_says_what_is_wrong_with_its_arguments() {
    let wrong = |arguments: &[&str], words: &[&str]| {
        refused(2, &[&["search", LENS], arguments].concat(), "", words);
    };
    wrong(&["--minutes", "0"], &["--minutes", "more than 0"]);
    wrong(&["--iterations", "0"], &["--iterations", "1 or more"]);
    wrong(&["--elements", "8..4"], &["smaller one first"]);
    wrong(&["--forbid", "paint"], &["add_singlet", "move_stop"]);
    wrong(&["--max-diameter=-3"], &["--max-diameter", "more than 0"]);
    wrong(&["--max-diameter", "-3"], &["--max-diameter", "found -3", "more than 0"]);
    wrong(&["--max-track", "-1e308"], &["--max-track", "found -1.0000e308"]);
    wrong(&["--max-diameter", "1"], &["no lens can satisfy", "semi-diameters of at most 0.5 mm"]);
    wrong(&["--max-track", "1"], &["no lens can satisfy", "a track of at most 1 mm"]);
    wrong(&["--min-back-focus", "1000"], &["no lens can satisfy", "a back focus of 1000"]);
    wrong(&["--focal-length", "1e308"], &["--focal-length", "1.0000e308"]);
    wrong(&["--heights", "-7"], &["--heights", "--focal-length"]);
    wrong(&["--minutes", "-1"], &["--minutes", "found -1", "more than 0"]);
    wrong(&["--chains", "1000000"], &["chains", "1000000", "1024"]);
    wrong(&["--steps", "1000000000"], &["steps", "1000000000", "10000"]);
    wrong(&["--c", "-1"], &["error: --c: found -1", "0 or more"]);
    wrong(&["--gamma", "-1e300"], &["gamma", "-1e300", "0 to 1"]);
    wrong(&["--temperature", "nan"], &["0 or more"]);
    wrong(&["--temperature", "-1"], &["0 or more"]);
    wrong(&["--error", "200%"], &["--error", "less than 100%"]);
    wrong(&["--method", "brute", "--chains", "0"], &["chains", "1 or more"]);
    wrong(&["--method", "metropolis", "--c", "-1"], &["error: --c: found -1"]);
    wrong(&["--light", "-1"], &["--light", "found -1"]);
    wrong(&["--open", "0"], &["--open", "more than 0"]);
    wrong(&["--heights", "0,7"], &["--heights", "--focal-length"]);
    wrong(&["--focal-length", "0"], &["--focal-length", "other than 0"]);
    wrong(&["--light=-1"], &["--light", "more than 0"]);
    wrong(&["--temperature", "cold"], &["0 or more", "infinite"]);
    wrong(&["--chains", "0"], &["chains", "1 or more"]);
    wrong(&["--reservoir", "0"], &["reservoir", "1 or more"]);
    wrong(&["--gamma", "2"], &["gamma", "0 to 1"]);
    wrong(&["--c=-1"], &["error: --c: found -1", "0 or more"]);
    wrong(&["--steps", "0"], &["steps", "1 or more"]);
    wrong(&["--error", "0"], &["more than 0"]);
    wrong(&["--method", "brute", "--minutes", "1"], &["gradients", "brute force"]);
    wrong(&["--out", "lens.txt"], &[".txt", ".json"]);
    wrong(&["--checkpoint", "no/such/run.json"], &["no such folder"]);
    wrong(&["--wavelength", "0"], &["--wavelength", "more than 0"]);
    wrong(&["--wavelength", "1e308"], &["wavelength is 1e308; expected"]);
    let rules = Scratch::with("rules.json", r#"{"glasses": ["SCHOTT N-BK77"]}"#);
    wrong(&["--rules", rules.path()], &["N-BK77"]);
    let rules = Scratch::with("rules-weight.json", r#"{"weights": [["bend", -2.0]]}"#);
    wrong(&["--rules", rules.path()], &["rules: the weight of bend is -2; expected 0 or more"]);
    let rules = Scratch::with("rules-kept.json", r#"{"kept": [5, 5]}"#);
    wrong(&["--rules", rules.path()], &["rules: kept is [5, 5]; expected"]);
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
    let words = ["focal length", "light, mm^2", "reservoir", "mutation", "generations", "term"];
    for word in words.into_iter().chain(["total_track", "the best lens"]) {
        assert!(text.contains(word), "{text}");
    }
    files::open(&out.0).unwrap().lens.check().unwrap();
    let count = std::fs::read_dir(folder.path()).unwrap().count();
    assert!(count > 0);
    std::fs::remove_dir_all(folder.path()).unwrap();
}

#[test]
fn samplers_are_compared() {
    let report = done_json(&["measure", "search", LENS, "--seconds", "0.2", "--seeds", "1"], "");
    for rows in [&report["methods"], &report["tolerances"]] {
        for row in rows.as_array().unwrap() {
            let marks = row["marks"].as_array().unwrap();
            assert_eq!(marks.len(), 4);
            assert!(marks.iter().all(|mark| mark["best"].as_f64().is_some()));
        }
    }
    assert_eq!(report["methods"][0]["method"], "iterated");
    let equal = ["measure", "search", LENS, "--iterations", "40", "--seeds", "3", "--methods"];
    let report = done_json(&[&equal[..], &["iterated,descent,brute"]].concat(), "");
    let rows = report["methods"].as_array().unwrap();
    assert_eq!((rows.len(), report["tolerances"].as_array().unwrap().len()), (3, 0));
    for row in rows {
        let ends: Vec<f64> =
            row["ends"].as_array().unwrap().iter().map(|end| end.as_f64().unwrap()).collect();
        assert_eq!(ends.len(), 3);
        let alike = ends[1..].iter().all(|end| *end == ends[0]);
        assert!(alike || row["method"] != "descent", "{row}");
    }
    assert!(rows[0]["against"].is_null() && rows[1]["against"]["seeds"].as_u64().is_some());
    assert!(done(&equal[..7], "").contains("first is better"));
    refused(2, &["measure", "search", LENS, "--seconds", "0"], "", &["--seconds"]);
    refused(2, &["measure", "search", LENS, "--seeds", "0"], "", &["--seeds"]);
}

/// No file that is read, or written by another argument, is written over.
#[test]
fn search_files_have_distinct_names() {
    let copy = Scratch::with("own.json", &std::fs::read_to_string(LENS).unwrap());
    let other = Scratch::new("other-own.json");
    let wrong = |arguments: &[&str], words: &[&str]| {
        refused(2, &[&["search", copy.path()], arguments].concat(), "", words);
    };
    wrong(&["--out", copy.path()], &["--out", "is the lens; expected another file"]);
    wrong(&["--checkpoint", copy.path()], &["--checkpoint", "is the lens"]);
    let both = ["--out", other.path(), "--checkpoint", other.path()];
    wrong(&both, &["--checkpoint", "is --out"]);
    let rules = Scratch::with("own-rules.json", "{}");
    wrong(&["--rules", rules.path(), "--out", rules.path()], &["--out", "is --rules"]);
    wrong(&["--reservoir-dir", copy.path()], &["is a file; expected a folder"]);
    assert!(!other.0.exists());
    if cfg!(target_os = "linux") {
        wrong(&["--checkpoint", "/proc/run.json"], &["/proc/run.json"]);
    }
}

#[test]
fn a_search_lists_violated_constraints() {
    let base = ["search", LENS, "--iterations", "60", "--max-track", "90", "--elements", "4..5"];
    let report = done_json(&base, "");
    let start = report["start_breaks"].as_array().unwrap();
    let names: Vec<&str> = start.iter().map(|limit| limit["term"].as_str().unwrap()).collect();
    assert!(names.contains(&"total_track") && names.contains(&"elements"), "{names:?}");
    let track = start.iter().find(|limit| limit["term"] == "total_track").unwrap();
    assert!((track["off_by"].as_f64().unwrap() - 29.08).abs() < 0.01, "{track}");
    has_keys(track, &["term", "surface", "zoom", "value", "min", "max", "off_by"]);
    assert!(report["best_breaks"].is_array());
    let terms = report["terms"].as_array().unwrap();
    let part =
        |term: &Value| term["weight"].as_f64().unwrap() * term["after"]["value"].as_f64().unwrap();
    let sum: f64 = terms.iter().map(part).sum();
    let best = report["merit_best"].as_f64().unwrap();
    assert!((sum / best - 1.0).abs() < 1e-12, "{sum} {best}");
    assert_eq!(report["gradients"], 60);
    assert_eq!(report["reservoir"][0]["merit"], report["merit_best"]);
    let said = Command::new(env!("CARGO_BIN_EXE_aplanat")).args(base).output().unwrap();
    let said = String::from_utf8(said.stderr).unwrap();
    assert!(said.contains("note: the start violates a constraint: total track"), "{said}");
}

/// A negative number is a number.
#[test]
fn signs_are_read() {
    let base = ["search", LENS, "--iterations", "8", "--heights", "-7,0", "--focal-length", "-100"];
    let report = done_json(&base, "");
    assert!(report["start"]["fields"][0]["y"].as_f64().unwrap() > 4.0 - 1e-9);
}

/// The merit function of the file counts without being asked for, but for what it asks of surfaces that
/// a mutation may remove.
#[test]
fn a_search_has_the_merit_function_of_its_file() {
    let mut lens = files::open(LENS).unwrap().lens;
    let mut goal = Goal::default_for(&lens).unwrap();
    goal.terms.retain(|weighted| !matches!(weighted.term, Term::TotalTrack(_)));
    goal.terms.push(WeightedTerm::new(Term::TotalTrack(90.0), 1.0));
    let mut edge = WeightedTerm::new(Term::GlassEdge(7.0), 1.0);
    edge.scope = TermScope { surfaces: Some([0, 1]), ..TermScope::default() };
    goal.terms.push(edge);
    lens.merit = Some(goal);
    let file = Scratch::new("own-merit.json");
    files::save(&lens, &file.0).unwrap();
    let base = ["search", file.path(), "--iterations", "20"];
    let report = done_json(&base, "");
    let start = report["start_breaks"].as_array().unwrap();
    let track = start.iter().find(|limit| limit["term"] == "total_track").unwrap();
    assert_eq!(track["max"].as_f64(), Some(90.0), "{track}");
    let said = Command::new(env!("CARGO_BIN_EXE_aplanat")).args(base).output().unwrap();
    let said = String::from_utf8(said.stderr).unwrap();
    assert!(said.contains("leaves out what the merit function asks of some surfaces"), "{said}");
}

/// A search for the spots of lenses that are made: the term stands in the report for the sharp spots, and the
/// tolerances of a file, which know no other structure, are refused.
#[test]
fn a_search_minimizes_the_spots_of_lenses_that_are_made() {
    const TESSAR: &str = "lenses/tessar_50_f28.json";
    let mut lens = files::open(TESSAR).unwrap().lens;
    lens.merit = Some(Goal::default_for(&lens).unwrap().as_built(None));
    let file = Scratch::new("as-built-merit.json");
    files::save(&lens, &file.0).unwrap();
    let few = ["search", file.path(), "--iterations", "10", "--elements", "3..5"];
    let words = ["as_built", "those of a class (--as-built commercial)"];
    refused(2, &few, "", &words);
    for lens in [TESSAR, file.path()] {
        let asked = [&["search", lens], &few[2..], &["--as-built", "commercial"]].concat();
        let report = done_json(&asked, "");
        let terms = report["terms"].as_array().unwrap();
        let of = |name: &str| terms.iter().filter(|term| term["term"] == name).count();
        assert_eq!((of("as_built"), of("spot")), (1, 0), "{report}");
    }
}
