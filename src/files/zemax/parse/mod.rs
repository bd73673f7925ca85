//! Reading of the lines: the meaning of each keyword.
//!
//! The order of lines is free: `SURF` begins a surface, the next header keyword ends it. A keyword
//! that is not known is not an error; its line is preserved in the report.

mod header;
mod surface;

use super::file::{ConfigurationOperand, ZemaxFile};
use super::line::{self, ZemaxLine};
use crate::files::error::ParseError;
use crate::files::report::{ConversionOutcome, ConversionReport, ConversionRow};

/// The outcome of a line, with a note.
pub(super) struct LineOutcome {
    outcome: ConversionOutcome,
    note: String,
}

fn used() -> LineOutcome {
    LineOutcome { outcome: ConversionOutcome::Used, note: String::new() }
}

fn preserved() -> LineOutcome {
    LineOutcome { outcome: ConversionOutcome::Preserved, note: String::new() }
}

fn approximated(note: impl Into<String>) -> LineOutcome {
    LineOutcome { outcome: ConversionOutcome::Approximated, note: note.into() }
}

fn dropped(note: impl Into<String>) -> LineOutcome {
    LineOutcome { outcome: ConversionOutcome::Dropped, note: note.into() }
}

/// Reads every line.
pub(super) fn parse(text: &str) -> Result<(ZemaxFile, ConversionReport), ParseError> {
    let mut reader = ZemaxReader::default();
    for line in line::lines(text) {
        let LineOutcome { outcome, note } = reader.read(&line)?;
        reader.report.rows.push(ConversionRow {
            outcome,
            line: Some(line.number),
            keyword: line.keyword.to_owned(),
            text: line.source_text(),
            note,
        });
    }
    Ok((reader.file, reader.report))
}

#[derive(Default)]
struct ZemaxReader {
    file: ZemaxFile,
    report: ConversionReport,
    /// True while lines belong to the last surface.
    in_surface: bool,
    /// True from the beginning of the multi-configuration table.
    in_table: bool,
}

impl ZemaxReader {
    fn read(&mut self, line: &ZemaxLine<'_>) -> Result<LineOutcome, ParseError> {
        if line.keyword == "SURF" {
            self.in_surface = true;
            return surface::begin(&mut self.file, line);
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
        if let Some(verdict) = header::read(&mut self.file, line)? {
            self.in_surface = false;
            return Ok(verdict);
        }
        match self.file.surfaces.last_mut() {
            Some(surface) if self.in_surface => {
                surface.lines.push(line.source_text());
                surface::read(surface, line)
            }
            None if surface::KEYWORDS.contains(&line.keyword) => {
                Err(line
                    .malformed(format!("`{}` before the first SURF", line.source_text()), "SURF 0"))
            }
            _ => Ok(preserved()),
        }
    }

    fn configurations(&mut self, line: &ZemaxLine<'_>) -> Result<LineOutcome, ParseError> {
        self.file.configurations = line.count(0)?.max(1);
        if self.file.configurations > MAX_CONFIGURATIONS {
            let found = format!("{} configurations", self.file.configurations);
            return Err(line.malformed(found, &format!("at most {MAX_CONFIGURATIONS}")));
        }
        Ok(used())
    }

    fn operand(&mut self, line: &ZemaxLine<'_>) -> Result<LineOutcome, ParseError> {
        let operand = ConfigurationOperand {
            name: line.keyword.to_owned(),
            target: line.count(0)?,
            configuration: line.count(1)?,
            value: line.number(2)?,
            variable: line.number_or(3, 0.0)? == 1.0,
            line: line.number,
        };
        if operand.configuration == 0 || operand.configuration > self.file.configurations {
            return Ok(dropped("no such configuration"));
        }
        self.file.operands.push(operand);
        Ok(used())
    }

    fn other_operand(&self) -> LineOutcome {
        if self.file.configurations == 1 {
            return preserved();
        }
        dropped("this cannot differ between zoom positions")
    }
}

/// The largest accepted number of configurations.
const MAX_CONFIGURATIONS: usize = 1000;

/// The operands of the multi-configuration table that are read.
const TABLE: &[&str] = &[
    "THIC", "CRVT", "CONN", "APER", "XFIE", "YFIE", "SDIA", "FVDX", "FVDY", "FVCX", "FVCY", "FVAN",
];

/// Operands that change the lens and are not read.
const OTHER_OPERANDS: &[&str] = &[
    "GLSS", "PRAM", "PAR1", "PAR2", "PAR3", "PAR4", "PAR5", "PAR6", "PAR7", "PAR8", "WAVE", "WLWT",
    "PRWV", "FLTP", "FLWT", "IGNR", "APMX", "APMN", "STPS", "TEMP", "PRES", "MIND", "MABB",
];
