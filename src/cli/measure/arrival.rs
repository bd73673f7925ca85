//! The part of `measure optimize` about lenses: the work of every method until it arrives.

use crate::cli::error::CliError;
use crate::cli::input::LensFiles;
use crate::cli::names::value_name;
use crate::cli::output::{ShortNumber, TextTable};
use crate::measure::{ArrivalComparison, Machine, measure_arrival};
use serde::Serialize;
use std::fmt::{self, Display};

/// The relative accuracy of the spot radii.
const TOLERANCE: f64 = 1e-4;

/// Optimizes every lens by every method, with up to this many evaluations each.
pub(super) fn measure(lenses: &LensFiles, evaluations: usize) -> Result<ArrivalReport, CliError> {
    let compare = |lens: &_, name: &str, stop: &_| {
        measure_arrival(lens, name, evaluations, TOLERANCE, stop).transpose()
    };
    let rows = lenses.map(compare, |file, found| match found {
        Ok(found) => ArrivalLens { file, found: Some(found), refused: None },
        Err(cause) => ArrivalLens { file, found: None, refused: Some(cause.to_string()) },
    })?;
    Ok(ArrivalReport { machine: Machine::detect(), evaluations, rows })
}

#[derive(Serialize)]
pub(super) struct ArrivalReport {
    machine: Machine,
    /// The maximum number of evaluations.
    evaluations: usize,
    rows: Vec<ArrivalLens>,
}

#[derive(Serialize)]
struct ArrivalLens {
    file: String,
    #[serde(flatten)]
    found: Option<ArrivalComparison>,
    /// The reason for which the lens is not optimized.
    #[serde(skip_serializing_if = "Option::is_none")]
    refused: Option<String>,
}

impl Display for ArrivalReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.machine)?;
        writeln!(
            f,
            "until within 1 % of the best merit known, of up to {} evaluations; -: never\n",
            self.evaluations
        )?;
        let mut table = TextTable::new(&[
            "lens",
            "best known",
            "method",
            "merit",
            "evaluations",
            "ms",
            "of evaluations",
            "of ms",
        ]);
        for ArrivalLens { file, found, .. } in &self.rows {
            for row in found.iter().flat_map(|found| &found.rows) {
                let best = found.as_ref().map_or(f64::NAN, |found| found.best_known);
                table.row([
                    file.clone(),
                    ShortNumber(best).to_string(),
                    value_name(&row.method),
                    format!("{:.4e}", row.merit),
                    row.evaluations.map_or("-".to_owned(), |count| count.to_string()),
                    row.ms.map_or("-".to_owned(), |ms| format!("{ms:.0}")),
                    row.evaluations_in_all.to_string(),
                    format!("{:.0}", row.ms_in_all),
                ]);
            }
        }
        write!(f, "{table}")?;
        for ArrivalLens { file, refused, .. } in &self.rows {
            refused.as_ref().map_or(Ok(()), |why| writeln!(f, "{file}: {why}"))?;
        }
        Ok(())
    }
}
