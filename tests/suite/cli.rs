//! The command line from outside: every subcommand with valid and invalid input, its exit status,
//! the keys of its JSON, its error messages.

use serde_json::{Value, json};
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};

const LENS: &str = "lenses/double_gauss_rudolph_50.json";
const ZOOM: &str = "lenses/zoom_nikkor_28_80.json";

/// Runs the program without a display.
pub(super) fn aplanat(arguments: &[&str], input: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_aplanat"));
    command.args(arguments).env_remove("DISPLAY").env("APLANAT_GLASSES", "no folder");
    command.env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let written = child.stdin.take().unwrap().write_all(input.as_bytes());
    // A program that refuses its arguments does not read its input.
    drop(written);
    child.wait_with_output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// The output of a successful run.
pub(super) fn done(arguments: &[&str], input: &str) -> String {
    let output = aplanat(arguments, input);
    let errors = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {errors}");
    text(&output.stdout)
}

pub(super) fn done_json(arguments: &[&str], input: &str) -> Value {
    let out = done(&[arguments, &["--json"]].concat(), input);
    serde_json::from_str(&out).unwrap_or_else(|e| panic!("{arguments:?}: {e} in {out}"))
}

/// The message of a run that ends with this status; it must contain these words.
pub(super) fn refused(status: i32, arguments: &[&str], input: &str, words: &[&str]) {
    let output = aplanat(arguments, input);
    let errors = text(&output.stderr);
    assert_eq!(output.status.code(), Some(status), "{arguments:?}: {errors}");
    assert!(output.stdout.is_empty(), "{arguments:?} prints {}", text(&output.stdout));
    for word in words {
        assert!(errors.contains(word), "{arguments:?}: `{errors}` does not say `{word}`");
    }
    assert!(!errors.contains("panicked"), "{errors}");
}

pub(super) fn has_keys(value: &Value, keys: &[&str]) {
    for key in keys {
        assert!(value.get(key).is_some(), "no key `{key}` in {value}");
    }
}

/// A path in the temporary folder that no other test has.
fn temporary(name: &str) -> PathBuf {
    static TAKEN: AtomicUsize = AtomicUsize::new(0);
    let number = TAKEN.fetch_add(1, Ordering::Relaxed);
    std::env::temp_dir().join(format!("aplanat-{}-{number}-{name}", std::process::id()))
}

/// A file that is gone when the test ends.
pub(super) struct Scratch(pub(super) PathBuf);

impl Scratch {
    pub(super) fn new(name: &str) -> Self {
        Self(temporary(name))
    }

    pub(super) fn with(name: &str, text: &str) -> Self {
        let scratch = Self::new(name);
        std::fs::write(&scratch.0, text).unwrap();
        scratch
    }

    pub(super) fn path(&self) -> &str {
        self.0.to_str().unwrap()
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        drop(std::fs::remove_file(&self.0));
    }
}

#[test]
fn help_is_printed_for_commands_and_topics() {
    assert!(done(&["--help"], "").contains("Exit status"));
    assert!(done(&["--version"], "").starts_with("aplanat "));
    assert!(done(&["help"], "").contains("Exit status"));
    assert_eq!(done(&["help", "measure", "spot"], ""), done(&["measure", "spot", "--help"], ""));
    assert!(done(&["help", "lens-file"], "").contains("semi_diameter"));
    refused(2, &["help", "lenses"], "", &["`lenses`", "lens-file", "conventions"]);
}

#[test]
fn without_a_display_the_message_names_what_works() {
    refused(1, &[], "", &["window", "aplanat info LENS", "aplanat --help"]);
    refused(1, &[LENS], "", &["window", "aplanat optimize"]);
    refused(1, &["measure", "window"], "", &["window"]);
}

#[test]
fn wrong_usage_has_the_exit_status_of_invalid_input() {
    refused(2, &["info"], "", &["LENS"]);
    refused(2, &["tarce"], "", &["tarce", "subcommand"]);
    refused(2, &["info", LENS, "--zoom", "one"], "", &["one"]);
    refused(2, &[LENS, "info", LENS], "", &["in front of a subcommand"]);
    refused(2, &["nowhere.json"], "", &["nowhere.json"]);
}

#[test]
fn wrong_lenses_are_named() {
    refused(2, &["info", "nowhere.json"], "", &["nowhere.json", "cannot be read"]);
    let whole = std::fs::read_to_string(LENS).unwrap();
    let wrong = [
        ("truncated.json", whole[..400].to_owned(), "truncated"),
        ("version.json", whole.replace("\"aplanat\": 1", "\"aplanat\": 9"), "9"),
        ("glass.json", whole.replace("SCHOTT N-BAK1", "SCHOTT N-BAK99"), "N-BAK99"),
        ("key.json", whole.replace("\"notes\"", "\"nots\""), "nots"),
        ("sd.json", whole.replace("6.3", "-6.3"), "-6.3"),
    ];
    for (name, text, word) in wrong {
        let scratch = Scratch::with(name, &text);
        refused(2, &["info", scratch.path()], "", &[scratch.path(), word]);
    }
}

#[test]
fn info_gives_first_order_data() {
    let info = done_json(&["info", LENS], "");
    let keys = [
        "efl",
        "bfl",
        "ffl",
        "f_number",
        "entrance_pupil",
        "exit_pupil",
        "petzval_sum",
        "seidel",
        "semi_diameters",
        "checks",
        "effects",
    ];
    has_keys(&info, &keys);
    let effects = info["effects"].as_array().unwrap();
    assert_eq!(effects.len(), 10);
    for effect in effects {
        has_keys(effect, &["effect", "needed", "computed", "error", "reason", "saves", "saved_ms"]);
    }
    has_keys(&info["entrance_pupil"], &["position", "diameter"]);
    assert!((info["efl"].as_f64().unwrap() - 49.389).abs() < 1e-3);
    assert_eq!(info["seidel"]["surfaces"].as_array().unwrap().len(), 11);
    assert!(done(&["info", LENS], "").contains("focal length"));
}

/// Unknown quantities of a gradient-index medium are named, and all others are printed.
#[test]
fn every_panel_shows_a_lens_with_a_gradient_index() {
    const WOOD: &str = "lenses/wood_lens_60.json";
    let info = done_json(&["info", WOOD], "");
    assert_eq!(info["seidel"], Value::Null);
    has_keys(&info, &["efl", "bfl", "petzval_sum", "semi_diameters", "checks", "effects"]);
    let page = done(&["info", WOOD], "");
    let seidel = "Seidel sums, zoom 0: none: those of a gradient-index medium are not";
    for words in [seidel, "Petzval sum", "effects on spots", "semi-diameters"] {
        assert!(page.contains(words), "no `{words}` in {page}");
    }
    for what in ["spot", "fan", "distortion", "field-curvature", "illumination", "through-focus"] {
        let report = done_json(&["analyze", WOOD, what], "");
        for field in report["fields"].as_array().unwrap() {
            assert!(field.get("dark").is_none(), "{what}: {field}");
        }
    }
    let derivatives = done(&["gradient", WOOD, "--field", "2"], "");
    assert!(
        derivatives.contains("gradient index after surface 1, coefficient of"),
        "{derivatives}"
    );
    assert!(derivatives.contains("r^12") && derivatives.contains("z^4"), "{derivatives}");
    refused(1, &["gradient", WOOD, "--method", "warp"], "", &["surface 1 has no warp field"]);
}

#[test]
fn info_gives_every_zoom_position() {
    let info = done_json(&["info", ZOOM], "");
    let positions = info["positions"].as_array().unwrap();
    assert_eq!(positions.len(), 3);
    assert_eq!(positions[0]["efl"], info["efl"]);
    let one = done_json(&["info", ZOOM, "--zoom", "2"], "");
    assert_eq!(one["efl"], positions[2]["efl"]);
    refused(2, &["info", ZOOM, "--zoom", "3"], "", &[ZOOM, "no zoom position 3", "0 to 2"]);
}

/// A ray of a request.
fn ray(y: f64, m: f64, n: f64) -> Value {
    json!({"x": 0.0, "y": y, "z": 0.0, "L": 0.0, "M": m, "N": n})
}

fn trace(rays: &Value) -> Value {
    done_json(&["trace", LENS, "--rays", "-"], &rays.to_string())
}

#[test]
fn trace_gives_every_ray_its_fate() {
    let rays = json!({"rays": [ray(2.0, 0.0, 1.0), ray(60.0, 0.0, 1.0), ray(6.2, 0.0, 1.0)]});
    let traced = trace(&rays);
    let rays = traced["rays"].as_array().unwrap();
    let keys = ["fate", "surface", "x", "y", "z", "L", "M", "N", "opl"];
    rays.iter().for_each(|ray| has_keys(ray, &keys));
    let fate = |i: usize| (rays[i]["fate"].as_str().unwrap(), rays[i]["surface"].as_u64().unwrap());
    assert_eq!(fate(0), ("imaged", 11));
    assert_eq!(fate(1), ("missed", 0));
    assert_eq!(fate(2).0, "clipped");
    assert_eq!(traced["fates"]["imaged"], 1);
    assert_eq!(rays[0]["z"], 0.0);
    assert!(rays[0].get("backwards").is_none());
    // The ray that a rim clips meets no rim.
    let request = json!({"rays": [ray(6.2, 0.0, 1.0)]}).to_string();
    let free = done_json(&["trace", LENS, "--rays", "-", "--unclipped"], &request);
    assert_eq!(free["rays"][0]["fate"], "imaged");
}

#[test]
fn trace_flags_a_ray_that_goes_backwards() {
    let rays = json!({"rays": [{"x": 0, "y": 1, "z": 5, "L": 0, "M": 0, "N": 1}]});
    assert_eq!(trace(&rays)["rays"][0]["backwards"], 0);
}

#[test]
fn trace_reads_a_file_and_prints_a_table() {
    let rays = json!({"wavelength_um": 0.55, "zoom": 1, "rays": [ray(1.0, 0.0, 1.0)]});
    let scratch = Scratch::with("rays.json", &rays.to_string());
    let out = done(&["trace", ZOOM, "--rays", scratch.path()], "");
    assert!(out.contains("imaged") && out.contains("0.55 um, zoom position 1"), "{out}");
}

#[test]
fn trace_refuses_what_cannot_be_traced() {
    let refuse = |input: &str, words: &[&str]| {
        refused(2, &["trace", LENS, "--rays", "-"], input, &[&["standard input"], words].concat());
    };
    let rays = |last: Value| json!({"rays": [ray(0.0, 0.0, 1.0), last]}).to_string();
    refuse(&rays(ray(0.0, 0.5, 1.0)), &["ray 1", "length"]);
    refuse(&rays(json!({"x": 0, "y": 0, "z": 0, "L": 0, "M": 0})), &["rays[1]", "`N`"]);
    refuse(&rays(ray(1e200, 0.0, 1.0)), &["ray 1", "finite"]);
    refuse(&rays(json!({"x": "NaN"})), &["rays[1].x", "NaN"]);
    refuse(&rays(ray(0.0, 0.0, 1.0)).replace("\"L\"", "\"U\""), &["rays[0]", "`U`", "column"]);
    refuse("{\"rays\": [], \"colour\": 1}", &["`colour`", "wavelength_um"]);
    refuse("{\"rays\": [{\"x\": 1e999}]}", &["range"]);
    refuse("{\"rays\": [", &["end of the file"]);
    let file = |input: &str, words: &[&str]| {
        refused(2, &["trace", LENS, "--rays", "-"], input, &[&[LENS], words].concat());
    };
    refuse("{\"rays\": [], \"zoom\": 7}", &["zoom position 7"]);
    file("{\"rays\": [], \"wavelength_um\": 90}", &["90 um"]);
}

/// The results of an analysis at all fields.
fn analyzed(what: &str, more: &[&str]) -> Vec<Value> {
    let report = done_json(&[&["analyze", LENS, what], more].concat(), "");
    let keys = ["analysis", "zoom", "wavelength_um", "tolerance", "field_kind", "airy_radius"];
    has_keys(&report, &keys);
    let fields = report["fields"].as_array().unwrap();
    assert!(!fields.is_empty(), "{what} of no field");
    fields.clone()
}

/// A number must come with its error and cost.
fn estimate(value: &Value) -> f64 {
    has_keys(value, &["value", "error", "rays"]);
    assert!(value["milliseconds"].as_f64().unwrap() > 0.0, "{value}");
    value["value"].as_f64().unwrap()
}

#[test]
fn the_airy_radius_is_that_of_the_working_f_number() {
    let first = done_json(&["info", LENS], "");
    let f_number = find(&first, "working_f_number").unwrap();
    let report = done_json(&["analyze", LENS, "spot", "--field", "0"], "");
    let um = report["wavelength_um"].as_f64().unwrap();
    let radius = report["airy_radius"].as_f64().unwrap();
    // In mm: 1.22 λ N.
    assert!((radius / (1.22e-3 * um * f_number) - 1.0).abs() < 1e-3, "{radius} {f_number}");
}

/// The first number of this name anywhere in a document.
fn find(value: &Value, name: &str) -> Option<f64> {
    match value {
        Value::Object(map) => {
            let own = map.get(name).and_then(Value::as_f64);
            own.or_else(|| map.values().find_map(|inner| find(inner, name)))
        }
        Value::Array(list) => list.iter().find_map(|inner| find(inner, name)),
        _ => None,
    }
}

#[test]
fn analyze_prints_every_number_with_error_and_cost() {
    let check = |value: &Value, keys: &[&str]| {
        keys.iter().for_each(|key| assert!(estimate(&value[key]).is_finite()));
    };
    for field in analyzed("spot", &[]) {
        check(&field, &["rms", "radius", "centroid_x", "centroid_y"]);
        assert_eq!(field["colors"].as_array().unwrap().len(), 3);
        field["colors"].as_array().unwrap().iter().for_each(|color| {
            check(color, &["rms", "lit_area"]);
        });
    }
    let distortion = analyzed("distortion", &[]);
    assert!(estimate(&distortion[1]["distortion"]).abs() < 0.05);
    assert_eq!(distortion[0]["distortion"], Value::Null);
    for field in analyzed("field-curvature", &[]) {
        check(&field, &["tangential", "sagittal"]);
    }
    for field in analyzed("illumination", &[]) {
        assert!(estimate(&field["relative"]) <= 1.0 + 1e-12);
    }
    let fan = &analyzed("fan", &["--field", "17"])[0]["colors"][0]["tangential"];
    has_keys(&fan[0], &["pupil", "dx", "dy", "fate", "surface"]);
    let focus = &analyzed("through-focus", &["--field", "0"])[0]["positions"];
    assert_eq!(focus.as_array().unwrap().len(), 11);
    let focused = estimate(&focus[5]["rms"]);
    let plain = estimate(&analyzed("spot", &["--field", "0"])[0]["rms"]);
    assert!((focused - plain).abs() < 1e-12, "{focused} {plain}");
    // Rays are straight behind the lens: the square of the radius is a parabola in the place of the
    // image plane, and it is least between the ends.
    let squares: Vec<f64> = (0..11).map(|i| estimate(&focus[i]["rms"]).powi(2)).collect();
    let bends: Vec<f64> = squares.windows(3).map(|s| s[0] - 2.0 * s[1] + s[2]).collect();
    assert!(bends.iter().all(|bend| *bend > 0.0), "{squares:?}");
    assert!(bends.iter().all(|bend| (bend / bends[0] - 1.0).abs() < 0.05), "{bends:?}");
}

/// What a person reads has a line for every number of the JSON.
#[test]
fn analyses_in_words_have_a_line_for_every_number() {
    let text = |what: &str| done(&["analyze", LENS, what, "--field", "0", "--error", "5%"], "");
    let lines = |text: &str, word: &str| text.lines().filter(|line| line.contains(word)).count();
    let focus = text("through-focus");
    assert_eq!(lines(&focus, " ± "), 11, "{focus}");
    let spot = text("spot");
    let rms = &analyzed("spot", &["--field", "0", "--error", "5%"])[0]["rms"];
    let digits = &rms["value"].to_string()[..6];
    assert!(spot.lines().any(|line| line.contains("rms") && line.contains(digits)), "{spot}");
    let contrast = text("through-focus-mtf");
    assert_eq!(lines(&contrast, "cycles/mm, "), 1, "{contrast}");
    assert!(lines(&contrast, "±") >= 11, "{contrast}");
    let fans = analyzed("opd-fan", &["--field", "0"]);
    assert_eq!(fans[0]["tangential"].as_array().unwrap().len(), 21);
}

#[test]
fn a_spot_meets_its_tolerance() {
    let rms = |error: &str| {
        let field = &analyzed("spot", &["--field", "17", "--error", error])[0]["rms"];
        (estimate(field), field["error"].as_f64().unwrap())
    };
    let (coarse, fine) = (rms("1%"), rms("1e-8"));
    assert!(fine.1 < 1e-8 * fine.0, "{fine:?}");
    assert!((coarse.0 - fine.0).abs() < 1e-2 * fine.0, "{coarse:?} {fine:?}");
    refused(2, &["analyze", LENS, "spot", "--error", "0"], "", &["--error", "0.1%"]);
}

#[test]
fn the_illumination_of_one_field_is_that_among_all() {
    let all = analyzed("illumination", &[]);
    let one = analyzed("illumination", &["--field", "17"]);
    assert_eq!(one.len(), 1);
    assert_eq!(one[0]["relative"]["value"], all[1]["relative"]["value"]);
    assert_eq!(analyzed("illumination", &["--field", "0"]).len(), 1);
}

#[test]
fn a_lens_without_light_is_refused_with_the_place() {
    let lens = std::fs::read_to_string(LENS).unwrap();
    let dark = lens.replace("\"semi_diameter\": 4.5", "\"semi_diameter\": 0.0");
    let scratch = Scratch::with("dark.json", &dark);
    let arguments = ["analyze", scratch.path(), "spot", "--field", "17"];
    refused(2, &arguments, "", &[scratch.path(), "no light", "clipped at surface 5"]);
}

/// The derivatives of a vignetted spot by the curvatures, and its value.
fn gradient(lens: &str) -> (f64, Vec<f64>) {
    let report = done_json(&["gradient", lens, "--field", "20", "--error", "1e-9"], "");
    assert_eq!(report["method"], "boundary");
    has_keys(&report, &["term", "method", "value", "error", "rays", "ms", "d"]);
    let d = &report["d"];
    for key in ["curvature", "thickness", "semi_diameter", "conic", "index", "asphere"] {
        assert_eq!(d[key].as_array().unwrap().len(), 11, "{key}");
    }
    assert_eq!(d["conic"][0], Value::Null);
    let slopes = d["curvature"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap());
    (report["value"].as_f64().unwrap(), slopes.collect())
}

#[test]
fn gradients_agree_with_differences_of_edited_files() {
    // The rims clip this field, and the pupil moves with the curvature.
    let lens = std::fs::read_to_string(LENS).unwrap();
    let changed = |name: &str, step: f64| {
        let curvature = 0.07061398863114783 + step;
        let text = lens.replacen("0.07061398863114783", &curvature.to_string(), 1);
        let scratch = Scratch::with(name, &text);
        gradient(scratch.path())
    };
    let step = 1e-6;
    let (_, slopes) = changed("open.json", 0.0);
    let difference = (changed("plus.json", step).0 - changed("minus.json", -step).0) / (2.0 * step);
    assert!((slopes[0] - difference).abs() < 1e-6 * difference.abs(), "{slopes:?} {difference}");
}

#[test]
fn a_gradient_weighs_wavelengths_as_the_lens_does() {
    let lens: Value = serde_json::from_str(&std::fs::read_to_string(LENS).unwrap()).unwrap();
    let light = |name: &str, wavelengths: Vec<Value>| {
        let mut lens = lens.clone();
        lens["wavelengths"] = wavelengths.into();
        let file = Scratch::with(name, &lens.to_string());
        let report = done_json(
            &["gradient", file.path(), "--field", "20", "--term", "throughput", "--error", "1e-9"],
            "",
        );
        report["value"].as_f64().unwrap()
    };
    let one = |um: f64, weight: f64, primary: bool| json!({"um": um, "weight": weight, "primary": primary});
    let (red, blue) = (0.7065188, 0.4046561);
    let alone = [red, blue].map(|um| light("one-color.json", vec![one(um, 0.3, true)]));
    assert!((alone[0] / alone[1] - 1.0).abs() > 1e-3, "the colors differ: {alone:?}");
    let both = light("two-colors.json", vec![one(red, 0.3, true), one(blue, 0.7, false)]);
    let mean = 0.3 * alone[0] + 0.7 * alone[1];
    // The stop alone limits the beams, whatever the primary wavelength is.
    assert!((both / mean - 1.0).abs() < 1e-6, "{both} {mean}");
}

#[test]
fn a_gradient_says_whether_its_tolerance_was_reached() {
    let boundary = ["gradient", LENS, "--field", "20"];
    assert_eq!(done_json(&boundary, "")["reached"], true);
    assert!(!done(&boundary, "").contains("not reached"));
    let few = [&boundary[..], &["--method", "warp", "--rays", "4000"]].concat();
    assert_eq!(done_json(&few, "")["reached"], false);
    assert!(done(&few, "").contains("the tolerance was not reached by every derivative: --rays"));
}

#[test]
fn a_gradient_and_a_spot_are_of_the_same_beam() {
    // The aperture is a focal ratio, and the beam off the axis is bounded by stop and rims.
    let lens = "lenses/cooke_triplet_100_f27.json";
    let value = |term: &str| {
        let report = done_json(&["gradient", lens, "--field", "14", "--term", term], "");
        report["value"].as_f64().unwrap()
    };
    let rms = (value("spot") / -value("throughput")).sqrt();
    let spot = done_json(&["analyze", lens, "spot", "--field", "14", "--error", "1e-7"], "");
    let exact = spot["fields"][0]["rms"]["value"].as_f64().unwrap();
    assert!((rms / exact - 1.0).abs() < 1e-6, "{rms} {exact}");
}

#[test]
fn a_wavelength_without_light_is_told_and_the_tolerance_not_reached() {
    // Beyond the corner of its field only blue light gets through this lens.
    let lens = "lenses/wide_nikkor_28_f35.json";
    let beyond = ["analyze", lens, "spot", "--field", "38.47"];
    let report = done_json(&beyond, "");
    assert_eq!(report["fields"][0]["reached"], false);
    let told = done(&beyond, "");
    assert!(told.contains("leave out the wavelengths without light"), "{told}");
    assert!(told.contains("0.6562725 um: no light"), "{told}");
    let corner = done_json(&["analyze", lens, "spot", "--field", "37.65"], "");
    assert_eq!(corner["fields"][0]["reached"], true);
    assert_eq!(done_json(&["gradient", lens, "--field", "37.65"], "")["reached"], true);
}

/// A triplet with a small hole far in front of it, which the light of its only field does not meet.
fn dark_lens() -> Scratch {
    let text = std::fs::read_to_string("lenses/cooke_triplet_100_f27.json").unwrap();
    let mut lens: Value = serde_json::from_str(&text).unwrap();
    lens["fields"]["values"] = json!([{"y": 14.0, "weight": 1.0}]);
    let rows = lens["surfaces"].as_array_mut().unwrap();
    rows.insert(0, json!({"thickness": 500.0, "semi_diameter": 1.0}));
    Scratch::with("dark_field.json", &lens.to_string())
}

#[test]
fn a_lens_without_light_is_refused_by_every_analysis_and_by_the_report() {
    let dark = dark_lens();
    let kinds = [
        "spot",
        "fan",
        "distortion",
        "distortion-grid",
        "spot-map",
        "lateral-color",
        "longitudinal",
        "footprint",
        "field-curvature",
        "illumination",
        "through-focus",
        "wavefront",
        "opd-fan",
        "zernike",
        "psf",
        "encircled-energy",
        "mtf",
        "through-focus-mtf",
        "field-mtf",
        "geometric-psf",
        "geometric-energy",
        "seidel",
        "ghosts",
    ];
    for kind in kinds {
        refused(
            2,
            &["analyze", dark.path(), kind],
            "",
            &["no light", "expected a lens that forms"],
        );
    }
    let report = Scratch::new("dark_field.html");
    let arguments = ["report", dark.path(), "--out", report.path()];
    refused(2, &arguments, "", &["no light", "expected a lens that forms"]);
    assert!(!std::path::Path::new(report.path()).exists());
    refused(2, &["measure", "gradient", dark.path()], "", &["no light"]);
}

/// A lens with light that lacks a number is not said to form no image.
#[test]
fn longitudinal_aberration_of_a_tilted_lens_is_refused_for_its_tilt_alone() {
    let triplet = std::fs::read_to_string("lenses/cooke_triplet_100_f27.json").unwrap();
    let mut lens: Value = serde_json::from_str(&triplet).unwrap();
    lens["surfaces"][1]["tilt"] = json!([0.5, 0.0]);
    let tilted = Scratch::with("tilted_triplet.json", &lens.to_string());
    let arguments = ["analyze", tilted.path(), "longitudinal"];
    refused(2, &arguments, "", &["the lens is not symmetric about its axis"]);
    let message = text(&aplanat(&arguments, "").stderr);
    assert!(!message.contains("forms an image"), "{message}");
}

#[test]
fn more_frequencies_than_are_computed_in_a_short_time_are_refused() {
    let many = vec!["10"; 20_000].join(",");
    let arguments = ["analyze", LENS, "mtf", "--frequencies", &many];
    refused(2, &arguments, "", &["--frequencies", "20000", "at most 1000"]);
}

#[test]
fn an_unknown_parameter_is_refused_by_name() {
    refused(2, &["gradient", LENS, "--term", "distortion"], "", &["distortion", "throughput"]);
    refused(2, &["gradient", LENS, "--method", "guess"], "", &["guess", "boundary"]);
    refused(2, &["gradient", LENS, "--field", "200"], "", &["200", "180"]);
}

#[test]
fn every_method_gives_the_same_gradient_of_light() {
    let of = |method: &str, error: &str| {
        let arguments =
            ["gradient", LENS, "--field", "20", "--term", "throughput", "--method", method];
        let report = done_json(&[&arguments[..], &["--error", error]].concat(), "");
        assert_eq!(report["method"], method);
        let numbers = |key: &str| -> Vec<f64> {
            let column = report[key]["semi_diameter"].as_array().unwrap().clone();
            column.iter().map(|v| v.as_f64().unwrap()).collect()
        };
        (numbers("d"), numbers("d_error"))
    };
    let (exact, _) = of("boundary", "1e-8");
    for (method, error) in [("warp", "1e-1"), ("difference", "1e-6")] {
        let (found, errors) = of(method, error);
        let largest = exact.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        for ((found, exact), error) in found.iter().zip(&exact).zip(errors) {
            let off = (found - exact).abs();
            assert!(off <= 6.0 * error + 1e-6 * largest, "{method}: {found} and {exact}");
        }
    }
    assert!(of("biased", "1e-6").0.iter().all(|v| *v == 0.0));
}

#[test]
fn a_front_is_written_with_all_its_lenses() {
    let folder = Scratch::new("front");
    let arguments =
        ["pareto", LENS, "--points", "2", "--steps", "3", "--out", folder.path(), "--error", "1%"];
    let report = done_json(&arguments, "");
    has_keys(&report, &["ms", "hypervolume", "tried", "start", "front", "biased", "files"]);
    let files = report["files"].as_array().unwrap();
    assert!(files.len() > 3);
    for file in files.iter().filter_map(Value::as_str).filter(|f| f.contains(".json")) {
        aplanat::files::open(file).unwrap().lens.check().unwrap();
    }
    refused(2, &["pareto", LENS, "--points", "0"], "", &["points", "1 to 1000"]);
    std::fs::remove_dir_all(folder.path()).unwrap();
}

#[test]
fn optimize_makes_the_lens_better_and_saves_it() {
    let (out, history) = (Scratch::new("better.json"), Scratch::new("history.json"));
    for method in ["trust-region", "dls", "adam"] {
        let arguments = [
            "optimize",
            LENS,
            "--out",
            out.path(),
            "--history",
            history.path(),
            "--steps",
            "8",
            "--vary",
            "curvatures,thicknesses",
            "--error",
            "0.1%",
            "--method",
            method,
        ];
        let report = done_json(&arguments, "");
        let number = |key: &str| report[key].as_f64().unwrap();
        assert!(number("merit_after") < number("merit_before"), "{report}");
        has_keys(&report["terms"][0], &["term", "weight", "before", "after"]);
        has_keys(&report["terms"][0]["after"], &["value", "error", "rays"]);
        has_keys(&report["variables"][0], &["parameter", "before", "after"]);
        let steps: Value =
            serde_json::from_str(&std::fs::read_to_string(&history.0).unwrap()).unwrap();
        assert_eq!(steps["steps"].as_array().unwrap().len() as f64, number("steps"));
        let better = done_json(&["info", out.path()], "");
        assert!((better["efl"].as_f64().unwrap() - 49.389).abs() < 0.5, "{better}");
    }
    assert!(done(&["optimize", "--help"], "").contains("Ctrl-C"));
}

#[test]
fn optimize_aims_at_a_goal() {
    let goal = json!({"terms": [{"term": {"focal_length": 52.0}, "weight": 1.0}]});
    let (goal, out) =
        (Scratch::with("goal.json", &goal.to_string()), Scratch::new("goal-out.json"));
    let arguments = ["optimize", LENS, "--out", out.path(), "--goal", goal.path()];
    done(&[&arguments[..], &["--vary", "curvatures"]].concat(), "");
    let efl = done_json(&["info", out.path()], "")["efl"].as_f64().unwrap();
    assert!((efl - 52.0).abs() < 1e-3, "{efl}");
}

#[test]
fn optimize_uses_the_merit_function_of_the_file() {
    let mut lens: Value = serde_json::from_str(&std::fs::read_to_string(LENS).unwrap()).unwrap();
    lens["merit"] = json!({"terms": [{"term": {"focal_length": 52.0}, "weight": 1.0}]});
    let (file, out) =
        (Scratch::with("merit.json", &lens.to_string()), Scratch::new("merit-out.json"));
    done(&["optimize", file.path(), "--out", out.path(), "--vary", "curvatures"], "");
    let efl = done_json(&["info", out.path()], "")["efl"].as_f64().unwrap();
    assert!((efl - 52.0).abs() < 1e-3, "{efl}");
    let saved: Value = serde_json::from_str(&std::fs::read_to_string(out.path()).unwrap()).unwrap();
    assert_eq!(saved["merit"]["terms"], lens["merit"]["terms"], "the result has it, too");
    for (merit, words) in [
        (
            json!({"terms": [{"term": "sharpness", "weight": 1.0}]}),
            ["merit.terms[0].term", "sharp"],
        ),
        (json!({"terms": [], "edge": 1}), ["merit.edge", "unknown key"]),
        (json!(null), ["merit", "found null"]),
        (json!({"terms": [{"term": "spot", "weight": -1.0}]}), ["`spot`", "zero or more"]),
        (
            json!({"terms": [{"term": {"air_center": {"min": 2.0, "max": 1.0}}, "weight": 1.0}]}),
            ["`air_center`", "minimum"],
        ),
    ] {
        lens["merit"] = merit;
        let wrong = Scratch::with("wrong-merit.json", &lens.to_string());
        refused(2, &["info", wrong.path()], "", &words);
    }
}

#[test]
fn optimize_refuses_before_it_works() {
    let out = Scratch::new("never.json");
    let mut lens: Value = serde_json::from_str(&std::fs::read_to_string(LENS).unwrap()).unwrap();
    lens["variables"] = json!([]);
    let rigid = Scratch::with("rigid.json", &lens.to_string());
    let optimize = |more: &[&str], words: &[&str]| {
        refused(2, &[&["optimize", rigid.path()], more].concat(), "", words);
        assert!(!out.0.exists());
    };
    optimize(&["--out", out.path()], &[rigid.path(), "no variables", "--vary"]);
    optimize(&["--out", "/nowhere/at/all.json"], &["/nowhere/at/all.json", "no such folder"]);
    optimize(&["--out", "lens.txt"], &["lens.txt", "`txt`", "`.json`"]);
    optimize(&["--out", out.path(), "--vary", "colours"], &["colours", "curvatures"]);
    let wrong = [
        (json!({"terms": [{"term": "spots", "weight": 1.0}]}), "spots"),
        (json!({"terms": [], "weight": 1.0}), "`weight`"),
        (json!({"terms": [{"term": "spot", "weight": -1.0}]}), "weight"),
    ];
    for (goal, word) in wrong {
        let goal = Scratch::with("wrong-goal.json", &goal.to_string());
        let more = ["--out", out.path(), "--vary", "curvatures", "--goal", goal.path()];
        optimize(&more, &[word]);
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_saves_the_best_so_far() {
    let out = Scratch::new("stopped.json");
    let mut command = Command::new(env!("CARGO_BIN_EXE_aplanat"));
    command.args(["optimize", LENS, "--out", out.path(), "--vary", "curvatures", "--json"]);
    command.args(["--method", "adam", "--steps", "100000000", "--error", "1e-9"]);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let id = child.id().to_string();
    std::thread::sleep(std::time::Duration::from_secs(1));
    Command::new("kill").args(["-INT", &id]).status().unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["ended"], "stopped");
    has_keys(&done_json(&["info", out.path()], ""), &["efl"]);
}

#[test]
fn convert_works_both_ways_and_reports_losses() {
    let (zemax, native) = (Scratch::new("convert.zmx"), Scratch::new("convert.json"));
    let there = done_json(&["convert", LENS, zemax.path()], "");
    has_keys(&there["export"], &["format", "report", "proof"]);
    assert_eq!(there["export"]["format"], "zemax");
    assert!(there["export"]["proof"]["worst_mm"].as_f64().unwrap() < 1e-9);
    let back = done_json(&["convert", zemax.path(), native.path()], "");
    assert!(back["import"]["rows"].as_array().unwrap().len() > 10);
    has_keys(&back["checks"][0], &["zoom", "efl", "bfl", "f_number"]);
    let efl = |path: &str| done_json(&["info", path], "")["efl"].as_f64().unwrap();
    assert!((efl(native.path()) - efl(LENS)).abs() < 1e-9);
    assert!(done(&["convert", zemax.path(), native.path()], "").contains("used"));
}

#[test]
fn convert_refuses_invalid_lenses_and_unwritable_paths() {
    let out = Scratch::new("refused.json");
    let picture = Scratch::new("picture.zmx");
    std::fs::write(&picture.0, b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01\0\0\0\x01").unwrap();
    refused(2, &["convert", picture.path(), out.path()], "", &[picture.path(), "PNG"]);
    refused(2, &["convert", LENS, "lens.dat"], "", &["lens.dat", "`dat`"]);
    refused(2, &["convert", LENS, "/nowhere/lens.zmx"], "", &["/nowhere/lens.zmx"]);
    assert!(!out.0.exists());
}

#[test]
fn experiment_writes_its_data_and_its_pictures() {
    let folder = temporary("experiment");
    let arguments = ["experiment", "3.3", "--out", folder.to_str().unwrap()];
    let report = done_json(&arguments, "");
    has_keys(&report, &["id", "title", "claim", "ms", "holds", "claims", "tables", "rays"]);
    let keys = ["says", "value", "error", "unit", "rule", "limit", "holds"];
    assert!(report["claims"].as_array().unwrap().iter().all(|claim| {
        has_keys(claim, &keys);
        claim["holds"] == true
    }));
    for file in report["files"].as_array().unwrap() {
        let path = folder.join(file.as_str().unwrap());
        assert!(std::fs::metadata(&path).unwrap().len() > 100, "{}", path.display());
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn experiment_lists_all_and_refuses_others() {
    let list = done_json(&["experiment"], "");
    has_keys(&list[0], &["id", "title", "claim", "seconds"]);
    assert!(done(&["experiment"], "").contains("3.3"));
    refused(2, &["experiment", "9.9"], "", &["`9.9`", "3.3"]);
    refused(2, &["experiment", "3.3", "--out", LENS], "", &[LENS, "folder"]);
    refused(2, &["experiment", "--out", "here"], "", &["FIGURE"]);
}

#[test]
fn measure_trace_has_a_rate_for_every_method() {
    let measured = done_json(&["measure", "trace", "--turns", "1"], "");
    has_keys(&measured["machine"], &["processor", "cores", "lane_bits", "optimised"]);
    let rows = measured["rows"].as_array().unwrap();
    for name in ["f64_batch_1_thread", "f64_batch_2_threads", "f32_batch_1_thread", "f64_single"] {
        let row = rows.iter().find(|row| row["name"] == name).unwrap();
        assert!(row["million_ray_surfaces_per_s"].as_f64().unwrap() > 0.0, "{name}");
    }
    let rounding = |name: &str| measured[name]["point_rms_mm"].as_f64().unwrap();
    assert!(rounding("rounding_f64") < 1e-12 && rounding("rounding_f32") < 1e-4);
    // Single precision rounds, and a mean is between nothing and the largest.
    let largest = measured["rounding_f32"]["point_max_mm"].as_f64().unwrap();
    let mean = rounding("rounding_f32");
    assert!(mean > 0.01 * largest && mean <= largest, "{mean} {largest}");
    assert_eq!(measured["rounding_f64"]["other_fates"], 0);
}

#[test]
fn measure_trace_reports_the_cost_of_derivatives() {
    let measured = done_json(&["measure", "trace", "--turns", "1"], "");
    assert!(measured["gradient_over_forward"].as_f64().unwrap() > 0.0);
    if cfg!(target_os = "linux") {
        for memory in ["memory_trace", "memory_gradient"] {
            let peak = measured[memory]["peak_mb"].as_f64().unwrap();
            assert!(peak < 150.0, "{memory} {peak}");
        }
    }
}

#[test]
fn measure_spot_draws_error_against_time() {
    let plot = Scratch::new("curves.png");
    let singlet = "lenses/singlet_la1131.json";
    let arguments = ["measure", "spot", singlet, "--field", "1", "--plot", plot.path()];
    let curves = done_json(&arguments, "");
    has_keys(&curves, &["machine", "lens", "y", "rms_clear", "rms_clipped", "lit", "rows"]);
    let rows = curves["rows"].as_array().unwrap();
    for key in ["pupil", "method", "precision", "rays", "error", "ms"] {
        assert!(rows.iter().all(|row| row.get(key).is_some()), "{key}");
    }
    let best = |method: &str| {
        let mine = rows.iter().filter(|row| {
            row["method"] == method && row["precision"] == "f64" && row["pupil"] == "clear"
        });
        mine.map(|row| row["error"].as_f64().unwrap()).fold(f64::INFINITY, f64::min)
    };
    assert!(best("gauss") < 1e-10 && best("square_grid") > 1e-6);
    assert!(std::fs::read(&plot.0).unwrap().starts_with(b"\x89PNG"));
    refused(2, &["measure", "spot", singlet, "--plot", "curves.gif"], "", &["`gif`", "`.png`"]);
}

#[test]
fn measure_gradient_draws_the_error_of_every_estimator_against_time() {
    let plot = Scratch::new("gradients.png");
    let singlet = "lenses/singlet_la1131.json";
    let measured = done_json(&["measure", "gradient", singlet, "--plot", plot.path()], "");
    has_keys(&measured, &["machine", "lens", "fields", "costs", "terms"]);
    let fields = measured["fields"].as_array().unwrap();
    assert_eq!(fields[0]["y"], 0.0);
    for field in fields {
        let keys = ["light", "planned", "reason", "reference", "checked", "rows"];
        has_keys(field, &keys);
        assert!(field["checked"][0].as_f64().unwrap() < 1e-6, "{field}");
        let worst = |estimator: &str, last: bool| {
            let rows = field["rows"].as_array().unwrap();
            let mut mine = rows.iter().filter(|row| row["estimator"] == estimator);
            let row = if last { mine.next_back() } else { mine.next() }.unwrap();
            let errors = row["errors"].as_array().unwrap().iter().filter_map(Value::as_f64);
            errors.fold(0.0, f64::max)
        };
        assert!(worst("boundary", true) < 1e-10 && worst("biased", true) > 0.1);
        assert!(worst("warp", true) < 0.1 && worst("difference", true) < 1e-6);
    }
    let cost = |i: usize, key: &str| measured["costs"][i][key].as_f64().unwrap();
    assert!(cost(3, "numbers") > 2.0 * cost(0, "numbers"));
    for key in ["integral_ms", "boundary", "difference", "warp", "warp_single"] {
        assert!(cost(3, key) > 0.0, "{measured}");
    }
    let terms = measured["terms"]["rows"].as_array().unwrap();
    let names: Vec<&str> = terms.iter().map(|row| row["term"].as_str().unwrap()).collect();
    assert_eq!(names, ["spot", "wavefront", "strehl", "geometric_mtf", "mtf"]);
    for row in terms {
        assert!(row["refused"].is_null() && row["value_ms"].as_f64().unwrap() > 0.0, "{row}");
        // No affordable rays resolve the phase of forty waves: that Strehl ratio is not known, nor its derivative.
        let is_resolved = row["term"] != "strehl";
        assert!(is_resolved || row["reached"] == false, "{row}");
        assert!(!is_resolved || row["difference"].as_f64().unwrap() < 2e-3, "{row}");
    }
    assert!(std::fs::read(&plot.0).unwrap().starts_with(b"\x89PNG"));
    refused(2, &["measure", "gradient", singlet, "--plot", "x.gif"], "", &["`gif`", "`.png`"]);
}

#[test]
fn measure_optimize_has_a_cost_for_every_search() {
    let measured = done_json(&["measure", "optimize", "--steps", "2"], "");
    has_keys(&measured, &["machine", "steps", "variables", "fields", "tolerance", "rows"]);
    for row in measured["rows"].as_array().unwrap() {
        let keys = ["name", "ms_per_iteration", "mean", "min", "max", "rays", "error"];
        has_keys(row, &keys);
        assert!(row["error"].as_f64().unwrap() < 1e-5, "{row}");
    }
}

#[cfg(unix)]
#[test]
fn a_closed_pipe_is_not_an_error() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_aplanat"));
    command.args(["info", LENS]).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), text(&output.stderr)), (Some(0), String::new()));
}

#[test]
fn a_grin_task_is_optimized_and_written_as_a_volume() {
    let volume = Scratch::new("fibre.npz");
    let report = done_json(&["grin", "fibre", "--out", volume.path(), "--nodes", "9"], "");
    has_keys(&report, &["loss", "views", "error", "index", "rays", "steps", "ms", "memory"]);
    assert!(report["views"][0]["spot"].as_f64().unwrap() < 1e-4);
    assert!(report["error"]["without_offset"].as_f64().unwrap() < 1e-4);
    let read = aplanat::files::read_volume(&volume.0).unwrap();
    assert_eq!(read.grid.counts(), [9; 3]);
    assert!(read.values.iter().all(|index| *index >= 1.0), "also where the fibre ends");
    let task = done(&["grin", "luneburg-radial", "--show"], "");
    let file = Scratch::with("task.json", &task);
    let before = std::time::SystemTime::now();
    let stopped = done_json(&["grin", file.path(), "--iterations", "2"], "");
    // A part of the time that the whole command took.
    let whole = 1e3 * before.elapsed().unwrap().as_secs_f64();
    let ms = stopped["ms"].as_f64().unwrap();
    assert!(ms > 0.0 && ms < whole, "{ms} of {whole}");
    assert_eq!(stopped["steps"], 2);
    assert_eq!(
        (&stopped["stopped"], stopped["end"].as_str()),
        (&json!(true), Some("iteration_limit"))
    );
    // A search that ends when its 0.03 minutes are over has lasted as long.
    let late = done_json(&["grin", "luneburg", "--minutes", "0.03"], "");
    assert!(late["stopped"] == true && late["ms"].as_f64().unwrap() >= 1800.0, "{late}");
    refused(2, &["grin", file.path(), "--out", file.path()], "", &["--out", "the task itself"]);
    assert!(done(&["grin"], "").contains("luneburg-radial"));
    // What goes into the task comes out of its volume.
    let task = task.replace("0.995", "-0.995");
    refused(2, &["grin", "-"], &task, &["source, radius", "-0.995", "above 0"]);
}

#[test]
fn wrong_grin_tasks_are_refused_with_their_place() {
    let task = done(&["grin", "luneburg", "--show"], "");
    let with = |from: &str, to: &str| {
        assert!(task.contains(from), "no {from} in {task}");
        task.replacen(from, to, 1)
    };
    let thin = with("\"low\": 1.0", "\"low\": 0.9");
    refused(2, &["grin", "-"], &thin, &["limits, low", "0.9", "1 or more"]);
    let unknown = with("\"tolerance\"", "\"tolerence\"");
    refused(2, &["grin", "-"], &unknown, &["tolerence"]);
    refused(2, &["grin", "no-such-task"], "", &["no-such-task", "luneburg"]);
    refused(2, &["grin", "fibre", "--out", "a.txt"], "", &["a.txt", ".npz"]);
    refused(2, &["grin", "fibre", "--minutes", "0"], "", &["--minutes"]);
    refused(2, &["grin", "fibre", "--nodes", "1"], "", &["--nodes"]);
    // Volumes without nodes and with a single one.
    for (name, count) in [("empty", 0), ("voxel", 1)] {
        let raw = Scratch::new(&format!("{name}.raw"));
        std::fs::write(&raw.0, 1.5_f64.to_le_bytes().repeat(count)).unwrap();
        let data = raw.0.file_name().unwrap().to_str().unwrap();
        let header = format!(
            r#"{{"aplanat_volume": 1, "counts": [{count}, {count}, {count}], "low": [0, 0, 0],
                "spacing": [1, 1, 1], "numbers": "f64", "data": "{data}"}}"#
        );
        let header = Scratch::with(&format!("{name}.json"), &header);
        let mut task: Value = serde_json::from_str(&task).unwrap();
        task["start"] = json!({"volume": header.path()});
        let words = if count == 0 { ["start", "values"] } else { ["start", "1 nodes along x"] };
        refused(2, &["grin", "-"], &task.to_string(), &words);
    }
}

#[test]
fn contrast_and_wavefront_have_errors_rays_and_times() {
    let folder = std::env::temp_dir().join(format!("aplanat_contrast_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let csv = folder.join("mtf.csv");
    let lens = "lenses/achromat_ac254_100.json";
    let run = |arguments: &[&str]| {
        let program = env!("CARGO_BIN_EXE_aplanat");
        let out = Command::new(program).args(arguments).output().unwrap();
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        serde_json::from_slice::<Value>(&out.stdout).unwrap()
    };
    let path = csv.to_str().unwrap();
    let mtf = ["--json", "analyze", lens, "mtf", "--field", "0", "--frequencies", "0,50"];
    let found = run(&[&mtf[..], &["--csv", path]].concat());
    let point = &found["fields"][0]["diffraction"]["points"][1]["tangential"];
    let contrast = point["modulus"]["value"].as_f64().unwrap();
    assert!((contrast - 0.728).abs() < 2e-3, "{point}");
    assert_eq!(found["fields"][0]["diffraction"]["points"][0]["sagittal"]["re"], 1.0);
    assert!(found["fields"][0]["gate"]["on"].as_bool().unwrap());
    let text = std::fs::read_to_string(&csv).unwrap();
    assert!(text.contains("diffraction.points.1.tangential.modulus.value,0.72"), "{text}");
    let wave = run(&["--json", "analyze", lens, "wavefront", "--field", "0"]);
    let rms = wave["fields"][0]["rms"]["value"].as_f64().unwrap();
    assert!((rms - 0.1008).abs() < 2e-3, "{rms}");
    let psf = ["--json", "analyze", lens, "psf", "--field", "0", "--at", "0.0025,0"];
    let spread = run(&psf);
    let strehl = spread["fields"][0]["strehl"]["value"].as_f64().unwrap();
    assert!((strehl - 0.68).abs() < 0.01, "{spread}");
    std::fs::remove_dir_all(folder).unwrap();
}
