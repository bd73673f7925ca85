//! The choice of integrator and step.

use super::{beam, length, until, vec3};
use aplanat::grin::field::{BSpline, Grid, Layered, Luneburg, Tricubic, Trilinear};
use aplanat::grin::{Field, Integrator, LastStep, Launch, Ray, Region, Setup, Tracer, plan};
use aplanat::math::Vec3;

fn index(p: Vec3<f64>) -> f64 {
    (2.0 - p.dot(p).min(1.5)).sqrt()
}

/// The largest error of the exits against a much finer trace.
fn true_error(field: &dyn Field<f64>, setup: &Setup<f64>, rays: &[Ray<f64>]) -> f64 {
    let fine = Setup { step: setup.step / 16.0, ..setup.clone() };
    let trace = |setup: Setup<f64>| Tracer::new(field, setup).unwrap().rays(rays);
    let pairs = trace(setup.clone()).into_iter().zip(trace(fine));
    let arrived = pairs.filter(|(a, b)| a.fate.arrived() && b.fate.arrived());
    arrived.map(|(a, b)| length(a.x - b.x)).fold(0.0, f64::max)
}

#[test]
fn grin_the_plan_reaches_its_tolerance_on_smooth_fields() {
    let region = Region::ball(1.0);
    let rays = beam(12, 0.6, -1.5);
    let spline = BSpline::new(0.0, 1.1, vec![1.5, 1.42, 1.37, 1.3, 1.22, 1.14, 1.07]).unwrap();
    let fields: [&dyn Field<f64>; 3] = [
        &Layered::sphere(Luneburg::new(1.0)),
        &Layered::sphere(spline),
        &Tricubic::near(16, 1.1, index).unwrap(),
    ];
    for field in fields {
        for tolerance in [1e-3, 1e-6, 1e-9] {
            let plan = plan(field, &region, Launch::AsGiven, &rays, tolerance).unwrap();
            let error = true_error(field, &plan.setup, &rays);
            println!("asked {tolerance:.0e}, planned {:.1e}, true {error:.1e}", plan.error);
            assert!(plan.reached && error < 2.0 * tolerance, "{plan:?}");
            assert_eq!(plan.setup.integrator, Integrator::BlanesMoan);
        }
    }
}

#[test]
fn grin_the_plan_for_a_grid_keeps_within_voxels_and_says_so() {
    let field = Trilinear::sampled(Grid::cube(33, 1.0).unwrap(), index).unwrap();
    let rays = beam(12, 0.6, -1.5);
    let plan = plan(&field, &Region::cube(1.0), Launch::AsGiven, &rays, 3e-3).unwrap();
    println!("{}", plan.reasons.join("\n"));
    assert_eq!(plan.setup.integrator, Integrator::LeapfrogDkd);
    assert!(plan.setup.step < 1.0 / 16.0);
    assert!(plan.reached && true_error(&field, &plan.setup, &rays) < 6e-3);
    assert!(plan.reasons.len() == 3 && plan.reasons.iter().any(|r| r.contains("voxel")));
}

#[test]
fn grin_the_plan_does_without_rays_and_in_chaos() {
    let field = Layered::sphere(Luneburg::new(1.0));
    let empty = plan(&field, &Region::ball(1.0), Launch::AsGiven, &[], 1e-6).unwrap();
    assert!(empty.reached);
    let value = |i: usize| 1.0 + 3.0 * (i as f64 * 0.754878).fract();
    let rough =
        Trilinear::new(Grid::cube(17, 1.0).unwrap(), (0..17 * 17 * 17).map(value).collect());
    let lost =
        plan(&rough.unwrap(), &Region::cube(1.0), Launch::AsGiven, &beam(3, 0.5, -1.2), 1e-9);
    assert!(!lost.unwrap().reached);
    let backwards = Ray { x: vec3([0.0, 0.0, -2.0]), v: vec3([0.0, 0.0, -1.0]) };
    let away = plan(&field, &Region::ball(1.0), Launch::AsGiven, &[backwards], 1e-6).unwrap();
    let fine = until(Integrator::BlanesMoan, 1.0, Region::ball(1.0), LastStep::Fractional);
    assert_eq!(away.setup.integrator, fine.integrator);
}
