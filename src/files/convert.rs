//! From one file to another.

use super::{ConversionReport, FileError, SaveReport, SelfCheck};
use serde::Serialize;
use std::fmt;
use std::path::Path;

/// What became of a lens on its way from one file to another.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Conversion {
    /// What became of the lines of a foreign file that was read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub import: Option<ConversionReport>,
    /// The numbers to compare with the program from which it comes.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub checks: Vec<SelfCheck>,
    /// What became of the numbers of the lens on writing.
    pub export: SaveReport,
}

/// Reads a lens from one file and writes it to another, each in any known format.
pub fn convert(from: impl AsRef<Path>, to: impl AsRef<Path>) -> Result<Conversion, FileError> {
    let opened = super::open(from)?;
    let export = super::save(&opened.lens, to)?;
    Ok(Conversion { import: opened.report, checks: opened.checks, export })
}

impl fmt::Display for Conversion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(report) = &self.import {
            write!(f, "read: {report}")?;
        }
        for check in &self.checks {
            writeln!(f, "{check}")?;
        }
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
