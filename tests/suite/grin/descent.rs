//! Gradient-index lenses recovered from their effect on rays.

use super::{until, vec3};
use aplanat::grin::field::{BSpline, ProfileField, ProfileFunction};
use aplanat::grin::{
    GrinRay, GrinRegion, GrinSetup, GrinTracer, IndexField, Integrator, LastStep, LaunchMode,
    RayAdjoint,
};
use aplanat::solve::{Adam, Lbfgs, ParameterBounds};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::FRAC_PI_2;

/// The last coefficient of a spline stands beyond the rim, where the index would fall below 1.
const RANGE: [f64; 2] = [0.7, 2.0];

fn ball(coefficients: Vec<f64>) -> ProfileField<BSpline<f64>> {
    ProfileField::sphere(BSpline::new(0.0, 1.0, coefficients).unwrap())
}

fn fibre(coefficients: Vec<f64>) -> ProfileField<BSpline<f64>> {
    ProfileField::cylinder(BSpline::new(0.0, 1.0, coefficients).unwrap())
}

/// Parallel meridional rays at even heights up to `edge`.
fn fan(count: usize, edge: f64, z: f64) -> Vec<GrinRay<f64>> {
    let height = |i: usize| edge * (i as f64 + 0.5) / count as f64;
    let ray = |i: usize| GrinRay { x: vec3([height(i), 0.0, z]), v: vec3([0.0, 0.0, 1.0]) };
    (0..count).map(ray).collect()
}

/// The relative L2 error of a profile in `s = r²` over the unit ball.
fn error(field: &ProfileField<BSpline<f64>>, exact: impl Fn(f64) -> f64) -> f64 {
    let (mut difference, mut norm) = (0.0, 0.0);
    for i in 0..200 {
        let r = (f64::from(i) + 0.5) / 200.0;
        let (got, exact) = (field.profile.evaluate(r * r).value, exact(r));
        difference += r * r * (got - exact).powi(2);
        norm += r * r * exact * exact;
    }
    (difference / norm).sqrt()
}

/// The residual of each ray, and its derivative by each parameter: one adjoint for
/// each row. The last row holds `η` at the rim.
fn rows(
    field: &ProfileField<BSpline<f64>>,
    setup: &GrinSetup<f64>,
    rays: &[GrinRay<f64>],
    target: [f64; 3],
) -> (DVector<f64>, DMatrix<f64>) {
    let tracer = GrinTracer::new(field, setup.clone()).unwrap();
    let (mut misses, mut slopes) = (Vec::new(), Vec::new());
    for ray in rays {
        let exit = tracer.trace(ray);
        let miss = exit.x - vec3(target);
        for (miss, axis) in [(miss.x, [1.0, 0.0, 0.0]), (miss.z, [0.0, 0.0, 1.0])] {
            let seed = RayAdjoint { x: vec3(axis), ..RayAdjoint::default() };
            misses.push(miss);
            slopes.extend(tracer.tape_gradient(&[*ray], &[exit], &[seed]).parameters);
        }
    }
    misses.push(field.profile.evaluate(1.0).value - 1.0);
    let mut rim = vec![0.0; field.parameters().len()];
    field.profile.accumulate(1.0, 1.0, 0.0, &mut rim);
    slopes.extend(rim);
    let count = misses.len();
    (DVector::from_vec(misses), DMatrix::from_row_slice(count, field.parameters().len(), &slopes))
}

#[test]
fn grin_luneburg_is_recovered_from_its_focus() {
    let region = GrinRegion::ball(1.0);
    let setup = until(Integrator::BlanesMoan, 0.12, region, LastStep::Fractional);
    let rays = fan(60, 0.995, -1.5);
    let mut field = ball(vec![1.0; 9]);
    let (mut misses, mut slopes) = rows(&field, &setup, &rays, [0.0, 0.0, 1.0]);
    let (mut damping, mut traces) = (1e-3, 1);
    while traces < 200 && damping < 1e6 {
        // Levenberg and Marquardt, with a limit on the change of the index.
        let mut normal = slopes.tr_mul(&slopes);
        let scale = normal.diagonal().max();
        (0..normal.nrows()).for_each(|i| normal[(i, i)] += damping * scale);
        let mut step = -normal.cholesky().unwrap().solve(&slopes.tr_mul(&misses));
        step *= (0.05 / step.amax()).min(1.0);
        let moved = ball(field.parameters().iter().zip(&step).map(|(c, s)| c + s).collect());
        let (new, new_slopes) = rows(&moved, &setup, &rays, [0.0, 0.0, 1.0]);
        traces += 1;
        if new.norm() < misses.norm() {
            let gain = misses.norm() - new.norm();
            (field, slopes, damping) = (moved, new_slopes, damping * 0.1);
            let settled = gain < 1e-6 * misses.norm();
            misses = new;
            if settled {
                break;
            }
        } else {
            damping *= 10.0;
        }
    }
    let (spot, error) = (misses.norm() / 60f64.sqrt(), error(&field, |r| (2.0 - r * r).sqrt()));
    println!("luneburg: spot {spot:.1e}, index {error:.1e}, {traces} traces of 60 rays");
    assert!(error < 1e-4, "{error:e}");
}

#[test]
fn grin_the_best_fibre_is_the_hyperbolic_secant() {
    let focus = FRAC_PI_2;
    let region = GrinRegion::rod(1.5, -1.0, focus);
    let setup = until(Integrator::BlanesMoan, 0.2, region, LastStep::Fractional);
    let setup = GrinSetup { launch: LaunchMode::Scaled, ..setup };
    let rays = fan(40, 0.95, 0.0);
    let sech = |r: f64| 1f64.cosh() / r.cosh(); // a = π / (2 focus) = 1, and 1 at the rim
    let mut parameters = vec![1.2; 7];
    let limits = ParameterBounds::uniform(7, RANGE, 0.05);
    let (mut descent, mut last, mut evaluations) = (Lbfgs::default(), f64::INFINITY, 0);
    for _ in 0..600 {
        let done = descent.step(&mut parameters, &limits, |p| {
            let field = fibre(p.to_vec());
            let tracer = GrinTracer::new(&field, setup.clone()).unwrap();
            let outcome = tracer.loss_and_gradient(&rays, |_, exit| {
                let x = exit.x.x;
                (x * x, RayAdjoint { x: vec3([2.0 * x, 0.0, 0.0]), ..RayAdjoint::default() })
            });
            let mut gradient = outcome.gradient.parameters;
            let miss = field.profile.evaluate(1.0).value - 1.0;
            field.profile.accumulate(1.0, 2.0 * miss, 0.0, &mut gradient);
            (outcome.loss + miss * miss, gradient)
        });
        (last, evaluations) = (done.value, evaluations + done.evaluations);
        if done.converged {
            break;
        }
    }
    let field = fibre(parameters);
    let heights = (0..95).map(|i| 0.01 * f64::from(i));
    let worst =
        heights.map(|r| (field.profile.evaluate(r * r).value - sech(r)).abs()).fold(0.0, f64::max);
    let spot = (last / 40.0).sqrt();
    println!(
        "fibre: spot {spot:.1e}, index {worst:.1e} from the secant, {evaluations} evaluations"
    );
    assert!(spot < 1e-4 && worst < 1e-3, "{spot:e} {worst:e}");
}

#[test]
fn grin_descent_respects_limits_and_reports_its_end() {
    // A valley along (1, 1) whose lowest point lies below the range.
    let evaluate = |p: &[f64]| {
        let (a, b) = (p[0] + p[1] - 1.0, p[0] - p[1]);
        (a * a + 100.0 * b * b, vec![2.0 * a + 200.0 * b, 2.0 * a - 200.0 * b])
    };
    let limits = ParameterBounds::uniform(2, [1.0, 1.5], 0.05);
    let (mut lbfgs, mut p) = (Lbfgs::default(), vec![1.4, 1.2]);
    let mut before = p.clone();
    let ended = (0..100).any(|_| {
        let done = lbfgs.step(&mut p, &limits, evaluate);
        let change = p.iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(change <= 0.05 + 1e-15 && p.iter().all(|v| *v >= 1.0));
        before.clone_from(&p);
        done.converged
    });
    assert!(ended && (p[0] - 1.0).abs() < 1e-9 && (p[1] - 1.0).abs() < 1e-9, "{p:?}");
    let (mut adam, mut p) = (Adam::new(0.02), vec![1.4, 1.2]);
    (0..500).for_each(|_| {
        let gradient = evaluate(&p).1;
        adam.step(&mut p, &gradient, &limits);
    });
    assert!(p.iter().all(|v| *v < 1.01), "{p:?}");
    let mut asked = vec![0.3, f64::NAN, 9.0, 1.2];
    let limits = ParameterBounds::uniform(4, [1.0, 1.5], 0.05);
    assert_eq!(limits.project(&mut asked), 3);
    assert_eq!(asked, [1.0, 1.0, 1.5, 1.2]);
}
