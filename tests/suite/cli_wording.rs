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
    // Beyond some radius no affordable nodes resolve the fringes.
    let large = ["analyze", ACHROMAT, "encircled-energy", "--field=0", "--radii=5"];
    refused(2, &large, "", &["--radii: found 5; expected mm, at most"]);
    // A point far away has an error of its own.
    let far = ["analyze", ACHROMAT, "psf", "--field=0", "--error=1%", "--at=0.5,0"];
    let strehl = &done_json(&far, "")["fields"][0]["strehl"];
    assert!(strehl["error"].as_f64().unwrap() < 0.01, "{strehl}");
    let found = &done_json(&asked("1%"), "")["fields"][0];
    assert!(found["reached"] == true && found["limit"].is_null(), "{found}");
}

/// Drawn contrast begins at frequency 0, beside that of a lens without aberrations; a drawn image spans its light.
#[test]
fn drawn_contrast_and_images_have_all_of_their_range() {
    let svg = Scratch::new("range.svg");
    let drawn = |more: &[&str]| {
        let arguments = ["analyze", SINGLET, "--field=0", "--error=10%", "--plot", svg.path()];
        done_json(&[&arguments[..], more].concat(), "");
        std::fs::read_to_string(svg.path()).unwrap()
    };
    let text = drawn(&["mtf", "--frequencies", "20,40"]);
    assert!(text.contains("diffraction limit, f/"), "{text}");
    // The curves of rays: the polyline of the legend aside, each begins at the axis of contrast.
    let first = |line: &str| -> Option<f64> {
        let points = line.split("points=\"").nth(1)?;
        points.split([',', ' ', '"']).next()?.parse().ok()
    };
    let starts: Vec<f64> =
        text.lines().filter(|line| line.contains("polyline")).filter_map(first).collect();
    let left = starts.iter().copied().fold(f64::INFINITY, f64::min);
    let at_axis = starts.iter().filter(|x| (**x - left).abs() < 1e-6).count();
    assert!(at_axis >= 5, "{starts:?}");
    // A line over a wide gap would look like contrast.
    let begins_late = drawn(&["mtf", "--frequencies", "40,50"]);
    let starts: Vec<f64> =
        begins_late.lines().filter(|line| line.contains("polyline")).filter_map(first).collect();
    assert!(starts.iter().filter(|x| **x > left + 1.0).count() >= 2, "{starts:?}");
    let narrow = drawn(&["psf", "--reach", "20"]);
    let usual = drawn(&["psf"]);
    assert!(narrow.contains("curves ±") && narrow.contains(">20<"), "{narrow}");
    assert!(!usual.contains(">20<"), "{usual}");
    refused(2, &["analyze", SINGLET, "psf", "--reach", "5"], "", &["--plot"]);
    let wrong = ["analyze", SINGLET, "psf", "--plot", svg.path(), "--reach", "-5"];
    refused(2, &wrong, "", &["error: --reach: found -5; expected um"]);
}

/// Wrong options are blamed by their names, and say what was expected.
#[test]
fn wrong_options_are_blamed_by_their_names() {
    let png = Scratch::new("blamed.png");
    let picture = |more: &[&'static str]| {
        let own = ["picture", SINGLET, "--scene", "target", "--out"];
        [&own[..], &[png.path()], more].concat().iter().map(|word| (*word).to_owned()).collect()
    };
    let words = |arguments: &[&str]| -> Vec<String> {
        arguments.iter().map(|word| (*word).to_owned()).collect()
    };
    let cases: Vec<(Vec<String>, &str)> = vec![
        (
            words(&["analyze", SINGLET, "spot", "--field", "100"]),
            "--field: found 100; expected a field",
        ),
        (words(&["gradient", SINGLET, "--field", "100"]), "--field: found 100; expected a field"),
        (words(&["measure", "spot", SINGLET, "--field", "100"]), "--field: found 100; expected"),
        (words(&["analyze", SINGLET, "spot", "--zoom", "3"]), "--zoom: no zoom position 3 in"),
        (words(&["tolerance", ZOOM, "--zoom", "3"]), "--zoom: no zoom position 3 in"),
        (words(&["analyze", SINGLET, "ghosts", "--ghosts", "0"]), "--ghosts: found 0; expected 1"),
        (
            words(&["analyze", SINGLET, "thermal", "--temperatures", "-1000"]),
            "--temperatures: temperature is -1000; expected",
        ),
        (
            words(&["analyze", SINGLET, "illumination", "--wave", "1,2,3", "--distance", "-5"]),
            "--distance: the distance of a plane is -5; expected",
        ),
        (words(&["search", SINGLET, "--steps", "0"]), "--steps: the number of steps"),
        (words(&["search", SINGLET, "--chains", "0"]), "--chains: found 0; expected 1 or more"),
        (words(&["search", SINGLET, "--wavelength", "99"]), "--wavelength: SCHOTT N-BK7"),
        (picture(&["--diagonal", "-3"]), "--diagonal: found -3; expected mm, more than 0"),
        (picture(&["--focus", "10"]), "--focus: an object 10 mm in front of the lens"),
        (picture(&["--focus", "-10"]), "--focus: found -10; expected mm"),
        (picture(&["--distance", "-10"]), "--distance: found -10; expected mm"),
        (picture(&["--size", "5"]), "--size: the width of the scene is 5; expected"),
        (picture(&["--focus=500", "--focus-group=7..10"]), "--focus-group: found 7..10; expected"),
        (picture(&["--max-samples", "0"]), "--max-samples: found 0; expected 1 or more"),
        (
            picture(&["--sensor=phone", "--quantum-efficiency=3"]),
            "--quantum-efficiency: found 3; expected more than 0",
        ),
        (
            words(&["tolerance", SINGLET, "--seed", "-1"]),
            "invalid value '-1' for '--seed <N>': expected a whole number, 0 or more",
        ),
        (
            words(&["analyze", SINGLET, "spot", "--zoom", "x"]),
            "invalid value 'x' for '--zoom <N>': expected a whole number, 0 or more",
        ),
        (
            words(&["optimize", SINGLET, "--out", "x.json", "--steps", "99999999999999999999999"]),
            "invalid value '99999999999999999999999' for '--steps <N>': expected a smaller whole number",
        ),
    ];
    for (arguments, expected) in &cases {
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        refused(2, &arguments, "", &[&format!("error: {expected}")[..]]);
    }
}
