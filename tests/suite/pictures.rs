//! Pictures by rays backwards: against exact values, against the irradiance, and their own errors.

use crate::images::image_lens;
use crate::reference::{number, read};
use aplanat::analysis::irradiance;
use aplanat::files;
use aplanat::lens::{Lens, Object};
use aplanat::picture::{
    BuiltInScene, ColorBand, Coloring, ErrorMap, ExactRenderer, ExactSettings, ImageFrame, Pattern,
    Picture, PictureError, QuickRenderer, Scene, SceneLayer, field_diagonal, filling_size, focused,
    picture_model, quick_error,
};
use aplanat::pupil::{Accuracy, RayModel};
use serde_json::Value;
use std::ops::ControlFlow;
use std::path::Path;

const ACCURACY: Accuracy = Accuracy { tolerance: 1e-5, max_rays: 200_000 };

pub(crate) fn bundled(name: &str) -> Lens {
    files::open(Path::new(&format!("lenses/{name}.json"))).unwrap().lens
}

fn go_on(_done: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn one_band(wavelength: usize) -> Vec<ColorBand> {
    vec![ColorBand { wavelengths: vec![(wavelength, 1.0)] }]
}

/// A single tiny pixel at a point of the image.
fn point_frame(center: [f64; 2]) -> ImageFrame {
    ImageFrame { pixels: [1, 1], pitch: 1e-9, center, inverted: true }
}

pub(crate) fn render(
    model: &RayModel,
    bands: &[ColorBand],
    scene: &Scene,
    frame: ImageFrame,
    settings: ExactSettings,
) -> Picture {
    ExactRenderer::new(model, bands, scene, frame).unwrap().render(&settings, &go_on)
}

pub(crate) fn render_by(renderer: &ExactRenderer<'_>, settings: &ExactSettings) -> Picture {
    renderer.render(settings, &go_on)
}

/// Exactly this many samples of each pixel.
pub(crate) fn samples(count: usize) -> ExactSettings {
    ExactSettings { tolerance: -1.0, max_samples: count, ..ExactSettings::default() }
}

/// The scene of an entry of `images.json`: a wave in the direction of light, or on a plane.
fn wave_scene(data: &Value) -> Scene {
    let at = |name: &str| number(&data[name]);
    let far = data["kind"] == "infinity";
    let [x, y] = if far { ["fx", "fy"] } else { ["gx", "gy"] }.map(at);
    Scene::wave([x, y, at("phase")], (!far).then(|| at("distance"))).unwrap()
}

#[test]
fn single_pixels_of_known_scenes() {
    let file = read("images.json");
    let lens = image_lens(file["scene"]["lens"].as_str().unwrap());
    let (model, bands) = (lens.model(true).unwrap(), one_band(lens.primary()));
    let mut compared = 0;
    for point in file["scene"]["points"].as_array().unwrap() {
        let frame = point_frame([number(&point["x"]), number(&point["y"])]);
        for data in point["scenes"].as_array().unwrap() {
            let picture = render(&model, &bands, &wave_scene(data), frame, samples(1 << 12));
            let (found, error) = (picture.values[0][0], picture.errors[0][0]);
            let exact = number(&data["value"]);
            let place = format!("{:?} {data}: {found} ± {error:e}", frame.center);
            // Four replicates tell their error roughly: by chance it is a fifth of what it should be.
            assert!((found - exact).abs() < 4.0 * error + 2e-3 * exact, "{place}");
            assert!(error < 4e-3 * exact, "{place}");
            assert!(error > 0.0 && picture.overshoot <= 1.0, "{place}");
            compared += 1;
        }
    }
    assert!(compared >= 12, "{compared}");
}

/// Compares white cards at some shares of the way to the corner with the irradiance there.
fn compare_white(name: &str, shares: &[f64]) {
    let lens = bundled(name);
    let model = RayModel::from_lens(&lens, 0).unwrap();
    let corner = 0.5 * field_diagonal(&model).unwrap();
    let (scene, bands) = (Scene::uniform(1.0), one_band(model.primary));
    let azimuth: f64 = 0.7;
    for share in shares {
        let at = [share * corner * azimuth.sin(), share * corner * azimuth.cos()];
        let picture = render(&model, &bands, &scene, point_frame(at), samples(1 << 11));
        let exact = irradiance(&model, model.primary, [0.0, share * corner], ACCURACY).unwrap();
        let (found, error) = (picture.values[0][0], picture.errors[0][0]);
        let exact = exact.value;
        let place = format!("{name} at {share}: {found} ± {error:e} of {exact}");
        assert!((found - exact).abs() < 6.0 * error + 1e-4 * exact, "{place}");
        assert!(error < 5e-3 * exact, "{place}");
    }
}

#[test]
fn a_white_card_has_the_irradiance() {
    compare_white("double_gauss_rudolph_50", &[0.0, 0.5, 0.71, 0.98]);
}

#[test]
fn so_it_has_behind_mirrors_and_in_a_gradient() {
    compare_white("telescope_rc_f8", &[0.0, 0.7]);
    compare_white("grin_rod_melles_griot", &[0.5]);
}

#[test]
fn so_it_has_in_a_phone_and_a_fisheye() {
    compare_white("phone_us7558005_1", &[0.0, 0.9]);
    compare_white("fisheye_minolta_16_f28", &[0.95]);
}

/// A small picture of a scene through the bundled double Gauss.
fn small(scene: BuiltInScene, pixels: [usize; 2], settings: ExactSettings) -> Picture {
    let (model, bands) =
        picture_model(&bundled("double_gauss_rudolph_50"), 0, Coloring::Rgb(1)).unwrap();
    let frame = ImageFrame::new(&model, pixels, 30.0).unwrap();
    let scene = scene.build(&model, &frame, None).unwrap();
    render(&model, &bands, &scene, frame, settings)
}

#[test]
fn the_stated_error_is_that_of_independent_pictures() {
    let at = |seed| small(BuiltInScene::Star, [24, 16], ExactSettings { seed, ..samples(64) });
    let (a, b) = (at(1), at(2));
    let values = a.values.iter().flatten().zip(b.values.iter().flatten());
    let grey = 0.18 * a.white;
    let square = |(a, b): (&f64, &f64)| ((a - b) / (0.5 * (a + b)).max(grey)).powi(2);
    let count = a.values.len() as f64 * 3.0;
    let found = (values.map(square).sum::<f64>() / count / 2.0).sqrt();
    let stated = (0.5 * (a.rms_error().powi(2) + b.rms_error().powi(2))).sqrt();
    assert!((found / stated - 1.0).abs() < 0.2, "{found} {stated}");
}

#[test]
fn the_same_bits_on_any_number_of_threads_and_a_tolerance_is_reached() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let settings = ExactSettings { tolerance: 0.05, ..ExactSettings::default() };
        pool.install(|| small(BuiltInScene::Edge, [20, 18], settings))
    };
    let picture = on(1);
    assert!(picture.reached && picture.complete && picture.rms_error() < 0.05);
    assert_eq!(picture, on(3));
    assert_eq!(picture.fates.total(), picture.rays);
}

#[test]
fn a_picture_that_is_ended_early_says_so() {
    let (model, bands) =
        picture_model(&bundled("double_gauss_rudolph_50"), 0, Coloring::Rgb(1)).unwrap();
    let frame = ImageFrame::new(&model, [64, 32], 30.0).unwrap();
    let scene = Scene::uniform(1.0);
    let renderer = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
    let picture = renderer.render(&samples(16), &|_| ControlFlow::Break(()));
    assert!(!picture.complete && !picture.reached);
    assert!(picture.values.contains(&[0.0; 3]));
}

#[test]
fn a_picture_is_upright() {
    let picture = small(BuiltInScene::Edge, [10, 6], samples(64));
    let mean = |columns: std::ops::Range<usize>| {
        columns.map(|column| picture.gray([column, 3])).sum::<f64>() / picture.white
    };
    // The light side is on the right, and the edge leans to the right at the top.
    assert!(mean(7..9) > 2.5 * mean(1..3), "{} {}", mean(1..3), mean(7..9));
    assert!(picture.gray([5, 0]) < 0.9 * picture.gray([5, 5]));
}

#[test]
fn the_image_plane_moves_to_focus() {
    let lens = bundled("double_gauss_rudolph_50");
    let near = focused(&lens, 0, 1000.0).unwrap();
    let at = |lens: &Lens| RayModel::from_lens(lens, 0).unwrap();
    let (before, after) = (at(&lens), at(&near));
    let defocus = |model: &RayModel| model.first_order.image_defocus.unwrap();
    assert!((defocus(&before) - defocus(&after)).abs() < 1e-9);
    assert!((before.stop_radius() / after.stop_radius() - 1.0).abs() < 1e-12);
    assert_eq!(near.object, Object::Finite(1000.0));
    let refused = focused(&lens, 0, 20.0).unwrap_err();
    assert!(matches!(refused, PictureError::NotImaged { .. }), "{refused}");
}

#[test]
fn planes_close_to_the_lens_have_numbers() {
    let lens = bundled("double_gauss_rudolph_50");
    let (model, bands) = picture_model(&lens, 0, Coloring::Gray).unwrap();
    let efl = model.first_order.efl.unwrap();
    let ffl = model.first_order.ffl.unwrap();
    for distance in [1e-3, 0.5 * efl, -ffl, 1e9] {
        let pattern = Pattern::Checkerboard(10.0);
        let half_size = [f64::INFINITY, 0.4 * distance];
        let layer = SceneLayer {
            distance: Some(distance),
            center: [0.0; 2],
            half_size,
            velocity: [0.0; 2],
            pattern,
        };
        let scene = Scene::new(vec![layer], [0.0; 3], 1.0).unwrap();
        let frame = ImageFrame::new(&model, [4, 4], 20.0).unwrap();
        let picture = render(&model, &bands, &scene, frame, samples(64));
        assert!(picture.values.iter().flatten().all(|v| v.is_finite() && *v >= 0.0), "{distance}");
        assert!(picture.mean() <= picture.white, "{distance}");
    }
}

#[test]
fn lenses_without_a_picture_are_refused() {
    let mut lens = bundled("double_gauss_rudolph_50");
    let (model, bands) = picture_model(&lens, 0, Coloring::Gray).unwrap();
    for (pixels, diagonal) in [([0, 4], 20.0), ([4, 4], 0.0), ([4, 4], f64::NAN)] {
        assert!(ImageFrame::new(&model, pixels, diagonal).is_err());
    }
    // A sensor that no light reaches.
    let scene = Scene::uniform(1.0);
    let frame = ImageFrame { center: [0.0, 1e4], ..point_frame([0.0; 2]) };
    let dark =
        ExactRenderer::new(&model, &bands, &scene, frame).map(|r| r.render(&samples(16), &go_on));
    assert!(dark.is_err() || dark.unwrap().values[0] == [0.0; 3]);
    lens.surfaces[3].decenter = [0.1, 0.0];
    let (model, bands) = picture_model(&lens, 0, Coloring::Gray).unwrap();
    let refused = ExactRenderer::new(&model, &bands, &scene, point_frame([0.0; 2])).unwrap_err();
    assert!(matches!(refused, PictureError::NotCentred(_)), "{refused}");
}

/// The error of the quick way for a scene of a double Gauss that is made at the size of its frame, and the
/// picture.
fn quick(lens: &Lens, build: impl Fn(&RayModel, &ImageFrame) -> Scene) -> (f64, Picture) {
    let (model, bands) = picture_model(lens, 0, Coloring::Rgb(1)).unwrap();
    let frame = ImageFrame::new(&model, [48, 32], 30.0).unwrap();
    let scene = build(&model, &frame);
    let exact = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
    let picture = QuickRenderer::new(&model, &bands, &exact).unwrap().render();
    let error = quick_error(&exact, &picture, 2, 64);
    assert!(picture.values.iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
    (error.value, picture)
}

#[test]
fn the_quick_way_is_close_to_the_exact_one_and_says_how_close() {
    let lens = bundled("double_gauss_rudolph_50");
    let (white, _) = quick(&lens, |_, _| Scene::uniform(1.0));
    assert!(white < 0.01, "{white}");
    let edge = |model: &RayModel, frame: &ImageFrame| {
        BuiltInScene::Edge.build(model, frame, None).unwrap()
    };
    let (edge, picture) = quick(&lens, edge);
    assert!(edge > 0.0 && edge < 0.05, "{edge}");
    // A picture with twice the light is wrong by more than its own light.
    let mut wrong = picture.clone();
    wrong.values.iter_mut().flatten().for_each(|value| *value *= 2.0);
    let (model, bands) = picture_model(&lens, 0, Coloring::Rgb(1)).unwrap();
    let scene = BuiltInScene::Edge.build(&model, &picture.frame, None).unwrap();
    let exact = ExactRenderer::new(&model, &bands, &scene, picture.frame).unwrap();
    let error = quick_error(&exact, &wrong, 1, 32).value;
    assert!((error - 1.0).abs() < 0.3, "{error}");
}

#[test]
fn the_quick_way_sees_depth() {
    let lens = focused(&bundled("double_gauss_rudolph_50"), 0, 1000.0).unwrap();
    let (error, _) = quick(&lens, |model, frame| {
        let plane = |distance: f64, half_size: [f64; 2], pattern| SceneLayer {
            distance: Some(distance),
            center: [0.0; 2],
            half_size,
            velocity: [0.0; 2],
            pattern,
        };
        let [width, height] = filling_size(model, frame, Some(1000.0)).unwrap();
        let near = Pattern::Uniform { radiance: [0.2; 3], cover: 1.0 };
        let near = plane(700.0, [0.3 * width, 0.3 * height], near);
        let far = plane(1500.0, [2.0 * width, 2.0 * height], Pattern::SlantedEdge);
        Scene::new(vec![near, far], [0.0; 3], 1.0).unwrap()
    });
    assert!(error < 0.06, "{error}");
}

/// A star that moves by some pixels during the exposure is smeared as the exact way smears it, and what stands
/// still behind it is not.
#[test]
fn the_quick_way_sees_motion() {
    let (model, bands) =
        picture_model(&bundled("double_gauss_rudolph_50"), 0, Coloring::Rgb(1)).unwrap();
    let frame = ImageFrame::new(&model, [48, 32], 30.0).unwrap();
    let [width, height] = filling_size(&model, &frame, None).unwrap();
    let plane = |half_size: [f64; 2], velocity: [f64; 2], pattern| SceneLayer {
        distance: None,
        center: [0.0; 2],
        half_size,
        velocity,
        pattern,
    };
    let moving = plane([0.4 * width, 0.4 * height], [0.3, 0.2], Pattern::Star(12.0));
    let behind = plane([2.0 * width, 2.0 * height], [0.0; 2], Pattern::SlantedEdge);
    let scene = Scene::new(vec![moving, behind], [0.0; 3], 1.0).unwrap();
    let exact = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
    let seconds = 0.3;
    let error = |picture: &Picture| {
        ErrorMap::of_exposure(&exact, picture, ((6, 256), seconds), || false).rms().value
    };
    let smeared = QuickRenderer::exposed(&model, &bands, &exact, seconds).unwrap().render();
    let still = QuickRenderer::new(&model, &bands, &exact).unwrap().render();
    let [smeared, still] = [error(&smeared), error(&still)];
    assert!(smeared < 0.06 && still > 5.0 * smeared, "{smeared} {still}");
}

/// A picture that is too bright by a tenth everywhere is wrong by as much everywhere, and from several
/// tiles that is known well.
#[test]
fn the_error_of_a_picture_that_is_wrong_alike_everywhere_is_well_known() {
    let lens = bundled("double_gauss_rudolph_50");
    let (model, bands) = picture_model(&lens, 0, Coloring::Rgb(1)).unwrap();
    let frame = ImageFrame::new(&model, [96, 64], 4.0).unwrap();
    let scene = Scene::uniform(1.0);
    let exact = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
    let mut picture = QuickRenderer::new(&model, &bands, &exact).unwrap().render();
    picture.values.iter_mut().flatten().for_each(|value| *value *= 1.1);
    let error = quick_error(&exact, &picture, 6, 64);
    assert!((error.value - 0.1).abs() < 0.02, "{error:?}");
    assert!(error.error < 0.15 * error.value, "{error:?}");
}
