//! The outcome of an experiment: claims with limits, tables, plots.

use crate::lens::Lens;
use crate::plot::NamedPlot;
use serde::Serialize;
use std::fmt::{self, Display};

/// The outcome of an experiment.
#[derive(Debug, Clone, Default, Serialize)]
pub struct ExperimentOutcome {
    /// The claims of the figure with their numbers.
    pub claims: Vec<Claim>,
    /// The data of the figure.
    pub tables: Vec<DataTable>,
    /// The plots; not a part of the JSON.
    #[serde(skip)]
    pub pictures: Vec<NamedPlot>,
    /// The resulting lenses with their names; not a part of the JSON.
    #[serde(skip)]
    pub lenses: Vec<(String, Lens)>,
    /// The number of rays traced.
    pub rays: usize,
    /// Sentences: what the figure shows, and the reasons why claims fail.
    pub reasons: Vec<String>,
}

impl ExperimentOutcome {
    /// The claims that do not hold.
    pub fn failed(&self) -> impl Iterator<Item = &Claim> {
        self.claims.iter().filter(|claim| !claim.holds)
    }
}

/// A number that has to satisfy a limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Claim {
    /// The description of the number.
    pub says: String,
    /// The number.
    pub value: f64,
    /// Its estimated error; 0 for an exact number.
    pub error: f64,
    /// The unit of all three numbers; empty for a ratio or a count.
    pub unit: &'static str,
    /// The required relation of the number to the limit.
    pub rule: ClaimRelation,
    /// The limit.
    pub limit: f64,
    /// True if the relation holds even if the number is wrong by its error.
    pub holds: bool,
}

/// The required relation of a number to its limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ClaimRelation {
    /// Not above the limit.
    AtMost,
    /// Not below the limit.
    AtLeast,
    /// Equal to the limit.
    Exactly,
}

impl Display for ClaimRelation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::AtMost => "at most",
            Self::AtLeast => "at least",
            Self::Exactly => "exactly",
        })
    }
}

/// The verdict of the data on a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClaimVerdict {
    /// The number satisfies its limit even if it is wrong by its error.
    Holds,
    /// The limit is within the error of the number: the data show neither that the claim holds nor
    /// that it is wrong.
    NoEffect,
    /// The number does not satisfy its limit, even if it is wrong by its error.
    Fails,
}

impl Display for ClaimVerdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Holds => "holds",
            Self::NoEffect => "no effect beyond its error",
            Self::Fails => "fails",
        })
    }
}

impl Claim {
    /// A claim that a number is not above a limit.
    pub fn at_most(says: impl Into<String>, value: f64, limit: f64) -> Self {
        Self::new(says, value, ClaimRelation::AtMost, limit)
    }

    /// A claim that a number is not below a limit.
    pub fn at_least(says: impl Into<String>, value: f64, limit: f64) -> Self {
        Self::new(says, value, ClaimRelation::AtLeast, limit)
    }

    /// A claim that two numbers are equal.
    pub fn exactly(says: impl Into<String>, value: f64, limit: f64) -> Self {
        Self::new(says, value, ClaimRelation::Exactly, limit)
    }

    fn new(says: impl Into<String>, value: f64, rule: ClaimRelation, limit: f64) -> Self {
        let says = says.into();
        Self { says, value, error: 0.0, unit: "", rule, limit, holds: false }.check()
    }

    /// The claim with a unit.
    #[must_use]
    pub fn in_unit(mut self, unit: &'static str) -> Self {
        self.unit = unit;
        self
    }

    /// The claim with the error of its number.
    #[must_use]
    pub fn with_error(mut self, error: f64) -> Self {
        self.error = error;
        self.check()
    }

    /// The verdict of the data on the claim.
    pub fn verdict(&self) -> ClaimVerdict {
        let Self { value, error, limit, .. } = *self;
        if self.holds {
            ClaimVerdict::Holds
        } else if self.rule != ClaimRelation::Exactly && (value - limit).abs() <= error {
            ClaimVerdict::NoEffect
        } else {
            ClaimVerdict::Fails
        }
    }

    fn check(mut self) -> Self {
        let Self { value, error, limit, .. } = self;
        self.holds = match self.rule {
            ClaimRelation::AtMost => value + error <= limit,
            ClaimRelation::AtLeast => value - error >= limit,
            ClaimRelation::Exactly => value == limit,
        };
        self
    }
}

/// A table with named columns of numbers and words.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DataTable {
    /// The name, as a part of a file name.
    pub name: &'static str,
    /// The names of the columns with their units: `radius_mm`.
    pub columns: Vec<&'static str>,
    /// The rows, each with as many cells as there are columns.
    pub rows: Vec<Vec<TableCell>>,
}

impl DataTable {
    /// A table without rows.
    pub fn new(name: &'static str, columns: &[&'static str]) -> Self {
        Self { name, columns: columns.to_vec(), rows: Vec::new() }
    }

    /// Adds a row.
    pub fn push_row(&mut self, cells: impl IntoIterator<Item = TableCell>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// The text of a CSV file (RFC 4180).
    pub fn csv(&self) -> String {
        let head = self.columns.iter().map(|name| quoted(name)).collect::<Vec<_>>().join(",");
        let line = |row: &Vec<TableCell>| {
            let cells: Vec<String> = row.iter().map(|cell| quoted(&cell.to_string())).collect();
            cells.join(",")
        };
        let lines = std::iter::once(head).chain(self.rows.iter().map(line));
        lines.map(|line| line + "\r\n").collect()
    }
}

fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// A number or a word.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum TableCell {
    /// A number; NaN is written as an empty cell.
    Number(f64),
    /// A word.
    Word(String),
}

impl From<f64> for TableCell {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl From<usize> for TableCell {
    fn from(value: usize) -> Self {
        Self::Number(value as f64)
    }
}

impl From<&str> for TableCell {
    fn from(text: &str) -> Self {
        Self::Word(text.to_owned())
    }
}

impl From<String> for TableCell {
    fn from(text: String) -> Self {
        Self::Word(text)
    }
}

impl Display for TableCell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(value) if value.is_finite() => write!(f, "{value:?}"),
            Self::Number(_) => Ok(()),
            Self::Word(word) => f.write_str(word),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_counts_against_a_claim() {
        let claim = Claim::at_most("a", 0.9, 1.0);
        assert!(claim.holds && !claim.clone().with_error(0.2).holds);
        assert!(!Claim::at_least("b", 1.1, 1.0).with_error(0.2).holds);
        assert!(Claim::exactly("c", 0.0, 0.0).holds && !Claim::exactly("c", 1e-300, 0.0).holds);
        assert!(!Claim::at_most("d", f64::NAN, 1.0).holds);
        assert!(!Claim::at_least("e", f64::NAN, 1.0).holds);
    }

    #[test]
    fn a_number_within_its_error_of_the_limit_decides_nothing() {
        let gain = |value: f64| Claim::at_least("gain", value, 0.0).with_error(0.05).verdict();
        for value in [0.01, -0.01] {
            assert_eq!(gain(value), ClaimVerdict::NoEffect);
        }
        assert_eq!(gain(0.06), ClaimVerdict::Holds);
        assert_eq!(gain(-0.06), ClaimVerdict::Fails);
        assert_eq!(gain(f64::NAN), ClaimVerdict::Fails);
        let count = Claim::exactly("count", 1.0, 0.0).with_error(2.0);
        assert_eq!(count.verdict(), ClaimVerdict::Fails);
    }

    #[test]
    fn a_table_becomes_csv() {
        let mut table = DataTable::new("t", &["name", "mm"]);
        table.push_row(["rim of 3, 4".into(), 0.5.into()]);
        table.push_row(["a \"stop\"".into(), f64::NAN.into()]);
        assert_eq!(table.csv(), "name,mm\r\n\"rim of 3, 4\",0.5\r\n\"a \"\"stop\"\"\",\r\n");
    }
}
