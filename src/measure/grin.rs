//! Light in gradient-index fields: error against time for every integrator, what the way back
//! costs, and the memory of the adjoint against that of a stored path.
//!
//! All on one thread. The reference is the same field traced with very fine steps: a grid has an
//! error of its own, which no step takes away and which is told beside its curves.

use super::clock::timed;
use super::grin_starts::GrinStarts;
use super::memory::{Memory, peak_megabytes};
use super::spot::Precision;
use crate::grin::field::{Diagonal, Grid, GridError, Trilinear};
use crate::grin::{
    End, Exit, Field, Integrator, LastStep, Ray, Region, Seed, Setup, SetupError, Tracer,
};
use crate::grin_task::{Exact, NoField, Task};
use crate::math::{Real, Vec3};
use rayon::ThreadPoolBuilder;
use serde::Serialize;
use std::hint::black_box;

/// One point of the curves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GrinRow {
    /// The kind of step.
    pub integrator: Integrator,
    /// The number type of the rays.
    pub precision: Precision,
    /// How often a ray asks the field, on average.
    pub kicks: f64,
    /// All rays forwards, in milliseconds.
    pub ms: f64,
    /// All rays forwards and back, with the gradient.
    pub gradient_ms: f64,
    /// The root of the mean square error of the exits, in mm.
    pub exit_error: f64,
    /// The relative error of the gradient by the numbers of the field.
    pub gradient_error: f64,
    /// The largest distance between a start and the end of its way back, in steps.
    pub retrace_error: f64,
    /// Rays that do not arrive, or whose way back goes astray.
    pub lost: usize,
}

/// The curves of one field.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GrinCurves {
    /// How the field is made up.
    pub field: &'static str,
    /// How many numbers it has.
    pub parameters: usize,
    /// How far its exits are from those of the exact field, root mean square, in mm.
    pub floor: f64,
    /// The curves.
    pub rows: Vec<GrinRow>,
}

/// What a ray costs for each time that it asks a field, in batches.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GrinCost {
    /// How the field is made up.
    pub field: &'static str,
    /// The number type of the rays.
    pub precision: Precision,
    /// Nanoseconds forwards.
    pub forward_ns: f64,
    /// Nanoseconds on the way back, with the gradient.
    pub back_ns: f64,
    /// Both in times of the way forwards.
    pub ratio: f64,
}

/// The adjoint against a stored path, on a trilinear grid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GrinMemory {
    /// Nodes along a side.
    pub nodes: usize,
    /// Rays.
    pub rays: usize,
    /// Steps of a ray, on average.
    pub steps: f64,
    /// Bytes that the adjoint keeps of the rays.
    pub adjoint_bytes: usize,
    /// Bytes of its private gradients.
    pub volume_bytes: usize,
    /// Bytes of the stored path, the least that reverse mode can do with.
    pub tape_bytes: usize,
    /// The peak of the process, and what it had before; where the system tells.
    pub adjoint_memory: Option<Memory>,
    /// The same with the stored path.
    pub tape_memory: Option<Memory>,
    /// Milliseconds of the adjoint: rays forwards and back, in batches.
    pub adjoint_ms: f64,
    /// The same with the stored path, one ray after the other.
    pub tape_ms: f64,
    /// The relative difference between the two gradients.
    pub difference: f64,
}

/// What is measured of a task.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GrinMeasured {
    /// Rays of every measurement.
    pub rays: usize,
    /// A chart for each field.
    pub fields: Vec<GrinCurves>,
    /// The derivative by the start of a ray.
    pub starts: Vec<GrinStarts>,
    /// What a ray costs.
    pub costs: Vec<GrinCost>,
    /// What a gradient keeps.
    pub memory: Vec<GrinMemory>,
}

/// Why nothing could be measured.
#[derive(Debug, thiserror::Error)]
pub enum NoGrin {
    /// There is nothing to compare with.
    #[error("exact: found none; expected a task whose exact field is known")]
    NoExact,
    /// The exact field.
    #[error(transparent)]
    Field(#[from] NoField),
    /// A grid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The space.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// No ray arrives.
    #[error("views: found no ray that leaves the space; expected light that goes through")]
    NoLight,
    /// No thread.
    #[error("no thread to measure with: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// Rays of every measurement.
const RAYS: usize = 512;
/// How often a ray asks the field in the curves, and for the reference.
const KICKS: [f64; 6] = [14.0, 28.0, 56.0, 112.0, 224.0, 448.0];
const FINE: f64 = 16_384.0;
/// The coarse trace by which the length of the rays is learnt.
const FIRST: f64 = 300.0;
/// Nodes along a side of the grids of the curves, and of the costs.
const NODES: usize = 33;
const COST_NODES: usize = 65;
/// Grids and steps a voxel of the measurement of memory.
const MEMORY: [(usize, f64); 5] = [(17, 2.0), (33, 2.0), (65, 1.0), (65, 2.0), (65, 4.0)];
/// A cube reaches so much beyond the space.
const MARGIN: f64 = 1.1;
/// Something is timed until it has taken so long, in ms, or so often.
const LONG_ENOUGH: f64 = 10.0;
const OFTEN_ENOUGH: usize = 7;
/// After so many times the steps of the longest ray one counts as trapped.
const TRAPPED: f64 = 8.0;

/// Measures a task whose exact field is known, by the light of its first view; `report` is told how
/// many of how many parts are done.
///
/// # Errors
/// A task without an exact field, or without light.
pub fn grin(task: &Task, mut report: impl FnMut(usize, usize)) -> Result<GrinMeasured, NoGrin> {
    let pool = ThreadPoolBuilder::new().num_threads(1).build()?;
    let stand = pool.install(|| Stand::new(task))?;
    let all = 4 + COSTS.len() + MEMORY.len();
    let mut done = 0;
    let mut tell = || {
        done += 1;
        report(done, all);
    };
    let mut measured = GrinMeasured {
        rays: stand.rays.len(),
        fields: vec![],
        starts: pool.install(|| stand.starts())?,
        costs: vec![],
        memory: vec![],
    };
    tell();
    for made in [Made::Exact, Made::Tricubic(NODES), Made::Trilinear(NODES)] {
        measured.fields.push(pool.install(|| stand.curves(made))?);
        tell();
    }
    for (made, precision) in COSTS {
        measured.costs.push(pool.install(|| stand.cost(made, precision))?);
        tell();
    }
    for (nodes, per_voxel) in MEMORY {
        measured.memory.push(pool.install(|| stand.memory(nodes, per_voxel))?);
        tell();
    }
    Ok(measured)
}

/// How a field is made up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Made {
    Exact,
    Tricubic(usize),
    /// With the smoothed diagonal.
    Trilinear(usize),
}

const COSTS: [(Made, Precision); 6] = [
    (Made::Trilinear(COST_NODES), Precision::F64),
    (Made::Trilinear(COST_NODES), Precision::F32),
    (Made::Tricubic(NODES), Precision::F64),
    (Made::Tricubic(NODES), Precision::F32),
    (Made::Exact, Precision::F64),
    (Made::Exact, Precision::F32),
];

impl Made {
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

/// Light and a field to send it through.
pub(super) struct Stand<'a> {
    task: &'a Task,
    pub(super) exact: &'a Exact,
    region: Region<f64>,
    /// Half the side of the cube of a grid.
    pub(super) half: f64,
    pub(super) rays: Vec<Ray<f64>>,
    /// The way of the longest ray in σ.
    way: f64,
    /// Where the loss of the gradient has its bottom.
    bottom: Vec3<f64>,
    /// The exits of the exact field.
    exits: Vec<Exit<f64>>,
}

/// Exits and a gradient.
struct Traced {
    exits: Vec<Option<Vec3<f64>>>,
    gradient: Vec<f64>,
    retrace_error: f64,
    kicks: f64,
    ms: f64,
    gradient_ms: f64,
}

impl<'a> Stand<'a> {
    fn new(task: &'a Task) -> Result<Self, NoGrin> {
        let exact = task.exact.as_ref().ok_or(NoGrin::NoExact)?;
        let (space, rays) = task.judging_rays(&task.views[0]);
        let stride = rays.len().div_ceil(RAYS).max(1);
        let [low, high] = space.corners();
        let size = [low.x, low.y, low.z, high.x, high.y, high.z].into_iter().map(f64::abs);
        let size = size.fold(0.0, f64::max);
        let mut stand = Self {
            task,
            exact,
            region: space.region(),
            half: MARGIN * size,
            rays: rays.into_iter().step_by(stride).collect(),
            way: space.diameter(),
            bottom: Vec3::new(0.3, -0.2, 0.5) * size,
            exits: Vec::new(),
        };
        // First roughly, then as finely as the way of the longest ray asks.
        let field = exact.field::<f64>()?;
        for kicks in [FIRST, FINE] {
            let setup = stand.setup(Integrator::BlanesMoan, kicks);
            let step = setup.step;
            stand.exits = Tracer::new(&*field, setup)?.rays(&stand.rays);
            let arrived = stand.exits.iter().filter(|exit| exit.fate.arrived());
            let most = arrived.map(|exit| exit.steps).max().ok_or(NoGrin::NoLight)?;
            stand.way = f64::from(most) * step;
        }
        Ok(stand)
    }

    /// How rays are traced with so many kicks on the longest way.
    pub(super) fn setup<R: Real>(&self, integrator: Integrator, kicks: f64) -> Setup<R> {
        let steps = kicks / integrator.kicks() as f64;
        let limit = (TRAPPED * steps).max(64.0) as u32;
        Setup {
            integrator,
            step: R::from_f64(self.way / steps),
            launch: self.task.launch,
            end: End::Boundary { region: self.region.lift(), last: LastStep::Fractional, limit },
            screen: None,
        }
    }

    /// Half a voxel of the finest grid a step, and no simple fraction of it; a last step that costs
    /// nothing.
    fn coarse<R: Real>(&self) -> Setup<R> {
        let step = 0.487 * 2.0 * self.half / (COST_NODES - 1) as f64;
        let setup = self.setup(Integrator::LeapfrogDkd, self.way / step);
        let limit = (TRAPPED * self.way / step) as u32;
        let end = End::Boundary { region: self.region.lift(), last: LastStep::BrokenLine, limit };
        Setup { end, ..setup }
    }

    pub(super) fn field<R: Real>(&self, made: Made) -> Result<Box<dyn Field<R>>, NoField> {
        match made {
            Made::Exact => self.exact.field(),
            Made::Tricubic(nodes) => self.exact.sampled(true, nodes, self.half),
            Made::Trilinear(nodes) => self.exact.sampled(false, nodes, self.half),
        }
    }

    fn lifted<R: Real>(&self) -> Vec<Ray<R>> {
        self.rays.iter().map(Ray::lift).collect()
    }

    /// The derivative of the loss by each exit.
    fn seeds<R: Real>(&self, exits: &[Exit<R>]) -> Vec<Seed<R>> {
        let share = 2.0 / exits.len() as f64;
        let seed = |exit: &Exit<R>| {
            let x = Vec3::from_f64((exit.x.value() - self.bottom) * share);
            Seed { x, ..Seed::default() }
        };
        exits.iter().map(seed).collect()
    }

    /// Traces all rays forwards and back; `often` for its time.
    fn trace<R: Real>(
        &self,
        field: &dyn Field<R>,
        setup: Setup<R>,
        often: usize,
    ) -> Result<Traced, NoGrin> {
        let rays = self.lifted();
        let kicks = setup.integrator.kicks() as f64;
        let tracer = Tracer::new(field, setup)?;
        let (mut exits, ms) = fastest(often, || tracer.rays(&rays));
        let seeds = self.seeds(&exits);
        let (gradient, back_ms) = fastest(often, || tracer.gradient(&rays, &mut exits, &seeds));
        let steps: f64 = exits.iter().map(|exit| f64::from(exit.steps)).sum();
        Ok(Traced {
            kicks: kicks * steps / exits.len() as f64,
            exits: exits.iter().map(|e| e.fate.arrived().then_some(e.x.value())).collect(),
            gradient: gradient.parameters.iter().map(|g| g.value()).collect(),
            retrace_error: gradient.retrace_error,
            ms,
            gradient_ms: ms + back_ms,
        })
    }

    fn curves(&self, made: Made) -> Result<GrinCurves, NoGrin> {
        let (double, single) = (self.field::<f64>(made)?, self.field::<f32>(made)?);
        let fine = self.setup(Integrator::BlanesMoan, FINE);
        let reference = self.trace(&*double, fine, 1)?;
        let ideal: Vec<Option<Vec3<f64>>> =
            self.exits.iter().map(|exit| exit.fate.arrived().then_some(exit.x)).collect();
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

    fn cost(&self, made: Made, precision: Precision) -> Result<GrinCost, NoGrin> {
        let found = match precision {
            Precision::F64 => self.trace(&*self.field::<f64>(made)?, self.coarse(), 40)?,
            Precision::F32 => self.trace(&*self.field::<f32>(made)?, self.coarse(), 40)?,
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

    fn memory(&self, nodes: usize, per_voxel: f64) -> Result<GrinMemory, NoGrin> {
        let exact = self.exact.field::<f64>()?;
        let grid = Grid::cube(nodes, self.half)?;
        let mut field = Trilinear::sampled(grid, |p| exact.sample(p).index)?;
        field.diagonal = Diagonal::Exact;
        let kicks = self.way * per_voxel / (0.974 * field.grid().spacing().x);
        let tracer = Tracer::new(&field, self.setup(Integrator::LeapfrogDkd, kicks))?;
        let rays = &self.rays;
        let mut exits = tracer.rays(rays);
        let seeds = self.seeds(&exits);
        // Rays without a gradient first, so that both work on the same ones.
        let adjoint = tracer.gradient(rays, &mut exits, &seeds);
        let tape = tracer.taped_gradient(rays, &exits, &seeds);
        let difference = relative(&tape.parameters, &adjoint.parameters);
        let by_adjoint = || {
            let mut exits = tracer.rays(rays);
            let seeds = self.seeds(&exits);
            drop(black_box(tracer.gradient(rays, &mut exits, &seeds)));
        };
        let by_tape = || {
            let exits = tracer.rays(rays);
            let seeds = self.seeds(&exits);
            drop(black_box(tracer.taped_gradient(rays, &exits, &seeds)));
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
    found: &Traced,
    reference: &Traced,
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

/// The root of the mean square distance, of the rays that arrive in both.
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

/// What comes out, and the least time of several, in milliseconds.
fn fastest<T>(often: usize, mut work: impl FnMut() -> T) -> (T, f64) {
    let (mut result, mut best) = timed(&mut work);
    let mut spent = best;
    for i in 1..often {
        if i >= 3 && spent > LONG_ENOUGH * often as f64 / OFTEN_ENOUGH as f64 {
            break;
        }
        let (again, ms) = timed(&mut work);
        (result, best, spent) = (again, best.min(ms), spent + ms);
    }
    (result, best)
}
