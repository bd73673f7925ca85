//! A file of another program as it was read: the outcome of its lines, and numbers to compare.

use super::{ConversionReport, OpenedLens, SelfCheck, StatedNumber, VignettingChoice};
use std::fmt;
use std::path::{Path, PathBuf};

/// A file of another program that a lens was read from.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportedFile {
    /// The file.
    pub path: PathBuf,
    /// The outcome of its lines.
    pub report: ConversionReport,
    /// Numbers of the lens at each zoom position, to compare with the program that wrote the file; empty
    /// if the glasses have no index at the wavelengths of the lens.
    pub checks: Vec<SelfCheck>,
    /// Numbers that the file states although they follow from the lens, beside those of this program.
    pub stated: Vec<StatedNumber>,
    /// The treatment of the vignetting factors of the file; `None` if it has none.
    pub vignetting: Option<VignettingChoice>,
}

impl OpenedLens {
    /// The file with its report; `None` for the native format, which holds every lens exactly.
    pub fn imported_from(&self, path: &Path) -> Option<ImportedFile> {
        let report = self.report.clone()?;
        let (checks, stated) = (self.checks.clone(), self.stated.clone());
        let (path, vignetting) = (path.to_owned(), self.vignetting);
        Some(ImportedFile { path, report, checks, stated, vignetting })
    }
}

impl fmt::Display for ImportedFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "imported {}", self.path.display())?;
        if !self.checks.is_empty() {
            writeln!(f, "To compare with the program that wrote it:")?;
        }
        self.checks.iter().try_for_each(|check| writeln!(f, "  {check}"))?;
        self.stated.iter().try_for_each(|number| writeln!(f, "  {number}"))?;
        write!(f, "{}", self.report)
    }
}
