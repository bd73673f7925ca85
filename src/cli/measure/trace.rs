//! `measure trace`: the speed of ray tracing.

use crate::cli::error::CliError;
use crate::cli::output::{Output, ShortNumber, TextTable};
use crate::cli::progress::{note_if_stopped, stop_flag};
use crate::measure::{Machine, MemoryUse, Rounding, Throughput, measure_throughput};
use serde::Serialize;
use std::fmt::{self, Display};

/// Ray-surfaces a second, rounding errors and memory, on a double Gauss with 12 surfaces
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_trace.txt"))]
pub(super) struct MeasureTraceArgs {
    /// The number of repetitions of each case
    #[arg(long, value_name = "N", default_value_t = 201)]
    turns: usize,
}

impl MeasureTraceArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        if self.turns == 0 {
            return Err(CliError::Input("--turns: found 0; expected 1 or more".into()));
        }
        let stop = stop_flag();
        let measured =
            measure_throughput(self.turns, &stop).map_err(|e| CliError::Failed(e.to_string()))?;
        note_if_stopped(&stop);
        output.print(&MeasureTraceReport { machine: Machine::detect(), measured })
    }
}

#[derive(Serialize)]
struct MeasureTraceReport {
    machine: Machine,
    #[serde(flatten)]
    measured: Throughput,
}

impl Display for MeasureTraceReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { machine, measured } = self;
        writeln!(f, "{machine}")?;
        let turns = measured.turns;
        writeln!(f, "million ray-surfaces a second, fates included, over {turns} repetitions:\n")?;
        let mut table = TextTable::new(&["", "median", "slowest", "fastest"]);
        for row in &measured.rows {
            let rates = [row.million_ray_surfaces_per_s, row.min, row.max];
            let rates = rates.map(|rate| format!("{rate:.1}"));
            table.row(std::iter::once(row.name.to_owned()).chain(rates));
        }
        writeln!(f, "{table}")?;
        write_rounding(f, "f64", &measured.rounding_f64)?;
        write_rounding(f, "f32", &measured.rounding_f32)?;
        let ratio = measured.gradient_over_forward;
        writeln!(
            f,
            "derivatives with respect to all numbers: {ratio:.2} times the trace of the same rays"
        )?;
        write_memory(f, "tracing a million rays", measured.memory_trace)?;
        write_memory(f, "differentiating a million rays", measured.memory_gradient)
    }
}

fn write_rounding(f: &mut fmt::Formatter<'_>, name: &str, rounding: &Rounding) -> fmt::Result {
    let Rounding { point_rms_mm, point_max_mm, path_rms_mm, .. } = *rounding;
    writeln!(
        f,
        "rounding in {name}: image point {} mm rms, {} mm at most; optical path {} mm rms",
        ShortNumber(point_rms_mm),
        ShortNumber(point_max_mm),
        ShortNumber(path_rms_mm)
    )
}

fn write_memory(f: &mut fmt::Formatter<'_>, what: &str, memory: Option<MemoryUse>) -> fmt::Result {
    match memory {
        Some(MemoryUse { before_mb, peak_mb }) => {
            writeln!(f, "{what}: {peak_mb:.0} MB at the peak, {before_mb:.0} MB before")
        }
        None => writeln!(f, "{what}: this system does not report its memory"),
    }
}
