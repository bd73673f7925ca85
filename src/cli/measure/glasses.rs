//! `measure glasses`: the exchange of glasses, guided by predictions against random.

use crate::cli::error::CliError;
use crate::cli::input::{LensFiles, Tolerance};
use crate::cli::output::{Output, ShortNumber, TextTable};
use crate::measure::{GlassComparison, GlassCourse, Machine, compare_glass_exchange};
use serde::Serialize;
use std::fmt::{self, Display};

/// The merit of optimized lenses whose glasses are exchanged, guided by predictions against random
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/measure_glasses.txt"))]
pub(super) struct MeasureGlassesArgs {
    #[command(flatten)]
    lenses: LensFiles,

    /// The seed of the random exchanges
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,

    /// Tolerance of the radius of each spot: `0.1%` or `1e-3`
    #[arg(long, default_value = "1e-3", value_name = "TOLERANCE")]
    error: Tolerance,
}

impl MeasureGlassesArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let compare = |lens: &_, _: &str, stop: &_| {
            compare_glass_exchange(lens, self.seed, self.error.0, stop).transpose()
        };
        let rows = self.lenses.map(compare, |file, found| match found {
            Ok(found) => GlassRow { file, found: Some(found), refused: None },
            Err(cause) => GlassRow { file, found: None, refused: Some(cause.to_string()) },
        })?;
        output.print(&MeasureGlassesReport { machine: Machine::detect(), seed: self.seed, rows })
    }
}

#[derive(Serialize)]
struct MeasureGlassesReport {
    machine: Machine,
    seed: u64,
    rows: Vec<GlassRow>,
}

#[derive(Serialize)]
struct GlassRow {
    file: String,
    #[serde(flatten)]
    found: Option<GlassComparison>,
    /// The reason for which no glass is exchanged.
    #[serde(skip_serializing_if = "Option::is_none")]
    refused: Option<String>,
}

impl Display for MeasureGlassesReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}\nmerit as it is, optimized, and with other glasses\n", self.machine)?;
        let columns =
            ["lens", "merit", "optimized", "order", "merit", "exchanges", "evaluations", "s"];
        let mut table = TextTable::new(&columns);
        for GlassRow { file, found, .. } in &self.rows {
            let Some(found) = found else { continue };
            let before = [found.merit_before, found.merit_optimized];
            let before = before.map(|merit| ShortNumber(merit).to_string());
            let first = std::iter::once(file.clone()).chain(before);
            table.row(first.chain(course("guided", &found.guided)));
            let none = std::iter::repeat_n(String::new(), 3);
            table.row(none.chain(course("random", &found.random)));
        }
        write!(f, "{table}")?;
        for row in &self.rows {
            if let Some(why) = &row.refused {
                writeln!(f, "{}: {why}", row.file)?;
            }
        }
        Ok(())
    }
}

/// The cells of one search.
fn course(order: &str, found: &GlassCourse) -> [String; 5] {
    [
        order.to_owned(),
        ShortNumber(found.merit).to_string(),
        found.exchanges.to_string(),
        found.evaluations.to_string(),
        format!("{:.1}", found.seconds),
    ]
}
