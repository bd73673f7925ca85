//! Rays that enter a field with an index jump at its boundary, used as given; and single precision
//! when every step ends on a plane of the grid.

use super::{bowl, length, until, vec3};
use aplanat::grin::field::{Parabolic, ProfileField, RegularGrid, Tricubic, Trilinear};
use aplanat::grin::{
    GrinFate, GrinRay, GrinRegion, GrinSetup, GrinTracer, IndexField, Integrator, LastStep,
    LaunchMode, LossAndGradient, RayAdjoint, RayExit,
};
use aplanat::math::{Real, Vec3};

/// `η² = 2.25 (1 − 0.16 r²)`: 1.5 on the axis, so that the index jumps at every boundary.
fn fibre() -> ProfileField<Parabolic<f64>> {
    ProfileField::cylinder(Parabolic::new(1.5, 0.4))
}

fn block() -> GrinRegion<f64> {
    GrinRegion::rod(1.2, -1.0, 1.0)
}

fn into_block(last: LastStep, launch: LaunchMode) -> GrinSetup<f64> {
    GrinSetup { launch, ..until(Integrator::BlanesMoan, 0.05, block(), last) }
}

fn slanted() -> Vec<GrinRay<f64>> {
    let ray = |x: f64, y: f64, a: f64, b: f64| GrinRay {
        x: vec3([x, y, -1.6]),
        v: vec3([a, b, (1.0 - a * a - b * b).sqrt()]),
    };
    vec![ray(0.1, 0.0, 0.0, 0.0), ray(0.5, -0.2, 0.03, 0.05), ray(-0.4, 0.6, -0.1, 0.08)]
}

/// The solution for a ray that enters with `|v| = 1`, whatever the index is: `x″ = −(n g)² x`
/// across the axis and `v_z` constant.
fn exact(ray: &GrinRay<f64>) -> (Vec3<f64>, Vec3<f64>) {
    let entry = ray.x + ray.v * ((-1.0 - ray.x.z) / ray.v.z);
    let (rate, sigma) = (1.5 * 0.4, 2.0 / ray.v.z);
    let (sine, cosine) = (rate * sigma).sin_cos();
    let at = |x: f64, v: f64| (x * cosine + v * sine / rate, v * cosine - x * rate * sine);
    let ((x, a), (y, b)) = (at(entry.x, ray.v.x), at(entry.y, ray.v.y));
    (vec3([x, y, 1.0]), vec3([a, b, ray.v.z]))
}

#[test]
fn grin_an_as_given_ray_ignores_the_index_jump_at_entry() {
    let field = fibre();
    let rays = slanted();
    for (last, tolerance) in [(LastStep::Fractional, 1e-9), (LastStep::BrokenLine, 2e-2)] {
        let exits = GrinTracer::new(&field, into_block(last, LaunchMode::AsGiven))
            .unwrap()
            .trace_batch(&rays);
        for (ray, exit) in rays.iter().zip(&exits) {
            let (x, v) = exact(ray);
            assert_eq!(exit.fate, GrinFate::Left);
            let off = length(exit.x - x).max(length(exit.v - v));
            assert!(off < tolerance, "{last:?}: {off:e}");
            // Nothing bends it at the far face either: what it had too little of, it still lacks.
            let entry = ray.x + ray.v * ((-1.0 - ray.x.z) / ray.v.z);
            let index = field.sample(entry).index;
            let lacks = exit.excess - (1.0 - index * index);
            assert!(lacks.abs() < tolerance, "{last:?}: {lacks:e}");
        }
    }
}

/// The three ways to come in differ by what they make of the same jump.
#[test]
fn grin_each_launch_mode_treats_the_index_jump_as_documented() {
    let field = fibre();
    let rays = slanted();
    let exits = |launch| {
        GrinTracer::new(&field, into_block(LastStep::Fractional, launch))
            .unwrap()
            .trace_batch(&rays)
    };
    let [given, scaled, refracted] =
        [LaunchMode::AsGiven, LaunchMode::Scaled, LaunchMode::Refracted].map(exits);
    for i in 0..rays.len() {
        assert!(given[i].excess.abs() > 1.0, "{}", given[i].excess);
        assert!(scaled[i].excess.abs() < 1e-8 && refracted[i].excess.abs() < 1e-8);
        // Faster rays have less time to come to the axis.
        let off = length(given[i].x - scaled[i].x);
        assert!(off > 0.02, "ray {i}: {off}");
    }
    // Upright rays are not bent by the face, and leave it as they came but for the speed.
    let off = length(scaled[0].x - refracted[0].x);
    assert!(off < 1e-12, "{off:e}");
    let off = length(scaled[1].x - refracted[1].x);
    assert!(off > 1e-3, "{off:e}");
}

fn outcome(
    field: &dyn IndexField<f64>,
    setup: GrinSetup<f64>,
    rays: &[GrinRay<f64>],
) -> LossAndGradient<f64> {
    GrinTracer::new(field, setup).unwrap().loss_and_gradient(rays, |_, exit| bowl(exit))
}

/// A ray that enters across an index jump as given depends on the field inside alone; the adjoint
/// agrees, with a curved boundary as with a plane one.
#[test]
fn grin_the_gradient_of_rays_used_as_given_across_a_jump_agrees_with_differences() {
    let rays = slanted();
    for region in [block(), GrinRegion::ball(1.05)] {
        for last in [LastStep::Fractional, LastStep::BrokenLine] {
            let setup = || GrinSetup {
                launch: LaunchMode::AsGiven,
                // Not a whole number of steps: where one comes or goes, a broken line jumps.
                ..until(Integrator::BlanesMoan, 0.0487, region.clone(), last)
            };
            let found = outcome(&fibre(), setup(), &rays);
            assert_eq!(found.fates.count_of(GrinFate::Left), rays.len());
            let loss = |field: &ProfileField<Parabolic<f64>>, rays: &[GrinRay<f64>]| {
                outcome(field, setup(), rays).loss
            };
            let h = 1e-6;
            for (k, exact) in found.gradient.parameters.iter().enumerate() {
                let moved = |by: f64| {
                    let mut field = fibre();
                    field.parameters_mut()[k] += by;
                    loss(&field, &rays)
                };
                let difference = (moved(h) - moved(-h)) / (2.0 * h);
                let off = (exact - difference).abs() / (1.0 + difference.abs());
                assert!(off < 1e-7, "{last:?} parameter {k}: {exact} {difference}");
            }
            for (i, start) in found.gradient.starts.iter().enumerate() {
                let moved = |by: Vec3<f64>, turn: Vec3<f64>| {
                    let mut rays = rays.clone();
                    (rays[i].x, rays[i].v) = (rays[i].x + by, rays[i].v + turn);
                    loss(&fibre(), &rays)
                };
                let none = Vec3::default();
                for axis in [vec3([h, 0.0, 0.0]), vec3([0.0, h, 0.0]), vec3([0.0, 0.0, h])] {
                    let by_place = (moved(axis, none) - moved(-axis, none)) / (2.0 * h);
                    let by_speed = (moved(none, axis) - moved(none, -axis)) / (2.0 * h);
                    let [x, v] = [start.x, start.v].map(|by| by.dot(axis) / h);
                    let off = (x - by_place).abs().max((v - by_speed).abs());
                    assert!(off < 1e-6, "{last:?} ray {i}: {x} {by_place}, {v} {by_speed}");
                }
            }
        }
    }
}

/// Rays along z through nodes of the grid, beside them, and on its planes in x alone.
fn on_planes<R: Real>(shift: f64) -> Vec<GrinRay<R>> {
    let at = |x: f64, y: f64| GrinRay {
        x: Vec3::from_f64(vec3([x + shift, y + shift, -1.0])),
        v: Vec3::from_f64(vec3([0.0, 0.0, 1.0])),
    };
    (0..64).map(|i| at(f64::from(i % 8) / 8.0 - 0.4375, f64::from(i / 8) / 8.0 - 0.4375)).collect()
}

fn voxels<R: Real>() -> Trilinear<R> {
    let grid = RegularGrid::cube(33, R::ONE).unwrap();
    let value = |i: usize| R::from_f64(1.0 + 2e-3 * (i as f64 * 0.754878).fract());
    Trilinear::new(grid, (0..33usize.pow(3)).map(value).collect()).unwrap()
}

fn smooth<R: Real>() -> Tricubic<R> {
    let spread = |p: Vec3<R>| R::from_f64(1.2) - p.dot(p) * R::from_f64(0.02);
    Tricubic::approximate(32, R::ONE, spread).unwrap()
}

fn traced<R: Real>(
    field: &dyn IndexField<R>,
    step: f64,
    rays: &[GrinRay<R>],
) -> LossAndGradient<R> {
    let setup =
        until(Integrator::LeapfrogDkd, step, GrinRegion::cube(R::ONE), LastStep::BrokenLine);
    let outcome = GrinTracer::new(field, setup).unwrap().loss_and_gradient(rays, |_, exit| {
        if exit.fate.has_arrived() { bowl(exit) } else { (R::ONE, RayAdjoint::default()) }
    });
    assert!(outcome.loss.is_finite());
    assert!(outcome.gradient.parameters.iter().all(|g| g.is_finite()));
    outcome
}

/// The errors of exits and gradients in single precision, and the retrace error in steps.
fn off(single: &LossAndGradient<f32>, double: &LossAndGradient<f64>) -> [f64; 3] {
    let place = |e: &RayExit<f32>| Vec3::new(e.x.x, e.x.y, e.x.z).value();
    let pairs = single.exits.iter().zip(&double.exits);
    let worst = pairs.map(|(a, b)| length(place(a) - b.x)).fold(0.0, f64::max);
    let (mut square, mut norm) = (0.0, 0.0);
    for (a, b) in single.gradient.parameters.iter().zip(&double.gradient.parameters) {
        square += (f64::from(*a) - b).powi(2);
        norm += b * b;
    }
    [worst, (square / norm).sqrt(), Real::value(single.gradient.retrace_error)]
}

/// In single precision a ray on a plane of the grid, where the force of a trilinear field jumps, may
/// fall to the other side than in double precision, whatever the step; a digit beside it, or in a
/// field that is smooth, only digits are lost. The way back is that of the same numbers everywhere.
#[test]
fn grin_single_precision_along_grid_planes_loses_no_ray() {
    let (half, odd) = (1.0 / 32.0, 0.487 / 16.0);
    for (name, step, shift) in [
        ("on planes, half a voxel a step", half, 0.0),
        ("on planes, an odd step", odd, 0.0),
        ("a digit beside them, half a voxel a step", half, 3e-8),
        ("between planes, an odd step", odd, 0.0137),
    ] {
        let rays = on_planes(shift);
        let rough = traced::<f32>(&voxels(), step, &on_planes(shift));
        let [place, gradient, retrace] = off(&rough, &traced(&voxels(), step, &rays));
        println!("trilinear {name}: {place:.1e}, gradient {gradient:.1e}, retrace {retrace:.1e}");
        let jumps = shift == 0.0;
        let allowed = if jumps { [4e-3, 0.2] } else { [5e-6, 5e-5] };
        assert!(place < allowed[0] && gradient < allowed[1], "{name}: {place:e} {gradient:e}");
        assert!(!jumps || gradient > 1e-3, "the trap has gone: say so in the documentation");
        let smoothed = traced::<f32>(&smooth(), step, &on_planes(shift));
        let [place, gradient, retrace_smooth] = off(&smoothed, &traced(&smooth(), step, &rays));
        println!("tricubic {name}: {place:.1e}, gradient {gradient:.1e}, {retrace_smooth:.1e}");
        assert!(place < 5e-6 && gradient < 1e-4, "{name}: {place:e} {gradient:e}");
        assert!(retrace < 1e-3 && retrace_smooth < 1e-3, "{name}: {retrace:e} {retrace_smooth:e}");
        for outcome in [rough, smoothed] {
            assert_eq!(
                outcome.fates.count_of(GrinFate::Left),
                rays.len(),
                "{name}: {:?}",
                outcome.fates
            );
        }
    }
}
