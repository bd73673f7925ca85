//! What the command line says: notes, tables with heads, refusals that name the right file and number.

use super::cli::{Scratch, aplanat, done, done_json, refused};
use serde_json::json;

const GAUSS: &str = "lenses/double_gauss_rudolph_50.json";
const ZOOM: &str = "lenses/zoom_nikkor_28_80.json";
const ACHROMAT: &str = "lenses/achromat_ac254_100.json";
const SINGLET: &str = "lenses/singlet_la1131.json";

/// The text of an optimization of so many steps.
fn optimized(lens: &str, steps: &str, more: &[&str]) -> String {
    let out = Scratch::new(&format!("worded-{steps}-{}.json", more.len()));
    let arguments = ["optimize", lens, "--out", out.path(), "--steps", steps];
    done(&[&arguments[..], more].concat(), "")
}

#[test]
fn optimize_notes_thicknesses_without_limits() {
    let note = "no term limits thicknesses, but thicknesses vary";
    let sharp = |more: &[serde_json::Value]| {
        let terms = [&[json!({"term": "spot", "weight": 1.0})], more].concat();
        Scratch::with(&format!("sharp-{}.json", more.len()), &json!({"terms": terms}).to_string())
    };
    let goal = sharp(&[]);
    let vary = ["--goal", goal.path(), "--vary", "curvatures,thicknesses"];
    assert!(optimized(SINGLET, "0", &vary).contains(note));
    let fixed = ["--goal", goal.path(), "--vary", "curvatures"];
    assert!(!optimized(SINGLET, "0", &fixed).contains(note));
    let limited = sharp(&[json!({"term": {"total_track": 90.0}, "weight": 1.0})]);
    let vary = ["--goal", limited.path(), "--vary", "curvatures,thicknesses"];
    assert!(!optimized(SINGLET, "0", &vary).contains(note));
}

#[test]
fn optimize_lists_every_active_limit_once_and_the_variables() {
    let text = optimized(GAUSS, "0", &["--error", "1%"]);
    assert!(text.contains("active limits; price: decrease of the merit per unit"), "{text}");
    let mut rows: Vec<&str> = text.lines().filter(|line| line.starts_with("glass_edge")).collect();
    // The first one is the term.
    rows.remove(0);
    let places: Vec<Vec<&str>> =
        rows.iter().map(|row| row.split_whitespace().take(4).collect()).collect();
    let mut distinct = places.clone();
    distinct.sort_unstable();
    distinct.dedup();
    assert_eq!(distinct.len(), places.len(), "{text}");
    let head = text.lines().find(|line| line.starts_with("variable ")).unwrap();
    assert_eq!(head.split_whitespace().collect::<Vec<_>>(), ["variable", "before", "after"]);
    assert!(text.contains("curvature of surface 1 "), "{text}");
}

#[test]
fn a_wrong_term_names_the_file_of_the_goal() {
    let terms = json!({"terms": [{"term": {"relative_illumination": {"field": 9, "min": 0.5}},
        "weight": 1.0}]});
    let goal = Scratch::with("wrong-term.json", &terms.to_string());
    let out = Scratch::new("wrong-term-out.json");
    let arguments = ["optimize", SINGLET, "--out", out.path(), "--goal", goal.path()];
    let output = aplanat(&[&arguments[..], &["--vary", "curvatures"]].concat(), "");
    let errors = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{errors}");
    assert!(errors.contains(goal.path()) && errors.contains("relative_illumination"), "{errors}");
    assert!(!errors.contains(SINGLET), "{errors}");
}

#[test]
fn a_wrong_zoom_position_names_the_file_of_the_rays() {
    let rays = json!({"zoom": 7, "rays": []}).to_string();
    refused(2, &["trace", ZOOM, "--rays", "-"], &rays, &["input: `zoom`", "position 7", ZOOM]);
}

#[test]
fn a_judgement_with_broken_limits_fails_and_is_printed() {
    let spec =
        json!({"focal_length_mm": 50, "f_number": 5, "half_field_deg": 1, "max_elements": 3});
    let spec = Scratch::with("few.json", &spec.to_string());
    let output = aplanat(&["design", spec.path(), "--judge", GAUSS], "");
    assert_eq!(output.status.code(), Some(1));
    let told = String::from_utf8(output.stdout).unwrap();
    assert!(told.contains("elements; at most 3 allowed"), "{told}");
    assert!(String::from_utf8(output.stderr).unwrap().contains("the lens breaks"));
}

#[test]
fn negative_numbers_are_refused_by_their_range() {
    let refuse = |arguments: &[&str], words: &[&str]| {
        let output = aplanat(arguments, "");
        let errors = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {errors}");
        assert!(!errors.contains("to pass"), "{errors}");
        assert!(words.iter().all(|word| errors.contains(word)), "{arguments:?}: {errors}");
    };
    refuse(&["analyze", SINGLET, "spot", "--error", "-1"], &["more than 0"]);
    refuse(&["design", "-", "--minutes", "-1"], &["--minutes", "expected 0 or more"]);
    refuse(&["tolerance", SINGLET, "--rms", "-1"], &["--rms", "more than 0"]);
    refuse(&["tolerance", SINGLET, "--samples", "1"], &["2 or more"]);
    refuse(&["tolerance", SINGLET, "--rms", "wide"], &["expected a number"]);
    refuse(&["analyze", SINGLET, "mtf", "--frequencies", "-3"], &["--frequencies", "-3"]);
}

#[test]
fn mutations_are_listed_and_may_be_spelled_either_way() {
    let help = done(&["search", "--help"], "");
    assert!(help.contains("`add_singlet`, `remove_singlet`") && help.contains("global_draw"));
    for name in ["add-singlet", "add_singlet"] {
        done(&["search", SINGLET, "--iterations", "1", "--forbid", name], "");
    }
    refused(2, &["search", SINGLET, "--forbid", "none"], "", &["add_singlet, remove_singlet"]);
}

#[test]
fn info_names_quantities_as_the_window_does() {
    let text = done(&["info", SINGLET], "");
    for name in ["back focal length", "entrance pupil diameter", "defocus", "Petzval radius"] {
        assert!(text.contains(name), "{name}: {text}");
    }
}

#[test]
fn effects_are_one_line() {
    for what in ["spot", "fan", "distortion"] {
        let text = done(&["analyze", SINGLET, what, "--error", "1%"], "");
        let lines: Vec<&str> = text.lines().filter(|line| line.contains("omitted")).collect();
        assert_eq!(lines.len(), 1, "{text}");
        assert!(lines[0].starts_with("effects: ") && lines[0].contains("`aplanat info`"), "{text}");
    }
}

#[test]
fn tables_have_heads_and_no_rounding_noise() {
    let analyzed =
        |what: &str| done(&["analyze", ACHROMAT, what, "--error", "5%", "--field", "0"], "");
    let zernike = analyzed("zernike");
    assert!(zernike.contains("(condition number 1)") || zernike.contains("projections"));
    assert!(!zernike.contains("-0.000000"), "{zernike}");
    assert!(zernike.contains("defocus") && zernike.contains("spherical"), "{zernike}");
    // On the axis the brightest point of a centred lens is on it, by symmetry.
    assert!(analyzed("psf").contains("found at x 0, y 0, along the axis"));
    for (what, heads) in [
        ("psf", ["x, mm", "y, mm", "intensity"]),
        ("mtf", ["cycles/mm", "tangential", "sagittal"]),
        ("through-focus-mtf", ["shift, mm", "tangential", "sagittal"]),
        ("footprint", ["x, mm", "y, mm", ""]),
        ("encircled-energy", ["radius, mm", "share", ""]),
    ] {
        let text = analyzed(what);
        let is_head = |line: &str| heads.iter().all(|head| line.contains(head));
        assert!(text.lines().skip(1).any(is_head), "{text}");
    }
}

/// Encircled energy says as contrast does that it did not reach its tolerance.
#[test]
fn encircled_energy_says_whether_its_tolerance_was_reached() {
    let asked = |error: &'static str| {
        ["analyze", ACHROMAT, "encircled-energy", "--field=0", "--radii=0.002", "--error", error]
    };
    let text = done(&asked("1e-15"), "");
    assert!(text.contains("tolerance not reached: limited by the number of rays"), "{text}");
    let found = &done_json(&asked("1%"), "")["fields"][0];
    assert!(found["reached"] == true && found["limit"].is_null(), "{found}");
}
