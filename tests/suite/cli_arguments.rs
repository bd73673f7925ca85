//! Arguments that cannot be meant are refused, and printed numbers come with what tells them apart.

use super::cli::{Scratch, done, done_json, refused};
use serde_json::Value;

const LENS: &str = "lenses/double_gauss_rudolph_50.json";

#[test]
fn a_tolerance_of_all_is_refused() {
    for error in ["100%", "200%", "1", "inf"] {
        let words = ["--error", "less than 100%"];
        refused(2, &["analyze", LENS, "spot", "--error", error], "", &words);
        refused(2, &["gradient", LENS, "--error", error], "", &words);
    }
    done(&["analyze", LENS, "spot", "--error", "99%"], "");
}

#[test]
fn a_design_without_steps_is_refused() {
    refused(2, &["grin", "luneburg", "--iterations", "0"], "", &["--iterations", "1 or more"]);
}

#[test]
fn too_few_rays_for_an_error_are_refused_with_their_number() {
    let with = |rays: &str| ["gradient", LENS, "--field", "20", "--rays", rays].map(str::to_owned);
    let few = with("10");
    let few: Vec<&str> = few.iter().map(String::as_str).collect();
    refused(2, &few, "", &["--rays: found 10", "expected at least"]);
    let enough = with("2000");
    let enough: Vec<&str> = enough.iter().map(String::as_str).collect();
    let report = done_json(&enough, "");
    for error in report["d_error"]["curvature"].as_array().unwrap() {
        assert!(error.as_f64().is_some(), "{report}");
    }
}

#[test]
fn optimize_says_what_became_of_the_focal_length() {
    let out = Scratch::new("focal.json");
    let arguments = ["optimize", LENS, "--out", out.path(), "--steps", "3", "--vary", "curvatures"];
    let report = done_json(&arguments, "");
    let focal = |key: &str| report["focal_lengths"][0][key].as_f64().unwrap();
    let read = |file: &str| done_json(&["info", file], "")["efl"].as_f64().unwrap();
    assert!((focal("before") - read(LENS)).abs() < 1e-12);
    assert!((focal("after") - read(out.path())).abs() < 1e-12);
    // The goal of a lens without one of its own keeps the focal length.
    assert!((focal("before") - focal("after")).abs() < 1e-9);
    let told = done(&arguments, "");
    assert!(told.contains("focal length 49.38898 -> "), "{told}");
}

#[test]
fn the_spots_of_an_imported_lens_have_errors() {
    let (foreign, own) = (Scratch::new("spots.zmx"), Scratch::new("spots.json"));
    done(&["convert", LENS, foreign.path()], "");
    let report = done_json(&["convert", foreign.path(), own.path()], "");
    let check = &report["checks"][0];
    for i in 0..3 {
        let [spot, error] = ["rms_spot_um", "rms_spot_error_um"].map(|k| check[k][i].as_f64());
        let (spot, error) = (spot.unwrap(), error.unwrap());
        assert!(0.0 < error && error < 0.1 * spot, "{spot} {error}");
    }
    assert!(done(&["convert", foreign.path(), own.path()], "").contains(" ± "));
}

#[test]
fn limits_of_light_are_told_apart_by_wavelength() {
    let arguments = ["search", LENS, "--light", "2", "--iterations", "30"];
    let report = done_json(&arguments, "");
    let light = |limit: &&Value| limit["term"] == "light";
    let breaks: Vec<&Value> =
        report["start_breaks"].as_array().unwrap().iter().filter(light).collect();
    let place = |limit: &&Value| (limit["surface"].to_string(), limit["um"].to_string());
    let mut places: Vec<_> = breaks.iter().map(place).collect();
    places.sort();
    places.dedup();
    assert!(breaks.len() > 3 && places.len() == breaks.len(), "{report}");
    assert!(breaks.iter().all(|limit| limit["um"].as_f64().is_some()));
}

#[test]
fn a_folder_is_created_only_in_one_that_exists() {
    let folder = std::env::temp_dir().join(format!("aplanat-{}-no", std::process::id()));
    let deep = folder.join("such/front");
    let words = ["no folder", folder.to_str().unwrap()];
    refused(2, &["pareto", LENS, "--out", deep.to_str().unwrap()], "", &words);
    refused(2, &["experiment", "3.3", "--out", deep.to_str().unwrap()], "", &words);
    assert!(!folder.exists());
}

#[test]
fn a_program_gets_results_and_errors_instead_of_output() {
    let run = |words: &[&str]| {
        let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
        aplanat::cli::run_collecting(&words)
    };
    let lens = "lenses/singlet_la1131.json";
    let info = run(&["info", lens]);
    let found: Value = serde_json::from_str(&info.json).unwrap();
    assert!(info.error.is_none() && info.status == 0 && found["efl"].as_f64().unwrap() > 1.0);
    let wrong = run(&["analyze", lens, "spot", "--zoom", "4"]);
    assert_eq!((wrong.json.as_str(), wrong.status), ("", 2));
    assert!(wrong.error.unwrap().contains("no zoom position 4"));
    let unknown = run(&["nothing", lens]);
    assert!(unknown.status == 2 && unknown.error.is_some());
}
