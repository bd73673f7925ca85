//! Rays in gradient-index fields: error against time for every integrator, the cost of the adjoint,
//! and its memory compared with that of a stored path.
//!
//! All on one thread. The reference is the same field traced with very fine steps. A grid has an
//! interpolation error that smaller steps do not reduce; it is reported with the curves.

use super::grin_starts::GrinStarts;
use super::machine::{MemoryUse, peak_megabytes};
use super::spot::Precision;
use super::timing::time_ms;
use crate::grin::field::{GridError, HessianDiagonal, RegularGrid, Trilinear};
use crate::grin::{
    EndCondition, GrinRay, GrinRegion, GrinSetup, GrinSetupError, GrinTracer, IndexField,
    Integrator, LastStep, RayAdjoint, RayExit,
};
use crate::grin_design::{GrinTask, ReferenceField, ReferenceFieldError};
use crate::math::{Real, Vec3};
use rayon::ThreadPoolBuilder;
use serde::Serialize;
use std::hint::black_box;
use std::ops::ControlFlow;

/// A point of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GrinRow {
    /// The integrator.
    pub integrator: Integrator,
    /// The number type of the rays.
    pub precision: Precision,
    /// The mean number of field evaluations (kicks) per ray.
    pub kicks: f64,
    /// The time of the forward trace of all rays, in milliseconds.
    pub ms: f64,
    /// The time of the forward and adjoint trace of all rays, in milliseconds.
    pub gradient_ms: f64,
    /// The RMS error of the exit points, in mm.
    pub exit_error: f64,
    /// The relative error of the gradient by the parameters of the field.
    pub gradient_error: f64,
    /// The largest distance between a start point and its reconstruction by the adjoint trace, in
    /// steps.
    pub retrace_error: f64,
    /// The number of rays that do not exit, or that the adjoint trace cannot retrace.
    pub lost: usize,
}

/// The curves of one field.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GrinCurves {
    /// The name of the representation of the field.
    pub field: &'static str,
    /// The number of its parameters.
    pub parameters: usize,
    /// The RMS distance of its exit points from those of the exact field, in mm.
    pub floor: f64,
    /// The points of the curves.
    pub rows: Vec<GrinRow>,
}

/// The cost of a ray per field evaluation, traced in batches.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GrinCost {
    /// The name of the representation of the field.
    pub field: &'static str,
    /// The number type of the rays.
    pub precision: Precision,
    /// The time of the forward trace per evaluation, in nanoseconds.
    pub forward_ns: f64,
    /// The time of the adjoint trace per evaluation, in nanoseconds.
    pub back_ns: f64,
    /// The time of both relative to the forward trace.
    pub ratio: f64,
}

/// The memory of the adjoint compared with that of a stored path, on a trilinear grid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GrinMemory {
    /// The number of nodes along a side of the grid.
    pub nodes: usize,
    /// The number of rays.
    pub rays: usize,
    /// The mean number of steps of a ray.
    pub steps: f64,
    /// The memory that the adjoint keeps for the rays, in bytes.
    pub adjoint_bytes: usize,
    /// The memory of its per-thread gradients, in bytes.
    pub volume_bytes: usize,
    /// The memory of the stored paths, the minimum for reverse mode, in bytes.
    pub tape_bytes: usize,
    /// The memory of the process with the adjoint, if the system reports it.
    pub adjoint_memory: Option<MemoryUse>,
    /// The memory of the process with the stored paths, if the system reports it.
    pub tape_memory: Option<MemoryUse>,
    /// The time of the forward and adjoint trace in batches, in milliseconds.
    pub adjoint_ms: f64,
    /// The time with the stored path, one ray after the other, in milliseconds.
    pub tape_ms: f64,
    /// The relative difference between the two gradients.
    pub difference: f64,
}

/// The benchmark of a GRIN task.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GrinBenchmark {
    /// The number of rays of every measurement.
    pub rays: usize,
    /// The curves of each field.
    pub fields: Vec<GrinCurves>,
    /// The accuracy of the derivative by the start point of a ray.
    pub starts: Vec<GrinStarts>,
    /// The cost of a ray.
    pub costs: Vec<GrinCost>,
    /// The memory of a gradient.
    pub memory: Vec<GrinMemory>,
}

/// The error of a GRIN benchmark.
#[derive(Debug, thiserror::Error)]
pub enum GrinBenchmarkError {
    /// The task has no exact field to compare with.
    #[error("exact: found none; expected a task with a known exact field")]
    NoExact,
    /// The exact field is invalid.
    #[error(transparent)]
    Field(#[from] ReferenceFieldError),
    /// A grid is invalid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The tracing setup is invalid.
    #[error(transparent)]
    Setup(#[from] GrinSetupError),
    /// No ray exits.
    #[error("views: found no ray that leaves the space; expected light that passes through it")]
    NoLight,
    /// The thread pool cannot be created.
    #[error("no thread to measure with: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// Rays of every measurement.
const RAYS: usize = 512;
/// The numbers of field evaluations per ray of the curves, and that of the reference.
const KICKS: [f64; 6] = [14.0, 28.0, 56.0, 112.0, 224.0, 448.0];
const REFERENCE_KICKS: f64 = 16_384.0;
/// The steps across the field of the coarse trace that finds the path lengths.
const COARSE_STEPS: f64 = 300.0;
/// The nodes along a side of the grids of the curves, and of the cost measurement.
const NODES: usize = 33;
const COST_NODES: usize = 65;
/// Nodes along a side and steps per voxel of the memory measurements.
const MEMORY: [(usize, f64); 5] = [(17, 2.0), (33, 2.0), (65, 1.0), (65, 2.0), (65, 4.0)];
/// The side of the cube of a grid, relative to that of the field.
const MARGIN: f64 = 1.1;
/// A measurement is repeated up to this total time in ms, or this many times.
const LONG_ENOUGH: f64 = 10.0;
const OFTEN_ENOUGH: usize = 7;
/// A ray counts as trapped after this many times the steps of the longest ray.
const TRAPPED: f64 = 8.0;

/// Measures a task with a known exact field, with the light of its first view. `report` receives
/// the numbers of finished and of all parts; those so far are returned once it breaks.
///
/// # Errors
/// A task without an exact field, or without light.
pub fn measure_grin(
    task: &GrinTask,
    mut report: impl FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<GrinBenchmark, GrinBenchmarkError> {
    let pool = ThreadPoolBuilder::new().num_threads(1).build()?;
    let scene = pool.install(|| GrinBenchmarkScene::new(task))?;
    let all = 4 + COSTS.len() + MEMORY.len();
    let mut done = 0;
    let mut report_part = || {
        done += 1;
        report(done, all).is_break()
    };
    let mut measured = GrinBenchmark {
        rays: scene.rays.len(),
        fields: vec![],
        starts: pool.install(|| scene.starts())?,
        costs: vec![],
        memory: vec![],
    };
    let mut stopped = report_part();
    for made in
        [BenchmarkField::Exact, BenchmarkField::Tricubic(NODES), BenchmarkField::Trilinear(NODES)]
    {
        if stopped {
            break;
        }
        measured.fields.push(pool.install(|| scene.curves(made))?);
        stopped = report_part();
    }
    for (made, precision) in COSTS {
        if stopped {
            break;
        }
        measured.costs.push(pool.install(|| scene.cost(made, precision))?);
        stopped = report_part();
    }
    for (nodes, per_voxel) in MEMORY {
        if stopped {
            break;
        }
        measured.memory.push(pool.install(|| scene.memory(nodes, per_voxel))?);
        stopped = report_part();
    }
    Ok(measured)
}

/// The representation of a field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum BenchmarkField {
    Exact,
    Tricubic(usize),
    /// Trilinear with the smoothed Hessian.
    Trilinear(usize),
}

const COSTS: [(BenchmarkField, Precision); 6] = [
    (BenchmarkField::Trilinear(COST_NODES), Precision::F64),
    (BenchmarkField::Trilinear(COST_NODES), Precision::F32),
    (BenchmarkField::Tricubic(NODES), Precision::F64),
    (BenchmarkField::Tricubic(NODES), Precision::F32),
    (BenchmarkField::Exact, Precision::F64),
    (BenchmarkField::Exact, Precision::F32),
];

impl BenchmarkField {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Tricubic(NODES) => "tricubic 33",
            Self::Tricubic(_) => "tricubic 65",
            Self::Trilinear(NODES) => "trilinear 33",
            Self::Trilinear(_) => "trilinear 65",
        }
    }
}

/// The field of a task and the rays to trace through it.
pub(super) struct GrinBenchmarkScene<'a> {
    task: &'a GrinTask,
    pub(super) exact: &'a ReferenceField,
    region: GrinRegion<f64>,
    /// Half the side of the cube of a grid, in mm.
    pub(super) half: f64,
    pub(super) rays: Vec<GrinRay<f64>>,
    /// The length of the longest ray in σ.
    longest_path: f64,
    /// The minimum of the loss that is differentiated.
    loss_minimum: Vec3<f64>,
    /// The exit states in the exact field.
    exits: Vec<RayExit<f64>>,
}

/// The exits and the gradient of a trace.
struct GrinTraceResult {
    exits: Vec<Option<Vec3<f64>>>,
    gradient: Vec<f64>,
    retrace_error: f64,
    kicks: f64,
    ms: f64,
    gradient_ms: f64,
}

impl<'a> GrinBenchmarkScene<'a> {
    fn new(task: &'a GrinTask) -> Result<Self, GrinBenchmarkError> {
        let exact = task.exact.as_ref().ok_or(GrinBenchmarkError::NoExact)?;
        let (space, rays) = task.scoring_rays(&task.views[0]);
        let stride = rays.len().div_ceil(RAYS).max(1);
        let [low, high] = space.corners();
        let size = [low.x, low.y, low.z, high.x, high.y, high.z].into_iter().map(f64::abs);
        let size = size.fold(0.0, f64::max);
        let mut scene = Self {
            task,
            exact,
            region: space.region(),
            half: MARGIN * size,
            rays: rays.into_iter().step_by(stride).collect(),
            longest_path: space.diameter(),
            loss_minimum: Vec3::new(0.3, -0.2, 0.5) * size,
            exits: Vec::new(),
        };
        // First coarsely, then as finely as the length of the longest ray requires.
        let field = exact.field::<f64>()?;
        for kicks in [COARSE_STEPS, REFERENCE_KICKS] {
            let setup = scene.setup(Integrator::BlanesMoan, kicks);
            let step = setup.step;
            scene.exits = GrinTracer::new(&*field, setup)?.trace_batch(&scene.rays);
            let arrived = scene.exits.iter().filter(|exit| exit.fate.has_arrived());
            let most = arrived.map(|exit| exit.steps).max().ok_or(GrinBenchmarkError::NoLight)?;
            scene.longest_path = f64::from(most) * step;
        }
        Ok(scene)
    }

    /// The tracing setup with this many kicks along the longest ray.
    pub(super) fn setup<R: Real>(&self, integrator: Integrator, kicks: f64) -> GrinSetup<R> {
        let steps = kicks / integrator.kicks_per_step() as f64;
        let limit = (TRAPPED * steps).max(64.0) as u32;
        GrinSetup {
            integrator,
            step: R::from_f64(self.longest_path / steps),
            launch: self.task.launch,
            end: EndCondition::Boundary {
                region: self.region.cast(),
                last: LastStep::Fractional,
                limit,
            },
            screen: None,
        }
    }

    /// The coarse setup: about half a voxel of the finest grid per step, but no simple fraction of
    /// it.
    fn coarse_setup<R: Real>(&self) -> GrinSetup<R> {
        let step = 0.487 * 2.0 * self.half / (COST_NODES - 1) as f64;
        let setup = self.setup(Integrator::LeapfrogDkd, self.longest_path / step);
        let limit = (TRAPPED * self.longest_path / step) as u32;
        let end = EndCondition::Boundary {
            region: self.region.cast(),
            last: LastStep::BrokenLine,
            limit,
        };
        GrinSetup { end, ..setup }
    }

    pub(super) fn field<R: Real>(
        &self,
        made: BenchmarkField,
    ) -> Result<Box<dyn IndexField<R>>, ReferenceFieldError> {
        match made {
            BenchmarkField::Exact => self.exact.field(),
            BenchmarkField::Tricubic(nodes) => self.exact.sample_on_grid(true, nodes, self.half),
            BenchmarkField::Trilinear(nodes) => self.exact.sample_on_grid(false, nodes, self.half),
        }
    }

    fn converted_rays<R: Real>(&self) -> Vec<GrinRay<R>> {
        self.rays.iter().map(GrinRay::cast).collect()
    }

    /// The derivatives of the loss by each exit.
    fn seeds<R: Real>(&self, exits: &[RayExit<R>]) -> Vec<RayAdjoint<R>> {
        let share = 2.0 / exits.len() as f64;
        let seed = |exit: &RayExit<R>| {
            let x = Vec3::from_f64((exit.x.value() - self.loss_minimum) * share);
            RayAdjoint { x, ..RayAdjoint::default() }
        };
        exits.iter().map(seed).collect()
    }

    /// Traces all rays forwards and back; repeated `often` times for its time.
    fn trace<R: Real>(
        &self,
        field: &dyn IndexField<R>,
        setup: GrinSetup<R>,
        often: usize,
    ) -> Result<GrinTraceResult, GrinBenchmarkError> {
        let rays = self.converted_rays();
        let kicks = setup.integrator.kicks_per_step() as f64;
        let tracer = GrinTracer::new(field, setup)?;
        let (mut exits, ms) = fastest(often, || tracer.trace_batch(&rays));
        let seeds = self.seeds(&exits);
        let (gradient, back_ms) = fastest(often, || tracer.gradient(&rays, &mut exits, &seeds));
        let steps: f64 = exits.iter().map(|exit| f64::from(exit.steps)).sum();
        Ok(GrinTraceResult {
            kicks: kicks * steps / exits.len() as f64,
            exits: exits.iter().map(|e| e.fate.has_arrived().then_some(e.x.value())).collect(),
            gradient: gradient.parameters.iter().map(|g| g.value()).collect(),
            retrace_error: gradient.retrace_error,
            ms,
            gradient_ms: ms + back_ms,
        })
    }

    fn curves(&self, made: BenchmarkField) -> Result<GrinCurves, GrinBenchmarkError> {
        let (double, single) = (self.field::<f64>(made)?, self.field::<f32>(made)?);
        let fine = self.setup(Integrator::BlanesMoan, REFERENCE_KICKS);
        let reference = self.trace(&*double, fine, 1)?;
        let ideal: Vec<Option<Vec3<f64>>> =
            self.exits.iter().map(|exit| exit.fate.has_arrived().then_some(exit.x)).collect();
        let mut rows = Vec::new();
        for integrator in Integrator::ALL {
            for kicks in KICKS {
                let in_f64 = self.setup(integrator, kicks);
                let found = self.trace(&*double, in_f64, OFTEN_ENOUGH)?;
                rows.push(row(integrator, Precision::F64, &found, &reference));
                let in_f32 = self.setup(integrator, kicks);
                let found = self.trace(&*single, in_f32, OFTEN_ENOUGH)?;
                rows.push(row(integrator, Precision::F32, &found, &reference));
            }
        }
        let floor = distance(&reference.exits, &ideal);
        let parameters = double.parameters().len();
        Ok(GrinCurves { field: made.name(), parameters, floor, rows })
    }

    fn cost(
        &self,
        made: BenchmarkField,
        precision: Precision,
    ) -> Result<GrinCost, GrinBenchmarkError> {
        let found = match precision {
            Precision::F64 => self.trace(&*self.field::<f64>(made)?, self.coarse_setup(), 40)?,
            Precision::F32 => self.trace(&*self.field::<f32>(made)?, self.coarse_setup(), 40)?,
        };
        let each = |ms: f64| 1e6 * ms / (found.kicks * self.rays.len() as f64);
        let back = found.gradient_ms - found.ms;
        Ok(GrinCost {
            field: made.name(),
            precision,
            forward_ns: each(found.ms),
            back_ns: each(back),
            ratio: found.gradient_ms / found.ms,
        })
    }

    fn memory(&self, nodes: usize, per_voxel: f64) -> Result<GrinMemory, GrinBenchmarkError> {
        let exact = self.exact.field::<f64>()?;
        let grid = RegularGrid::cube(nodes, self.half)?;
        let mut field = Trilinear::from_function(grid, |p| exact.sample(p).index)?;
        field.diagonal = HessianDiagonal::Exact;
        let kicks = self.longest_path * per_voxel / (0.974 * field.grid().spacing().x);
        let tracer = GrinTracer::new(&field, self.setup(Integrator::LeapfrogDkd, kicks))?;
        let rays = &self.rays;
        let mut exits = tracer.trace_batch(rays);
        let seeds = self.seeds(&exits);
        // The adjoint runs first, so that both gradients use the same rays.
        let adjoint = tracer.gradient(rays, &mut exits, &seeds);
        let tape = tracer.tape_gradient(rays, &exits, &seeds);
        let difference = relative(&tape.parameters, &adjoint.parameters);
        let by_adjoint = || {
            let mut exits = tracer.trace_batch(rays);
            let seeds = self.seeds(&exits);
            drop(black_box(tracer.gradient(rays, &mut exits, &seeds)));
        };
        let by_tape = || {
            let exits = tracer.trace_batch(rays);
            let seeds = self.seeds(&exits);
            drop(black_box(tracer.tape_gradient(rays, &exits, &seeds)));
        };
        let [adjoint_bytes, volume_bytes] = tracer.gradient_bytes(rays.len());
        let steps: f64 = exits.iter().map(|exit| f64::from(exit.steps)).sum();
        Ok(GrinMemory {
            nodes,
            rays: rays.len(),
            steps: steps / rays.len() as f64,
            adjoint_bytes,
            volume_bytes,
            tape_bytes: tape.bytes,
            adjoint_memory: peak_megabytes(by_adjoint),
            tape_memory: peak_megabytes(by_tape),
            adjoint_ms: fastest(OFTEN_ENOUGH, by_adjoint).1,
            tape_ms: fastest(OFTEN_ENOUGH, by_tape).1,
            difference,
        })
    }
}

fn row(
    integrator: Integrator,
    precision: Precision,
    found: &GrinTraceResult,
    reference: &GrinTraceResult,
) -> GrinRow {
    GrinRow {
        integrator,
        precision,
        kicks: found.kicks,
        ms: found.ms,
        gradient_ms: found.gradient_ms,
        exit_error: distance(&found.exits, &reference.exits),
        gradient_error: relative(&found.gradient, &reference.gradient),
        retrace_error: found.retrace_error,
        lost: found.exits.iter().filter(|exit| exit.is_none()).count(),
    }
}

/// The RMS distance of the exits, over the rays that exit in both.
fn distance(found: &[Option<Vec3<f64>>], exact: &[Option<Vec3<f64>>]) -> f64 {
    let pairs = found.iter().zip(exact).filter_map(|(a, b)| Some((*a)? - (*b)?));
    let squares: Vec<f64> = pairs.map(|d| d.dot(d)).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn relative(found: &[f64], exact: &[f64]) -> f64 {
    let square = |v: &mut dyn Iterator<Item = f64>| v.map(|v| v * v).sum::<f64>();
    let off = square(&mut found.iter().zip(exact).map(|(a, b)| a - b));
    (off / square(&mut exact.iter().copied())).sqrt()
}

/// The result of `work` and the shortest of several times, in milliseconds.
fn fastest<T>(often: usize, mut work: impl FnMut() -> T) -> (T, f64) {
    let (mut result, mut best) = time_ms(&mut work);
    let mut spent = best;
    for i in 1..often {
        if i >= 3 && spent > LONG_ENOUGH * often as f64 / OFTEN_ENOUGH as f64 {
            break;
        }
        let (again, ms) = time_ms(&mut work);
        (result, best, spent) = (again, best.min(ms), spent + ms);
    }
    (result, best)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exits_are_as_far_apart_as_pythagoras_says_and_lost_ones_do_not_count() {
        let at = |x: f64, y: f64, z: f64| Some(Vec3::new(x, y, z));
        let found = [at(1.0, 2.0, 3.0), None, at(0.0, 0.0, 0.0), at(5.0, 5.0, 5.0)];
        let exact = [at(1.0, 5.0, 7.0), at(9.0, 9.0, 9.0), None, at(5.0, 5.0, 4.0)];
        // 5 and 1 apart.
        assert!((distance(&found, &exact) - 13f64.sqrt()).abs() < 1e-12);
        assert_eq!(distance(&found[2..], &found[2..]), 0.0);
    }
}
