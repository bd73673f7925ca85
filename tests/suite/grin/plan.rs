//! The choice of integrator and step.

use super::{beam, length, until, vec3};
use aplanat::grin::field::{BSpline, Luneburg, ProfileField, RegularGrid, Tricubic, Trilinear};
use aplanat::grin::{
    GrinRay, GrinRegion, GrinSetup, GrinTracer, IndexField, Integrator, LastStep, LaunchMode,
    plan_tracing,
};
use aplanat::math::Vec3;

fn index(p: Vec3<f64>) -> f64 {
    (2.0 - p.dot(p).min(1.5)).sqrt()
}

/// The largest error of the exits against a much finer trace.
fn true_error(field: &dyn IndexField<f64>, setup: &GrinSetup<f64>, rays: &[GrinRay<f64>]) -> f64 {
    let fine = GrinSetup { step: setup.step / 16.0, ..setup.clone() };
    let trace = |setup: GrinSetup<f64>| GrinTracer::new(field, setup).unwrap().trace_batch(rays);
    let pairs = trace(setup.clone()).into_iter().zip(trace(fine));
    let arrived = pairs.filter(|(a, b)| a.fate.has_arrived() && b.fate.has_arrived());
    arrived.map(|(a, b)| length(a.x - b.x)).fold(0.0, f64::max)
}

#[test]
fn grin_the_plan_reaches_its_tolerance_on_smooth_fields() {
    let region = GrinRegion::ball(1.0);
    let rays = beam(12, 0.6, -1.5);
    let spline = BSpline::new(0.0, 1.1, vec![1.5, 1.42, 1.37, 1.3, 1.22, 1.14, 1.07]).unwrap();
    let fields: [&dyn IndexField<f64>; 3] = [
        &ProfileField::sphere(Luneburg::new(1.0)),
        &ProfileField::sphere(spline),
        &Tricubic::approximate(16, 1.1, index).unwrap(),
    ];
    for field in fields {
        for tolerance in [1e-3, 1e-6, 1e-9] {
            let plan = plan_tracing(field, &region, LaunchMode::AsGiven, &rays, tolerance).unwrap();
            let error = true_error(field, &plan.setup, &rays);
            println!("asked {tolerance:.0e}, planned {:.1e}, true {error:.1e}", plan.error);
            assert!(plan.is_within_tolerance && error < 2.0 * tolerance, "{plan:?}");
            assert_eq!(plan.setup.integrator, Integrator::BlanesMoan);
        }
    }
}

#[test]
fn grin_the_plan_for_a_grid_keeps_within_voxels_and_says_so() {
    let field = Trilinear::from_function(RegularGrid::cube(33, 1.0).unwrap(), index).unwrap();
    let rays = beam(12, 0.6, -1.5);
    let plan =
        plan_tracing(&field, &GrinRegion::cube(1.0), LaunchMode::AsGiven, &rays, 3e-3).unwrap();
    println!("{}", plan.reasons.join("\n"));
    assert_eq!(plan.setup.integrator, Integrator::LeapfrogDkd);
    assert!(plan.setup.step < 1.0 / 16.0);
    assert!(plan.is_within_tolerance && true_error(&field, &plan.setup, &rays) < 6e-3);
    assert!(plan.reasons.len() == 3 && plan.reasons.iter().any(|r| r.contains("voxel")));
}

#[test]
fn grin_the_plan_works_without_rays_and_for_chaotic_rays() {
    let field = ProfileField::sphere(Luneburg::new(1.0));
    let empty =
        plan_tracing(&field, &GrinRegion::ball(1.0), LaunchMode::AsGiven, &[], 1e-6).unwrap();
    assert!(empty.is_within_tolerance);
    let value = |i: usize| 1.0 + 3.0 * (i as f64 * 0.754878).fract();
    let rough =
        Trilinear::new(RegularGrid::cube(17, 1.0).unwrap(), (0..17 * 17 * 17).map(value).collect());
    let lost = plan_tracing(
        &rough.unwrap(),
        &GrinRegion::cube(1.0),
        LaunchMode::AsGiven,
        &beam(3, 0.5, -1.2),
        1e-9,
    );
    assert!(!lost.unwrap().is_within_tolerance);
    let backwards = GrinRay { x: vec3([0.0, 0.0, -2.0]), v: vec3([0.0, 0.0, -1.0]) };
    let away =
        plan_tracing(&field, &GrinRegion::ball(1.0), LaunchMode::AsGiven, &[backwards], 1e-6)
            .unwrap();
    let fine = until(Integrator::BlanesMoan, 1.0, GrinRegion::ball(1.0), LastStep::Fractional);
    assert_eq!(away.setup.integrator, fine.integrator);
}
