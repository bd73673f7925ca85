//! Diffraction in pictures: against closed forms through a telescope without aberrations on its axis, and its
//! gate.

use super::cli::{done, done_json};
use super::cli_files::Folder;
use super::pictures::{bundled, render_by, samples};
use aplanat::analysis::diffraction_mtf;
use aplanat::lens::{FieldPoint, Lens};
use aplanat::picture::{
    ColorBand, Coloring, ExactRenderer, ImageFrame, Pattern, Picture, QuickRenderer, Scene,
    SceneLayer, picture_model, quick_error,
};
use aplanat::pupil::{Accuracy, RayModel};
use std::f64::consts::PI;

const RC: &str = "telescope_rc_f8";
/// λF in mm of that telescope: 0.55 um at f/8.
const LAMBDA_F: f64 = 0.55e-3 * 8.0;
const EFL: f64 = 8.0 * 3962.4;

/// A square light at infinity whose image has this side in mm.
fn light(side: f64) -> Scene {
    let layer = SceneLayer {
        distance: None,
        center: [0.0; 2],
        half_size: [0.5 * side / EFL; 2],
        velocity: [0.0; 2],
        pattern: Pattern::Uniform { radiance: [1.0; 3], cover: 1.0 },
    };
    Scene::new(vec![layer], [0.0; 3], 1.0).unwrap()
}

/// The side of a light in pixels.
const SIDE: f64 = 3.0;

/// The picture of a light of some pixels, in grey.
fn picture_of_light(lens: &Lens, count: usize, pitch: f64, many: usize) -> Picture {
    let (model, bands) = picture_model(lens, 0, Coloring::Gray).unwrap();
    let frame = ImageFrame { pixels: [count; 2], pitch, center: [0.0; 2], inverted: true };
    let scene = light(SIDE * pitch);
    let renderer = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
    let renderer = renderer.with_diffraction(&model, &bands, 0.01).unwrap();
    let report = renderer.diffraction().unwrap();
    assert!(report.on && report.change > 0.3 && report.left < 5e-3, "{report:?}");
    render_by(&renderer, &samples(many))
}

/// J1 by its integral.
fn bessel(x: f64) -> f64 {
    let at = |i: u32| {
        let t = PI * (f64::from(i) + 0.5) / 64.0;
        (t - x * t.sin()).cos()
    };
    (0..64).map(at).sum::<f64>() / 64.0
}

/// The share of the light of a point in 1/mm² at a distance in mm, behind an aperture with a dark middle of this
/// ratio of radii (Airy).
fn airy(distance: f64, ratio: f64) -> f64 {
    let x = PI * distance.max(1e-9) / LAMBDA_F;
    let field = 2.0 * (bessel(x) - ratio * bessel(ratio * x)) / x;
    PI / (4.0 * LAMBDA_F * LAMBDA_F) * field * field / (1.0 - ratio * ratio)
}

/// The light of a pixel, so far to the right and down from a square light, over that of a white card.
fn on_pixel([right, down]: [f64; 2], pitch: f64, ratio: f64) -> f64 {
    let (steps, half) = (24, 0.5 * (SIDE + 1.0) * pitch);
    let width = 2.0 * half / f64::from(steps);
    let place = |i: i32| width * (f64::from(i) + 0.5) - half;
    // The part of a pixel over which a light and the pixel meet that are so far apart.
    let common = |v: f64| ((half - v.abs()) / pitch).clamp(0.0, 1.0);
    let mut sum = 0.0;
    for i in 0..steps {
        for j in 0..steps {
            let (x, y) = (place(i), place(j));
            sum += common(x) * common(y) * airy((right + x).hypot(down + y), ratio);
        }
    }
    sum * width * width
}

/// Every ray meets the light or does not, so that their numbers scatter by their roots at most.
fn compare(lens: &Lens, ratio: f64) {
    let (count, pitch, many) = (11, 1.5e-3, 1 << 12);
    let picture = picture_of_light(lens, count, pitch, many);
    let from_middle = |i: usize| (i as f64 - 5.0) * pitch;
    let (mut sum, mut all) = (0.0, 0.0);
    for (i, value) in picture.values.iter().enumerate() {
        let at = [from_middle(i % count), from_middle(i / count)];
        let (found, exact) = (value[0] / picture.white, on_pixel(at, pitch, ratio));
        let scatter = 5.0 * (exact / many as f64).sqrt();
        assert!((found - exact).abs() < scatter + 4e-3, "{at:?}: {found} {exact}");
        sum += found;
        all += exact;
    }
    assert!((sum / all - 1.0).abs() < 0.02, "{sum} {all}");
}

#[test]
fn a_small_light_is_an_airy_disc() {
    let mut lens = bundled(RC);
    lens.surfaces[0].obstruction = None;
    compare(&lens, 0.0);
}

#[test]
fn behind_a_ring_it_has_the_rings_of_one() {
    let mut lens = bundled(RC);
    lens.surfaces[0].obstruction = Some(0.5 * 1981.2);
    compare(&lens, 0.5);
}

/// The quick way spreads light alike, and light is neither lost nor made.
#[test]
fn the_quick_way_spreads_light_as_the_exact_one() {
    let (model, bands) = picture_model(&bundled(RC), 0, Coloring::Rgb(1)).unwrap();
    let frame = ImageFrame { pixels: [40; 2], pitch: 4e-3, center: [0.0; 2], inverted: true };
    let scene = light(40e-3);
    let exact = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
    let sharp = QuickRenderer::new(&model, &bands, &exact).unwrap().render();
    let exact = exact.with_diffraction(&model, &bands, 0.01).unwrap();
    let quick = QuickRenderer::new(&model, &bands, &exact).unwrap().render();
    assert_eq!(quick.frame, frame);
    let [spread, geometric] = [&quick, &sharp].map(|p| quick_error(&exact, p, 9, 512).value);
    assert!(spread < 0.05 && geometric > 4.0 * spread, "{spread} {geometric}");
    assert!((quick.mean() / sharp.mean() - 1.0).abs() < 0.05, "{} {}", quick.mean(), sharp.mean());
}

/// The error of a picture holds what diffraction leaves, and says what it is.
#[test]
fn a_picture_says_what_diffraction_changes() {
    let folder = Folder::new("picture-diffraction");
    let out = folder.path("star.png");
    let base = ["picture", "lenses/telescope_rc_f8.json", "--scene", "star", "--out", &out];
    let small = ["--diagonal", "0.2", "--pixels", "24x24", "--gray", "--error", "6%"];
    let report = done_json(&[&base[..], &small].concat(), "");
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let found = &report["diffraction"];
    assert_eq!(found["on"], true, "{report}");
    assert!(number(&found["change"]) > 0.3 && number(&found["left"]) < 0.01, "{found}");
    assert!(report["left_out"].as_array().unwrap().iter().all(|e| e["effect"] != "diffraction"));
    let errors = report["errors"].as_array().unwrap();
    assert_eq!([&errors[0]["effect"], &errors[1]["effect"]], ["sampling", "diffraction"]);
    let square: f64 = errors.iter().map(|error| number(&error["used"]).powi(2)).sum();
    assert!((square.sqrt() - number(&report["error"])).abs() < 1e-12);
    assert_eq!(report["reached"], number(&report["error"]) <= 0.06);
    // An achromat with a part of a wavelength of aberrations has another spread than its pupil: that one is put in.
    let base = ["picture", "lenses/achromat_ac254_100.json", "--scene", "star", "--out", &out];
    let small = ["--diagonal", "0.1", "--pixels", "16x16", "--gray", "--quick", "--error", "3%"];
    let report = done_json(&[&base[..], &small].concat(), "");
    let found = &report["diffraction"];
    assert_eq!([&found["on"], &found["aberrated"]], [true, true], "{report}");
    assert!(number(&found["left"]) < 0.01, "{report}");
    assert_eq!(report["reached"], number(&report["error"]) <= 0.03, "{report}");
    assert!(number(&report["error"]) >= number(&found["left"]));
    let text = done(&[&base[..], &small].concat(), "");
    assert!(text.contains("with its aberrations") && text.contains("  diffraction "), "{text}");
}

/// The contrast and the phase of waves of this frequency in the image about a point, along x or y, in a picture.
fn wave(renderer: &ExactRenderer<'_>, many: usize, (count, along): (usize, usize)) -> [f64; 2] {
    let picture = render_by(renderer, &samples(many));
    let mut sums = [0.0; 3];
    let columns = picture.frame.pixels[0];
    for (i, value) in picture.values.iter().enumerate() {
        let at = [i % columns, i / columns][along];
        let (sin, cos) = (2.0 * PI * (at as f64 + 0.5) / count as f64).sin_cos();
        sums = [sums[0] + value[0], sums[1] + value[0] * cos, sums[2] + value[0] * sin];
    }
    let half = PI / count as f64;
    let pixel = half.sin() / half;
    [2.0 * sums[1].hypot(sums[2]) / sums[0] / pixel, sums[2].atan2(sums[1])]
}

/// Waves through an achromat with aberrations of a part of a wavelength, on the axis and off it, have the contrast of
/// diffraction, and are where rays have them.
#[test]
fn aberrations_of_a_part_of_a_wave_have_the_contrast_of_diffraction() {
    let lens = bundled("achromat_ac254_100");
    let model = RayModel::from_lens(&lens, 0).unwrap();
    let bands = vec![ColorBand { wavelengths: vec![(model.primary, 1.0)] }];
    let focal = model.first_order.efl.unwrap();
    let count = 16;
    for (height, along, nu) in [(0.0, 1, 120.0), (0.8, 1, 60.0), (0.8, 1, 150.0), (0.8, 0, 120.0)] {
        let mut pixels = [2; 2];
        pixels[along] = count;
        let pitch = 1.0 / nu / count as f64;
        let frame = ImageFrame { pixels, pitch, center: [0.0, height], inverted: true };
        let mut frequency = [0.0; 2];
        frequency[along] = nu * focal;
        let layer = SceneLayer {
            distance: None,
            center: [0.0; 2],
            half_size: [f64::INFINITY; 2],
            velocity: [0.0; 2],
            pattern: Pattern::Wave { contrast: 1.0, frequency, phase: 0.0 },
        };
        let scene = Scene::new(vec![layer], [0.0; 3], 1.0).unwrap();
        let by_rays = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
        let [_, straight] = wave(&by_rays, 4096, (count, along));
        let spread = by_rays.with_diffraction(&model, &bands, 0.003).unwrap();
        let report = spread.diffraction().unwrap().clone();
        let place = format!("{height} {along} {nu}: {report:?}");
        assert!(report.on && report.aberrated && report.left < 0.01, "{place}");
        let [found, phase] = wave(&spread, 4096, (count, along));
        let angle = (height / focal).atan().to_degrees();
        let field = FieldPoint { x: 0.0, y: angle, weight: 1.0 };
        let curve = diffraction_mtf(&model, field, model.primary, &[nu], Accuracy::default());
        let point = &curve.unwrap().points[0];
        let exact = [&point.sagittal, &point.tangential][along].modulus.value;
        assert!((found - exact).abs() < 0.015, "{found} {exact} {place}");
        let off = (phase - straight + PI).rem_euclid(2.0 * PI) - PI;
        // At low frequencies the middle of a spread is that of its rays.
        assert!(nu > 100.0 || off.abs() < 0.05, "{phase} {straight} {place}");
        let quick = QuickRenderer::new(&model, &bands, &spread).unwrap().render();
        let error = quick_error(&spread, &quick, 1, 512).value;
        assert!(error < 0.05, "{error} {place}");
    }
}

/// The same light from every direction: no spread changes it, and nothing is computed for one.
#[test]
fn a_scene_without_contrast_has_no_diffraction() {
    let out = std::env::temp_dir().join("aplanat-even.png").display().to_string();
    let lens = "lenses/achromat_ac254_100.json";
    let base = ["picture", lens, "--scene", "white", "--gray", "--pixels", "24x16"];
    let found = done_json(&[&base[..], &["--pitch", "5", "--out", &out]].concat(), "");
    assert_eq!(found["reached"], true, "{found}");
    assert_eq!(found["diffraction"]["on"], false, "{found}");
    assert_eq!(found["diffraction"]["change"].as_f64(), Some(0.0), "{found}");
}
