//! A lens from a specification: what is filled, what is refused, how a lens is judged.

use super::cli::{Scratch, done, done_json, refused};
use aplanat::analysis::polychromatic_geometric_mtf;
use aplanat::lens::{Aperture, Lens, Medium, Object, Row, blank, glass};
use aplanat::paraxial::{Beam, first_order};
use aplanat::pupil::{Accuracy, RayModel};
use aplanat::search::design::{
    DesignRun, DesignSettings, DesignedLens, LensRequirements, LensSpecification, LensWish,
    SpecificationError, judge_lens,
};
use serde::Deserialize;
use serde_json::Value;
use std::sync::atomic::AtomicBool;

/// `tests/reference/spec_sheets.json`.
#[derive(Deserialize)]
struct SpecSheets {
    sheets: Vec<SpecSheet>,
}

#[derive(Deserialize)]
struct SpecSheet {
    id: String,
    spec: LensSpecification,
    reference: Value,
    surfaces: Vec<SheetSurface>,
}

#[derive(Deserialize)]
struct SheetSurface {
    radius: Option<f64>,
    conic: f64,
    asphere: Vec<f64>,
    thickness: f64,
    semi_diameter: f64,
    n: [f64; 3],
}

fn sheets() -> Vec<SpecSheet> {
    let text = std::fs::read_to_string("tests/reference/spec_sheets.json").unwrap();
    serde_json::from_str::<SpecSheets>(&text).unwrap().sheets
}

/// The glass of a surface: the next one of the list by name, or by its indices.
fn medium(surface: &SheetSurface, glasses: &mut dyn Iterator<Item = &Value>) -> Medium {
    let [blue, yellow, red] = surface.n;
    if yellow == 1.0 {
        return Medium::Air;
    }
    match glasses.next().and_then(Value::as_str) {
        Some(name) => Medium::Glass(glass::find(name).unwrap().full_name()),
        None => Medium::Model { nd: yellow, vd: (yellow - 1.0) / (blue - red) },
    }
}

/// The reference lens of a sheet.
fn reference(sheet: &SpecSheet) -> Lens {
    let stop = sheet.reference["stop_surface"].as_u64().unwrap() as usize;
    let mut glasses = sheet.reference["glasses"].as_array().unwrap().iter();
    let row = |(i, surface): (usize, &SheetSurface)| Row {
        curvature: surface.radius.map_or(0.0, |radius| 1.0 / radius),
        conic: surface.conic,
        asphere: surface.asphere.clone(),
        thickness: surface.thickness,
        medium: medium(surface, &mut glasses),
        semi_diameter: Some(surface.semi_diameter),
        stop: i == stop,
        ..Row::default()
    };
    let surfaces: Vec<Row> = sheet.surfaces.iter().enumerate().map(row).collect();
    let aperture = Aperture::StopSemiDiameter(surfaces[stop].semi_diameter.unwrap());
    Lens { surfaces, aperture, ..blank() }
}

fn spec(text: &str) -> LensSpecification {
    serde_json::from_str(text).unwrap()
}

fn refusal(text: &str) -> String {
    LensRequirements::complete(&spec(text)).unwrap_err().to_string()
}

/// The figures of the sheets come from another tracer, which samples the pupil by pixels: radii and
/// areas are good to half a per cent, a per cent at steep rims.
#[test]
fn the_references_of_the_sheets_have_their_figures() {
    for sheet in sheets() {
        let (asked, filled) = LensRequirements::complete(&sheet.spec).unwrap();
        // How a lens is made, and what it is to be good at, is no part of a sheet.
        let is_other = |key: &str| ["as_built", "wish"].contains(&key);
        assert!(filled.iter().all(|value| is_other(value.key)), "{}: {filled:?}", sheet.id);
        let found = judge_lens(&reference(&sheet), &asked, 1e-3).unwrap();
        let near = |what: &str, value: f64, stated: &Value, within: f64| {
            let stated = stated.as_f64().unwrap();
            let off = (value - stated).abs() / stated.abs().max(1e-2);
            assert!(off < within, "{}: {what} {value}, stated {stated}", sheet.id);
        };
        near("rms", 1e3 * found.rms, &sheet.reference["rms_um_over_fields"], 0.01);
        near("focal length", found.focal_length, &sheet.reference["focal_length_mm"], 1e-4);
        for (field, stated) in
            found.fields.iter().zip(sheet.reference["fields"].as_array().unwrap())
        {
            near("field", 1e3 * field.rms, &stated["rms_um"], 0.012);
            near("area", field.clear_area, &stated["clear_area_mm2"], 0.01);
            near("light", field.relative_illumination, &stated["relative_illumination"], 0.012);
            near("distortion", field.distortion, &stated["distortion"], 0.012);
        }
        // The bounds are rounded, and one published lens has rims that would meet in air.
        for margin in found.limits.iter().filter(|margin| !margin.is_kept) {
            let limit = &margin.limit;
            let explained = limit.term == "air_edge" || limit.slack() > -1e-4;
            assert!(explained, "{}: {limit:?}", sheet.id);
        }
        let about_glass = |text: &String| text.contains("not one of the permitted glasses");
        assert!(found.faults.iter().all(about_glass), "{}: {:?}", sheet.id, found.faults);
    }
}

#[test]
fn focal_length_aperture_and_field_suffice() {
    let text = r#"{"focal_length_mm": 50, "f_number": 2.8, "half_field_deg": 20}"#;
    let (asked, filled) = LensRequirements::complete(&spec(text)).unwrap();
    assert_eq!(asked.fields, [0.0, 14.0, 20.0]);
    assert_eq!((asked.track, asked.elements, asked.aspheric_surfaces), (125.0, 4, 0));
    let keys: Vec<&str> = filled.iter().map(|value| value.key).collect();
    for key in ["fields_deg", "wavelengths_um", "max_track_mm", "max_elements", "glasses"] {
        assert!(keys.contains(&key), "{keys:?}");
    }
    let by_height = r#"{"focal_length_mm": 50, "numerical_aperture": 0.25, "image_height_mm": 20}"#;
    let (asked, _) = LensRequirements::complete(&spec(by_height)).unwrap();
    assert!((asked.half_field() - 0.4_f64.atan().to_degrees()).abs() < 1e-12);
    assert!((asked.f_number - 2.0).abs() < 1e-12);
}

/// The beam of the axis fills a circle of the area that is asked for, and its diameter into the focal
/// length is the f-number.
#[test]
fn light_that_is_asked_for_gives_the_f_number() {
    let area = std::f64::consts::PI * 6.25_f64.powi(2);
    let text = format!(
        r#"{{"focal_length_mm": 50, "half_field_deg": 5, "fields_deg": [0, 5],
            "min_clear_area_mm2": [{area}, {}]}}"#,
        0.8 * area
    );
    let (asked, _) = LensRequirements::complete(&spec(&text)).unwrap();
    assert!((asked.f_number - 4.0).abs() < 1e-9, "{}", asked.f_number);
}

#[test]
fn a_lens_for_its_axis_alone_can_be_asked_for() {
    let text = r#"{"focal_length_mm": 50, "f_number": 8, "half_field_deg": 0, "fields_deg": [0]}"#;
    let (asked, _) = LensRequirements::complete(&spec(text)).unwrap();
    assert_eq!((asked.fields.as_slice(), asked.half_field()), (&[0.0][..], 0.0));
}

#[test]
fn without_aperture_or_field_nothing_is_specified() {
    let text = r#"{"focal_length_mm": 50, "half_field_deg": 20}"#;
    assert_eq!(
        LensRequirements::complete(&spec(text)).unwrap_err(),
        SpecificationError::Missing("f_number")
    );
    let text = r#"{"focal_length_mm": 50, "f_number": 2.8}"#;
    assert_eq!(
        LensRequirements::complete(&spec(text)).unwrap_err(),
        SpecificationError::Missing("half_field_deg")
    );
}

#[test]
fn what_no_lens_can_do_is_refused_by_name() {
    let with = |rest: &str| format!("{{\"focal_length_mm\": 50, {rest}}}");
    for (rest, words) in [
        (r#""f_number": 0.4, "half_field_deg": 5"#, "f/0.4; an image in air"),
        (r#""f_number": 0.5, "half_field_deg": 5"#, "f/0.5; an image in air"),
        (r#""numerical_aperture": 1.0, "half_field_deg": 5"#, "f/0.5; an image in air"),
        (r#""f_number": 4, "half_field_deg": 85"#, "a field of 170 degrees"),
        (
            r#""f_number": 4, "half_field_deg": 5, "min_back_focus_mm": 80, "max_track_mm": 60"#,
            "a back focus of 80 mm within a track of 60 mm",
        ),
        (
            r#""f_number": 4, "half_field_deg": 85, "max_abs_distortion": 0.0"#,
            "170 degrees with a distortion of at most 0",
        ),
        (
            r#""f_number": 1.2, "half_field_deg": 5, "max_elements": 1"#,
            "1 spherical element at f/1.2",
        ),
        (
            r#""f_number": 4, "half_field_deg": 5, "min_back_focus_mm": 60, "max_track_mm": 60"#,
            "a back focus of 60 mm within a track of 60 mm",
        ),
        (
            r#""f_number": 4, "half_field_deg": 20, "image_height_mm": 25"#,
            "an image height of 25 mm at 20 degrees",
        ),
        (
            r#""f_number": 2, "half_field_deg": 5, "max_semi_diameter_mm": 8"#,
            "through a semi-diameter of 8 mm",
        ),
        (r#""f_number": 4, "half_field_deg": 5, "max_elements": 0"#, "without an element"),
        // A beam of 100 mm across at 50 mm is that of f/0.5.
        (
            r#""f_number": 0.6, "half_field_deg": 5, "fields_deg": [0, 5], "max_elements": 6,
                "min_clear_area_mm2": [8000, 8000], "max_semi_diameter_mm": 80"#,
            "a beam of 8000 mm^2 at a focal length of 50 mm",
        ),
    ] {
        let text = refusal(&with(rest));
        assert!(text.starts_with("no lens can do that: ") && text.contains(words), "{text}");
    }
}

#[test]
fn values_that_cannot_be_meant_are_refused_by_key() {
    let with = |rest: &str| {
        format!("{{\"focal_length_mm\": 50, \"f_number\": 4, \"half_field_deg\": 5, {rest}}}")
    };
    for (rest, words) in [
        (r#""fields_deg": [0, 3, 2]"#, "fields_deg: found [0.0, 3.0, 2.0]; expected angles"),
        (r#""fields_deg": [0, 4]"#, "the last field is 4 degrees, and `half_field_deg` is 5"),
        (r#""min_clear_area_mm2": [100]"#, "min_clear_area_mm2: found 1 numbers for 3 fields"),
        (r#""glasses": ["N-BK99"]"#, "glasses: found `N-BK99`; expected manufacturer"),
        (r#""glasses": "cheap ones""#, "glasses: found `cheap ones`"),
        (r#""max_track_mm": -1"#, "max_track_mm: found -1; expected a number above 0"),
        (r#""object": "near""#, "object: found `near`; expected `infinity`, or `finite`"),
        (r#""numerical_aperture": 0.1"#, "both `f_number` and `numerical_aperture`"),
    ] {
        let text = refusal(&with(rest));
        assert!(text.contains(words), "{text}");
    }
}

#[test]
fn the_command_line_names_the_place_and_judges_a_lens() {
    let file = Scratch::new("spec.json");
    let write = |text: &str| std::fs::write(file.path(), text).unwrap();
    write(r#"{"focal_length_mm": 50, "f_numbr": 4}"#);
    refused(2, &["design", file.path()], "", &["line 1, column", "`f_numbr`", "`f_number`"]);
    write(r#"{"focal_length_mm": 50, "f_number": 0.4, "half_field_deg": 5}"#);
    refused(2, &["design", file.path()], "", &["no lens can do that", "f/0.4"]);
    write(r#"{"focal_length_mm": 100, "f_number": 4.38, "half_field_deg": 1}"#);
    let lens = "lenses/achromat_ac254_100.json";
    let arguments = ["design", file.path(), "--judge", lens];
    let told = done(&arguments, "");
    assert!(told.contains("not stated: max_elements, taken as 2"), "{told}");
    assert!(told.contains("all 19 limits are kept"), "{told}");
    let report = done_json(&arguments, "");
    assert_eq!(report["requirements"]["elements"], 2);
    assert_eq!(report["judgement"]["faults"].as_array().unwrap().len(), 0);
}

/// Two rounds of a small design on so many threads; the state passes through JSON between them.
fn two_rounds(threads: usize, saved: bool) -> DesignRun {
    let text = r#"{"focal_length_mm": 50, "f_number": 8, "half_field_deg": 2, "max_elements": 1}"#;
    let (asked, _) = LensRequirements::complete(&spec(text)).unwrap();
    let settings = DesignSettings { starts: [1, 1], ..DesignSettings::with_seed(3) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let mut run = DesignRun::new(&asked, &settings);
        assert!(run.advance(0.0, &AtomicBool::new(false)));
        if saved {
            run = serde_json::from_str(&serde_json::to_string(&run).unwrap()).unwrap();
        }
        assert!(run.advance(0.0, &AtomicBool::new(false)));
        run
    })
}

#[test]
fn a_design_is_the_same_on_any_number_of_threads_and_when_it_is_resumed() {
    let undisturbed = two_rounds(1, false);
    assert!(undisturbed.pool_size() > 0 && undisturbed.best() < 0.1);
    assert!(undisturbed == two_rounds(2, true));
}

#[test]
fn a_design_excludes_only_lenses_that_exist() {
    let file = Scratch::new("excluded.json");
    let text = r#"{"focal_length_mm": 50, "f_number": 8, "half_field_deg": 2}"#;
    std::fs::write(file.path(), text).unwrap();
    let out = Scratch::new("designed.json");
    let arguments = ["design", file.path(), "--out", out.path(), "--without", "no_such_lens"];
    refused(2, &arguments, "", &["--without: found `no_such_lens`"]);
}

#[test]
fn sheets_are_measured_by_name() {
    let sheets = "tests/reference/spec_sheets.json";
    let arguments = ["measure", "design", sheets, "--only", "no_such_sheet"];
    refused(2, &arguments, "", &["--only: found `no_such_sheet`"]);
    let arguments = ["measure", "design", sheets, "--seconds", "0"];
    refused(2, &arguments, "", &["--seconds: found 0; expected more than 0"]);
}

/// Every lens at the end is shown as it is made too.
#[test]
fn designed_lenses_come_with_their_spots_as_built() {
    let file = Scratch::new("as-built.json");
    let text =
        r#"{"focal_length_mm": 100, "f_number": 10, "half_field_deg": 1, "max_elements": 2}"#;
    std::fs::write(file.path(), text).unwrap();
    let out = Scratch::new("as-built-lens.json");
    let design = |grade: &str| {
        let words = ["design", file.path(), "--out", out.path(), "--gradients", "300"];
        done_json(&[&words[..], &["--as-built", grade]].concat(), "")
    };
    for lens in design("commercial")["lenses"].as_array().unwrap() {
        let made = &lens["as_built"];
        let [nominal, mean, most] =
            ["nominal", "mean", "within_90_percent"].map(|key| made[key].as_f64().unwrap());
        assert!(nominal < mean && mean < most && made["grade"] == "commercial", "{made}");
        let rms = lens["judgement"]["rms"].as_f64().unwrap();
        assert!((nominal / rms - 1.0).abs() < 0.01, "{nominal} {rms}");
    }
    assert!(design("none")["lenses"][0]["as_built"].is_null());
    let wrong = ["design", file.path(), "--as-built", "perfect"];
    refused(2, &wrong, "", &["as_built", "`perfect`", "shop_limit"]);
}

/// The lenses of a small design from achromats alone.
fn designed(text: &str) -> (LensRequirements, Vec<DesignedLens>) {
    let (asked, _) = LensRequirements::complete(&spec(text)).unwrap();
    let settings = DesignSettings { starts: [0, 0], ..DesignSettings::with_seed(2) };
    let mut run = DesignRun::new(&asked, &settings);
    let go_on = AtomicBool::new(false);
    while run.gradients() < 600 && run.advance(0.0, &go_on) {}
    let lenses = run.finish(&go_on);
    (asked, lenses)
}

/// The magnification times the distance of the object stands for the focal length; the rest follows as for
/// a distant object.
#[test]
fn a_near_object_is_specified_by_its_magnification() {
    let text = r#"{"magnification": -0.5, "object_distance_mm": 150, "numerical_aperture": 0.05,
                   "image_height_mm": 5}"#;
    let (asked, _) = LensRequirements::complete(&spec(text)).unwrap();
    let object = asked.object.unwrap();
    assert_eq!((object.distance, object.magnification, asked.focal_length), (150.0, -0.5, 75.0));
    assert!((asked.thin_focal_length() - 50.0).abs() < 1e-12 && asked.f_number == 10.0);
    // The object of 10 mm from the first vertex.
    assert!((asked.half_field().to_radians().tan() - 10.0 / 150.0).abs() < 1e-12);
    // Of a thin lens: 1/s + 1/s' = 1/f, and s' = s/2.
    let text =
        r#"{"magnification": 0.5, "focal_length_mm": 50, "f_number": 8, "half_field_deg": 2}"#;
    let (asked, filled) = LensRequirements::complete(&spec(text)).unwrap();
    assert!((asked.object.unwrap().distance - 150.0).abs() < 1e-12);
    assert!(filled.iter().any(|value| value.key == "object_distance_mm"), "{filled:?}");
    for (text, words) in [
        (
            r#""magnification": -1, "object": "infinity""#,
            "a magnification of an object at infinity",
        ),
        (r#""focal_length_mm": 50, "object": "finite""#, "no key `magnification`"),
        (r#""focal_length_mm": 50, "object_distance_mm": 100"#, "no key `magnification`"),
        (r#""magnification": -1"#, "no key `object_distance_mm`"),
        (r#""magnification": 0, "object_distance_mm": 100"#, "magnification: found 0"),
        (
            r#""magnification": -1, "focal_length_mm": 50, "object_distance_mm": 300"#,
            "at 100.000 mm",
        ),
    ] {
        let text = refusal(&format!(r#"{{"f_number": 8, "half_field_deg": 2, {text}}}"#));
        assert!(text.contains(words), "{text}");
    }
}

#[test]
fn a_lens_for_a_near_object_has_its_magnification() {
    let (asked, lenses) = designed(
        r#"{"magnification": -1, "object_distance_mm": 100, "f_number": 10, "half_field_deg": 1.5,
            "max_elements": 2, "as_built": "none"}"#,
    );
    let best = &lenses[0];
    assert!(best.judgement.is_valid(), "{:?}", best.judgement.failures());
    assert_eq!(best.lens.object, Object::Finite(100.0));
    let um = best.lens.wavelengths[best.lens.primary()].um;
    let system = best.lens.resolve(0, um).unwrap();
    let first = first_order(&system, &Beam::for_lens(&best.lens, 0)).unwrap();
    let magnification = first.magnification.unwrap();
    assert!((magnification + 1.0).abs() < 0.0101, "{magnification}");
    let judged = best.judgement.magnification.unwrap();
    assert!((judged - magnification).abs() < 2e-3, "{judged} {magnification}");
    // The cone of the image is that of the working f-number, 2 % of its light may be missing.
    let working = first.working_f_number.unwrap();
    assert!((working / 10.0 - 1.0).abs() < 0.03, "{working}");
    assert!(best.judgement.rms < 0.05, "{}", best.judgement.rms);
    let light: Vec<f64> = best.judgement.fields.iter().map(|field| field.clear_area).collect();
    assert!(light.iter().zip(&asked.clear_area).all(|(found, least)| found >= least), "{light:?}");
}

/// A lens is judged by the contrast that is wished, and none is taken that has less of it.
#[test]
fn a_wish_for_contrast_is_judged_and_served() {
    let text = |wish: &str| {
        format!(
            r#"{{"focal_length_mm": 60, "f_number": 5, "half_field_deg": 3, "max_elements": 2,
                "as_built": "none"{wish}}}"#
        )
    };
    let (asked, filled) = LensRequirements::complete(&spec(&text(""))).unwrap();
    assert_eq!(asked.wish, LensWish::Rms);
    assert!(filled.iter().any(|value| value.key == "wish" && value.value == "rms"));
    let (asked, wished) = designed(&text(r#", "wish": {"mtf": 30}"#));
    assert_eq!(asked.wish, LensWish::Mtf(30.0));
    let best = &wished[0];
    assert!(best.judgement.is_valid(), "{:?}", best.judgement.failures());
    let model = RayModel::from_lens(&best.lens, 0).unwrap();
    let contrast = |field: &aplanat::lens::FieldPoint| {
        let accuracy = Accuracy { tolerance: 1e-3, ..Accuracy::default() };
        let point =
            polychromatic_geometric_mtf(&model, *field, &[30.0], accuracy).unwrap().points[0];
        0.5 * (point.tangential.modulus.value + point.sagittal.modulus.value)
    };
    let mean = model.fields.iter().map(contrast).sum::<f64>() / model.fields.len() as f64;
    let judged = best.judgement.contrast.unwrap();
    assert!((judged - mean).abs() < 5e-3, "{judged} {mean}");
    let (_, sharp) = designed(&text(""));
    assert!(sharp[0].judgement.contrast.is_none());
    let of_sharp = judge_lens(&sharp[0].lens, &asked, 1e-3).unwrap().contrast.unwrap();
    assert!(judged >= of_sharp - 1e-3, "{judged} {of_sharp}");
    let refused = refusal(&text(r#", "wish": {"mtf": 0}"#));
    assert!(refused.contains("wish: found 0"), "{refused}");
}

/// What every limit costs is in the report of every lens: lengths by the millimetre, light by the percent.
#[test]
fn the_report_of_a_design_has_the_costs_of_its_limits() {
    let file = Scratch::new("costs.json");
    let text = r#"{"focal_length_mm": 60, "f_number": 5, "half_field_deg": 3, "max_elements": 2,
                   "max_track_mm": 58, "min_back_focus_mm": 50, "as_built": "none"}"#;
    std::fs::write(file.path(), text).unwrap();
    let out = Scratch::new("costs-lens.json");
    let words = ["design", file.path(), "--out", out.path(), "--gradients", "300"];
    for lens in done_json(&words, "")["lenses"].as_array().unwrap() {
        let costs = lens["costs"].as_array().unwrap();
        let has =
            |key: &str| costs.iter().any(|cost| cost[key].as_f64().is_some_and(|um| um > 0.0));
        assert!(has("um_per_mm") && has("um_per_percent"), "{costs:?}");
    }
    let told = done(&words, "");
    assert!(told.contains(" um per mm") && told.contains("light costs "), "{told}");
}
