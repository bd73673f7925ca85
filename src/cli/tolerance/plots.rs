//! The results of `tolerance` as a picture: the worst errors, the distribution of the lenses that are
//! made, and the yield against the limit.

use crate::cli::error::CliError;
use crate::files;
use crate::lens::ToleranceSheet;
use crate::report::{sheet_bytes, tolerance_sheet};
use crate::tolerance::ToleranceAnalysis;
use std::path::Path;

/// The extensions of the files that can be written.
pub(super) const EXTENSIONS: [&str; 3] = ["png", "svg", "pdf"];

/// Draws the results into a file.
pub(super) fn save(
    path: &Path,
    lens: &str,
    sheet: &ToleranceSheet,
    analysis: &ToleranceAnalysis,
) -> Result<(), CliError> {
    let fail = |why: String| CliError::Failed(format!("{}: {why}", path.display()));
    let charts = tolerance_sheet(lens, sheet, analysis).map_err(|why| fail(why.to_string()))?;
    let bytes = sheet_bytes(&charts, lens, path).map_err(|why| fail(why.to_string()))?;
    Ok(files::write_atomic(path, &bytes)?)
}
