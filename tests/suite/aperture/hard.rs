//! Pupils at which estimators may fail: tangent rays, total reflection, several pieces, no light, a
//! single ray, extreme scales.

use super::cases;
use super::estimators::compare;
use crate::reference::Worst;
use aplanat::lens::{Aperture, FieldKind, FieldPoint, Object, Shape, Surface, System};
use aplanat::math::Vec3;
use aplanat::paraxial::Beam;
use aplanat::pupil::{
    Accuracy, Aiming, DerivativeError, DerivativeEstimator, Launch, PupilDerivative, PupilLimit,
    QuadraticIntegrand, RayModel, Region, RegionKind, WarpSampling, choose_estimator,
    differentiate,
};
use aplanat::trace::{Ray, RayLimit, SurfaceParameter, SystemGradient, Tracer};
use std::f64::consts::PI;

/// The error of central differences, relatively.
const TOLERANCE: f64 = 1e-7;
const ORDER: usize = 8;
const ASKED: Accuracy = Accuracy { tolerance: 1e-2, max_rays: 400_000 };

/// Curvature, thickness, index behind and semi-diameter.
type Row = (f64, f64, f64, f64);

/// Surfaces in air in front of an image plane, the stop as marked.
fn system(rows: &[Row], stop: usize) -> System<f64> {
    let surface = |(curvature, thickness, index, semi_diameter): Row| Surface {
        shape: Shape::simplest(curvature, 0.0, [0.0; 7]),
        semi_diameter,
        ..Surface::plane(thickness, index)
    };
    let image = (0.0, 0.0, 1.0, f64::INFINITY);
    let surfaces = rows.iter().copied().chain([image]).map(surface).collect();
    System { index_before: 1.0, surfaces, stop: Some(stop) }
}

/// A system limited by its rims, for a beam from infinity.
fn model(system: System<f64>) -> RayModel {
    let rim = system.surfaces[system.stop.unwrap_or(0)].semi_diameter;
    let beam = Beam {
        object: Object::Infinity,
        aperture: Aperture::StopSemiDiameter(rim),
        field: FieldKind::Angle,
        edge: 1.0,
    };
    RayModel::from_systems(vec![(0.5876, 1.0, system)], 0, beam, Aiming::Paraxial).unwrap()
}

fn launch(model: &RayModel, degrees: f64) -> Launch<'_> {
    model.launch(FieldPoint { x: 0.0, y: degrees, weight: 1.0 }, 0).unwrap()
}

fn costs(region: &Region<'_>) -> [QuadraticIntegrand; 2] {
    [
        QuadraticIntegrand::spread(region.trace_pupil(4).moments.centroid),
        QuadraticIntegrand::throughput(),
    ]
}

fn is_finite(derivative: &PupilDerivative) -> bool {
    let PupilDerivative { gradient: by, error, .. } = derivative;
    by.numbers().chain(error.numbers()).all(f64::is_finite)
}

/// All estimators agree: boundary with differences to `tolerance`, the warp field with both within
/// six of its standard errors, and no number is not one.
fn all_agree(what: &str, model: &RayModel, degrees: f64, tolerance: f64) {
    let region = Region::new(launch(model, degrees));
    let mut worst = Worst::default();
    for cost in costs(&region) {
        let what = format!("{what}, {cost:?}");
        let exact = region.trace_pupil(ORDER).boundary_derivative(&cost).unwrap();
        let differences = region.difference_derivative(&cost, ORDER).unwrap();
        assert!(is_finite(&differences), "{what}");
        // Derivatives of this size by a millimetre, with pupils of about ten, are small.
        let floor = 0.1 * cost.integrate(&region.trace_pupil(4).moments).abs();
        compare(&mut worst, (tolerance, floor), [&exact, &differences.gradient], &what);
        by_warp_too(&what, &region, &cost, &exact);
    }
    worst.check(what, 1.0);
}

fn by_warp_too(
    what: &str,
    region: &Region<'_>,
    cost: &QuadraticIntegrand,
    exact: &SystemGradient<f64>,
) {
    let found = region.warp_derivative(cost, WarpSampling { count: 16_384, seed: 3 }).unwrap();
    assert!(is_finite(&found), "{what}");
    for slot in SurfaceParameter::all() {
        let floor = 1e-3 * exact.largest(slot) + 1e-9;
        let pairs =
            found.gradient.of_kind(slot).zip(exact.of_kind(slot)).zip(found.error.of_kind(slot));
        for (i, ((got, exact), error)) in pairs.enumerate() {
            let off = (got - exact).abs();
            assert!(
                off <= 6.0 * error + floor,
                "{what}, {slot:?} {i}: {got:e} +- {error:e}, {exact:e}"
            );
        }
    }
}

/// The largest difference between two derivatives, each against the largest of its kind.
fn off(found: &SystemGradient<f64>, exact: &SystemGradient<f64>) -> f64 {
    let off = found.zip_with(exact, |a, b| (a - b).abs());
    let ratio = |slot| off.largest(slot) / exact.largest(slot);
    SurfaceParameter::all().map(ratio).filter(|ratio| !ratio.is_nan()).fold(0.0, f64::max)
}

#[test]
fn aperture_gradients_converge_where_a_grazing_edge_meets_a_rim() {
    // The double Gauss with rims so wide that rays graze the surface in front of its stop: beside
    // a rim, behind it, and where the two take turns.
    let case = &cases()[2];
    for (factor, degrees, grazes) in [
        (1.5, 24.0, false),
        (1.5, 28.0, false),
        (1.7, 24.0, false),
        (2.0, 22.0, true),
        (2.0, 24.0, true),
        (2.0, 26.0, false),
    ] {
        let mut system = case.system();
        system.surfaces.iter_mut().for_each(|surface| surface.semi_diameter *= factor);
        let model = model(system);
        let region = Region::new(launch(&model, degrees));
        let RegionKind::StarShaped(boundary) = &region.kind else { panic!("{:?}", region.kind) };
        let arcs = boundary.arcs.iter().map(|arc| arc.limit);
        assert_eq!(
            arcs.clone().any(PupilLimit::is_grazing),
            grazes,
            "{:?}",
            arcs.collect::<Vec<_>>()
        );
        for cost in costs(&region) {
            let at = |order| region.trace_pupil(order).boundary_derivative(&cost).unwrap();
            let exact = at(11);
            let differences = region.difference_derivative(&cost, 10).unwrap();
            let errors = [4, 6, 8, 10].map(|order| off(&at(order), &exact));
            let checked = off(&differences.gradient, &exact);
            let shown = errors.map(|error| format!("{error:.1e}")).join(", ");
            let what = format!("rims times {factor} at {degrees}, square {}", cost.square);
            let what = format!("{what}: orders 4, 6, 8, 10 {shown}; differences {checked:.1e}");
            println!("{what}");
            let allowed = [4e-3, 4e-4, 4e-6, 1e-8];
            assert!(errors.iter().zip(allowed).all(|(error, allowed)| *error < allowed), "{what}");
            assert!(checked < 1e-7, "{what}");
        }
    }
}

#[test]
fn aperture_gradients_split_coincident_limits() {
    // Two rims of the same size in a beam along the axis: the pupil shrinks with either, and grows
    // with both together alone.
    let rows = [(0.0, 5.0, 1.0, 4.0), (0.0, 10.0, 1.0, 4.0)];
    let model = model(system(&rows, 0));
    let region = Region::new(launch(&model, 0.0));
    let cost = QuadraticIntegrand::throughput();
    let exact = -std::f64::consts::TAU * 4.0;
    for estimator in
        [DerivativeEstimator::Boundary, DerivativeEstimator::Difference, DerivativeEstimator::Warp]
    {
        let found = differentiate(&region, &cost, estimator, ASKED).unwrap();
        assert!(is_finite(&found), "{estimator}");
        let sum: f64 = found.gradient.of_kind(SurfaceParameter::SemiDiameter).sum();
        let error: f64 = found.error.of_kind(SurfaceParameter::SemiDiameter).sum();
        assert!((sum - exact).abs() < 6.0 * error + 1e-6, "{estimator}: {sum} +- {error}, {exact}");
    }
}

#[test]
fn aperture_gradients_hold_at_a_critical_angle() {
    // A convex side in glass reflects totally what comes in far from the axis.
    let rows = [(0.0, 2.0, 1.5, 9.9), (-0.1, 5.0, 1.0, 9.9)];
    let system = system(&rows, 0);
    for degrees in [0.0, 5.0] {
        let model = model(system.clone());
        let region = Region::new(launch(&model, degrees));
        let RegionKind::StarShaped(boundary) = &region.kind else { panic!("{:?}", region.kind) };
        assert_eq!(boundary.arcs[0].limit, PupilLimit::Surface(1, RayLimit::TotalReflection));
        all_agree("a critical angle", &model, degrees, 1e-6);
    }
}

#[test]
fn aperture_gradients_hold_where_rays_miss_a_sphere() {
    // A rim that is larger than its sphere: the pupil ends where rays touch the sphere, or where
    // they would meet its far half.
    let rows = [(-0.01, 12.0, 1.0, 30.0), (0.08, 4.0, 1.1, 20.0), (0.0, 20.0, 1.0, 40.0)];
    let model = model(system(&rows, 0));
    // On the axis rays touch it at its equator, and from the side the two edges touch each other:
    // where two limits vanish at once, edges and corners are not known to rounding.
    for degrees in [0.0, 3.0, 20.0] {
        let region = Region::new(launch(&model, degrees));
        let lit = region.trace_pupil(4);
        let RegionKind::StarShaped(boundary) = &region.kind else { panic!("{:?}", region.kind) };
        let ends = |hurdle| boundary.arcs.iter().any(|a| a.limit == PupilLimit::Surface(1, hurdle));
        assert!(ends(RayLimit::Miss) && (degrees == 0.0 || ends(RayLimit::Equator)));
        let found = lit.boundary_derivative(&QuadraticIntegrand::throughput()).unwrap();
        assert_eq!(found.surfaces[1].semi_diameter, 0.0);
        all_agree("a missed sphere", &model, degrees, 1e-4);
    }
}

#[test]
fn aperture_gradients_hold_for_planes_and_equal_indices_in_a_collimated_beam() {
    // A window, a surface of equal indices and a lens.
    let rows = [
        (0.0, 2.0, 1.5, 10.0),
        (0.0, 3.0, 1.0, 10.0),
        (0.05, 1.0, 1.0, 6.0),
        (0.02, 3.0, 1.6, 7.0),
        (-0.01, 40.0, 1.0, 7.0),
    ];
    let model = model(system(&rows, 2));
    all_agree("planes and equal indices", &model, 0.0, TOLERANCE);
    all_agree("planes and equal indices", &model, 4.0, TOLERANCE);
}

#[test]
fn aperture_gradients_without_light_are_an_error_with_a_remedy() {
    let rows = [(0.0, 50.0, 1.0, 4.0), (0.02, 5.0, 1.5, 5.0), (0.0, 50.0, 1.0, 5.0)];
    let clipped = model(system(&rows, 0));
    let closed = model(system(&[(0.0, 5.0, 1.0, 0.0)], 0));
    for (model, degrees, says) in
        [(&clipped, 30.0, "clipped by surface 2"), (&closed, 0.0, "open the stop")]
    {
        let region = Region::new(launch(model, degrees));
        let dark = choose_estimator(&region, ASKED).unwrap_err();
        assert!(
            matches!(dark, DerivativeError::Dark(..)) && dark.to_string().contains(says),
            "{dark}"
        );
        for estimator in DerivativeEstimator::ALL {
            assert_eq!(
                differentiate(&region, &QuadraticIntegrand::throughput(), estimator, ASKED),
                Err(dark.clone())
            );
        }
    }
}

/// Area of the rays along the axis that get through, from the heights where light begins and ends.
fn area_of_zones(system: &System<f64>) -> f64 {
    const CELLS: usize = 400;
    let tracer = Tracer::new(system).unwrap();
    let reach = system.surfaces[0].semi_diameter;
    let is_lit = |r: f64| {
        let (point, direction) = (Vec3::new(r, 0.0, 0.0), Vec3::new(0.0, 0.0, 1.0));
        tracer.trace(Ray { point, direction }).fate.is_imaged()
    };
    let mut area = if is_lit(reach) { reach * reach } else { 0.0 };
    for cell in 0..CELLS {
        let [mut a, mut b] = [cell, cell + 1].map(|i| reach * i as f64 / CELLS as f64);
        let lit = is_lit(a);
        if is_lit(b) == lit {
            continue;
        }
        for _ in 0..60 {
            let middle = 0.5 * (a + b);
            if is_lit(middle) == lit { a = middle } else { b = middle }
        }
        area += if lit { a * a } else { -a * a };
    }
    PI * area
}

#[test]
fn aperture_gradients_of_a_pupil_in_pieces_come_from_the_warp_field() {
    // A ball lens focuses its zones far apart; a small rim behind lets a disc and a ring through.
    let rows = [(0.1, 18.0, 1.5, 9.9), (-0.1, 2.0, 1.0, 9.9), (0.0, 5.0, 1.0, 1.0)];
    let system = system(&rows, 2);
    let model = model(system.clone());
    let region = Region::new(launch(&model, 0.0));
    assert!(matches!(region.kind, RegionKind::Irregular { pieces: 2, .. }), "{:?}", region.kind);
    let asked = Accuracy { tolerance: 1e-6, max_rays: 100_000 };
    let (estimator, reason) = choose_estimator(&region, asked).unwrap();
    assert_eq!(estimator, DerivativeEstimator::Warp, "{reason}");
    assert!(reason.contains("2 pieces") && reason.contains("1e-6"), "{reason}");
    let refused = differentiate(
        &region,
        &QuadraticIntegrand::throughput(),
        DerivativeEstimator::Boundary,
        ASKED,
    );
    assert!(matches!(refused, Err(DerivativeError::NotStarShaped(_))), "{refused:?}");
    let found =
        differentiate(&region, &QuadraticIntegrand::throughput(), estimator, ASKED).unwrap();
    for (slot, surface) in [
        (SurfaceParameter::SemiDiameter, 2),
        (SurfaceParameter::Curvature, 0),
        (SurfaceParameter::Curvature, 1),
        (SurfaceParameter::Thickness, 0),
        (SurfaceParameter::Index, 0),
    ] {
        let changed = |step: f64| {
            let mut system = system.clone();
            *slot.value_mut(&mut system, surface) += step;
            area_of_zones(&system)
        };
        let step = 1e-5 * *slot.value_mut(&mut system.clone(), surface);
        let exact = -(changed(step) - changed(-step)) / (2.0 * step);
        let (got, error) =
            (found.gradient.surfaces[surface].by(slot), found.error.surfaces[surface].by(slot));
        assert!(
            (got - exact).abs() <= 6.0 * error,
            "{slot:?} {surface}: {got} +- {error}, {exact}"
        );
    }
}

#[test]
fn aperture_gradients_of_a_ring_move_both_of_its_edges() {
    // A shadow in front of a lens, seen straight and from the side.
    let rows = [(0.0, 20.0, 1.0, 10.0), (0.02, 5.0, 1.5, 12.0), (-0.01, 60.0, 1.0, 9.0)];
    let mut system = system(&rows, 0);
    system.surfaces[1].obstruction = 3.0;
    let model = model(system);
    for degrees in [0.0, 2.0, 6.0] {
        let region = Region::new(launch(&model, degrees));
        assert!(
            matches!(region.kind, RegionKind::Irregular { annulus: Some(_), .. }),
            "{:?}",
            region.kind
        );
        let (estimator, reason) = choose_estimator(&region, ASKED).unwrap();
        assert!(
            estimator == DerivativeEstimator::Boundary && reason.contains("annulus"),
            "{reason}"
        );
        let light = QuadraticIntegrand::throughput();
        let sampled = differentiate(&region, &light, DerivativeEstimator::Warp, ASKED).unwrap();
        let exact = region.trace_pupil(ORDER).boundary_derivative(&light).unwrap();
        let numbers = sampled.gradient.numbers().zip(exact.numbers()).zip(sampled.error.numbers());
        // What is exactly zero is rounding in both.
        let rounding = 1e-15 * exact.numbers().map(f64::abs).fold(0.0, f64::max);
        for ((sampled, exact), error) in numbers {
            let allowed = 6.0 * error + 1e-9 * exact.abs() + rounding;
            assert!((sampled - exact).abs() <= allowed, "{sampled} and {exact}");
        }
        let mut worst = Worst::default();
        for cost in costs(&region) {
            let exact = region.trace_pupil(ORDER).boundary_derivative(&cost).unwrap();
            let differences = region.difference_derivative(&cost, ORDER).unwrap();
            let what = format!("a ring at {degrees}, {cost:?}");
            compare(&mut worst, (TOLERANCE, 1e-3), [&exact, &differences.gradient], &what);
        }
        worst.check("aperture gradients of a ring", 1.0);
    }
}

#[test]
fn aperture_gradients_scale_with_the_lens_over_a_hundred_decades() {
    let case = &cases()[2];
    let one = |scale: f64| {
        let mut system = case.system();
        for surface in &mut system.surfaces {
            surface.shape = Shape::simplest(surface.shape.curvature() / scale, 0.0, [0.0; 7]);
            surface.thickness *= scale;
            surface.semi_diameter *= scale;
        }
        model(system)
    };
    let derivatives = |model: &RayModel| -> Vec<(&'static str, f64, SystemGradient<f64>)> {
        let region = Region::new(launch(model, 14.0));
        let center = region.trace_pupil(4).moments.centroid;
        let mut found = Vec::new();
        for (cost, power) in
            [(QuadraticIntegrand::spread(center), 4), (QuadraticIntegrand::throughput(), 2)]
        {
            let boundary = region.trace_pupil(4).boundary_derivative(&cost).unwrap();
            let warp = region.warp_derivative(&cost, WarpSampling { count: 512, seed: 1 }).unwrap();
            let difference = region.difference_derivative(&cost, 4).unwrap();
            assert!(is_finite(&warp) && is_finite(&difference));
            found.push(("boundary", f64::from(power), boundary));
            found.push(("warp", f64::from(power), warp.gradient));
            found.push(("difference", f64::from(power), difference.gradient));
        }
        found
    };
    let usual = derivatives(&one(1.0));
    let mut worst = Worst::default();
    for decades in [-50, -20, -3, 3, 20, 50] {
        let scale = 10_f64.powi(decades);
        for ((name, power, usual), (_, _, scaled)) in usual.iter().zip(derivatives(&one(scale))) {
            let tolerance = if *name == "difference" { 1e-6 } else { 1e-8 };
            let back = unscaled(&scaled, scale, *power);
            compare(&mut worst, (tolerance, 1e-6), [&back, usual], &format!("{name}, 1e{decades}"));
        }
    }
    worst.check("aperture gradients over a hundred decades", 1.0);
}

/// The derivatives of an integral with a power of a length, of a lens scaled back to its size.
fn unscaled(gradient: &SystemGradient<f64>, scale: f64, power: f64) -> SystemGradient<f64> {
    let mut back = gradient.clone();
    let whole = scale.powf(-power);
    back.index_before *= whole;
    for surface in &mut back.surfaces {
        surface.curvature *= whole / scale;
        surface.thickness *= whole * scale;
        surface.index *= whole;
        surface.semi_diameter *= whole * scale;
    }
    back
}

#[test]
fn aperture_gradients_by_the_warp_field_are_the_same_in_single_precision() {
    for case in cases().iter().take(5) {
        let model = case.model();
        let region = Region::new(case.launch(&model));
        for cost in costs(&region) {
            let sampling = WarpSampling { count: 4096, seed: 5 };
            let double = region.warp_derivative(&cost, sampling).unwrap();
            let single = region.warp_derivative_in::<f32>(&cost, sampling).unwrap();
            assert!(is_finite(&single));
            for slot in SurfaceParameter::all() {
                let error = double.error.largest(slot);
                let off = double.gradient.zip_with(&single.gradient, |a, b| (a - b).abs());
                assert!(off.largest(slot) <= 0.5 * error, "{}, {slot:?}", case.name());
            }
        }
    }
}

#[test]
fn a_zero_aperture_passes_no_light_and_axial_rays_are_finite() {
    // Fields on the axis: every estimator meets the axial ray or its neighbourhood.
    let rows = [(0.02, 5.0, 1.5, 10.0), (-0.02, 50.0, 1.0, 10.0)];
    let mut single = system(&rows, 0);
    let open = model(single.clone());
    all_agree("a beam along the axis", &open, 0.0, TOLERANCE);
    single.surfaces[1].semi_diameter = 0.0;
    let pinhole = model(single);
    let region = Region::new(launch(&pinhole, 0.0));
    let dark =
        differentiate(&region, &QuadraticIntegrand::throughput(), DerivativeEstimator::Warp, ASKED);
    assert!(matches!(dark, Err(DerivativeError::Dark(..))), "{dark:?}");
}
