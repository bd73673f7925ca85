//! `measure grin`: ray tracing in gradient-index fields: accuracy against time, cost, memory.

use super::plot::{self, Color, ErrorChart, ErrorCurve, LegendEntry, PlotArgs, Stroke};
use crate::cli::error::CliError;
use crate::cli::failures::Failures;
use crate::cli::grin::{load_task, task_inputs};
use crate::cli::output::{Output, TextTable};
use crate::cli::progress::{stop_flag, with_bar};
use crate::grin::Integrator;
use crate::measure::{
    GrinBenchmark, GrinCost, GrinCurves, GrinMemory, GrinRow, GrinStarts, Machine, MemoryUse,
    Precision, measure_grin,
};
use crate::plot::PALETTE;
use image::ImageError;
use serde::Serialize;
use std::fmt::{self, Display};

/// Error of exits and gradients against milliseconds for every integrator, and the cost of a gradient
/// in time and memory
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_grin.txt"))]
pub(super) struct MeasureGrinArgs {
    /// A task whose exact field is known: the name of a built-in one, or a file .json
    #[arg(value_name = "TASK", default_value = "luneburg")]
    task: String,

    #[command(flatten)]
    plot: PlotArgs,
}

impl MeasureGrinArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let task = load_task(&self.task)?;
        let inputs = task_inputs(&self.task, &task);
        self.plot.check(inputs.iter().map(|(name, path)| (*name, &**path)))?;
        let (measured, _) = with_bar(&stop_flag(), "curves", |report| measure_grin(&task, report));
        let measured = measured.map_err(|e| CliError::Input(format!("{}: {e}", self.task)))?;
        let mut failures = Failures::default();
        failures.note(self.plot.write(|| draw_curves(&measured, &task.name)));
        failures.note(output.print(&MeasureGrinReport {
            machine: Machine::detect(),
            task: task.name,
            measured,
        }));
        failures.into_result()
    }
}

const STROKES: [(Precision, Stroke); 2] =
    [(Precision::F64, Stroke::Solid), (Precision::F32, Stroke::Dashed)];

fn color(integrator: Integrator) -> Color {
    let place = Integrator::ALL.iter().position(|other| *other == integrator).unwrap_or(0);
    PALETTE[place % PALETTE.len()]
}

/// Draws a chart for each of the first two fields.
fn draw_curves(measured: &GrinBenchmark, title: &str) -> Result<Vec<u8>, ImageError> {
    let chart = |curves: &GrinCurves| {
        let curve = |integrator: Integrator, (precision, stroke)| {
            let mine = |row: &&GrinRow| row.integrator == integrator && row.precision == precision;
            let points = curves.rows.iter().filter(mine).map(|row| [row.ms, row.exit_error]);
            ErrorCurve { color: color(integrator), stroke, points: points.collect() }
        };
        let all = Integrator::ALL.into_iter().flat_map(|i| STROKES.map(|s| curve(i, s)));
        ErrorChart { name: format!("{}, error of exits, mm", curves.field), curves: all.collect() }
    };
    let charts: Vec<ErrorChart> = measured.fields.iter().take(2).map(chart).collect();
    let named = Integrator::ALL.into_iter().map(|i| LegendEntry::colored(i.name(), color(i)));
    let strokes = [("f64", Stroke::Solid), ("f32", Stroke::Dashed)];
    let strokes = strokes.map(|(name, stroke)| LegendEntry::stroked(name, stroke));
    let labels: Vec<LegendEntry> = named.chain(strokes).collect();
    plot::draw(&charts, &labels, title)
}

/// The printed result.
#[derive(Serialize)]
struct MeasureGrinReport {
    machine: Machine,
    task: String,
    #[serde(flatten)]
    measured: GrinBenchmark,
}

impl Display for MeasureGrinReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { machine, task, measured } = self;
        writeln!(f, "{machine}\n{task}: {} rays, one thread", measured.rays)?;
        for curves in &measured.fields {
            let GrinCurves { field, parameters, floor, .. } = curves;
            writeln!(f, "\n{field}, {parameters} numbers; {floor:.1e} mm from the exact field\n")?;
            write!(f, "{}", table(curves))?;
        }
        writeln!(f, "\nthe derivative of an exit with respect to the start of its ray:\n")?;
        write!(f, "{}", starts(&measured.starts))?;
        writeln!(f, "\nper evaluation of the field, in batches:\n")?;
        write!(f, "{}", costs(&measured.costs))?;
        writeln!(f, "\nthe adjoint against a stored path:\n")?;
        write!(f, "{}", memory(&measured.memory))
    }
}

fn table(curves: &GrinCurves) -> TextTable {
    let mut table = TextTable::new(&[
        "integrator",
        "kicks",
        "ms",
        "with gradient",
        "exit error, mm",
        "gradient error",
        "retrace, steps",
        "lost",
    ]);
    for row in &curves.rows {
        let precision = if row.precision == Precision::F32 { " f32" } else { "" };
        table.row([
            format!("{}{precision}", row.integrator.name()),
            format!("{:.0}", row.kicks),
            format!("{:.3}", row.ms),
            format!("{:.3}", row.gradient_ms),
            format!("{:.1e}", row.exit_error),
            format!("{:.1e}", row.gradient_error),
            format!("{:.0e}", row.retrace_error),
            row.lost.to_string(),
        ]);
    }
    table
}

fn starts(rows: &[GrinStarts]) -> TextTable {
    let mut table = TextTable::new(&["field", "size", "error", "worst ray", "rays"]);
    for row in rows {
        table.row([
            row.field.to_owned(),
            format!("{:.1e}", row.size),
            format!("{:.1e}", row.error),
            format!("{:.1e}", row.worst),
            row.rays.to_string(),
        ]);
    }
    table
}

fn costs(costs: &[GrinCost]) -> TextTable {
    let mut table =
        TextTable::new(&["field", "ns forwards", "ns back", "both in times of forwards"]);
    for cost in costs {
        let precision = if cost.precision == Precision::F32 { " f32" } else { "" };
        table.row([
            format!("{}{precision}", cost.field),
            format!("{:.2}", cost.forward_ns),
            format!("{:.2}", cost.back_ns),
            format!("{:.2}", cost.ratio),
        ]);
    }
    table
}

fn memory(rows: &[GrinMemory]) -> TextTable {
    let mut table = TextTable::new(&[
        "nodes",
        "rays",
        "steps",
        "rays kB",
        "gradients kB",
        "tape kB",
        "peak MB",
        "with tape",
        "ms",
        "with tape",
        "difference",
    ]);
    let kb = |bytes: usize| format!("{:.0}", bytes as f64 / 1024.0);
    let mb = |memory: Option<MemoryUse>| {
        memory.map_or("-".to_owned(), |m| format!("{:.1}", m.peak_mb - m.before_mb))
    };
    for row in rows {
        table.row([
            row.nodes.to_string(),
            row.rays.to_string(),
            format!("{:.0}", row.steps),
            kb(row.adjoint_bytes),
            kb(row.volume_bytes),
            kb(row.tape_bytes),
            mb(row.adjoint_memory),
            mb(row.tape_memory),
            format!("{:.2}", row.adjoint_ms),
            format!("{:.2}", row.tape_ms),
            format!("{:.0e}", row.difference),
        ]);
    }
    table
}
