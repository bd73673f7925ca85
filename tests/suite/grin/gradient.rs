//! The adjoint against forward differentiation of the whole tracer, against a stored tape, and on
//! any number of threads.

use super::{Kind, beam, bowl, kinds, length, steps, until, vec3};
use crate::reference::Worst;
use aplanat::grin::field::HessianDiagonal;
use aplanat::grin::{
    Face, GrinRay, GrinRegion, GrinSetup, GrinTracer, IndexField, Integrator, LastStep, LaunchMode,
    LossAndGradient, RayAdjoint, RayExit,
};
use aplanat::math::{Dual, Real, Vec3};
use rayon::ThreadPoolBuilder;

type Slope = Dual<f64, 1>;

/// Ways to trace, each a little different.
fn setups<R: Real>(integrator: Integrator) -> Vec<(&'static str, GrinSetup<R>)> {
    let c = R::from_f64;
    let ball = || GrinRegion::ball(c(0.95));
    let slab = || {
        let mut slab = GrinRegion::rod(c(3.0), c(-0.77), c(0.81));
        slab.faces.push(Face::sphere(c(1.4)));
        slab
    };
    let screen = Face::plane(Vec3::from_f64(vec3([0.1, -0.05, 1.0])), c(2.5));
    let fractional = || until(integrator, 0.08, ball(), LastStep::Fractional);
    let broken = || until(integrator, 0.08, slab(), LastStep::BrokenLine);
    vec![
        ("steps", steps(integrator, 0.08, 17)),
        ("steps, scaled", GrinSetup { launch: LaunchMode::Scaled, ..steps(integrator, 0.08, 17) }),
        ("fractional", fractional()),
        ("broken", broken()),
        (
            "fractional, scaled, screen",
            GrinSetup { launch: LaunchMode::Scaled, screen: Some(screen), ..fractional() },
        ),
        (
            "fractional, refracted, screen",
            GrinSetup { launch: LaunchMode::Refracted, screen: Some(screen), ..fractional() },
        ),
        (
            "broken, refracted, round screen",
            GrinSetup {
                launch: LaunchMode::Refracted,
                screen: Some(Face::sphere(c(3.0))),
                ..broken()
            },
        ),
    ]
}

/// Rays from outside, from inside, and from inside to the side.
fn rays() -> Vec<GrinRay<f64>> {
    vec![
        GrinRay { x: vec3([0.21, -0.13, -1.7]), v: vec3([0.03, 0.06, 1.0]) },
        GrinRay { x: vec3([-0.42, 0.33, -1.5]), v: vec3([0.17, -0.05, 0.98]) },
        GrinRay { x: vec3([0.11, 0.23, -0.37]), v: vec3([-0.12, 0.31, 1.01]) },
    ]
}

/// The derivative of the loss along one direction of parameters and starts, forwards.
fn forward(kind: &Kind, setup: GrinSetup<Slope>) -> f64 {
    let carry = |seed: usize, value: f64| Slope { value, slope: [direction(seed, value)] };
    let field = kind.field::<Slope>(carry);
    let tracer = GrinTracer::new(&*field, setup).unwrap();
    let vector =
        |v: Vec3<f64>, n: usize| Vec3::new(carry(n, v.x), carry(n + 1, v.y), carry(n + 2, v.z));
    let ray = |(i, ray): (usize, GrinRay<f64>)| {
        let (x, v) = (vector(ray.x, 1000 + 6 * i), vector(ray.v, 1003 + 6 * i));
        bowl(&tracer.trace(&GrinRay { x, v })).0.slope[0]
    };
    rays().into_iter().enumerate().map(ray).sum()
}

fn direction(n: usize, _: f64) -> f64 {
    (n as f64 * 0.618034).fract() - 0.43
}

/// The same from the gradient.
fn backward(outcome: &LossAndGradient<f64>) -> f64 {
    let parameters = &outcome.gradient.parameters;
    let by_parameters: f64 =
        parameters.iter().enumerate().map(|(n, g)| g * direction(n, 0.0)).sum();
    let along = |v: Vec3<f64>, n: usize| {
        v.dot(vec3([direction(n, 0.0), direction(n + 1, 0.0), direction(n + 2, 0.0)]))
    };
    let starts = outcome.gradient.starts.iter().enumerate();
    let by_starts: f64 =
        starts.map(|(i, s)| along(s.x, 1000 + 6 * i) + along(s.v, 1003 + 6 * i)).sum();
    by_parameters + by_starts
}

#[test]
fn grin_every_integrator_end_and_start_has_its_exact_adjoint() {
    let mut worst = Worst::default();
    for integrator in Integrator::ALL {
        let pairs = setups::<f64>(integrator).into_iter().zip(setups::<Slope>(integrator));
        for ((name, plain), (_, carried)) in pairs {
            for kind in kinds() {
                let place = format!("{}, {name}, {}", integrator.name(), kind.name);
                let field = kind.field::<f64>(|_, value| value);
                let tracer = GrinTracer::new(&*field, plain.clone()).unwrap();
                let outcome = tracer.loss_and_gradient(&rays(), |_, exit| bowl(exit));
                assert_eq!(
                    outcome.fates.arrived_count(),
                    rays().len(),
                    "{place}: {:?}",
                    outcome.fates
                );
                let exact = forward(&kind, carried.clone());
                worst.note(backward(&outcome), exact, exact.abs().max(1.0), place);
            }
        }
    }
    worst.check("grin adjoint against forward differentiation", 1e-11);
}

/// A field, a way to trace, and rays.
type Scene = (Box<dyn IndexField<f64>>, GrinSetup<f64>, Vec<GrinRay<f64>>);

/// A strongly bent trilinear field with a batch through it.
fn trilinear() -> Scene {
    let trilinear = kinds().into_iter().find(|kind| kind.name == "trilinear").unwrap();
    let kind = Kind { diagonal: HessianDiagonal::Smoothed, ..trilinear };
    let region = GrinRegion::cube(0.9);
    let setup = until(Integrator::LeapfrogDkd, 0.0487, region, LastStep::BrokenLine);
    (kind.field(|_, value| value), setup, beam(20, 0.8, -1.3))
}

fn seeds(exits: &[RayExit<f64>]) -> Vec<RayAdjoint<f64>> {
    exits.iter().map(|exit| bowl(exit).1).collect()
}

#[test]
fn grin_retraced_and_taped_gradients_agree_and_only_the_tape_grows() {
    for (integrator, last) in [
        (Integrator::LeapfrogDkd, LastStep::BrokenLine),
        (Integrator::BlanesMoan, LastStep::Fractional),
    ] {
        let (field, setup, rays) = trilinear();
        let mut bytes = Vec::new();
        for step in [0.0487, 0.0487 / 4.0] {
            let setup = GrinSetup {
                launch: LaunchMode::Refracted,
                ..until(integrator, step, setup_region(&setup), last)
            };
            let tracer = GrinTracer::new(&*field, setup).unwrap();
            let mut exits = tracer.trace_batch(&rays);
            let seeds = seeds(&exits);
            let gradient = tracer.gradient(&rays, &mut exits, &seeds);
            let taped = tracer.tape_gradient(&rays, &exits, &seeds);
            let norm = taped.parameters.iter().map(|g| g * g).sum::<f64>().sqrt();
            for (a, b) in gradient.parameters.iter().zip(&taped.parameters) {
                assert!((a - b).abs() < 1e-11 * norm, "{a} {b}");
            }
            for (a, b) in gradient.starts.iter().zip(&taped.starts) {
                assert!(length(a.x - b.x) < 1e-11 * norm && length(a.v - b.v) < 1e-11 * norm);
            }
            bytes.push(taped.bytes);
            let kept = size_of_val(&exits[..]) + size_of_val(&gradient.parameters[..]);
            println!(
                "{}: step {step:.4}, tape {} kB, retrace {} kB, retrace error {:.1e} steps",
                integrator.name(),
                taped.bytes / 1024,
                kept / 1024,
                gradient.retrace_error
            );
        }
        assert!(bytes[1] > 3 * bytes[0]);
    }
}

fn setup_region(setup: &GrinSetup<f64>) -> GrinRegion<f64> {
    match &setup.end {
        aplanat::grin::EndCondition::Boundary { region, .. } => region.clone(),
        aplanat::grin::EndCondition::Steps(_) => GrinRegion::cube(1.0),
    }
}

#[test]
fn grin_the_same_bits_on_any_number_of_threads_and_one_by_one() {
    let (field, setup, rays) = trilinear();
    let tracer = GrinTracer::new(&*field, setup).unwrap();
    let on = |threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| tracer.loss_and_gradient(&rays, |_, exit| bowl(exit)))
    };
    let one = on(1);
    assert!(one.fates.arrived_count() > 300, "{:?}", one.fates);
    assert_eq!(one, on(2));
    assert_eq!(one, on(5));
    for (ray, exit) in rays.iter().zip(&one.exits) {
        assert_eq!(tracer.trace(ray), *exit);
    }
}

#[test]
fn grin_a_path_has_every_step_and_ends_at_the_exit() {
    let (field, setup, rays) = trilinear();
    let tracer = GrinTracer::new(&*field, setup).unwrap();
    let (points, exit) = tracer.trace_path(&rays[150]);
    assert_eq!(exit, tracer.trace(&rays[150]));
    assert_eq!(points.len(), exit.steps as usize);
    assert!((points[0].x.z + 0.9).abs() < 1e-12);
    let rises = points.windows(2).all(|pair| pair[1].path > pair[0].path);
    assert!(rises && exit.path > points[points.len() - 1].path);
}
