//! The speed of tracing.

use crate::cli::failure::Failure;
use crate::cli::output::{Number, Output, Table};
use crate::measure::{Machine, Memory, Rounding, Throughput, throughput};
use serde::Serialize;
use std::fmt::{self, Display};

/// Ray-surfaces a second, rounding errors and memory, on a double Gauss with 12 surfaces
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_trace.txt"))]
pub(super) struct Trace {
    /// How many times each way of tracing is timed
    #[arg(long, value_name = "N", default_value_t = 201)]
    turns: usize,
}

impl Trace {
    pub(super) fn run(&self, output: &Output) -> Result<(), Failure> {
        let measured = throughput(self.turns).map_err(|e| Failure::Failed(e.to_string()))?;
        output.print(&Report { machine: Machine::here(), turns: self.turns, measured })
    }
}

#[derive(Serialize)]
struct Report {
    machine: Machine,
    turns: usize,
    #[serde(flatten)]
    measured: Throughput,
}

impl Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { machine, turns, measured } = self;
        writeln!(f, "{machine}")?;
        writeln!(f, "million ray-surfaces a second, fates included, over {turns} turns:\n")?;
        let mut table = Table::new(&["", "median", "slowest", "fastest"]);
        for row in &measured.rows {
            let rates = [row.million_ray_surfaces_per_s, row.min, row.max];
            let rates = rates.map(|rate| format!("{rate:.1}"));
            table.row(std::iter::once(row.name.to_owned()).chain(rates));
        }
        writeln!(f, "{table}")?;
        write_rounding(f, "f64", &measured.rounding_f64)?;
        write_rounding(f, "f32", &measured.rounding_f32)?;
        let ratio = measured.gradient_over_forward;
        writeln!(f, "derivatives by all numbers: {ratio:.2} times the trace of the same rays")?;
        write_memory(f, "tracing a million rays", measured.memory_trace)?;
        write_memory(f, "differentiating a million rays", measured.memory_gradient)
    }
}

fn write_rounding(f: &mut fmt::Formatter<'_>, name: &str, rounding: &Rounding) -> fmt::Result {
    let Rounding { point_rms_mm, point_max_mm, path_rms_mm, .. } = *rounding;
    writeln!(
        f,
        "rounding in {name}: image point {} mm rms, {} mm at most; optical path {} mm rms",
        Number(point_rms_mm),
        Number(point_max_mm),
        Number(path_rms_mm)
    )
}

fn write_memory(f: &mut fmt::Formatter<'_>, what: &str, memory: Option<Memory>) -> fmt::Result {
    match memory {
        Some(Memory { before_mb, peak_mb }) => {
            writeln!(f, "{what}: {peak_mb:.0} MB at the peak, {before_mb:.0} MB before")
        }
        None => writeln!(f, "{what}: this system does not tell its memory"),
    }
}
