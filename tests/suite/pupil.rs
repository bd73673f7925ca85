//! Rays from pupil coordinates against the hexapolar sums of `lenses.json`.

use crate::reference::{Reference, Worst, count, lenses, number};
use aplanat::pupil::{Bench, Pattern, pattern};
use aplanat::trace::{Points, Rays, Sink};

/// Relative to the largest coordinate that a sum is made of.
const TOLERANCE: f64 = 1e-11;

/// Where the rays of the usual pattern land.
fn hexapolar(bench: &Bench, field: usize, wavelength: usize) -> Vec<[f64; 2]> {
    let launch = bench.launch(bench.fields[field], wavelength).unwrap();
    let rays: Rays<f64> =
        pattern(Pattern::Hexapolar(6)).iter().map(|p| launch.ray(*p).unwrap()).collect();
    let mut landed = Points::default();
    launch.color().tracer.batch(&rays, &mut landed);
    assert_eq!(landed.fates().imaged, 127);
    landed.x.into_iter().zip(landed.y).map(|(x, y)| [x, y]).collect()
}

/// Centroid and RMS distance from it.
fn spot(points: &[[f64; 2]]) -> [f64; 3] {
    let n = points.len() as f64;
    let first = points[0];
    let mean = |i: usize| first[i] + points.iter().map(|p| p[i] - first[i]).sum::<f64>() / n;
    let (x, y) = (mean(0), mean(1));
    let square: f64 = points.iter().map(|p| (p[0] - x).powi(2) + (p[1] - y).powi(2)).sum();
    [x, y, (square / n).sqrt()]
}

fn compare(worst: &mut Worst, got: [f64; 3], exact: &serde_json::Value, lens: &Reference) {
    let size = number(&exact["cy"]).abs().max(number(&exact["rms"]));
    for (got, name) in got.into_iter().zip(["cx", "cy", "rms"]) {
        let scale = if name == "rms" { number(&exact["rms"]) } else { size };
        worst.note(got, number(&exact[name]), scale, format!("{} of {}", name, lens.id()));
    }
}

#[test]
fn reference_spots() {
    for lens in lenses() {
        let (bench, mut worst) = (lens.open_bench(), Worst::default());
        for exact in lens.data["spots"].as_array().unwrap() {
            let field = count(&exact["f"]);
            let mut all = Vec::new();
            for color in exact["per_wavelength"].as_array().unwrap() {
                let points = hexapolar(&bench, field, count(&color["w"]));
                compare(&mut worst, spot(&points), color, &lens);
                all.extend(points);
            }
            compare(&mut worst, spot(&all), &exact["poly"], &lens);
        }
        worst.check(&format!("spots {}", lens.id()), TOLERANCE);
    }
}
