//! Hard cases of pictures that are about sums, noise and threads: a number with its error, never a NaN.
//!
//! The cases of wavefronts and of rays are in `image_hard_cases`: 1, 3, 5, 7, 10, 12, 13, 14, 16 and a smear longer
//! than the frame (19). Case 11 is in `folded_image`. Case 15 is `planes_close_to_the_lens_have_numbers` in `pictures` and the unit tests of scenes,
//! 17 those of coatings, and 18 that of sensors and the exposure without time below.

use crate::pictures::{bundled, samples};
use aplanat::analysis::Coating;
use aplanat::picture::{
    BuiltInScene, Coloring, ExactRenderer, ExactSettings, Exposure, GhostLight, ImageFrame,
    LightLosses, Picture, QuickRenderer, Scene, SensorModel, field_diagonal, photon_count,
    picture_model,
};
use aplanat::trace::Fates;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

const LENS: &str = "double_gauss_rudolph_50";

const SENSOR: SensorModel = SensorModel {
    quantum_efficiency: 0.5,
    full_well: 20_000.0,
    dark_current: 1.0,
    read_noise: 3.0,
    gain: 0.4,
    black_level: 100.0,
    bits: 14,
};

/// A grey picture of even light, of so many photons in a second at luminance 1.
fn even(photons: f64) -> Picture {
    let frame = ImageFrame { pixels: [100, 100], pitch: 0.005, center: [0.0; 2], inverted: true };
    let level = photons / photon_count(1.0, frame.pitch, 1.0);
    Picture {
        frame,
        values: vec![[level; 3]; 10_000],
        errors: vec![[0.0; 3]; 10_000],
        white: level,
        rays: 0,
        fates: Fates::default(),
        reached: true,
        complete: true,
        overshoot: 0.0,
    }
}

/// Case 19: of two exposures whose times are a million apart the short one has the noise of the linear model of
/// EMVA 1288, and the long one is full: no number overflows.
#[test]
fn exposures_a_million_apart_are_noise_and_saturation() {
    let picture = even(2000.0);
    let at = |seconds: f64| Exposure { luminance: 1.0, seconds, seed: 3 };
    let long = SENSOR.expose(&picture, &at(1e3));
    assert!((long.saturated - 1.0).abs() < 1e-12, "{}", long.saturated);
    let full = (SENSOR.gain * SENSOR.full_well + SENSOR.black_level).round();
    let is_full = |n: &u16| (f64::from(*n) - full).abs() < 6.0 * SENSOR.gain * SENSOR.read_noise;
    assert!(long.numbers.iter().flatten().all(is_full));
    for seconds in [1e-3, 1e-1] {
        let short = SENSOR.expose(&picture, &at(seconds));
        let numbers: Vec<f64> = short.numbers.iter().flatten().map(|n| f64::from(*n)).collect();
        let n = numbers.len() as f64;
        let mean = numbers.iter().sum::<f64>() / n;
        let variance = numbers.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        // y = K e + black, var y = K² (mu_e + sigma_d²) + 1/12.
        let electrons = seconds * (SENSOR.quantum_efficiency * 2000.0 + SENSOR.dark_current);
        let expected = SENSOR.gain * electrons + SENSOR.black_level;
        let spread = SENSOR.gain.powi(2) * (electrons + SENSOR.read_noise.powi(2)) + 1.0 / 12.0;
        assert!((mean - expected).abs() < 4.0 * (spread / n).sqrt(), "{seconds}: {mean}");
        assert!((variance / spread - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "{seconds}: {variance}");
        let shown = short.develop(&picture);
        assert!(shown.values.iter().flatten().all(|v| v.is_finite()));
    }
}

/// Case 18: an exposure without time is black with read noise, and shows no light.
#[test]
fn an_exposure_without_time_shows_no_light() {
    let picture = even(2000.0);
    let image = SENSOR.expose(&picture, &Exposure { luminance: 1.0, seconds: 0.0, seed: 1 });
    let shown = image.develop(&picture);
    assert!(shown.values.iter().flatten().all(|v| *v == 0.0), "{:?}", shown.values[0]);
}

/// Light, ghosts and noise of a picture through coatings, on so many threads.
fn film(threads: usize) -> (Picture, Picture, Vec<[u16; 3]>) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let (model, bands) = picture_model(&bundled(LENS), 0, Coloring::Rgb(3)).unwrap();
        let frame = ImageFrame::new(&model, [40, 24], 30.0).unwrap();
        let scene = BuiltInScene::Lights.build(&model, &frame, None).unwrap();
        let coating = Coating::parse("1.38:99.6").unwrap();
        let renderer = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
        let taken = LightLosses { coating, glasses: None };
        let renderer = renderer.with_losses(&model, &bands, taken, 1e-6).unwrap();
        let settings = ExactSettings { tolerance: 0.2, max_samples: 64, ..samples(64) };
        let mut picture = renderer.render(&settings, &|_| ControlFlow::Continue(()));
        let quick = QuickRenderer::new(&model, &bands, &renderer).unwrap().render();
        let light = (&model, &bands[..]);
        GhostLight::new(light, &scene, &picture, (coating, 1e-9)).unwrap().add_to(&mut picture);
        let exposure = Exposure { luminance: 100.0, seconds: 0.01, seed: 5 };
        let numbers = SENSOR.expose(&picture, &exposure).numbers;
        (picture, quick, numbers)
    })
}

/// Cases 17 and 20: light through films, both ways, ghosts and noise have the same bits on 1, 2 and 8 threads.
#[test]
fn a_film_has_the_same_bits_on_any_number_of_threads() {
    let one = film(1);
    assert!(one.2.iter().flatten().any(|n| f64::from(*n) > SENSOR.black_level + 20.0));
    for threads in [2, 8] {
        assert!(one == film(threads), "{threads}");
    }
}

/// Case 20: a picture that is ended early again and again, and resumed, has the bits of one that never was.
#[test]
fn a_picture_that_is_resumed_has_the_same_bits() {
    let (model, bands) = picture_model(&bundled(LENS), 0, Coloring::Gray).unwrap();
    // More tiles than belong to a group.
    let frame = ImageFrame::new(&model, [720, 400], field_diagonal(&model).unwrap()).unwrap();
    let scene = BuiltInScene::Edge.build(&model, &frame, None).unwrap();
    let renderer = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
    let settings = samples(16);
    let whole = renderer.render(&settings, &|_| ControlFlow::Continue(()));
    let mut run = renderer.begin();
    let mut ended = 0;
    let resumed = loop {
        let asked = AtomicUsize::new(0);
        let found = renderer.resume(&mut run, &settings, &|done| {
            // The first time within the first group, then within the second one, then never.
            let is_late = done > [0.05, 0.6, 2.0][ended];
            let again = asked.fetch_add(1, Ordering::Relaxed) > 40;
            if is_late && again { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        if found.complete {
            break found;
        }
        assert!(!found.reached && ended < 2, "{ended}");
        ended += 1;
    };
    assert!(ended > 0, "never ended early");
    assert!(whole == resumed);
}

/// A uniform scene of no light is black both ways, with no error.
#[test]
fn no_light_is_black() {
    let (model, bands) = picture_model(&bundled(LENS), 0, Coloring::Gray).unwrap();
    let frame = ImageFrame::new(&model, [6, 4], 20.0).unwrap();
    let scene = Scene::uniform(0.0);
    let renderer = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
    let exact = renderer.render(&samples(16), &|_| ControlFlow::Continue(()));
    let quick = QuickRenderer::new(&model, &bands, &renderer).unwrap().render();
    for picture in [exact, quick] {
        assert!(picture.values.iter().flatten().all(|v| *v == 0.0));
    }
}
