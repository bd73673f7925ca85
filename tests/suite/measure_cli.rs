//! `aplanat measure mtf`, `picture` and `minima`: their numbers, and what is refused.

use super::cli::{Scratch, done, done_json, refused};
use serde_json::Value;

const LENS: &str = "lenses/achromat_ac254_100.json";

fn rows(report: &Value) -> Vec<Value> {
    report["lenses"][0]["rows"].as_array().unwrap().clone()
}

#[test]
fn contrast_is_measured_both_ways_at_four_tolerances() {
    let chart = Scratch::new("mtf.png");
    let plot = chart.0.to_str().unwrap();
    let report =
        done_json(&["measure", "mtf", LENS, "--count", "2", "--highest", "8", "--plot", plot], "");
    assert_eq!(report["lenses"][0]["fields"], serde_json::json!([0.0, 0.7, 1.0]));
    assert_eq!(report["lenses"][0]["frequencies"], serde_json::json!([4.0, 8.0]));
    let rows = rows(&report);
    assert_eq!(rows.len(), 8);
    for row in &rows {
        let [error, tolerance] = ["error", "tolerance"].map(|key| row[key].as_f64().unwrap());
        assert!(row["reached"] == true && error <= tolerance, "{row}");
        assert!(row["ms"].as_f64().unwrap() > 0.0 && row["rays"].as_u64().unwrap() > 0, "{row}");
    }
    let png = std::fs::read(&chart.0).unwrap();
    assert_eq!(&png[1..4], b"PNG");
    let text = done(&["measure", "mtf", LENS, LENS, "--count", "1", "--highest", "2"], "");
    assert!(text.contains("1 frequencies from 2 to 2 cycles/mm"), "{text}");
    assert_eq!(text.matches("diffraction").count(), 8, "{text}");
}

#[test]
fn point_spreads_are_measured_at_four_tolerances() {
    let report = done_json(&["measure", "psf", LENS], "");
    let fields = report["fields"].as_array().unwrap();
    assert_eq!(fields.len(), 3);
    for row in fields.iter().flat_map(|field| field["rows"].as_array().unwrap()) {
        let [error, tolerance] = ["error", "tolerance"].map(|key| row[key].as_f64().unwrap());
        assert!(row["reached"] == true && error <= tolerance, "{row}");
        assert!(row["ms"].as_f64().unwrap() > 0.0 && row["rays"].as_u64().unwrap() > 0, "{row}");
    }
    assert!(fields.iter().all(|field| field["rows"].as_array().unwrap().len() == 4), "{report}");
}

/// An interpreter that answers with a contrast of one half everywhere: the error is the largest difference from it.
#[cfg(unix)]
#[test]
fn another_program_is_compared_in_the_same_run() {
    use std::os::unix::fs::PermissionsExt as _;
    let python = Scratch::new("python");
    let field = "[[0.5],[0.5]]";
    let color = format!("[{field},{field},{field}]");
    let row = |method: &str| {
        format!(r#"{{"method":"{method}","rays":64,"ms":12.5,"values":[{color},{color},{color}]}}"#)
    };
    let answer =
        format!(r#"{{"version":"0.0","rows":[{},{}]}}"#, row("geometric"), row("diffraction"));
    std::fs::write(&python.0, format!("#!/bin/sh\necho '{answer}'\n")).unwrap();
    std::fs::set_permissions(&python.0, std::fs::Permissions::from_mode(0o755)).unwrap();
    let path = python.0.to_str().unwrap();
    let asked = ["measure", "mtf", LENS, "--count", "1", "--highest", "2", "--optiland", path];
    let report = done_json(&asked, "");
    let found = &report["lenses"][0]["optiland"];
    assert_eq!(found["version"], "0.0");
    for row in found["rows"].as_array().unwrap() {
        let error = row["error"].as_f64().unwrap();
        assert!(error > 0.4 && error <= 0.5 && row["ms"] == 12.5, "{row}");
    }
    let text = done(&["measure", "mtf", LENS, "--count", "1", "--highest", "2"], "");
    assert!(text.contains("pip install optiland"), "{text}");
    refused(
        2,
        &["measure", "mtf", LENS, "--count", "1", "--optiland", "no-python"],
        "",
        &["--optiland", "no-python"],
    );
}

#[test]
fn pictures_are_measured_the_quick_way_and_the_exact_one() {
    let small = ["--pixels", "24x16", "--exact-pixels", "12x8", "--scene", "edge"];
    let report = done_json(&[&["measure", "picture", LENS], &small[..]].concat(), "");
    let rows = rows(&report);
    let ways: Vec<&str> = rows.iter().map(|row| row["way"].as_str().unwrap()).collect();
    assert_eq!(ways, ["first", "quick", "exact", "exact", "exact", "exact"]);
    let exact = &rows[2..];
    for row in exact {
        let [error, tolerance] = ["error", "tolerance"].map(|key| row[key].as_f64().unwrap());
        assert!(error <= tolerance, "{row}");
        let [ms, whole] = ["ms", "whole_ms"].map(|key| row[key].as_f64().unwrap());
        assert!(whole >= 4.0 * ms, "{row}");
    }
    assert!(exact.windows(2).all(|pair| pair[0]["error"].as_f64() >= pair[1]["error"].as_f64()));
}

#[test]
fn tolerances_are_exact_and_their_costs_are_told() {
    let report = done_json(
        &["measure", "tolerance", "lenses/tessar_50_f28.json", "--samples", "4", "--steps", "0"],
        "",
    );
    let cost = &report["cost"];
    assert!(cost["first_error"].as_f64().unwrap() < 1e-9, "{cost}");
    assert!(cost["second_error"].as_f64().unwrap() < 1e-7, "{cost}");
    assert!(cost["errors"].as_u64().unwrap() > 50 && cost["samples"] == 4, "{cost}");
    let counts: Vec<&Value> =
        cost["gradients"].as_array().unwrap().iter().map(|row| &row["tolerances"]).collect();
    assert_eq!(counts, [10, 100, 1000]);
    assert_eq!(report["designs"], Value::Null);
}

/// An exchange of glasses ends at its number of evaluations, and a round that does not fit does not count.
#[test]
fn an_exchange_of_glasses_ends_at_its_evaluations() {
    let command = ["measure", "glasses", "lenses/achromat_ac254_100.json", "--evaluations"];
    refused(2, &[&command[..], &["0"]].concat(), "", &["--evaluations: found 0"]);
    let found = done_json(&[&command[..], &["1"]].concat(), "");
    let row = &found["rows"][0];
    assert!(row["finished"] == false && row["exchanges"] == 0, "{row}");
    assert!(row["evaluations"] == 0 && row["merit_random"].is_null(), "{row}");
    assert_eq!(row["merit"], row["merit_optimized"]);
}

/// The spots of a singlet depend on its bending alone, and have one minimum in it; other ends are at
/// limits of its thickness and rims.
#[test]
fn descents_of_a_singlet_end_at_few_minima() {
    let command = ["measure", "minima", "lenses/singlet_la1131.json", "--starts", "24"];
    let count = |report: &Value, key: &str| report[key].as_u64().unwrap();
    let report = done_json(&command, "");
    let [ended, distinct] = ["ended", "distinct"].map(|key| count(&report, key));
    let parts = ["lost", "unfinished", "stuck", "ended"].map(|key| count(&report, key));
    assert_eq!(parts.iter().sum::<u64>(), 24, "{report}");
    assert!(ended >= 12 && distinct >= 1 && 3 * distinct <= ended, "{report}");
    assert!(count(&report, "found_once") + 2 * count(&report, "found_twice") <= ended, "{report}");
    // The same seed, the same minima; another one, other descents.
    let again = done_json(&command, "");
    for key in ["ended", "distinct", "evaluations", "best"] {
        assert_eq!(again[key], report[key], "{key}");
    }
    let other = done_json(&[&command[..], &["--seed", "2"]].concat(), "");
    assert_ne!(other["evaluations"], report["evaluations"]);
    refused(2, &["measure", "minima", LENS, "--starts", "0"], "", &["--starts", "1 or more"]);
}

#[test]
fn wrong_measurements_are_refused() {
    for (arguments, words) in [
        (vec!["mtf"], ["LENS", "required"]),
        (vec!["mtf", "no-lens.json"], ["no-lens.json", "No such file"]),
        (vec!["mtf", LENS, "--highest", "0"], ["--highest", "positive"]),
        (vec!["mtf", LENS, "--highest", "NaN"], ["--highest", "positive"]),
        (vec!["mtf", LENS, "--count", "0"], ["--count", "1 to"]),
        (vec!["gradient", LENS, "--frequency", "0"], ["--frequency", "positive"]),
        (vec!["psf", LENS, "--zoom", "3"], ["zoom", "3"]),
        (vec!["mtf", LENS, "--zoom", "3"], ["zoom", "3"]),
        (vec!["mtf", LENS, "--plot", "chart.gif"], ["chart.gif", "png"]),
        (vec!["picture", LENS, "--scene", "moon"], ["moon", "star"]),
        (vec!["picture", LENS, "--scene", "still-life"], ["still-life", "star"]),
        (vec!["picture", LENS, "--pixels", "0x3"], ["0x3", "columns"]),
        (vec!["picture", LENS, "--exact-pixels", "9"], ["9", "columns"]),
    ] {
        refused(2, &[&["measure"], &arguments[..]].concat(), "", &words);
    }
}
