//! Printing of results: text for readers, JSON for programs.

use super::error::CliError;
use crate::files::json;
use crate::lens::Lens;
pub(super) use crate::math::ShortNumber;
use serde::Serialize;
use std::fmt::{self, Display};
use std::io::{Write as _, stderr, stdout};
use std::sync::{Mutex, PoisonError};

/// The printer of results, as text or as JSON.
#[derive(Debug)]
pub(super) struct Output {
    json: bool,
    /// The results so far, if they are collected instead of printed.
    collected: Option<Mutex<String>>,
}

impl Output {
    pub(super) fn new(json: bool) -> Self {
        Self { json, collected: None }
    }

    /// A printer that collects results as JSON.
    pub(super) fn collecting() -> Self {
        Self { json: true, collected: Some(Mutex::default()) }
    }

    /// True if results are printed as JSON.
    pub(super) fn is_json(&self) -> bool {
        self.json
    }

    /// The collected results; empty if they were printed.
    pub(super) fn into_collected(self) -> String {
        let into_text =
            |text: Mutex<String>| text.into_inner().unwrap_or_else(PoisonError::into_inner);
        self.collected.map(into_text).unwrap_or_default()
    }

    /// Prints a result.
    pub(super) fn print(&self, result: &(impl Serialize + Display)) -> Result<(), CliError> {
        let text = if self.json { json::pretty(result) } else { result.to_string() };
        if let Some(collected) = &self.collected {
            collected.lock().unwrap_or_else(PoisonError::into_inner).push_str(&text);
            return Ok(());
        }
        let mut out = stdout().lock();
        out.write_all(text.as_bytes())?;
        Ok(out.flush()?)
    }
}

/// Writes the file of the best lens, or the lens itself if it could not be saved.
pub(super) fn write_saved(
    f: &mut fmt::Formatter<'_>,
    out: Option<&str>,
    unsaved: Option<&Lens>,
) -> fmt::Result {
    out.map_or(Ok(()), |out| writeln!(f, "saved as {out}"))?;
    let Some(lens) = unsaved else { return Ok(()) };
    write!(f, "the lens could not be saved; this is its file:\n\n{}", json::write(lens))
}

/// Prints a note on standard error.
pub(super) fn print_note(text: impl Display) {
    // A note that cannot be printed is not a failure.
    drop(writeln!(stderr(), "{text}"));
}

/// A number of things, the noun in the singular for one.
pub(super) fn counted(count: usize, noun: &str) -> String {
    if count == 1 { format!("1 {noun}") } else { format!("{count} {noun}s") }
}

/// A number from rays, or 0 if it is below its error and that is rounding.
pub(super) fn without_rounding(value: f64, error: f64) -> f64 {
    if value.abs() <= error && error < ROUNDING { 0.0 } else { value }
}

/// The largest error, in mm or wavelengths, that is taken for rounding.
const ROUNDING: f64 = 1e-9;

/// A number, or a dash if it does not exist.
pub(super) fn or_dash(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), |value| ShortNumber(value).to_string())
}

/// A table of text: the first column is aligned to the left, the others to the right.
#[derive(Debug, Default)]
pub(super) struct TextTable {
    rows: Vec<Vec<String>>,
    /// Further columns that are aligned to the left.
    left: &'static [usize],
}

impl TextTable {
    pub(super) fn new(head: &[&str]) -> Self {
        Self { rows: vec![head.iter().map(|cell| (*cell).to_owned()).collect()], left: &[] }
    }

    /// Aligns further columns to the left, which are counted from 0.
    pub(super) fn left(self, columns: &'static [usize]) -> Self {
        Self { left: columns, ..self }
    }

    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    fn widths(&self) -> Vec<usize> {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let width = |row: &Vec<String>, i: usize| row.get(i).map_or(0, |cell| cell.chars().count());
        (0..columns).map(|i| self.rows.iter().map(|row| width(row, i)).max().unwrap_or(0)).collect()
    }
}

impl Display for TextTable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let widths = self.widths();
        for row in &self.rows {
            let cells = row.iter().zip(&widths).enumerate().map(|(i, (cell, width))| match i {
                i if i == 0 || self.left.contains(&i) => format!("{cell:<width$}"),
                _ => format!("{cell:>width$}"),
            });
            writeln!(f, "{}", cells.collect::<Vec<_>>().join("  ").trim_end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up() {
        let mut table = TextTable::new(&["row", "x"]);
        table.row(["a longer one".into(), "-1".into()]);
        assert_eq!(table.to_string(), "row            x\na longer one  -1\n");
    }

    #[test]
    fn a_number_below_its_rounding_error_is_0() {
        assert_eq!(without_rounding(-2e-12, 3e-12), 0.0);
        assert_eq!(without_rounding(-2e-12, 1e-12), -2e-12);
        // An error that is more than rounding says nothing about the number.
        assert_eq!(without_rounding(1e-3, 2e-3), 1e-3);
        assert_eq!(without_rounding(1.5, 1e-12), 1.5);
    }
}
