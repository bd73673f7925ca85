//! The cost of a step of a search.

use crate::cli::failure::Failure;
use crate::cli::output::{Number, Output, Table};
use crate::measure::{Machine, StepCosts, step_costs};
use serde::Serialize;
use std::fmt::{self, Display};

/// Milliseconds an iteration on one core: double Gauss, 4 fields, all curvatures and thicknesses
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_optimize.txt"))]
pub(super) struct Optimize {
    /// How many steps each search takes
    #[arg(long, value_name = "N", default_value_t = 200)]
    steps: usize,
}

impl Optimize {
    pub(super) fn run(&self, output: &Output) -> Result<(), Failure> {
        let costs = step_costs(self.steps).map_err(|e| Failure::Failed(e.to_string()))?;
        output.print(&Report { machine: Machine::here(), steps: self.steps, costs })
    }
}

#[derive(Serialize)]
struct Report {
    machine: Machine,
    steps: usize,
    #[serde(flatten)]
    costs: StepCosts,
}

impl Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { machine, steps, costs } = self;
        let StepCosts { variables, fields, tolerance, rows } = costs;
        writeln!(f, "{machine}")?;
        writeln!(
            f,
            "one core, {fields} fields, {variables} variables, spots good to {tolerance}, up to \
             {steps} steps; ms an iteration:\n"
        )?;
        let mut table =
            Table::new(&["", "median", "mean", "fastest", "slowest", "rays", "error", "spot mm^2"]);
        for row in rows {
            let times = [row.ms_per_iteration, row.mean, row.min, row.max];
            let times = times.map(|ms| format!("{ms:.4}"));
            let (before, after) = (Number(row.spot_before), Number(row.spot_after));
            let rest = [
                row.rays.to_string(),
                format!("{:.1e}", row.error),
                format!("{before} -> {after}"),
            ];
            table.row(std::iter::once(row.name.to_owned()).chain(times).chain(rest));
        }
        write!(f, "{table}")
    }
}
