//! The boundary estimator.

use super::{Case, GROUPS, cases, exact, group, image};
use crate::reference::Worst;
use aplanat::lens::{Aperture, FieldKind, FieldPoint, Object, Shape, Surface, System};
use aplanat::paraxial::Beam;
use aplanat::pupil::{Aiming, QuadraticIntegrand, RayModel, Region, RegionKind};
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
    assert_eq!(worst.check("aperture gradients by boundary", 1.0), 281);
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

/// A sphere with a rim at a distance from the pupil.
fn distant_sphere(distance: f64, curvature: f64) -> RayModel {
    let pupil = Surface { thickness: distance, ..image() };
    let shape = Shape::Sphere { curvature };
    let sphere = Surface { shape, semi_diameter: 4.0, thickness: 1.0, ..image() };
    let surfaces = vec![pupil, sphere, image()];
    let beam = Beam {
        object: Object::Infinity,
        aperture: Aperture::EntrancePupilDiameter(10.0),
        field: FieldKind::Angle,
        edge: 0.0,
    };
    let system = System { index_before: 1.0, surfaces, stop: Some(0) };
    RayModel::from_systems(vec![(0.55, 1.0, system)], 0, beam, Aiming::Paraxial).unwrap()
}

#[test]
fn a_pupil_whose_margins_are_no_numbers_is_dark() {
    let axis = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
    let near = distant_sphere(10.0, 0.01);
    let before = Region::new(near.launch(axis, 0).unwrap()).kind;
    assert!(matches!(before, RegionKind::StarShaped(_)), "{before:?}");
    // Both terms of the discriminant overflow: every ray misses a sphere of 1e-100 mm.
    let far = distant_sphere(1e100, 1e100);
    for kind in [&before, &RegionKind::Clear] {
        assert!(Region::track(kind, far.launch(axis, 0).unwrap()).is_dark());
    }
}
