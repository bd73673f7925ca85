//! From lines to a draft: what each keyword means.
//!
//! The order of lines is free: `SURF` begins a surface, the next header keyword ends it. A keyword
//! that is not known is no error; its line is preserved in the report.

mod header;
mod surface;

use super::draft::{Draft, Operand};
use super::line::{self, Line};
use crate::files::error::Malformed;
use crate::files::report::{Outcome, Report, ReportRow};

/// What became of a line.
pub(super) struct Verdict {
    outcome: Outcome,
    note: String,
}

fn used() -> Verdict {
    Verdict { outcome: Outcome::Used, note: String::new() }
}

fn preserved() -> Verdict {
    Verdict { outcome: Outcome::Preserved, note: String::new() }
}

fn approximated(note: impl Into<String>) -> Verdict {
    Verdict { outcome: Outcome::Approximated, note: note.into() }
}

fn dropped(note: impl Into<String>) -> Verdict {
    Verdict { outcome: Outcome::Dropped, note: note.into() }
}

/// Reads every line.
pub(super) fn parse(text: &str) -> Result<(Draft, Report), Malformed> {
    let mut reader = Reader::default();
    for line in line::lines(text) {
        let Verdict { outcome, note } = reader.read(&line)?;
        reader.report.rows.push(ReportRow {
            outcome,
            line: Some(line.number),
            keyword: line.keyword.to_owned(),
            text: line.text(),
            note,
        });
    }
    Ok((reader.draft, reader.report))
}

#[derive(Default)]
struct Reader {
    draft: Draft,
    report: Report,
    /// Whether the lines belong to the last surface.
    in_surface: bool,
    /// Whether the multi-configuration table has begun.
    in_table: bool,
}

impl Reader {
    fn read(&mut self, line: &Line<'_>) -> Result<Verdict, Malformed> {
        if line.keyword == "SURF" {
            self.in_surface = true;
            return surface::begin(&mut self.draft, line);
        }
        if line.keyword == "MNUM" {
            (self.in_surface, self.in_table) = (false, true);
            return self.configurations(line);
        }
        if self.in_table && TABLE.contains(&line.keyword) {
            return self.operand(line);
        }
        if self.in_table && OTHER_OPERANDS.contains(&line.keyword) {
            return Ok(self.other_operand());
        }
        if let Some(verdict) = header::read(&mut self.draft, line)? {
            self.in_surface = false;
            return Ok(verdict);
        }
        match self.draft.surfaces.last_mut() {
            Some(surface) if self.in_surface => surface::read(surface, line),
            None if surface::KEYWORDS.contains(&line.keyword) => {
                Err(line.wrong(format!("`{}` before the first SURF", line.text()), "SURF 0"))
            }
            _ => Ok(preserved()),
        }
    }

    fn configurations(&mut self, line: &Line<'_>) -> Result<Verdict, Malformed> {
        self.draft.configurations = line.count(0)?.max(1);
        if self.draft.configurations > MOST_CONFIGURATIONS {
            let found = format!("{} configurations", self.draft.configurations);
            return Err(line.wrong(found, &format!("at most {MOST_CONFIGURATIONS}")));
        }
        Ok(used())
    }

    fn operand(&mut self, line: &Line<'_>) -> Result<Verdict, Malformed> {
        let operand = Operand {
            name: line.keyword.to_owned(),
            target: line.count(0)?,
            configuration: line.count(1)?,
            value: line.number(2)?,
            variable: line.number_or(3, 0.0)? == 1.0,
            line: line.number,
        };
        if operand.configuration == 0 || operand.configuration > self.draft.configurations {
            return Ok(dropped("no such configuration"));
        }
        self.draft.operands.push(operand);
        Ok(used())
    }

    fn other_operand(&self) -> Verdict {
        if self.draft.configurations == 1 {
            return preserved();
        }
        dropped("only thicknesses, aperture and fields differ between zoom positions here")
    }
}

/// More than any zoom lens has, few enough to list.
const MOST_CONFIGURATIONS: usize = 1000;

/// The operands of the multi-configuration table that are read.
const TABLE: &[&str] = &["THIC", "APER", "XFIE", "YFIE", "SDIA"];

/// Those that change the lens and are not read.
const OTHER_OPERANDS: &[&str] = &[
    "CRVT", "CONN", "GLSS", "PRAM", "PAR1", "PAR2", "PAR3", "PAR4", "PAR5", "PAR6", "PAR7", "PAR8",
    "WAVE", "WLWT", "PRWV", "FLTP", "FLWT", "FVDX", "FVDY", "FVCX", "FVCY", "FVAN", "IGNR", "APMX",
    "APMN", "STPS", "TEMP", "PRES", "MIND", "MABB",
];
