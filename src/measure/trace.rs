//! Throughput of the tracer in ray-surfaces per second, with the rounding error of each precision.

use super::double_gauss::{bundle, double_gauss};
use super::machine::{MemoryUse, peak_megabytes};
use super::rounding::{Rounding, measure_rounding};
use super::timing::{RateStatistics, TimedCase, time_interleaved};
use crate::lens::{
    ApertureShape, LensError, Pose, Shape, SurfaceAperture, System, SystemError, glass::line,
};
use crate::math::{Real, Vec3};
use crate::merit::MeritError;
use crate::trace::{AdjointSeed, ImagePoints, Ray, Rays, SimdWidth, Tracer};
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::Serialize;
use std::hint::black_box;
use std::sync::atomic::AtomicBool;

/// Rays of a repetition on one thread.
const RAYS: usize = 2 * 4096;
/// Rays of a repetition on two threads: 24 tasks.
const SHARED_RAYS: usize = 24 * 4096;
/// Rays traced one at a time in a repetition.
const SINGLE_RAYS: usize = 512;
/// Rays on which rounding is measured.
const ROUNDED_RAYS: usize = 4096;
/// Rays for which memory is measured.
const MANY_RAYS: usize = 1_000_000;
const TURN: f64 = 5e-4; // seconds: much shorter than what a busy system grants at once

const FORWARD: &str = "f64_batch_1_thread";
const GRADIENT: &str = "gradient";

/// The throughput of the tracer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Throughput {
    /// The number of surfaces of the lens, including the image plane.
    pub surfaces: usize,
    /// The number of repetitions of each way of tracing.
    pub turns: usize,
    /// One row per way of tracing.
    pub rows: Vec<TraceRow>,
    /// Rounding in `f64` against twice the precision.
    pub rounding_f64: Rounding,
    /// Rounding in `f32` against twice the precision.
    pub rounding_f32: Rounding,
    /// The time of the derivatives by all parameters, including the forward trace, relative to the
    /// forward trace of the same rays.
    pub gradient_over_forward: f64,
    /// The memory of tracing a million rays, including the rays.
    pub memory_trace: Option<MemoryUse>,
    /// The memory of the derivatives of a million rays by all parameters, including the rays.
    pub memory_gradient: Option<MemoryUse>,
}

/// The throughput of one way of tracing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TraceRow {
    /// The name of the way of tracing.
    pub name: &'static str,
    /// The median, in millions of ray-surfaces per second.
    pub million_ray_surfaces_per_s: f64,
    /// The slowest repetition, likewise.
    pub min: f64,
    /// The fastest repetition, likewise.
    pub max: f64,
}

impl TraceRow {
    fn new(name: &'static str, rate: RateStatistics) -> Self {
        let RateStatistics { median, min, max } = rate.times(1e-6);
        Self { name, million_ray_surfaces_per_s: median, min, max }
    }
}

/// The error of a benchmark of the tracer or of the optimizers.
#[derive(Debug, thiserror::Error)]
pub enum BenchmarkError {
    /// The prescription is invalid.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// The system is invalid.
    #[error(transparent)]
    Invalid(#[from] SystemError),
    /// The lens has no merit.
    #[error(transparent)]
    Merit(#[from] MeritError),
    /// The thread pool cannot be created.
    #[error("no threads to measure with: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// The variants of the lens that are timed.
struct TracerVariants {
    plain: Tracer<f64>,
    single_precision: Tracer<f32>,
    spheres: Tracer<f64>,
    conics: Tracer<f64>,
    aspheres: Tracer<f64>,
    tilted: Tracer<f64>,
    framed: Tracer<f64>,
}

impl TracerVariants {
    fn new(system: &System<f64>) -> Result<Self, SystemError> {
        let reshaped = |f: fn(usize, Shape<f64>) -> Shape<f64>| {
            let mut system = system.clone();
            for (i, surface) in system.surfaces.iter_mut().enumerate() {
                surface.shape = f(i, surface.shape);
            }
            Tracer::new(&system)
        };
        Ok(Self {
            plain: Tracer::new(system)?,
            single_precision: Tracer::new(&system.cast())?,
            spheres: reshaped(|_, shape| Shape::Sphere { curvature: shape.curvature() })?,
            conics: reshaped(|_, shape| Shape::Conic { curvature: shape.curvature(), conic: 0.0 })?,
            aspheres: reshaped(with_asphere)?,
            tilted: Tracer::new(&tilted(system))?,
            framed: Tracer::new(&framed(system))?,
        })
    }
}

/// The system with every surface but the image plane decentred and tilted a little.
fn tilted(system: &System<f64>) -> System<f64> {
    let mut tilted = system.clone();
    let (_, lens) = tilted.surfaces.split_last_mut().unzip();
    for surface in lens.into_iter().flatten() {
        surface.pose = Some(Pose::new([1e-3, -1e-3], [1e-4, -1e-4]));
    }
    tilted
}

/// The system with a square aperture around all rays on its first surface.
fn framed(system: &System<f64>) -> System<f64> {
    let mut framed = system.clone();
    let (half_width, half_height) = (AROUND, AROUND);
    let square = ApertureShape::Rectangle { half_width, half_height };
    framed.surfaces[0].apertures.push(SurfaceAperture::inside(square));
    framed
}

/// Half of the width of an aperture around all rays, in mm.
const AROUND: f64 = 100.0;

/// The shape of a surface, with the first and the last glass surface as aspheres.
fn with_asphere(i: usize, shape: Shape<f64>) -> Shape<f64> {
    if i != 0 && i != 10 {
        return shape;
    }
    let mut terms = [0.0; crate::lens::ASPHERE_TERMS];
    (terms[0], terms[1]) = (1e-9, 1e-13);
    Shape::Asphere { curvature: shape.curvature(), conic: 0.0, terms }
}

/// Times every way of tracing in turn, `turns` repetitions each, or as many as there are, but at
/// least one, when `stop` becomes true.
pub fn measure_throughput(turns: usize, stop: &AtomicBool) -> Result<Throughput, BenchmarkError> {
    let system = double_gauss().resolve(0, line::D)?;
    let tracers = TracerVariants::new(&system)?;
    let pool = ThreadPoolBuilder::new().num_threads(2).build()?;
    let memory_trace = peak_megabytes(|| trace_many(&tracers.plain));
    let memory_gradient = peak_megabytes(|| differentiate_many(&tracers.plain));
    let (names, mut contestants): (Vec<_>, Vec<_>) =
        timed_cases(&tracers, &pool).into_iter().unzip();
    let (rates, turns) = time_interleaved(&mut contestants, turns, TURN, stop);
    let rows: Vec<TraceRow> =
        names.into_iter().zip(rates).map(|(name, rate)| TraceRow::new(name, rate)).collect();
    let rate = |name| {
        let row = rows.iter().find(|row| row.name == name);
        row.map_or(f64::NAN, |row| row.million_ray_surfaces_per_s)
    };
    Ok(Throughput {
        surfaces: tracers.plain.surfaces(),
        turns,
        gradient_over_forward: rate(FORWARD) / rate(GRADIENT),
        rows,
        rounding_f64: measure_rounding::<f64>(&system, ROUNDED_RAYS)?,
        rounding_f32: measure_rounding::<f32>(&system, ROUNDED_RAYS)?,
        memory_trace,
        memory_gradient,
    })
}

fn timed_cases<'a>(
    tracers: &'a TracerVariants,
    pool: &'a ThreadPool,
) -> Vec<(&'static str, TimedCase<'a>)> {
    let TracerVariants { plain, single_precision, spheres, conics, aspheres, tilted, framed } =
        tracers;
    vec![
        (FORWARD, batch(plain, SimdWidth::Bits512)),
        ("f64_batch_2_threads", on_two_threads(plain, pool)),
        ("f64_batch_1_thread_spheres", batch(spheres, SimdWidth::Bits512)),
        ("f64_batch_1_thread_conics", batch(conics, SimdWidth::Bits512)),
        ("f64_batch_1_thread_2_aspheres", batch(aspheres, SimdWidth::Bits512)),
        ("f64_batch_1_thread_tilted", batch(tilted, SimdWidth::Bits512)),
        ("f64_batch_1_thread_square", batch(framed, SimdWidth::Bits512)),
        ("f64_batch_avx2", batch(plain, SimdWidth::Bits256)),
        ("f64_batch_baseline", batch(plain, SimdWidth::Baseline)),
        ("f64_single", single_rays(plain)),
        ("f32_batch_1_thread", batch(single_precision, SimdWidth::Bits512)),
        (GRADIENT, gradient(plain)),
        ("gradient_2_aspheres", gradient(aspheres)),
        ("gradient_tilted", gradient(tilted)),
        ("gradient_2_threads", gradient_on_two_threads(plain, pool)),
    ]
}

fn ray_surfaces<R: Real>(tracer: &Tracer<R>, rays: usize) -> f64 {
    (tracer.surfaces() * rays) as f64
}

fn batch<R: Real>(tracer: &Tracer<R>, width: SimdWidth) -> TimedCase<'_> {
    let (rays, mut points) = (cast_rays(&bundle(RAYS)), ImagePoints::<R>::default());
    let turn = Box::new(move || {
        tracer.trace_batch_with(width, &rays, &mut points);
        black_box(&points);
    });
    TimedCase { work: ray_surfaces(tracer, RAYS), repetition: turn }
}

fn on_two_threads<'a>(tracer: &'a Tracer<f64>, pool: &'a ThreadPool) -> TimedCase<'a> {
    let (rays, mut points) = (bundle(SHARED_RAYS), ImagePoints::default());
    let turn = Box::new(move || {
        pool.install(|| tracer.trace_batch_parallel(&rays, &mut points));
        black_box(&points);
    });
    TimedCase { work: ray_surfaces(tracer, SHARED_RAYS), repetition: turn }
}

fn single_rays(tracer: &Tracer<f64>) -> TimedCase<'_> {
    let rays: Vec<Ray<f64>> = {
        let bundle = bundle(SINGLE_RAYS);
        (0..SINGLE_RAYS).map(|i| bundle.get(i)).collect()
    };
    let turn = Box::new(move || {
        for ray in &rays {
            black_box(tracer.trace(*ray));
        }
    });
    TimedCase { work: ray_surfaces(tracer, SINGLE_RAYS), repetition: turn }
}

/// The derivative of a sum of squares over the image by the image point of a ray.
fn seed(ray: usize) -> AdjointSeed<f64> {
    let (x, y) = ((ray % 7) as f64 * 1e-3, (ray % 5) as f64 * 1e-3);
    AdjointSeed { point: Vec3::new(x, y, 0.0), ..AdjointSeed::default() }
}

fn gradient(tracer: &Tracer<f64>) -> TimedCase<'_> {
    let rays = bundle(RAYS);
    let turn = Box::new(move || {
        black_box(tracer.gradient(&rays, seed));
    });
    TimedCase { work: ray_surfaces(tracer, RAYS), repetition: turn }
}

fn gradient_on_two_threads<'a>(tracer: &'a Tracer<f64>, pool: &'a ThreadPool) -> TimedCase<'a> {
    let rays = bundle(SHARED_RAYS);
    let turn = Box::new(move || {
        black_box(pool.install(|| tracer.gradient_parallel(&rays, seed)));
    });
    TimedCase { work: ray_surfaces(tracer, SHARED_RAYS), repetition: turn }
}

/// The rays converted to another number type.
fn cast_rays<R: Real>(rays: &Rays<f64>) -> Rays<R> {
    let column = |from: &[f64]| from.iter().map(|v| R::from_f64(*v)).collect();
    Rays {
        x: column(&rays.x),
        y: column(&rays.y),
        z: column(&rays.z),
        l: column(&rays.l),
        m: column(&rays.m),
        n: column(&rays.n),
    }
}

fn trace_many(tracer: &Tracer<f64>) {
    let (rays, mut points) = (bundle(MANY_RAYS), ImagePoints::default());
    tracer.trace_batch(&rays, &mut points);
    black_box(&points);
}

fn differentiate_many(tracer: &Tracer<f64>) {
    let rays = bundle(MANY_RAYS);
    black_box(tracer.gradient(&rays, seed));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_surfaces_become_aspheres() {
        let sphere = Shape::Sphere { curvature: 0.01 };
        let surfaces = (0..12).map(|i| with_asphere(i, sphere));
        assert_eq!(surfaces.filter(|shape| matches!(shape, Shape::Asphere { .. })).count(), 2);
    }
}
