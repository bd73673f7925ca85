//! Estimators against each other on lenses of the library: every number, on and off the axis.

use crate::reference::Worst;
use aplanat::files;
use aplanat::lens::Field;
use aplanat::pupil::{Bench, Cost, Derivative, Estimator, Kind, Region};
use aplanat::trace::Slot;
use std::path::PathBuf;

/// Of the largest of a kind of numbers; what central differences leave of fifteen digits.
const TOLERANCE: f64 = 1e-7;
const ORDER: usize = 8;

/// Lens, zoom position and fields, in parts of the farthest one: spheres, conics and aspheres, and
/// a zoom lens where it is vignetted.
const CASES: [(&str, usize, [f64; 2]); 4] = [
    ("double_gauss_nikkor_s_50", 0, [0.0, 0.7]),
    ("phone_us7558005_1", 0, [0.0, 0.6]),
    ("zoom_nikkor_28_80", 1, [0.0, 1.0]),
    ("zoom_tamron_28_75_f28", 0, [0.0, 0.9]),
];

fn bench(name: &str, zoom: usize) -> Bench {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("lenses/{name}.json"));
    Bench::of(&files::open(&path).unwrap().lens, zoom).unwrap()
}

#[test]
fn aperture_gradients_of_all_numbers_are_those_of_differences_with_the_edge_found_anew() {
    let mut worst = Worst::default();
    for (name, zoom, fields) in CASES {
        let bench = bench(name, zoom);
        for part in fields {
            let field = Field { x: 0.0, y: part * bench.beam.edge, weight: 1.0 };
            let region = Region::new(bench.launch(field, bench.primary).unwrap());
            let lit = region.lit(ORDER);
            println!("{name} {zoom} {part} {:?} {:?}", lit.moments, kind(&region));
            for (term, cost) in [
                ("spot", Cost::spread(lit.moments.centroid)),
                ("throughput", Cost::throughput()),
            ] {
                let start = std::time::Instant::now();
                let differences = region.difference_derivative(&cost, ORDER).unwrap();
                println!("   {:?}", start.elapsed());
                let found = lit.boundary_derivative(&cost).unwrap();
                for slot in Slot::all() {
                    let exact: Vec<f64> = differences.by.group(slot).collect();
                    let errors: Vec<f64> = differences.error.group(slot).collect();
                    let largest = exact.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
                    for (i, (got, exact)) in found.group(slot).zip(exact).enumerate() {
                        let place = format!("{slot:?} {i} of {term} of {name}, zoom {zoom}, field {part}: {got:e}, {exact:e} +- {:e} of {largest:e}", errors[i]);
                        if (got - exact).abs() > TOLERANCE * largest { println!("  {place}"); }
                        worst.note(got, exact, TOLERANCE * largest, place);
                    }
                }
            }
        }
    }
    worst.check("aperture gradients by boundary against differences", 1.0);
}

fn kind(region: &Region<'_>) -> String {
    match &region.kind {
        Kind::Split(b) => format!("{:?}", b.arcs.iter().map(|a| a.limit).collect::<Vec<_>>()),
        k => format!("{k:?}"),
    }
}
