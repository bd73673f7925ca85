//! Rays from pupil coordinates against the hexapolar sums of `lenses.json`.

use crate::reference::{Reference, Worst, count, lenses, number};
use aplanat::pupil::{Bench, Pattern, Region, pattern};
use aplanat::trace::{Points, Rays, Sink};

/// Relative to the RMS radius, or to the height of a centroid.
const TOLERANCE: f64 = 1e-11;
/// What a ray's rounding may add, in units of 2⁻⁵³ of the largest coordinate on its way: a spot of
/// 0.2 µm behind a pupil of 2.4 m has no eleven digits in double precision.
const ROUNDING: f64 = 16.0;

/// Centroid and RMS distance from it.
fn spot(points: &[[f64; 2]]) -> [f64; 3] {
    let n = points.len() as f64;
    let first = points[0];
    let mean = |i: usize| first[i] + points.iter().map(|p| p[i] - first[i]).sum::<f64>() / n;
    let (x, y) = (mean(0), mean(1));
    let square: f64 = points.iter().map(|p| (p[0] - x).powi(2) + (p[1] - y).powi(2)).sum();
    [x, y, (square / n).sqrt()]
}

fn compare(worst: &mut Worst, got: [f64; 3], exact: &serde_json::Value, rounding: f64) {
    let size = number(&exact["cy"]).abs().max(number(&exact["rms"]));
    for (got, name) in got.into_iter().zip(["cx", "cy", "rms"]) {
        let scale = if name == "rms" { number(&exact["rms"]) } else { size };
        worst.note(got, number(&exact[name]), TOLERANCE * scale + rounding, name);
    }
}

/// The largest coordinate on the way of a beam.
fn size(bench: &Bench) -> f64 {
    let rows = &bench.colors[bench.primary].system.surfaces;
    let heights = bench.first.marginal.heights.iter();
    rows.iter().map(|row| &row.thickness).chain(heights).fold(0.0, |m: f64, v| m.max(v.abs()))
}

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

#[test]
fn reference_spots() {
    for lens in lenses() {
        let (bench, mut worst) = (lens.open_bench(), Worst::default());
        let rounding = ROUNDING * size(&bench) * f64::EPSILON * 0.5;
        for exact in lens.data["spots"].as_array().unwrap() {
            let field = count(&exact["f"]);
            let mut all = Vec::new();
            for color in exact["per_wavelength"].as_array().unwrap() {
                let points = hexapolar(&bench, field, count(&color["w"]));
                compare(&mut worst, spot(&points), color, rounding);
                all.extend(points);
            }
            compare(&mut worst, spot(&all), &exact["poly"], rounding);
        }
        worst.check(&format!("spots {}", lens.id()), 1.0);
    }
}

/// RMS radius at every order of a region's quadrature, with the rays that each order traces: those
/// that land, and all of them.
fn orders(region: &Region<'_>) -> Vec<(usize, usize, f64)> {
    let at = |order: usize| {
        let nodes = region.nodes(order);
        let landed = region.trace::<Points<f64>>(&nodes);
        let area: f64 = landed.arrived().map(|(_, w)| w).sum();
        let points = &landed.sink;
        let y = landed.arrived().map(|(i, w)| w * points.y[i]).sum::<f64>() / area;
        let square = |i: usize| points.x[i].powi(2) + (points.y[i] - y).powi(2);
        let rms = (landed.arrived().map(|(i, w)| w * square(i)).sum::<f64>() / area).sqrt();
        (nodes.points.len(), nodes.points.len() + nodes.rays, rms)
    };
    (0..region.orders()).map(at).collect()
}

fn double_gauss() -> Reference {
    lenses().into_iter().find(|lens| lens.id() == "double_gauss").unwrap()
}

/// Prints the errors of all orders against the highest and returns them.
fn errors(bench: &Bench, field: usize) -> Vec<(usize, f64)> {
    let region = Region::new(bench.launch(bench.fields[field], bench.primary).unwrap());
    let orders = orders(&region);
    let best = orders.last().unwrap().2;
    println!("field {}, {} rays to find the pupil", bench.fields[field].y, region.rays);
    for (rays, all, rms) in &orders {
        println!("  {rays} rays ({all} with the edge): {:.1e}", (rms / best - 1.0).abs());
    }
    orders.iter().map(|(rays, _, rms)| (*rays, (rms / best - 1.0).abs())).collect()
}

#[test]
fn a_clear_pupil_takes_25_rays_for_nine_digits() {
    let errors = errors(&double_gauss().open_bench(), 2);
    let (_, error) = errors.iter().find(|(rays, _)| *rays == 25).unwrap();
    assert!(*error < 1e-9, "{error:e}");
}

#[test]
fn a_clipped_pupil_takes_240_rays_for_six_digits() {
    let bench = double_gauss().clipped_bench();
    for field in [1, 2] {
        let errors = errors(&bench, field);
        assert!(errors.iter().any(|(rays, error)| *rays <= 240 && *error < 1e-6));
    }
}
