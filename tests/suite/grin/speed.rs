//! The speed of rays, printed without a limit, since other processes may interfere. In a release
//! build on one thread: `cargo test --release --no-default-features --test suite -- grin_speed
//! --nocapture`.
#![expect(clippy::disallowed_methods, reason = "it measures time and decides nothing by it")]

use super::{bowl, until, vec3};
use aplanat::grin::field::{
    BSpline, HessianDiagonal, Luneburg, ProfileField, RegularGrid, Tricubic, Trilinear,
};
use aplanat::grin::{
    GrinRay, GrinRegion, GrinTracer, IndexField, Integrator, LastStep, RayAdjoint,
};
use aplanat::math::Vec3;
use rayon::ThreadPoolBuilder;
use std::time::{Duration, Instant};

/// Runs of each measurement; the fastest counts. A build for debugging is not worth measuring.
const RUNS: usize = if cfg!(debug_assertions) { 1 } else { 40 };

fn fastest(mut work: impl FnMut()) -> Duration {
    let run = || {
        let start = Instant::now();
        work();
        start.elapsed()
    };
    std::iter::repeat_with(run).take(RUNS).min().unwrap_or_default()
}

/// Nanoseconds per ray and kick, forwards and backwards.
fn measure(
    name: &str,
    field: &dyn IndexField<f64>,
    integrator: Integrator,
    step: f64,
    last: LastStep,
) {
    let tracer =
        GrinTracer::new(field, until(integrator, step, GrinRegion::cube(1.0), last)).unwrap();
    let at = |i: usize| 0.7 * (2.0 * (i as f64 + 0.5137) / 24.0 - 1.0);
    let ray =
        |n: usize| GrinRay { x: vec3([at(n % 24), at(n / 24), -0.99]), v: vec3([0.01, 0.02, 1.0]) };
    let rays: Vec<_> = (0..24 * 24).map(ray).collect();
    let mut exits = tracer.trace_batch(&rays);
    assert!(exits.iter().all(|exit| exit.fate.has_arrived()), "{name}");
    let seeds: Vec<RayAdjoint<f64>> = exits.iter().map(|exit| bowl(exit).1).collect();
    let kicks =
        exits.iter().map(|exit| exit.steps as usize).sum::<usize>() * integrator.kicks_per_step();
    let forward = fastest(|| drop(tracer.trace_batch(&rays)));
    let back = fastest(|| drop(tracer.gradient(&rays, &mut exits, &seeds)));
    let each = |time: Duration| time.as_secs_f64() * 1e9 / kicks as f64;
    println!(
        "{name}: {:.1} ns forwards, {:.1} ns backwards a ray and kick; both {:.2} times forwards",
        each(forward),
        each(back),
        1.0 + back.as_secs_f64() / forward.as_secs_f64()
    );
}

#[test]
fn grin_speed_of_rays_forwards_and_backwards() {
    let index = |p: Vec3<f64>| (2.0 - p.dot(p).min(1.0)).sqrt();
    let mut grid = Trilinear::from_function(RegularGrid::cube(65, 1.0).unwrap(), index).unwrap();
    let cubic = Tricubic::approximate(32, 1.0, index).unwrap();
    let spline = BSpline::new(0.0, 3.0, vec![1.4, 1.35, 1.3, 1.2, 1.1, 1.05, 1.04]).unwrap();
    let (dkd, bm) = (Integrator::LeapfrogDkd, Integrator::BlanesMoan);
    let (broken, cut) = (LastStep::BrokenLine, LastStep::Fractional);
    let voxel = 0.487 / 32.0;
    ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(|| {
        measure("trilinear 65, smoothed", &grid, dkd, voxel, broken);
        grid.diagonal = HessianDiagonal::Exact;
        measure("trilinear 65, exact", &grid, dkd, voxel, broken);
        measure("tricubic 33", &cubic, bm, 2.0 * voxel, cut);
        measure("radial b-spline", &ProfileField::sphere(spline), bm, 0.05, cut);
        measure("luneburg", &ProfileField::sphere(Luneburg::new(1.8)), bm, 0.05, cut);
    });
}
