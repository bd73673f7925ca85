//! `measure limits`: limits as constraints against limits as penalties.

use crate::cli::error::CliError;
use crate::cli::input::{LensFiles, Tolerance};
use crate::cli::output::{Output, ShortNumber, TextTable};
use crate::measure::{LimitComparison, LimitedDescent, Machine, compare_limit_treatments};
use serde::Serialize;
use std::fmt::{self, Display};

/// The largest broken limit of optimized lenses and their merit, limits as constraints against
/// limits as penalties
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_limits.txt"))]
pub(super) struct MeasureLimitsArgs {
    #[command(flatten)]
    lenses: LensFiles,

    /// The maximum number of steps of each descent
    #[arg(long, value_name = "N", default_value_t = 1000)]
    steps: usize,

    /// Tolerance of the radius of each spot: `0.1%` or `1e-3`
    #[arg(long, default_value = "1e-4", value_name = "TOLERANCE")]
    error: Tolerance,
}

/// The violation, in the unit of a limit, up to which it counts as kept.
const KEPT: f64 = 1e-9;

impl MeasureLimitsArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let compare = |lens: &_, _: &str, stop: &_| {
            compare_limit_treatments(lens, self.steps, self.error.0, stop).transpose()
        };
        let rows: Vec<LimitRow> = self.lenses.map(compare, |file, found| match found {
            Ok(found) => LimitRow { file, found: Some(found), refused: None },
            Err(cause) => LimitRow { file, found: None, refused: Some(cause.to_string()) },
        })?;
        let broken = rows.iter().filter(|row| row.is_broken()).count();
        output.print(&MeasureLimitsReport { machine: Machine::detect(), broken, rows })
    }
}

#[derive(Serialize)]
struct MeasureLimitsReport {
    machine: Machine,
    /// The number of lenses that end with a broken limit although it is a constraint.
    broken: usize,
    rows: Vec<LimitRow>,
}

#[derive(Serialize)]
struct LimitRow {
    file: String,
    #[serde(flatten)]
    found: Option<LimitComparison>,
    /// The reason for which the lens is not optimized.
    #[serde(skip_serializing_if = "Option::is_none")]
    refused: Option<String>,
}

impl LimitRow {
    fn is_broken(&self) -> bool {
        self.found.as_ref().is_some_and(|found| found.constraints.violation > KEPT)
    }
}

impl Display for MeasureLimitsReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { machine, broken, rows } = self;
        writeln!(f, "{machine}")?;
        writeln!(f, "limits as constraints / as penalties; merit without penalties, in mm^2\n")?;
        let mut table = TextTable::new(&[
            "lens",
            "start",
            "merit",
            "",
            "broken by",
            "",
            "binding",
            "evaluations",
            "",
            "s",
            "",
        ]);
        for LimitRow { file, found, .. } in rows {
            let Some(found) = found else { continue };
            let both = [&found.constraints, &found.penalties];
            let pair = |show: fn(&LimitedDescent) -> String| both.map(show);
            let name = [file.clone(), ShortNumber(found.merit_before).to_string()];
            let cells = name
                .into_iter()
                .chain(pair(|end| format!("{:.4e}", end.merit)))
                .chain(pair(|end| format!("{:.1e}", end.violation)))
                .chain([found.constraints.binding.to_string()])
                .chain(pair(|end| end.evaluations.to_string()))
                .chain(pair(|end| format!("{:.1}", 1e-3 * end.ms)));
            table.row(cells);
        }
        writeln!(f, "{table}")?;
        for LimitRow { file, refused, .. } in rows {
            refused.as_ref().map_or(Ok(()), |why| writeln!(f, "{file}: {why}"))?;
        }
        let optimized = rows.iter().filter(|row| row.found.is_some()).count();
        if optimized == 0 {
            return writeln!(f, "no lens was optimized to its end");
        }
        writeln!(f, "{broken} of {optimized} lenses end with a limit broken by more than {KEPT:e}")
    }
}
