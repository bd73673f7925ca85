//! The report of a conversion between two formats: the outcome of each part of the lens.

use crate::lens::{Row, SurfaceNumber};
use serde::Serialize;
use std::fmt;

/// The outcome for one line or one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ConversionOutcome {
    /// The other format cannot represent it; it is lost.
    Dropped,
    /// A surface that cannot be traced; its lines are kept with the row, and rays meet its conic.
    Locked,
    /// It is represented approximately, as described by the note.
    Approximated,
    /// It affects no ray; it is kept in this report only.
    Preserved,
    /// It is represented exactly.
    Used,
}

impl ConversionOutcome {
    /// All outcomes, the most important one first.
    pub const ALL: [Self; 5] =
        [Self::Dropped, Self::Locked, Self::Approximated, Self::Preserved, Self::Used];

    /// The word in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dropped => "dropped",
            Self::Locked => "locked",
            Self::Approximated => "approximated",
            Self::Preserved => "preserved",
            Self::Used => "used",
        }
    }
}

/// One line of the source, or one number of the lens, with its outcome.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ConversionRow {
    /// The outcome.
    pub outcome: ConversionOutcome,
    /// The line in the foreign file, counted from 1; `None` for a number that has no line there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<usize>,
    /// The first word of the text.
    pub keyword: String,
    /// The whole text.
    pub text: String,
    /// The approximation, or the reason of the loss; empty for none.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub note: String,
}

/// The report of an import or export: used, approximated, preserved and dropped parts.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct ConversionReport {
    /// On import a row for each line; on export a row for each number that is not exact.
    pub rows: Vec<ConversionRow>,
}

impl ConversionReport {
    /// The number of rows with this outcome.
    pub fn count(&self, outcome: ConversionOutcome) -> usize {
        self.rows_with(outcome).count()
    }

    /// The number of rows with each outcome, as one line.
    pub fn counts(&self) -> String {
        let count =
            |outcome| format!("{} {}", self.count(outcome), ConversionOutcome::name(outcome));
        ConversionOutcome::ALL.map(count).join(", ")
    }

    /// The rows with this outcome.
    pub fn rows_with(&self, outcome: ConversionOutcome) -> impl Iterator<Item = &ConversionRow> {
        self.rows.iter().filter(move |row| row.outcome == outcome)
    }

    /// Adds a row without a line number.
    pub(super) fn add(&mut self, outcome: ConversionOutcome, what: &str, note: impl Into<String>) {
        self.rows.push(ConversionRow {
            outcome,
            line: None,
            keyword: what.split_whitespace().next().unwrap_or_default().to_owned(),
            text: what.to_owned(),
            note: note.into(),
        });
    }

    /// Adds an aperture of a foreign file that an export does not write back.
    pub(super) fn add_aperture_loss(&mut self, surface: SurfaceNumber, row: &Row) {
        if row.foreign_aperture.is_some() {
            let what = format!("aperture of surface {surface}");
            let note = "the apertures traced here are written, not the lines of its file";
            self.add(ConversionOutcome::Approximated, &what, note);
        }
    }

    /// Adds what a format without sheets of hyperhemispheres and without foreign shapes loses of a row.
    pub(super) fn add_row_losses(&mut self, surface: SurfaceNumber, row: &Row) {
        if row.hyperhemisphere {
            let what = format!("hyperhemisphere of surface {surface}");
            self.add(ConversionOutcome::Dropped, &what, "the other program decides by itself");
        }
        if let Some(locked) = &row.locked {
            let what = format!("surface {surface}: {}", locked.kind);
            self.add(ConversionOutcome::Locked, &what, "written as its conic or asphere alone");
        }
    }

    /// Changes the outcome of a line that was read before.
    pub(super) fn amend(
        &mut self,
        line: usize,
        outcome: ConversionOutcome,
        note: impl Into<String>,
    ) {
        // An import adds one row for each line, in order.
        if let Ok(found) = self.rows.binary_search_by_key(&Some(line), |row| row.line) {
            self.rows[found].outcome = outcome;
            self.rows[found].note = note.into();
        }
    }
}

impl fmt::Display for ConversionReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.counts())?;
        for row in ConversionOutcome::ALL.into_iter().flat_map(|outcome| self.rows_with(outcome)) {
            let line = row.line.map(|line| line.to_string()).unwrap_or_default();
            let text: String = row.text.chars().take(60).collect();
            let row = format!("{:<12} {line:>5}  {text:<40}  {}", row.outcome.name(), row.note);
            writeln!(f, "{}", row.trim_end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_shows_what_was_lost_first() {
        let mut report = ConversionReport::default();
        report.rows.push(ConversionRow {
            outcome: ConversionOutcome::Used,
            line: Some(7),
            keyword: "ENPD".to_owned(),
            text: "ENPD 16".to_owned(),
            note: String::new(),
        });
        report.add(ConversionOutcome::Dropped, "hyper of surface 3", "no such thing there");
        let table = report.to_string();
        let lines: Vec<&str> = table.lines().collect();
        assert_eq!(lines[0], "1 dropped, 0 locked, 0 approximated, 0 preserved, 1 used");
        assert!(lines[1].starts_with("dropped") && lines[1].ends_with("no such thing there"));
        assert!(lines[2].contains("    7  ENPD 16"), "{}", lines[2]);
        report.rows.truncate(1);
        report.amend(7, ConversionOutcome::Approximated, "as 15");
        assert_eq!(report.count(ConversionOutcome::Approximated), 1);
    }
}
