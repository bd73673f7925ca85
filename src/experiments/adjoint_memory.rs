//! Figure 5.3: the memory of a gradient through a grid. Reverse mode stores a path that grows with
//! the number of steps; the adjoint retraces the rays and stores none. Both give the same gradient.
//!
//! The stored path is the minimum for reverse mode, 24 bytes per step: programs that record every
//! operation store about ten times as much. The table lists these bytes; the claims are about the
//! peak memory of the process while each gradient is computed, where the system reports it.
//! `aplanat measure grin` measures the time of both.

use super::{
    Claim, DataTable, Effort, Experiment, ExperimentError, ExperimentOutcome, ExperimentResult,
    NamedPlot, ProgressFn, report_progress,
};
use crate::grin::field::{HessianDiagonal, Luneburg, ProfileField, RegularGrid, Trilinear};
use crate::grin::{
    EndCondition, GrinRay, GrinRegion, GrinSetup, GrinTracer, IndexField as _, Integrator,
    LastStep, LaunchMode, RayAdjoint, RayExit,
};
use crate::math::Vec3;
use crate::measure::peak_megabytes;
use crate::plot::{Axis, Canvas, Chart, Legend, PALETTE, Stroke};

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "5.3",
    title: "Memory of a gradient through a grid",
    claim: "The memory of the adjoint does not grow with the steps, that of reverse mode does",
    omits: "the time of both methods, which `aplanat measure grin` prints; a program that \
            records every operation, for which the shortest stored path stands",
    seconds: 3.0,
    run,
};

/// The numbers of steps per voxel.
const FINENESS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];
/// The largest relative difference attributed to rounding.
const ROUNDING: f64 = 1e-10;

/// The memory of one gradient, in bytes.
struct AdjointMemoryRow {
    nodes: usize,
    steps: f64,
    tape: usize,
    rays: usize,
    gradients: usize,
    difference: f64,
    /// The growth of the memory of the process with the adjoint and with the stored path, in MB;
    /// NaN where the system does not report it.
    measured: [f64; 2],
}

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let nodes = effort.select([17, 33, 65, 129].as_slice(), &[17, 33]);
    let side = effort.select(64, 16);
    let (mut outcome, mut rows) = (ExperimentOutcome::default(), Vec::new());
    let all = nodes.len() * FINENESS.len();
    for nodes in nodes {
        for fineness in FINENESS {
            let done = rows.len() as f64 / all as f64;
            report_progress(
                progress,
                done,
                &format!("{nodes} nodes per side, {fineness} steps per voxel"),
            )?;
            rows.push(measure(*nodes, fineness, side)?);
            outcome.rays += 2 * side * side;
        }
    }
    outcome.claims = claims(&rows, effort);
    outcome.tables.push(table(&rows, side * side));
    outcome.pictures.push(NamedPlot { name: "memory", canvas: draw(&rows) });
    Ok(outcome)
}

fn measure(nodes: usize, fineness: f64, side: usize) -> ExperimentResult<AdjointMemoryRow> {
    let lens = ProfileField::sphere(Luneburg::new(1.0));
    let grid = RegularGrid::cube(nodes, 1.1)?;
    let sampled = Trilinear::from_function(grid, |p| lens.sample(p).index);
    let mut field = sampled?;
    field.diagonal = HessianDiagonal::Exact;
    let tracer = GrinTracer::new(&field, setup(0.974 * grid.spacing().x / fineness));
    let tracer = tracer?;
    let at = |i: usize| 0.6 * (2.0 * (i as f64 + 0.5137) / side as f64 - 1.0);
    let ray = |n: usize| GrinRay {
        x: Vec3::new(at(n % side), at(n / side), -1.5),
        v: Vec3::new(0.0, 0.0, 1.0),
    };
    let rays: Vec<GrinRay<f64>> = (0..side * side).map(ray).collect();
    let mut exits = tracer.trace_batch(&rays);
    let focus = Vec3::new(0.1, 0.2, 1.0);
    let seed =
        |exit: &RayExit<f64>| RayAdjoint { x: (exit.x - focus) * 2.0, ..RayAdjoint::default() };
    let seeds: Vec<RayAdjoint<f64>> = exits.iter().map(seed).collect();
    let (mut adjoint, mut taped) = (Vec::new(), None);
    let by_adjoint = || adjoint = tracer.gradient(&rays, &mut exits, &seeds).parameters;
    let by_adjoint = growth(by_adjoint);
    let by_tape = growth(|| taped = Some(tracer.tape_gradient(&rays, &exits, &seeds)));
    let taped = taped.ok_or_else(|| ExperimentError::Failed("no gradient".to_owned()))?;
    let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|v| v * v).sum::<f64>().sqrt();
    let off = norm(&mut adjoint.iter().zip(&taped.parameters).map(|(a, b)| a - b));
    let [ray_bytes, gradients] = tracer.gradient_bytes(rays.len());
    let steps: f64 = exits.iter().map(|exit| f64::from(exit.steps)).sum();
    Ok(AdjointMemoryRow {
        nodes,
        steps: steps / rays.len() as f64,
        tape: taped.bytes,
        rays: ray_bytes,
        gradients,
        difference: off / norm(&mut adjoint.iter().copied()),
        measured: [by_adjoint, by_tape],
    })
}

/// The growth of the memory of the process during some work, in MB; NaN if unknown.
fn growth(work: impl FnOnce()) -> f64 {
    peak_megabytes(work).map_or(f64::NAN, |memory| memory.peak_mb - memory.before_mb)
}

fn setup(step: f64) -> GrinSetup<f64> {
    let region = GrinRegion::ball(1.0);
    let end = EndCondition::Boundary { region, last: LastStep::BrokenLine, limit: 100_000 };
    let (integrator, launch) = (Integrator::LeapfrogDkd, LaunchMode::AsGiven);
    GrinSetup { integrator, step, launch, end, screen: None }
}

/// A test shares its process with others, so that its memory cannot be measured.
fn claims(rows: &[AdjointMemoryRow], effort: Effort) -> Vec<Claim> {
    let worst = rows.iter().map(|row| row.difference).fold(0.0, f64::max);
    let same = Claim::at_most("relative difference of the two gradients", worst, ROUNDING);
    let mut claims = vec![same];
    if effort == Effort::Full && rows.iter().all(|row| row.measured.iter().all(|mb| mb.is_finite()))
    {
        claims.extend(memory_claims(&rows[rows.len() - FINENESS.len()..]));
    }
    claims
}

/// The claims about the measured memory with the finest grid.
fn memory_claims(rows: &[AdjointMemoryRow]) -> [Claim; 2] {
    let (first, last) = (&rows[0], &rows[rows.len() - 1]);
    let nodes = first.nodes;
    let times = last.steps / first.steps;
    [
        Claim::at_most(
            format!("{nodes} nodes: memory of the adjoint, gain with {times:.1} times the steps"),
            last.measured[0] - first.measured[0],
            0.1 * last.measured[1],
        )
        .in_unit("MB"),
        Claim::at_least(
            format!(
                "{nodes} nodes: memory of the stored path, gain with {times:.1} times the steps"
            ),
            last.measured[1] - first.measured[1],
            0.5 * (times - 1.0) * first.tape as f64 / 1e6,
        )
        .in_unit("MB"),
    ]
}

fn table(rows: &[AdjointMemoryRow], rays: usize) -> DataTable {
    let mut table = DataTable::new(
        "memory",
        &[
            "nodes",
            "rays",
            "steps",
            "tape_bytes",
            "ray_bytes",
            "gradient_bytes",
            "difference",
            "adjoint_measured_mb",
            "tape_measured_mb",
        ],
    );
    for row in rows {
        table.push_row([
            row.nodes.into(),
            rays.into(),
            row.steps.into(),
            row.tape.into(),
            row.rays.into(),
            row.gradients.into(),
            row.difference.into(),
            row.measured[0].into(),
            row.measured[1].into(),
        ]);
    }
    table
}

fn draw(rows: &[AdjointMemoryRow]) -> Canvas {
    let mb = |bytes: usize| bytes as f64 / 1e6;
    let mut canvas = Canvas::new([1500, 860]);
    let tape = |row: &AdjointMemoryRow| [row.steps, mb(row.tape)];
    let adjoint = |row: &AdjointMemoryRow| [row.steps, mb(row.rays + row.gradients)];
    let all = || rows.iter().flat_map(|row| [tape(row), adjoint(row)]);
    let x = Axis::logarithmic("steps of a ray", all().map(|p| p[0]), 1.0);
    let y = Axis::logarithmic("megabytes", all().map(|p| p[1]), 1e-3);
    let chart = Chart::new([140.0, 110.0], [960.0, 760.0], x, y);
    chart.draw(&mut canvas, "memory of a gradient");
    let mut legend = Legend::new([1000.0, 123.0]);
    for (i, rows) in rows.chunks(FINENESS.len()).enumerate() {
        let color = PALETTE[i % PALETTE.len()];
        let curves: [(&str, Vec<[f64; 2]>, Stroke); 2] = [
            ("stored path", rows.iter().map(tape).collect(), Stroke::Dashed),
            ("adjoint", rows.iter().map(adjoint).collect(), Stroke::Solid),
        ];
        for (name, points, stroke) in curves {
            canvas.marked_curve(&chart.to_pixels(&points), color, stroke);
            let text = format!("{name}, {} nodes", rows[0].nodes);
            legend.curve(&mut canvas, &text, color, stroke);
        }
    }
    canvas
}
