//! The warp field against the exact derivatives.

use super::{Case, GROUPS, cases, exact, group};
use aplanat::pupil::{Cost, Derivative, Region, Warp};
use serde_json::Value;

/// Estimate, standard error and exact value of every number of a group.
fn compare(found: &Derivative, expected: &Value, name: &str) -> Vec<[f64; 3]> {
    let (by, error) = (group(&found.by, name), group(&found.error, name));
    let each = by.into_iter().zip(error).zip(exact(expected, name));
    each.filter_map(|((by, error), exact)| Some([by, error, exact?])).collect()
}

fn objectives(case: &Case) -> [(&'static str, (Cost, &Value)); 2] {
    [("spot", case.spot()), ("throughput", case.throughput())]
}

#[test]
fn aperture_gradients_by_the_warp_field_are_right() {
    for case in cases() {
        let bench = case.bench();
        let region = Region::new(case.launch(&bench));
        for (what, (cost, expected)) in objectives(&case) {
            let start = std::time::Instant::now();
            let found = region.warp_derivative(&cost, Warp { count: 16384, seed: 1 }).unwrap();
            let ms = start.elapsed().as_secs_f64() * 1e3;
            for name in GROUPS {
                let rows = compare(&found, expected, name);
                let norm = |f: &dyn Fn(&[f64; 3]) -> f64| rows.iter().map(|r| f(r).powi(2)).sum::<f64>().sqrt();
                let off = norm(&|r| r[0] - r[2]) / norm(&|r| r[2]);
                let z = rows.iter().filter(|r| r[1] > 0.0).map(|r| ((r[0] - r[2]) / r[1]).abs()).fold(0.0, f64::max);
                println!("{} {what} {}: {off:.1e} max z {z:.1} rays {} {ms:.1} ms", case.name(), name, found.rays);
                if std::env::var_os("VERBOSE").is_some() { println!("{rows:?}"); }
            }
        }
    }
}
