//! Conversion of a lens file into another format.

use super::{ConversionReport, FileError, OpenedLens, SaveReport, SelfCheck, StatedNumber};
use serde::Serialize;
use std::fmt;
use std::path::Path;

/// The report of a conversion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Conversion {
    /// The report on the lines of a foreign file that was read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub import: Option<ConversionReport>,
    /// Numbers to compare with the program that wrote the file.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub checks: Vec<SelfCheck>,
    /// Numbers that the file states although they follow from the lens, beside those of this program.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub stated: Vec<StatedNumber>,
    /// The report on the written file.
    pub export: SaveReport,
}

/// Reads a lens from one file and writes it to another, each in any known format.
///
/// # Errors
/// Those of [`open`](super::open) and [`save`](super::save).
pub fn convert(from: impl AsRef<Path>, to: impl AsRef<Path>) -> Result<Conversion, FileError> {
    super::open(from)?.convert_to(to)
}

impl OpenedLens {
    /// Writes the lens to a file of any known format.
    ///
    /// # Errors
    /// Those of [`save`](super::save).
    pub fn convert_to(self, to: impl AsRef<Path>) -> Result<Conversion, FileError> {
        let export = super::save(&self.lens, to)?;
        let Self { report: import, checks, stated, .. } = self;
        Ok(Conversion { import, checks, stated, export })
    }
}

impl fmt::Display for Conversion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(report) = &self.import {
            write!(f, "read: {report}")?;
        }
        for check in &self.checks {
            writeln!(f, "{check}")?;
        }
        self.stated.iter().try_for_each(|number| writeln!(f, "{number}"))?;
        write!(f, "{}", self.export)
    }
}

impl fmt::Display for SaveReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.report {
            Some(report) => write!(f, "written: {report}")?,
            None => writeln!(f, "written: all of it, exactly")?,
        }
        match &self.proof {
            Some(proof) => writeln!(f, "{proof}"),
            None => Ok(()),
        }
    }
}
