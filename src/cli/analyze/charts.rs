//! The curves of an analysis as a picture or on paper: a row of charts for each field.

use super::caption::{CaptionUnits, caption};
use super::{AnalysisReport, AnalysisRun, FieldOutcome, TextLines, field_charts};
use crate::cli::error::CliError;
use crate::cli::output::ShortNumber;
use crate::files;
use crate::lens::FieldKind;
use crate::plot::{CurveChart, CurveSheet};
use crate::report::sheet_bytes;
use serde::Serialize;
use std::path::Path;

/// The extensions of the files that can be written.
pub(super) const EXTENSIONS: [&str; 3] = ["png", "svg", "pdf"];

/// Draws a result into a file: over the field, or for each field that has light.
pub(super) fn save<T: TextLines + Serialize>(
    run: &AnalysisRun,
    report: &AnalysisReport<T>,
    path: &Path,
) -> Result<(), CliError> {
    let lens = run.opened.lens.name.as_str();
    let over_field = field_charts::charts(run);
    let is_over_field = !over_field.is_empty();
    let rows = if is_over_field { vec![over_field] } else { rows(report) };
    let fail = |why: String| CliError::Failed(format!("{}: {why}", path.display()));
    if rows.iter().flatten().all(|chart| chart.curves.is_empty()) {
        return Err(fail("there is nothing to draw".to_owned()));
    }
    // The rest of the title explains the printed table.
    let title = T::TITLE.split([';', ':']).next().unwrap_or_default();
    let caption = if is_over_field {
        // The report is that of the fields of the lens, not that of the places of the curves.
        Vec::new()
    } else {
        let value = serde_json::to_value(report).map_err(|why| fail(why.to_string()))?;
        let units = CaptionUnits { field: unit(report.field_kind), error: T::error_unit };
        caption(&value, units)
    };
    let sheet = CurveSheet { title: format!("{lens}: {title}"), rows, caption };
    let bytes = sheet_bytes(&sheet, lens, path).map_err(|why| fail(why.to_string()))?;
    Ok(files::write_atomic(path, &bytes)?)
}

/// The unit of the fields, as it follows a number.
const fn unit(kind: FieldKind) -> &'static str {
    match kind {
        FieldKind::Angle => " deg",
        FieldKind::ObjectHeight | FieldKind::ImageHeight => " mm",
    }
}

/// The charts of each field, with its name before their titles.
fn rows<T: TextLines>(report: &AnalysisReport<T>) -> Vec<Vec<CurveChart>> {
    let unit = unit(report.field_kind);
    let row = |field: &super::AtField<T>| {
        let FieldOutcome::Transmitted(found) = &field.outcome else { return None };
        let (x, y) = (ShortNumber(field.x), ShortNumber(field.y));
        let x = if field.x == 0.0 { String::new() } else { format!("x {x}{unit}, ") };
        let named = |chart: CurveChart| {
            let title = format!("{x}y {y}{unit}: {}", chart.title);
            CurveChart { title, ..chart }
        };
        Some(found.charts().into_iter().map(named).collect())
    };
    report.fields.iter().filter_map(row).collect()
}
