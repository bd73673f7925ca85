//! Sensor noise against exact sums of its law (`images.json`), photons, and one exposed picture.

use crate::reference::{count, number, read};
use aplanat::picture::{Exposure, ImageFrame, Picture, SensorModel, photon_count};
use aplanat::trace::Fates;
use serde_json::Value;

fn sensor(data: &Value) -> SensorModel {
    SensorModel {
        quantum_efficiency: number(&data["quantum_efficiency"]),
        full_well: number(&data["full_well_e"]),
        dark_current: number(&data["dark_e"]),
        read_noise: number(&data["read_noise_e"]),
        gain: number(&data["gain_dn_per_e"]),
        black_level: number(&data["black_level_dn"]),
        bits: count(&data["bits"]) as u32,
    }
}

/// A grey picture whose pixels all have this many photons in a second at luminance 1.
fn flat(photons: f64, pixels: [usize; 2]) -> Picture {
    let frame = ImageFrame { pixels, pitch: 0.005, center: [0.0; 2], inverted: true };
    let level = photons / photon_count(1.0, frame.pitch, 1.0);
    let all = pixels[0] * pixels[1];
    Picture {
        frame,
        values: vec![[level; 3]; all],
        errors: vec![[0.0; 3]; all],
        white: 1.0,
        rays: 0,
        fates: Fates::default(),
        reached: true,
        complete: true,
        overshoot: 0.0,
    }
}

#[test]
fn levels_have_the_exact_mean_and_variance() {
    let mut compared = 0;
    for data in read("images.json")["noise"].as_array().unwrap() {
        let sensor = sensor(data);
        for level in data["levels"].as_array().unwrap() {
            let exposure = Exposure { luminance: 1.0, seconds: 1.0, seed: 7 };
            let image = sensor.expose(&flat(number(&level["photons"]), [120, 100]), &exposure);
            let numbers: Vec<f64> = image.numbers.iter().flatten().map(|n| f64::from(*n)).collect();
            let n = numbers.len() as f64;
            let mean = numbers.iter().sum::<f64>() / n;
            let variance = numbers.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
            let exact = number(&level["variance"]);
            let place = format!("{level}: {mean} {variance}");
            assert!((mean - number(&level["mean"])).abs() < 4.0 * (exact / n).sqrt(), "{place}");
            assert!((variance / exact - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "{place}");
            let photons = number(&level["photons"]);
            let snr = sensor.signal_to_noise(photons, sensor.dark_current);
            assert!((snr - number(&level["ideal_snr"])).abs() < 1e-12 * (1.0 + snr), "{place}");
            compared += 1;
        }
    }
    assert_eq!(compared, 12);
}

#[test]
fn photons_of_an_illuminance() {
    for data in read("images.json")["photons"].as_array().unwrap() {
        let pitch = 1e-3 * number(&data["pixel_um"]);
        let found = photon_count(number(&data["illuminance_lux"]), pitch, number(&data["seconds"]));
        let exact = number(&data["photons"]);
        assert!((found / exact - 1.0).abs() < 1e-12, "{data}: {found}");
    }
}

#[test]
fn noise_is_repeatable_and_differs_between_pixels_and_seeds() {
    let sensor = sensor(&read("images.json")["noise"][0]);
    let picture = flat(1000.0, [8, 8]);
    let at = |seed| sensor.expose(&picture, &Exposure { luminance: 1.0, seconds: 1.0, seed });
    let (first, other) = (at(1), at(2));
    assert_eq!(first, at(1));
    assert!(first != other && first.numbers.iter().flatten().any(|n| *n != first.numbers[0][0]));
    // The mean of what is shown is the light.
    let shown = first.develop(&picture);
    assert!((shown.mean() / picture.mean() - 1.0).abs() < 0.02);
}
