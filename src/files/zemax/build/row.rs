//! One surface between object and image.

use super::aperture;
use crate::files::error::ParseError;
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::files::zemax::INFINITE_GAP;
use crate::files::zemax::file::{ZemaxFile, ZemaxSurface};
use crate::files::zemax::row_plan::PlannedRow;
use crate::files::zemax::shape::{self, ZemaxShape};
use crate::lens::{LockedSurface, Medium, Pose, Row};

/// The row of a surface.
pub(super) fn row(
    file: &ZemaxFile,
    planned: &PlannedRow,
    stop: usize,
    medium: Medium,
    report: &mut ConversionReport,
) -> Result<Row, ParseError> {
    let number = planned.surface;
    let surface = &file.surfaces[number];
    let (form, locked) = shape_or_lock(surface, file.unit, report);
    if let Some((line, outcome, note)) = form.note {
        report.amend(line, outcome, note);
    }
    let unit = file.unit;
    let scaled_pose = |pose: Pose<f64>| Pose { shift: pose.shift * unit, ..pose };
    let scaled =
        form.asphere.iter().zip((4..).step_by(2)).map(|(a, power)| a * unit.powi(1 - power));
    let mut row = Row {
        curvature: form.curvature / unit,
        conic: form.conic,
        asphere: scaled.collect(),
        freeform: form.freeform.map(|form| form.in_mm(unit)),
        ideal: form.ideal.map(|ideal| ideal.scaled(unit)),
        thickness: thickness(file, planned)? * unit,
        medium,
        stop: number == stop,
        locked,
        comment: surface.comment.clone(),
        ..Row::default()
    };
    row.place_on_axis(&scaled_pose(planned.before), &scaled_pose(planned.after));
    aperture::apply(file, number, stop, &mut row, report);
    Ok(row)
}

/// The shape of a surface. One that cannot be traced becomes its base conic, and its lines are kept.
fn shape_or_lock(
    surface: &ZemaxSurface,
    unit: f64,
    report: &mut ConversionReport,
) -> (ZemaxShape, Option<LockedSurface>) {
    match shape::surface_shape(surface) {
        Ok(form) => (form, None),
        Err(why) => {
            let (kind, line) = &surface.kind;
            let why = if why.is_empty() { why } else { format!(" with {why}") };
            let note = format!(
                "{kind}{why} cannot be traced: the row is locked and rays meet its conic alone"
            );
            report.amend(*line, ConversionOutcome::Locked, note);
            let lengths = (unit != 1.0).then(|| format!("UNIT {unit} mm"));
            let lines = lengths.into_iter().chain(surface.lines.iter().cloned()).collect();
            let locked = LockedSurface { kind: kind.clone(), lines };
            (ZemaxShape::base(surface), Some(locked))
        }
    }
}

fn thickness(file: &ZemaxFile, planned: &PlannedRow) -> Result<f64, ParseError> {
    let (number, thickness) = (planned.gap, planned.thickness);
    let surface = &file.surfaces[number];
    let line = surface.thickness.map_or(surface.line, |(_, line)| line);
    if thickness.abs() < INFINITE_GAP {
        return Ok(thickness);
    }
    let found = format!("an infinite thickness after surface {number}");
    let expected = "INFINITY only behind the object".to_owned();
    Err(ParseError { place: format!("line {line}"), found, expected })
}
