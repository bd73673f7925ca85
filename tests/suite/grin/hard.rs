//! Hard cases: each ray ends with a fate, never with a panic, and non-finite values are not passed
//! on.

use super::{beam, bowl, length, steps, until, vec3};
use aplanat::grin::field::{
    HessianDiagonal, Luneburg, Maxwell, Polynomial, ProfileField, RegularGrid, Tricubic, Trilinear,
};
use aplanat::grin::{
    EndCondition, Face, GrinFate, GrinRay, GrinRegion, GrinSetup, GrinSetupError, GrinTracer,
    IndexField, Integrator, LastStep, LaunchMode, LossAndGradient, RayAdjoint, RayExit,
};
use aplanat::math::{Real, Vec3};

fn trace<R: Real>(
    field: &dyn IndexField<R>,
    setup: GrinSetup<R>,
    rays: &[GrinRay<R>],
) -> LossAndGradient<R> {
    let outcome = GrinTracer::new(field, setup).unwrap().loss_and_gradient(rays, |_, exit| {
        if exit.fate.has_arrived() { bowl(exit) } else { (R::ONE, RayAdjoint::default()) }
    });
    assert_eq!(outcome.fates.total(), rays.len());
    assert!(outcome.loss.is_finite());
    assert!(outcome.gradient.parameters.iter().all(|g| g.is_finite()));
    let is_finite = |s: &RayAdjoint<R>| s.x.is_finite() && s.v.is_finite();
    assert!(outcome.gradient.starts.iter().all(is_finite));
    outcome
}

/// Node values between 1 and `1 + strength` without a pattern.
fn rough<R: Real>(count: usize, strength: f64) -> Trilinear<R> {
    let value = |i: usize| R::from_f64(1.0 + strength * (i as f64 * 0.754878).fract());
    let grid = RegularGrid::cube(count, R::ONE).unwrap();
    Trilinear::new(grid, (0..count.pow(3)).map(value).collect()).unwrap()
}

#[test]
fn grin_closed_orbits_count_as_trapped_and_add_nothing() {
    let field = ProfileField::sphere(Maxwell::new(2.0, 1.0));
    let setup = until(Integrator::Pefrl, 0.05, GrinRegion::ball(3.0), LastStep::Fractional);
    let setup = GrinSetup { end: limited(&setup.end, 500), ..setup };
    // An orbit through the unit sphere at 0.9 rad stays within r < 2.1; one that is too fast leaves.
    let inside = |angle: f64| GrinRay {
        x: vec3([-1.0, 0.0, 0.0]),
        v: vec3([angle.cos(), angle.sin(), 0.0]),
    };
    let fast = GrinRay { x: vec3([-1.0, 0.0, 0.0]), v: vec3([0.0, 9.0, 0.0]) };
    let outcome = trace(&field, setup, &[inside(0.9), inside(1.2), fast]);
    assert_eq!(outcome.fates.count_of(GrinFate::Trapped), 2);
    assert_eq!(outcome.exits[0].steps, 500);
    assert_eq!(outcome.gradient.starts[0], RayAdjoint::default());
    assert_eq!(outcome.fates.count_of(GrinFate::Left), 1);
}

fn limited<R: Clone>(end: &EndCondition<R>, limit: u32) -> EndCondition<R> {
    match end {
        EndCondition::Steps(_) => EndCondition::Steps(limit),
        EndCondition::Boundary { region, last, .. } => {
            EndCondition::Boundary { region: region.clone(), last: *last, limit }
        }
    }
}

#[test]
fn grin_grazing_rays_report_their_exit_angle() {
    let field = ProfileField::sphere(Luneburg::new(1.0));
    for last in [LastStep::Fractional, LastStep::BrokenLine] {
        for integrator in [Integrator::LeapfrogDkd, Integrator::BlanesMoan] {
            let setup = until(integrator, 0.05, GrinRegion::ball(1.0), last);
            let rays: Vec<_> = (0..200)
                .map(|i| GrinRay {
                    x: vec3([0.99 + 6e-5 * f64::from(i), 0.0, -1.5]),
                    v: vec3([0.0, 0.0, 1.0]),
                })
                .collect();
            let outcome = trace(&field, setup, &rays);
            let fates = outcome.fates;
            assert!(fates.count_of(GrinFate::NeverEntered) >= 33, "{fates:?}");
            let flat =
                outcome.exits.iter().filter(|e| e.fate.has_arrived() && e.cosine < 0.1).count();
            assert!(flat > 50, "{flat}");
            assert_eq!(
                fates.arrived_count()
                    + fates.count_of(GrinFate::NeverEntered)
                    + fates.count_of(GrinFate::Grazing),
                200
            );
        }
    }
}

#[test]
fn grin_rays_along_grid_planes_end_where_rays_beside_them_do() {
    // Nodes at multiples of 1/16, half of a voxel a step: every point lies on a face.
    let field = Tricubic::approximate(32, 1.0, |p: Vec3<f64>| 1.2 - 0.1 * p.dot(p)).unwrap();
    let rough = rough::<f64>(33, 1e-3);
    for field in [&field as &dyn IndexField<f64>, &rough] {
        let setup =
            until(Integrator::LeapfrogDkd, 1.0 / 32.0, GrinRegion::cube(1.0), LastStep::BrokenLine);
        let ray =
            |d: f64| GrinRay { x: vec3([0.25 + d, -0.5 - d, -1.0]), v: vec3([0.0, 0.0, 1.0]) };
        let outcome = trace(field, setup, &[ray(0.0), ray(1e-9), ray(-1e-9)]);
        assert_eq!(outcome.fates.count_of(GrinFate::Left), 3);
        for exit in &outcome.exits[1..] {
            assert!(length(exit.x - outcome.exits[0].x) < 2e-3);
        }
    }
}

#[test]
fn grin_a_step_longer_than_a_voxel_is_exactly_reversible() {
    let field = rough::<f64>(33, 0.02);
    let setup = until(Integrator::LeapfrogDkd, 0.317, GrinRegion::cube(1.0), LastStep::BrokenLine);
    let outcome = trace(&field, setup, &beam(8, 0.8, -1.0));
    assert_eq!(outcome.fates.arrived_count(), 64);
    assert!(outcome.gradient.retrace_error < 1e-12);
}

#[test]
fn grin_chaotic_rays_lose_their_gradient_and_are_counted() {
    let rays = beam(12, 0.8, -1.0);
    let gradient = |strength: f64, step: f64| {
        let field = rough::<f64>(33, strength);
        let setup =
            until(Integrator::LeapfrogDkd, step, GrinRegion::cube(1.0), LastStep::BrokenLine);
        trace(&field, GrinSetup { end: limited(&setup.end, 4000), ..setup }, &rays)
    };
    let weak = gradient(0.003, 0.0155);
    assert_eq!(weak.fates.count_of(GrinFate::Left), rays.len());
    assert!(weak.gradient.retrace_error < 1e-12);
    let strong = gradient(3.0, 0.0155);
    let fates = strong.fates;
    println!("1000 times stronger: {fates:?}, retrace error {:.1e}", strong.gradient.retrace_error);
    assert!(fates.count_of(GrinFate::Chaotic) > 10 && fates.arrived_count() > 10, "{fates:?}");
    assert!(strong.gradient.retrace_error < 1e-6);
    // The dropped rays left no trace in the gradient of the others.
    let kept: Vec<_> = (0..rays.len()).filter(|i| strong.exits[*i].fate.has_arrived()).collect();
    let field = rough::<f64>(33, 3.0);
    let setup = until(Integrator::LeapfrogDkd, 0.0155, GrinRegion::cube(1.0), LastStep::BrokenLine);
    let setup = GrinSetup { end: limited(&setup.end, 4000), ..setup };
    let alone: Vec<_> = kept.iter().map(|i| rays[*i]).collect();
    let alone = trace(&field, setup, &alone);
    assert_eq!(alone.fates.arrived_count(), kept.len());
    let norm = alone.gradient.parameters.iter().map(|g| g * g).sum::<f64>().sqrt();
    for (a, b) in alone.gradient.parameters.iter().zip(&strong.gradient.parameters) {
        assert!((a - b).abs() < 1e-12 * norm);
    }
}

#[test]
fn grin_reflected_and_transmitted_rays_are_distinguished() {
    // The index falls towards +z: a mirage.
    let field = ProfileField::axial(Polynomial { coefficients: vec![1.2, -0.3] });
    let region = GrinRegion::block(vec3([-9.0, -9.0, -1.0]), vec3([9.0, 9.0, 1.0]));
    let setup = until(Integrator::BlanesMoan, 0.1, region, LastStep::Fractional);
    let setup = GrinSetup { launch: LaunchMode::Scaled, ..setup };
    let at = |angle: f64| GrinRay {
        x: vec3([0.0, 0.0, -1.0]),
        v: vec3([angle.cos(), 0.0, angle.sin()]),
    };
    // v_x is constant, so it turns where the index has fallen to v_x; flat light keeps v·v₀ > 0.
    let outcome = trace(&field, setup.clone(), &[at(1.2), at(0.3)]);
    assert_eq!(outcome.exits[0].fate, GrinFate::Left);
    assert!((outcome.exits[0].x.z - 1.0).abs() < 1e-12);
    assert!((outcome.exits[1].x.z + 1.0).abs() < 1e-12);
    assert!((outcome.exits[1].v.z + 1.5 * (0.3f64).sin()).abs() < 1e-9, "mirrored");
    // Straight into a rise that throws it back.
    let wall = ProfileField::axial(Polynomial { coefficients: vec![0.9, -0.8] });
    let outcome = trace(&wall, setup, &[at(1.1)]);
    assert_eq!(outcome.exits[0].fate, GrinFate::Turned);
    assert!(outcome.gradient.parameters[1] != 0.0);
}

#[test]
fn grin_a_ray_enters_from_the_boundary_itself_or_not_at_all() {
    let field = ProfileField::sphere(Luneburg::new(1.0));
    let ball = until(Integrator::BlanesMoan, 0.05, GrinRegion::ball(1.0), LastStep::Fractional);
    let start = vec3([0.6, 0.0, -0.8]);
    let ray = |v: [f64; 3]| GrinRay { x: start, v: vec3(v) };
    let rays = [ray([0.0, 0.0, 1.0]), ray([0.0, 0.0, -1.0]), ray([0.8, 0.0, 0.6])];
    let outcome = trace(&field, ball, &rays);
    let fates = outcome.exits.iter().map(|exit| exit.fate).collect::<Vec<_>>();
    assert_eq!(fates, [GrinFate::Left, GrinFate::NeverEntered, GrinFate::NeverEntered]);
    assert!(length(outcome.exits[0].x - vec3([0.0, 0.0, 1.0])) < 1e-7);
    // On a face, on an edge and on a corner of a grid.
    let cube = until(Integrator::LeapfrogDkd, 0.05, GrinRegion::cube(1.0), LastStep::BrokenLine);
    let at = |x: [f64; 3], v: [f64; 3]| GrinRay { x: vec3(x), v: vec3(v) };
    let outcome = trace(
        &rough(9, 0.01),
        cube,
        &[
            at([0.1, 0.2, -1.0], [0.0, 0.0, 1.0]),
            at([-1.0, 0.2, -1.0], [0.5, 0.0, 0.8]),
            at([-1.0, -1.0, -1.0], [0.6, 0.5, 0.7]),
            at([3.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
        ],
    );
    let fates = outcome.exits.iter().map(|exit| exit.fate).collect::<Vec<_>>();
    assert_eq!(fates, [GrinFate::Left, GrinFate::Left, GrinFate::Left, GrinFate::NeverEntered]);
}

#[test]
fn grin_a_screen_behind_the_ray_and_total_reflection_are_fates() {
    let field = ProfileField::axial(Polynomial { coefficients: vec![1.5] });
    let glass = GrinSetup {
        launch: LaunchMode::Refracted,
        screen: Some(Face::plane(vec3([0.0, 0.0, 1.0]), -4.0)),
        ..until(Integrator::LeapfrogDkd, 0.1, GrinRegion::cube(1.0), LastStep::Fractional)
    };
    let into = GrinRay { x: vec3([0.1, 0.1, -2.0]), v: vec3([0.1, 0.0, 1.0]) };
    let flat = GrinRay { x: vec3([0.0; 3]), v: vec3([1.2, 0.0, 0.9]) };
    let outcome = trace(&field, glass.clone(), &[into, flat]);
    assert_eq!(outcome.exits[0].fate, GrinFate::MissedScreen);
    assert_eq!(outcome.exits[1].fate, GrinFate::MissedScreen);
    let trapped = GrinRay { x: vec3([0.0; 3]), v: vec3([1.1, 0.0, 1.02]) };
    let outcome = trace(&field, glass, &[trapped]);
    assert_eq!(outcome.exits[0].fate, GrinFate::TotalReflection);
}

#[test]
fn grin_an_index_below_one_bends_rays_without_losing_numbers() {
    let mut field = rough::<f64>(9, 0.2);
    field.parameters_mut().iter_mut().for_each(|value| *value -= 0.9);
    let setup = until(Integrator::LeapfrogDkd, 0.031, GrinRegion::cube(1.0), LastStep::BrokenLine);
    let glass = GrinSetup { launch: LaunchMode::Refracted, ..setup.clone() };
    assert_eq!(trace(&field, setup, &beam(8, 0.8, -1.0)).fates.arrived_count(), 64);
    // From air into a thinner medium at a slant there is total reflection.
    let slant = |i: usize| GrinRay { v: vec3([0.8, 0.0, 0.6]), ..beam(8, 0.8, -1.0)[i] };
    let rays: Vec<_> = (0..64).map(slant).collect();
    assert_eq!(trace(&field, glass, &rays).fates.count_of(GrinFate::TotalReflection), 64);
}

#[test]
fn grin_an_empty_field_and_a_single_voxel_leave_straight_rays_straight() {
    let one = Trilinear::new(RegularGrid::cube(2, 1.0).unwrap(), vec![1.0; 8]).unwrap();
    for diagonal in [HessianDiagonal::Exact, HessianDiagonal::Smoothed] {
        let mut field = one.clone();
        field.diagonal = diagonal;
        let setup = until(Integrator::BlanesMoan, 0.1, GrinRegion::cube(1.0), LastStep::Fractional);
        let ray = GrinRay { x: vec3([0.3, -0.2, -1.0]), v: vec3([0.1, 0.2, 1.0]) };
        let outcome = trace(&field, setup, &[ray]);
        assert!(length(outcome.exits[0].x - vec3([0.5, 0.2, 1.0])) < 1e-14);
        assert!(outcome.gradient.parameters.iter().any(|g| *g != 0.0));
    }
    let none = trace(&one, steps(Integrator::Pefrl, 0.1, 3), &[]);
    assert_eq!((none.loss, none.fates.total()), (0.0, 0));
}

#[test]
fn grin_invalid_setups_are_refused() {
    let field = ProfileField::sphere(Luneburg::new(1.0));
    let refused = |setup: GrinSetup<f64>| GrinTracer::new(&field, setup).unwrap_err();
    assert_eq!(refused(steps(Integrator::Pefrl, 0.0, 3)), GrinSetupError::Step(0.0));
    assert!(matches!(refused(steps(Integrator::Pefrl, f64::NAN, 3)), GrinSetupError::Step(_)));
    assert_eq!(refused(steps(Integrator::Pefrl, 0.1, 0)), GrinSetupError::NoSteps);
    let empty = GrinRegion::block(vec3([0.0; 3]), vec3([1.0, 0.0, 1.0]));
    let empty = until(Integrator::Pefrl, 0.1, empty, LastStep::BrokenLine);
    assert_eq!(refused(empty), GrinSetupError::EmptyRegion { axis: 'y' });
}

#[test]
fn grin_nan_and_overflowing_rays_are_reported() {
    let field = ProfileField::sphere(Polynomial { coefficients: vec![1.0, 0.0, 0.5, 1e3] });
    let setup = until(Integrator::LeapfrogDkd, 0.5, GrinRegion::ball(1e30), LastStep::Fractional);
    let ray = |x: f64, v: f64| GrinRay { x: vec3([x, 0.0, 0.0]), v: vec3([v, 0.0, 0.3]) };
    let rays = [ray(f64::NAN, 1.0), ray(0.1, f64::INFINITY), ray(0.5, 1.0)];
    let outcome = trace(&field, setup, &rays);
    assert_eq!(outcome.exits[0].fate, GrinFate::Diverged);
    assert_eq!(outcome.exits[1].fate, GrinFate::Diverged);
    assert!(!outcome.exits[2].fate.has_arrived() || outcome.exits[2].x.is_finite());
}

#[test]
fn grin_single_precision_agrees_to_its_digits() {
    let rays = beam(16, 0.8, -1.0);
    let single = |v: Vec3<f64>| Vec3::new(v.x as f32, v.y as f32, v.z as f32);
    let rays32: Vec<_> =
        rays.iter().map(|ray| GrinRay { x: single(ray.x), v: single(ray.v) }).collect();
    let step = 0.487 / 16.0;
    let end = |e: &RayExit<f32>| Vec3::new(e.x.x, e.x.y, e.x.z).value();
    let setup =
        || until(Integrator::LeapfrogDkd, step, GrinRegion::cube(1.0), LastStep::BrokenLine);
    let double = trace(&rough::<f64>(33, 0.002), setup(), &rays);
    let setup = until(Integrator::LeapfrogDkd, step, GrinRegion::cube(1.0), LastStep::BrokenLine);
    let float = trace::<f32>(&rough(33, 0.002), setup, &rays32);
    assert_eq!(float.fates.arrived_count(), rays.len());
    let worst = double.exits.iter().zip(&float.exits).map(|(a, b)| length(a.x - end(b)));
    let worst = worst.fold(0.0, f64::max);
    println!("f32: exits off by {worst:.1e}, retrace {:.1e} steps", float.gradient.retrace_error);
    assert!(worst < 1e-4 && float.gradient.retrace_error < 1e-2);
}
