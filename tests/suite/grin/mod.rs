//! Light in gradient-index fields.

mod fields;
mod gradient;
mod hard;
mod lenses;
mod plan;
mod reference;

use aplanat::grin::{End, Exit, Integrator, LastStep, Launch, Ray, Region, Seed, Setup};
use aplanat::math::{Real, Vec3};

/// A vector of plain numbers.
pub(crate) fn vec3([x, y, z]: [f64; 3]) -> Vec3<f64> {
    Vec3::new(x, y, z)
}

pub(crate) fn length(v: Vec3<f64>) -> f64 {
    v.dot(v).sqrt()
}

/// Rays that end after so many steps.
pub(crate) fn steps<R: Real>(integrator: Integrator, step: f64, count: u32) -> Setup<R> {
    let (step, launch, end) = (R::from_f64(step), Launch::AsGiven, End::Steps(count));
    Setup { integrator, step, launch, end, screen: None }
}

/// Rays that end at a boundary.
pub(crate) fn until<R: Real>(
    integrator: Integrator,
    step: f64,
    region: Region<R>,
    last: LastStep,
) -> Setup<R> {
    let end = End::Boundary { region, last, limit: 100_000 };
    Setup { integrator, step: R::from_f64(step), launch: Launch::AsGiven, end, screen: None }
}

/// A smooth loss with every kind of derivative.
pub(crate) fn bowl<R: Real>(exit: &Exit<R>) -> (R, Seed<R>) {
    let c = R::from_f64;
    let (dx, dv) = (
        exit.x - Vec3::from_f64(vec3([0.9375, 0.1875, -0.125])),
        exit.v - Vec3::from_f64(vec3([1.125, -0.0625, 0.25])),
    );
    let dp = exit.path - c(1.3);
    let loss = dx.dot(dx) + c(0.5) * dv.dot(dv) + c(0.3) * dp * dp;
    (loss, Seed { x: dx * c(2.0), v: dv, path: c(0.6) * dp })
}

/// Rays from a square of side `2 half` at `z`, towards +z, a little off the grid.
pub(crate) fn beam(count: usize, half: f64, z: f64) -> Vec<Ray<f64>> {
    let at = |i: usize| half * (2.0 * (i as f64 + 0.5137) / count as f64 - 1.0);
    let ray =
        |n: usize| Ray { x: vec3([at(n % count), at(n / count), z]), v: vec3([0.0, 0.0, 1.0]) };
    (0..count * count).map(ray).collect()
}
