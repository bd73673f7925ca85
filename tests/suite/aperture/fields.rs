//! The other numbers of the file: mean square spots, the motion of centroids, derivatives with the
//! edge held fixed, and which constraint makes which arc of the edge.

use super::{Case, GROUPS, cases, exact, group};
use crate::reference::{Worst, number, numbers};
use aplanat::pupil::{
    Boundary, PolarFrame, PupilLimit, QuadraticIntegrand, Region, RegionKind, TracedPupil,
};
use aplanat::trace::{RayLimit, SystemGradient, TraceSink as _};
use serde_json::Value;

/// The highest order of quadrature.
const ORDER: usize = 10;

/// Compares the groups of a derivative, relative to the largest of each.
fn compare(found: &SystemGradient<f64>, expected: &Value, what: &str, worst: &mut Worst) {
    for name in GROUPS {
        let expected = exact(expected, name);
        let largest = expected.iter().flatten().fold(0.0, |m: f64, v| m.max(v.abs()));
        for (i, (got, exact)) in group(found, name).iter().zip(expected).enumerate() {
            let Some(exact) = exact else { continue };
            // A group that is all zero is compared with the curvatures' own unit.
            let scale = if largest > 0.0 { largest } else { 1.0 };
            worst.note(*got, exact, scale, format!("{name} {i} of {what}: {got:e}, {exact:e}"));
        }
    }
}

/// The derivative of the centroid: `∫ y dw` is half the difference of two spreads about points half a
/// unit above and below, and `d(ȳ) = (d∫ y dw − ȳ dA)/A`.
fn centroid_derivative(pupil: &TracedPupil<'_>, case: &Case) -> SystemGradient<f64> {
    let of = |cost| pupil.boundary_derivative(&cost).unwrap();
    let mut total = of(QuadraticIntegrand::spread([0.0, -0.5]));
    total.add(&of(QuadraticIntegrand::spread([0.0, 0.5])), -1.0);
    let area = case.number("area");
    let mut moved = SystemGradient::zero(total.surfaces.len());
    moved.add(&total, 0.5 / area);
    moved.add(&of(QuadraticIntegrand::throughput()), case.number("centroid_y") / area);
    moved
}

#[test]
fn aperture_gradients_of_centroids_and_of_fixed_edges() {
    let (mut centroids, mut fixed) = (Worst::default(), Worst::default());
    for case in cases() {
        let (model, name) = (case.model(), case.name());
        let region = Region::new(case.launch(&model));
        let pupil = region.trace_pupil(ORDER);
        let light = pupil.moments;
        let (spot, square) = (case.number("mean_square_spot"), light.rms_radius().powi(2));
        fixed.note(square, spot, spot, format!("mean square spot of {name}"));
        fixed.note(
            -light.area,
            case.number("L_throughput"),
            light.area,
            format!("light of {name}"),
        );
        let bias = pupil.biased_derivative(&case.spot().0);
        compare(&bias, &case.data["d_L_spot_interior_term_only"], &name, &mut fixed);
        let moved = centroid_derivative(&pupil, &case);
        if case.number("field_deg") == 0.0 {
            continue; // It stays on the axis; the file says 0 and differences say rounding.
        }
        compare(&moved, &case.data["d_centroid_y"], &name, &mut centroids);
    }
    assert_eq!((fixed.check("fixed edges", 1e-7), centroids.check("centroids", 1e-7)), (150, 84));
}

/// The polar angle of a point about the origin of the file, from −90° below it to 90° above it.
fn angle(case: &Case, point: [f64; 2]) -> f64 {
    let origin = numbers(&case.data["polar_origin"]);
    (point[1] - origin[1]).atan2((point[0] - origin[0]).abs()).to_degrees()
}

/// The constraint of the file that makes a point of the edge.
fn constraint(case: &Case, point: [f64; 2]) -> (&str, usize) {
    let at = angle(case, point);
    let arcs = case.data["boundary_arcs"].as_array().unwrap();
    let arc = arcs.iter().find(|arc| at <= number(&arc["phi_to_deg"])).unwrap();
    (arc["constraint"].as_str().unwrap(), arc["surface"].as_u64().unwrap() as usize)
}

fn same(limit: PupilLimit, (kind, surface): (&str, usize)) -> bool {
    let PupilLimit::Surface(found, ray_limit) = limit else { return false };
    let kinds: &[RayLimit] = match kind {
        "semi" => &[RayLimit::Rim],
        "cos" => &[RayLimit::TotalReflection, RayLimit::Miss],
        other => panic!("constraint {other}"),
    };
    found + 1 == surface && kinds.contains(&ray_limit)
}

#[test]
fn aperture_edges_are_made_by_the_constraints_of_the_file() {
    let (mut compared, mut corners) = (0, 0);
    for case in cases() {
        let (model, name) = (case.model(), case.name());
        let region = Region::new(case.launch(&model));
        let RegionKind::StarShaped(boundary) = &region.kind else { panic!("{name}") };
        let frame: PolarFrame = boundary.frame;
        let (mut wide, mut low, mut high): (f64, f64, f64) = (0.0, 0.0, 0.0);
        for arc in &boundary.arcs {
            for i in 1..20 {
                let azimuth = arc.from + (arc.to - arc.from) * f64::from(i) / 20.0;
                let radius = edge(&region, &frame, azimuth);
                let point = region.launch.crossing(frame.point(azimuth, radius)).unwrap();
                let expected = constraint(&case, point);
                assert!(same(arc.limit, expected), "{name}: {:?}, {expected:?}", arc.limit);
                compared += 1;
                (wide, low, high) =
                    (wide.max(point[0].abs()), low.min(point[1]), high.max(point[1]));
            }
        }
        let half = case.number("pupil_half_extent_mm");
        // The file rounds it.
        assert!((wide.max(0.5 * (high - low)) / half - 1.0).abs() < 0.02, "{name}: {wide} {half}");
        corners += compare_corners(&case, &region, boundary);
    }
    assert_eq!((compared, corners), (209, 4));
}

/// Compares the angles at which the constraint changes, and says how many there are.
fn compare_corners(case: &Case, region: &Region<'_>, boundary: &Boundary) -> usize {
    let ends = boundary.arcs[..boundary.arcs.len() - 1].iter().map(|arc| arc.to);
    let mut found: Vec<f64> = ends
        .map(|azimuth| {
            let point = boundary.frame.point(azimuth, edge(region, &boundary.frame, azimuth));
            angle(case, region.launch.crossing(point).unwrap())
        })
        .collect();
    found.sort_by(f64::total_cmp);
    let arcs = case.data["boundary_arcs"].as_array().unwrap();
    let exact = arcs[..arcs.len() - 1].iter().map(|arc| number(&arc["phi_to_deg"]));
    assert_eq!(found.len(), exact.len(), "{}", case.name());
    for (found, exact) in found.iter().zip(exact) {
        assert!((found - exact).abs() < 1e-6, "{}: {found} instead of {exact}", case.name());
    }
    found.len()
}

/// The radius of the edge at an azimuth, by bisection of what gets through.
fn edge(region: &Region<'_>, frame: &PolarFrame, azimuth: f64) -> f64 {
    let lit = |radius: f64| {
        let (launched, landed) = region.launch.trace_points(&[frame.point(azimuth, radius)]);
        !launched.is_empty() && landed.fate(0).is_imaged()
    };
    let (mut low, mut high) = (0.0, 4.0);
    assert!(lit(low) && !lit(high));
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        *(if lit(middle) { &mut low } else { &mut high }) = middle;
    }
    low
}
