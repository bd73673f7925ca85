//! Scenes, sensors, focus groups and the table of effects of `aplanat picture`.

use super::cli::{done, done_json, refused};
use super::cli_files::Folder;
use super::pictures::bundled;
use aplanat::picture::{FocusGroup, focused};
use aplanat::pupil::RayModel;
use serde_json::Value;

const LENS: &str = "lenses/singlet_la1131.json";

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

/// A grey plane that covers a half before a white one, and one that leaves during the exposure.
#[test]
fn planes_of_a_file_have_their_light_and_move() {
    let folder = Folder::new("picture-scene");
    let (scene, out) = (folder.path("scene.json"), folder.path("out.png"));
    let write = |planes: &str| {
        let text = format!(r#"{{"white": 200, "background": 50, "planes": [{planes}]}}"#);
        std::fs::write(&scene, text).unwrap();
    };
    let small = ["--diagonal", "0.2", "--pixels", "8x8", "--gray", "--error", "5%", "--exact"];
    let base = ["picture", LENS, "--scene", &scene, "--out", &out, "--focus", "900"];
    let base = [&base[..], &small].concat();
    let level = |extra: &[&str]| {
        let report = done_json(&[&base[..], extra].concat(), "");
        number(&report["mean"]) / number(&report["white"])
    };
    let veil = r#"{"pattern": "white", "distance": 600, "size": [400, 400], "luminance": 40, "alpha": 0.5}"#;
    write(veil);
    // Half of 40 before half of 50, of 200 cd/m2.
    assert!((level(&[]) - 0.225).abs() < 0.01, "{}", level(&[]));
    write(&format!(r#"{{"pattern": "white", "distance": 800, "size": [400, 400]}}, {veil}"#));
    assert!((level(&[]) - 0.6).abs() < 0.02, "{}", level(&[]));
    // It leaves the picture after half of the time.
    write(r#"{"pattern": "white", "distance": 900, "size": [400, 400], "velocity": [40000, 0]}"#);
    assert!((level(&[]) - 1.0).abs() < 0.02);
    assert!((level(&["--seconds", "0.01"]) - 0.625).abs() < 0.05);
    let quick: Vec<&str> = base.iter().copied().filter(|word| *word != "--exact").collect();
    let moving = [&quick[..], &["--seconds", "0.01", "--quick"]].concat();
    let quick = number(&done_json(&moving, "")["mean"]);
    let still = number(&done_json(&[&base[..], &["--seconds", "0.01"]].concat(), "")["mean"]);
    assert!((quick / still - 1.0).abs() < 0.1, "{quick} {still}");
    write(r#"{"pattern": "moon"}"#);
    refused(2, &base, "", &["scene.json", "planes[0].pattern", "`moon`", "star"]);
    write(r#"{"picture": "none.png"}"#);
    refused(2, &base, "", &["none.png"]);
    let star = ["picture", LENS, "--scene", "star", "--out", &out, "--size", "30"];
    refused(2, &star, "", &["width of the scene", "infinity"]);
}

#[test]
fn a_sensor_has_the_numbers_that_it_is_given() {
    let folder = Folder::new("picture-own-sensor");
    let (file, out) = (folder.path("own.json"), folder.path("out.png"));
    let numbers = r#"{"name": "mine", "quantum_efficiency": 0.5, "full_well": 9000, "dark_current": 0,
        "read_noise": 2, "gain": 0.25, "black_level": 32, "bits": 12}"#;
    std::fs::write(&file, numbers).unwrap();
    let base = ["picture", LENS, "--scene", "white", "--out", &out, "--pixels", "20x20"];
    let base =
        [&base[..], &["--pitch", "5", "--error", "10%", "--quick", "--sensor", &file]].concat();
    let report =
        done_json(&[&base[..], &["--full-well", "5000", "--sensor-bits", "10"]].concat(), "");
    let sensor = &report["sensor"];
    assert_eq!((&sensor["name"], &sensor["bits"]), (&"mine".into(), &10.into()));
    assert_eq!(number(&sensor["full_well"]), 5000.0);
    assert!((number(&report["size"][0]) - 0.1).abs() < 1e-12, "{report}");
    // The range of 10 bits is the smaller one: (1023 - 32) / 0.25 electrons.
    let electrons = 0.5 * number(&sensor["white_photons"]);
    assert!((electrons / (0.8 * 991.0 / 0.25) - 1.0).abs() < 1e-9, "{sensor}");
    refused(
        2,
        &[&base[..], &["--gain", "0"]].concat(),
        "",
        &["--gain: found 0; expected a positive number"],
    );
    refused(2, &[&base[..], &["--diagonal", "2"]].concat(), "", &["--pitch", "--diagonal"]);
    std::fs::write(&file, r#"{"gain": 1, "iso": 100}"#).unwrap();
    refused(2, &base, "", &["own.json", "iso"]);
}

/// All surfaces as a group move the image as the image plane would move, and a group breathes.
#[test]
fn a_focus_group_focuses_and_breathes() {
    let lens = bundled("double_gauss_rudolph_50");
    let last = lens.surfaces.len() - 1;
    let whole = FocusGroup { first: 0, last };
    let distance = 1000.0;
    let group = whole.focus(&lens, 0, distance).unwrap();
    assert!(group.shift < -1.0 && group.shift > -5.0, "{}", group.shift);
    let before = RayModel::from_lens(&lens, 0).unwrap().first_order.image_defocus.unwrap();
    let after = RayModel::from_lens(&group.lens, 0).unwrap().first_order.image_defocus.unwrap();
    assert!((before - after).abs() < 1e-9, "{before} {after}");
    assert!((group.distance - distance - group.shift).abs() < 1e-12);
    // By extension, the picture shows less of the scene: about f/s.
    let by_image = focused(&lens, 0, distance).unwrap();
    assert!(RayModel::from_lens(&by_image, 0).is_ok());
    assert!(group.breathing < -0.03 && group.breathing > -0.08, "{}", group.breathing);
    let none = FocusGroup { first: 3, last: last + 5 };
    assert!(none.focus(&lens, 0, distance).unwrap_err().to_string().contains("focus group"));
    let folder = Folder::new("picture-focus-group");
    let out = folder.path("out.png");
    let count = (last + 1).to_string();
    let base =
        ["picture", "lenses/double_gauss_rudolph_50.json", "--scene", "white", "--out", &out];
    let small = ["--pixels", "6x4", "--error", "20%", "--focus", "1000", "--focus-group"];
    let text = done(&[&base[..], &small, &[&format!("1..{count}")]].concat(), "");
    assert!(text.contains("breathing: -"), "{text}");
    refused(2, &[&base[..], &["--focus-group", "1..3"]].concat(), "", &["--focus"]);
    refused(2, &[&base[..], &small, &["5..2"]].concat(), "", &["7..10"]);
}

#[test]
fn every_effect_has_a_number_and_a_measured_saving() {
    let folder = Folder::new("picture-effects");
    let out = folder.path("out.png");
    let base = ["picture", LENS, "--scene", "star", "--out", &out, "--effects", "--quick"];
    let base = [&base[..], &["--pixels", "12x8", "--diagonal", "4", "--error", "20%"]].concat();
    let report = done_json(&base, "");
    let gates = report["gates"].as_array().unwrap();
    let gate = |name: &str| gates.iter().find(|gate| gate["effect"] == name).unwrap();
    for name in ["distortion", "lateral colour", "blur", "field variation", "vignetting"] {
        assert!(number(&gate(name)["number"]) >= 0.0, "{name}");
    }
    for name in ["depth of field", "occlusion", "polarisation", "ghosts", "losses"] {
        assert_eq!(gate(name)["on"], false, "{name}");
    }
    for name in ["diffraction", "number of wavelengths", "motion"] {
        assert!(gate(name)["saved_milliseconds"].is_number(), "{name}");
    }
    assert_eq!(gate("motion")["on"], false);
    let left_out = report["left_out"].as_array().unwrap();
    assert!(left_out.iter().any(|effect| effect["effect"] == "motion"), "{report}");
    // Its colour is small against such pixels: one wavelength is enough for a colour.
    assert_eq!(gate("number of wavelengths")["on"], false);
    let text = done(&base, "");
    assert!(text.contains("off motion: 0 of 0.2 px") && text.contains("measured"), "{text}");
}
