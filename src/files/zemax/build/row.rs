//! One surface between object and image.

use crate::files::error::ParseError;
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::files::zemax::INFINITE_GAP;
use crate::files::zemax::file::{ApertureLine, ZemaxFile, ZemaxSurface};
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
        semi_diameter: semi_diameter(file, number, stop, report).map(|radius| radius * unit),
        obstruction: obstruction(surface).map(|radius| radius * unit),
        stop: number == stop,
        locked,
        comment: surface.comment.clone(),
        ..Row::default()
    };
    row.place_on_axis(&scaled_pose(planned.before), &scaled_pose(planned.after));
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

/// The radius of the obstruction, which is centred.
fn obstruction(surface: &ZemaxSurface) -> Option<f64> {
    let (radius, _) = surface.obstruction?;
    surface.aperture_offset.is_none().then_some(radius)
}

/// The clipping radius. In the file only circular apertures clip: a fixed semi-diameter is drawn there
/// and clips here, an automatic one is wide enough for every ray and is not read.
fn semi_diameter(
    file: &ZemaxFile,
    number: usize,
    stop: usize,
    report: &mut ConversionReport,
) -> Option<f64> {
    let surface = &file.surfaces[number];
    if let Some((.., line)) = surface.aperture_offset {
        let note = "a decentred aperture: only centred ones clip here, so nothing clips";
        let clip = surface.clip.map(|(_, line)| line);
        let drawn = surface.semi_diameter.map(|given| given.line);
        for line in [Some(line), clip, drawn].into_iter().flatten() {
            report.amend(line, ConversionOutcome::Dropped, note);
        }
        return None;
    }
    if let Some((radius, _)) = surface.clip {
        return Some(radius);
    }
    let given = surface.semi_diameter?;
    let floating = matches!(file.aperture, Some((ApertureLine::FloatByStop, _)));
    if floating && number == stop {
        return None; // it is the aperture of the lens
    }
    if given.fixed && surface.obstruction.is_some_and(|(inner, _)| inner >= given.value) {
        let note = "the drawn size of the obscuration; nothing is clipped outside it";
        report.amend(given.line, ConversionOutcome::Preserved, note);
        return None;
    }
    if given.fixed && given.value > 0.0 {
        let note = "clips in this program; in the file it is only drawn";
        report.amend(given.line, ConversionOutcome::Approximated, note);
        return Some(given.value);
    }
    let note = "automatic in the file; nothing is clipped";
    report.amend(given.line, ConversionOutcome::Preserved, note);
    None
}
