//! The boundary estimator.

use super::{Case, GROUPS, cases, exact, group};
use crate::reference::Worst;
use aplanat::pupil::{QuadraticIntegrand, Region};
use serde_json::Value;

/// Of the largest component of a group.
const TOLERANCE: f64 = 1e-8;
/// The highest order of quadrature.
const ORDER: usize = 10;

#[test]
fn aperture_gradients_by_boundary_match_every_case() {
    let mut worst = Worst::default();
    for case in cases() {
        let model = case.model();
        let region = Region::new(case.launch(&model));
        let moments = region.trace_pupil(ORDER).moments;
        let name = case.name();
        for (key, got) in [
            ("area", moments.area),
            ("centroid_y", moments.centroid[1]),
            ("L_spot", moments.spread),
        ] {
            let exact = case.number(key);
            worst.note(got, exact, exact.abs().max(1e-3) * TOLERANCE, format!("{key} of {name}"));
        }
        compare(&case, &region, case.spot(), "spot", &mut worst);
        compare(&case, &region, case.throughput(), "throughput", &mut worst);
    }
    worst.check("aperture gradients by boundary", 1.0);
}

fn compare(
    case: &Case,
    region: &Region<'_>,
    (cost, expected): (QuadraticIntegrand, &Value),
    term: &str,
    worst: &mut Worst,
) {
    let found = region.trace_pupil(ORDER).boundary_derivative(&cost).unwrap();
    for name in GROUPS {
        let expected = exact(expected, name);
        let largest = expected.iter().flatten().fold(0.0, |m: f64, v| m.max(v.abs()));
        if largest == 0.0 {
            continue;
        }
        for (i, (got, exact)) in group(&found, name).iter().zip(expected).enumerate() {
            let Some(exact) = exact else { continue };
            let place = format!("{name} {i} of {term} of {}: {got:e}, {exact:e}", case.name());
            worst.note(*got, exact, TOLERANCE * largest, place);
        }
    }
}
