//! `aplanat picture`: files with their data inside, and what is refused.

use super::cli::{done, done_json, has_keys, refused};
use super::cli_files::Folder;

const LENS: &str = "lenses/singlet_la1131.json";

#[test]
fn a_picture_is_saved_with_its_data() {
    let folder = Folder::new("picture");
    let out = folder.path("star.png");
    let base = ["picture", LENS, "--scene", "star", "--exact", "--out", &out, "--pixels", "24x16"];
    let report = done_json(&[&base[..], &["--diagonal", "4", "--max-samples", "32"]].concat(), "");
    has_keys(&report, &["error", "reached", "white", "mean", "fates", "left_out", "milliseconds"]);
    assert_eq!(report["pixels"], serde_json::json!([24, 16]));
    assert!(report["error"].as_f64().unwrap() > 0.0);
    assert_eq!(report["left_out"][0]["effect"], "diffraction");
    let reader = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(&out).unwrap()));
    let reader = reader.read_info().unwrap();
    assert_eq!((reader.info().width, reader.info().height), (24, 16));
    let texts = &reader.info().utf8_text;
    let data = texts.iter().find(|text| text.keyword == "Aplanat picture").unwrap();
    let data: serde_json::Value = serde_json::from_str(&data.get_text().unwrap()).unwrap();
    assert_eq!(data["error"], report["error"]);

    assert_eq!(
        (&report["way"], &report["quick_milliseconds"]),
        (&"exact".into(), &serde_json::Value::Null)
    );

    // The picture is a scene for the next one, in grey, 16 bits and at another distance.
    let next = folder.path("next.png");
    let options = ["--gray", "--bits", "16", "--distance", "900", "--focus", "1000"];
    let base = ["picture", LENS, "--scene", &out, "--out", &next, "--pixels", "6x4"];
    let text = done(&[&base[..], &options, &["--error", "20%", "--diagonal", "4"]].concat(), "");
    assert!(text.contains("at 900 mm, focus at 1000 mm"), "{text}");
    assert!(text.contains("left out: ghosts"), "{text}");
}

#[test]
fn a_sensor_shows_its_noise() {
    let folder = Folder::new("picture-sensor");
    let out = folder.path("noisy.png");
    let base = ["picture", LENS, "--scene", "white", "--out", &out, "--pixels", "40x30"];
    let options = ["--sensor", "phone", "--diagonal", "4", "--error", "10%", "--quick"];
    let report = done_json(&[&base[..], &options].concat(), "");
    let sensor = &report["sensor"];
    // White fills 80 % of the full well, the smaller range.
    let electrons = 0.62 * sensor["white_photons"].as_f64().unwrap();
    assert!((electrons / (0.8 * 3800.0) - 1.0).abs() < 1e-9, "{sensor}");
    assert_eq!(sensor["saturated"], 0.0);
    let dark = done_json(&[&base[..], &options, &["--seconds", "0"]].concat(), "");
    assert_eq!(dark["sensor"]["white_photons"], 0.0);
    assert_eq!(dark["sensor"]["signal_to_noise"], serde_json::json!([0.0, 0.0, 0.0]));
}

/// The mean of the numbers of a file, in red, green and blue.
fn mean_colors(path: &str) -> [f64; 3] {
    let image = image::open(path).unwrap().into_rgb16();
    let count = image.pixels().len() as f64;
    let sum = |c: usize| image.pixels().map(|pixel| f64::from(pixel.0[c])).sum::<f64>();
    [0, 1, 2].map(|c| sum(c) / count / 65535.0)
}

/// Interpolation between filters keeps the mean of even light, and a linear curve its share of white.
#[test]
fn filters_and_tone_curves_keep_the_light() {
    let folder = Folder::new("picture-bayer");
    let out = folder.path("white.png");
    let base = ["picture", LENS, "--scene", "white", "--out", &out, "--pixels", "60x40"];
    let options = ["--sensor", "canon-7d", "--diagonal", "0.5", "--error", "10%", "--quick"];
    let linear = ["--gamma", "1", "--bits", "16"];
    let base = [&base[..], &options, &linear].concat();
    assert_eq!(done_json(&base, "")["sensor"]["bayer"], false);
    let all = mean_colors(&out);
    assert_eq!(done_json(&[&base[..], &["--bayer"]].concat(), "")["sensor"]["bayer"], true);
    let filtered = mean_colors(&out);
    for (all, filtered) in all.iter().zip(filtered) {
        assert!((all - filtered).abs() < 2e-3 && (all - 1.0).abs() < 0.02, "{all} {filtered}");
    }
    let [bayer, curve] = [&["--bayer"][..], &["--gamma", "0"]];
    let plain = ["picture", LENS, "--scene", "lights", "--out", &out];
    refused(2, &[&plain[..], bayer].concat(), "", &["--bayer", "--sensor"]);
    refused(2, &[&plain[..], curve].concat(), "", &["srgb, or a number"]);
}

#[test]
fn wrong_pictures_are_refused() {
    let out = std::env::temp_dir().join("aplanat-refused.png").display().to_string();
    let wrong = [
        (vec!["--scene", "moon"], ["`moon`", "still-life"]),
        (vec!["--scene", "star", "--pixels", "0x4"], ["0x4", "columns"]),
        (vec!["--scene", "star", "--diagonal", "-1"], ["diagonal", "-1"]),
        (vec!["--scene", "star", "--distance", "0"], ["distance", "0"]),
        (vec!["--scene", "white", "--distance", "-5"], ["distance", "-5"]),
        (vec!["--scene", "white", "--distance", "nan"], ["distance", "NaN"]),
        (vec!["--scene", "star", "--focus", "10"], ["10 mm", "image"]),
        (vec!["--scene", "star", "--zoom", "3"], ["zoom", "3"]),
        (vec!["--scene", LENS], [LENS, "image"]),
        (vec!["--scene", "star", "--sensor", "film"], ["`film`", "phone"]),
        (vec!["--scene", "star", "--luminance", "0"], ["--luminance", "0"]),
    ];
    for (options, words) in wrong {
        let base = ["picture", LENS, "--out", &out];
        refused(2, &[&base[..], &options].concat(), "", &words);
    }
    refused(
        2,
        &["picture", LENS, "--scene", "star", "--out", "star.gif"],
        "",
        &["star.gif", "png"],
    );
}
