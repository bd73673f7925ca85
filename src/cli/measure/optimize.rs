//! `measure optimize`: the time of a step of local optimization, and the work until it arrives.

use super::arrival;
use crate::cli::error::CliError;
use crate::cli::input::LensFiles;
use crate::cli::output::{Output, ShortNumber, TextTable};
use crate::cli::progress::{note_if_stopped, stop_flag};
use crate::measure::{Machine, StepCosts, measure_step_costs};
use serde::Serialize;
use std::fmt::{self, Display};
use std::path::PathBuf;

/// Milliseconds per iteration on one core: double Gauss, 4 fields, all curvatures and thicknesses.
/// With lenses: evaluations and milliseconds until within 1 % of the best merit known
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_optimize.txt"))]
pub(super) struct MeasureOptimizeArgs {
    /// The lenses: .json, .zmx, .zar, .seq, .len or .roa
    #[arg(value_name = "LENS")]
    lenses: Vec<PathBuf>,

    /// The number of steps of each run without lenses
    #[arg(long, value_name = "N", default_value_t = 200)]
    steps: usize,

    /// The maximum number of evaluations of each method with lenses
    #[arg(long, value_name = "N", default_value_t = 1500)]
    evaluations: usize,
}

impl MeasureOptimizeArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        if self.steps == 0 {
            return Err(CliError::Input("--steps: found 0; expected 1 or more".into()));
        }
        if !self.lenses.is_empty() {
            let lenses = LensFiles::new(self.lenses.clone());
            return output.print(&arrival::measure(&lenses, self.evaluations)?);
        }
        let stop = stop_flag();
        let costs =
            measure_step_costs(self.steps, &stop).map_err(|e| CliError::Failed(e.to_string()))?;
        note_if_stopped(&stop);
        output.print(&MeasureOptimizeReport {
            machine: Machine::detect(),
            steps: self.steps,
            costs,
        })
    }
}

#[derive(Serialize)]
struct MeasureOptimizeReport {
    machine: Machine,
    steps: usize,
    #[serde(flatten)]
    costs: StepCosts,
}

impl Display for MeasureOptimizeReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { machine, steps, costs } = self;
        let StepCosts { variables, fields, tolerance, rows } = costs;
        writeln!(f, "{machine}")?;
        writeln!(
            f,
            "one core, {fields} fields, {variables} variables, spots good to {tolerance}, up to \
             {steps} steps; ms an iteration:\n"
        )?;
        let mut table = TextTable::new(&[
            "",
            "median",
            "mean",
            "fastest",
            "slowest",
            "rays",
            "error",
            "spot mm^2",
        ]);
        for row in rows {
            let times = [row.ms_per_iteration, row.mean, row.min, row.max];
            let times = times.map(|ms| format!("{ms:.4}"));
            let (before, after) = (ShortNumber(row.spot_before), ShortNumber(row.spot_after));
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
