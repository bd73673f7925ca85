//! Estimators against each other: every number of lenses of the library, on and off the axis; the
//! errors they state; and which of them a pupil calls for.

use super::{GROUPS, cases, exact as exact_group, group};
use crate::reference::Worst;
use aplanat::files;
use aplanat::lens::FieldPoint;
use aplanat::pupil::{
    Accuracy, DerivativeEstimator, Launch, QuadraticIntegrand, RayModel, Region, choose_estimator,
    differentiate,
};
use aplanat::trace::{SurfaceParameter, SystemGradient};
use std::path::PathBuf;

/// Of the largest of a kind of numbers; what central differences leave of fifteen digits.
const TOLERANCE: f64 = 1e-7;
/// A kind of numbers whose largest derivative is below this is rounding of differences, which leaves
/// ten digits of the integral: the stop of the phone lens is its first surface, and moving a rim
/// along a beam does not change the area that it cuts out.
const FLOOR: f64 = 1e-3;
const ORDER: usize = 8;

/// Lens, zoom position and fields, in parts of the farthest one: spheres, conics and aspheres, and
/// a zoom lens where it is vignetted.
const CASES: [(&str, usize, [f64; 2]); 4] = [
    ("double_gauss_nikkor_s_50", 0, [0.0, 0.7]),
    ("double_gauss_rudolph_50", 0, [0.5, 1.0]),
    ("phone_us7558005_1", 0, [0.0, 0.6]),
    ("zoom_nikkor_28_80", 1, [0.0, 1.0]),
];

fn model(name: &str, zoom: usize) -> RayModel {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("lenses/{name}.json"));
    RayModel::from_lens(&files::open(&path).unwrap().lens, zoom).unwrap()
}

fn launch(model: &RayModel, part: f64) -> Launch<'_> {
    let field = FieldPoint { x: 0.0, y: part * model.beam.edge, weight: 1.0 };
    model.launch(field, model.primary).unwrap()
}

/// Notes the differences between two derivatives, each against the largest of its kind and a
/// `floor` below which all of a kind is rounding.
pub(super) fn compare(
    worst: &mut Worst,
    (tolerance, floor): (f64, f64),
    [got, exact]: [&SystemGradient<f64>; 2],
    what: &str,
) {
    for slot in SurfaceParameter::all() {
        let scale = tolerance * exact.largest(slot).max(floor);
        for (i, (got, exact)) in got.of_kind(slot).zip(exact.of_kind(slot)).enumerate() {
            let place = format!("{slot:?} {i} of {what}: {got:e}, {exact:e}");
            worst.note(got, exact, scale, place);
        }
    }
}

#[test]
fn aperture_gradients_agree_with_differences_of_recomputed_pupils() {
    let mut worst = Worst::default();
    for (name, zoom, fields) in CASES {
        let model = model(name, zoom);
        for part in fields {
            let region = Region::new(launch(&model, part));
            let lit = region.trace_pupil(ORDER);
            for (term, cost) in [
                ("spot", QuadraticIntegrand::spread(lit.moments.centroid)),
                ("throughput", QuadraticIntegrand::throughput()),
            ] {
                let differences = region.difference_derivative(&cost, ORDER).unwrap();
                let found = lit.boundary_derivative(&cost).unwrap();
                let what = format!("{term} of {name}, zoom {zoom}, field {part}");
                compare(&mut worst, (TOLERANCE, FLOOR), [&found, &differences.gradient], &what);
            }
        }
    }
    worst.check("aperture gradients by boundary against differences", 1.0);
}

/// Errors that are larger than stated, in parts of what is stated: of values with their errors, against
/// exact ones where there are some.
fn beyond([found, errors]: &[Vec<f64>; 2], exact: &[Option<f64>]) -> f64 {
    let largest = exact.iter().flatten().fold(1.0, |largest: f64, by| largest.max(by.abs()));
    let floor = 1e-12 * largest;
    let known =
        found.iter().zip(errors).zip(exact).filter_map(|(found, exact)| Some((found, (*exact)?)));
    known.map(|((got, error), exact)| (got - exact).abs() / (error + floor)).fold(0.0, f64::max)
}

/// Against exact derivatives by curvatures, thicknesses and semi-diameters; an order of the quadrature
/// would not do, since a critical angle multiplies its rounding.
#[test]
fn aperture_gradients_meet_the_requested_and_stated_accuracy() {
    for case in cases() {
        let model = case.model();
        let region = Region::new(case.launch(&model));
        let lit = region.trace_pupil(10);
        for (cost, exact) in [case.spot(), case.throughput()] {
            let high_order = lit.boundary_derivative(&cost).unwrap();
            for (estimator, tolerance, standard_errors) in [
                (DerivativeEstimator::Boundary, 1e-3, 1.0),
                (DerivativeEstimator::Boundary, 1e-7, 1.0),
                (DerivativeEstimator::Difference, 1e-4, 1.0),
                (DerivativeEstimator::Warp, 0.2, 6.0),
            ] {
                let asked = Accuracy { tolerance, max_rays: 4_000_000 };
                let found = differentiate(&region, &cost, estimator, asked).unwrap();
                let what = format!("{estimator} to {tolerance:e} of {cost:?}, {}", case.name());
                // Numbers without an effect keep some noise.
                let reached = found.reaches(tolerance) || estimator == DerivativeEstimator::Warp;
                assert!(reached, "{what}: {} rays", found.rays);
                for name in GROUPS {
                    let exact = exact_group(exact, name);
                    let found = [&found.gradient, &found.error].map(|by| group(by, name));
                    let beyond = beyond(&found, &exact);
                    assert!(beyond <= standard_errors, "{what}, {name}: {beyond}");
                }
                for slot in SurfaceParameter::all().filter(|slot| !is_in_groups(*slot)) {
                    let exact: Vec<_> = high_order.of_kind(slot).map(Some).collect();
                    let found =
                        [&found.gradient, &found.error].map(|by| by.of_kind(slot).collect());
                    let beyond = beyond(&found, &exact);
                    assert!(beyond <= standard_errors, "{what}, {slot:?}: {beyond}");
                }
            }
        }
    }
}

/// True for a kind of number whose exact derivatives are known.
fn is_in_groups(slot: SurfaceParameter) -> bool {
    matches!(
        slot,
        SurfaceParameter::Curvature | SurfaceParameter::Thickness | SurfaceParameter::SemiDiameter
    )
}

#[test]
fn aperture_gradients_report_an_exhausted_ray_budget() {
    let case = &cases()[2];
    let model = case.model();
    let region = Region::new(case.launch(&model));
    let (cost, _) = case.spot();
    for (estimator, most_rays) in [
        (DerivativeEstimator::Biased, 10_000),
        (DerivativeEstimator::Boundary, 10_000),
        (DerivativeEstimator::Warp, 10_000),
        (DerivativeEstimator::Difference, 1_000_000),
    ] {
        let asked = Accuracy { tolerance: 1e-16, max_rays: most_rays };
        let found = differentiate(&region, &cost, estimator, asked).unwrap();
        assert!(found.rays <= most_rays, "{estimator}: {}", found.rays);
        assert!(found.reaches(1.0) && !found.reaches(1e-16), "{estimator}");
    }
}

#[test]
fn a_connected_pupil_selects_the_boundary_estimator() {
    for case in cases() {
        let model = case.model();
        let region = Region::new(case.launch(&model));
        let (estimator, reason) = choose_estimator(&region, Accuracy::default()).unwrap();
        assert_eq!(estimator, DerivativeEstimator::Boundary, "{reason}");
        assert!(reason.contains("one piece"), "{reason}");
    }
}

/// A limit that ends the pupil over so few azimuths that the rays along the edge miss it has an arc of its
/// own: without it low orders agree with each other, and not with high ones.
#[test]
fn an_arc_between_the_rays_of_the_edge_is_found() {
    for (name, part) in [("more/zoom_canon_ef_21_34_f28", 1.0), ("more/telescope_jwst_f166", 0.9)] {
        let model = model(name, 0);
        let region = Region::new(launch(&model, part));
        let [low, high] = [7, 13].map(|order| {
            let lit = region.trace_pupil(order);
            lit.boundary_derivative(&QuadraticIntegrand::throughput()).unwrap()
        });
        for slot in SurfaceParameter::all() {
            let pairs = low.of_kind(slot).zip(high.of_kind(slot));
            let off = pairs.map(|(low, high)| (low - high).abs()).fold(0.0, f64::max);
            let largest = high.largest(slot).max(FLOOR);
            assert!(off <= 1e-7 * largest, "{slot:?} of {name}: {off:e} of {largest:e}");
        }
    }
}
