//! One surface between object and image.

use crate::files::error::ParseError;
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::files::zemax::file::{ApertureLine, ZemaxFile, ZemaxSurface};
use crate::files::zemax::shape::{self, ZemaxShape};
use crate::files::zemax::{INFINITE_GAP, coordinate_breaks};
use crate::lens::{Medium, Row};

/// The row of surface `number`.
pub(super) fn row(
    file: &ZemaxFile,
    number: usize,
    stop: usize,
    medium: Medium,
    report: &mut ConversionReport,
) -> Result<Row, ParseError> {
    let surface = &file.surfaces[number];
    let form = if coordinate_breaks::is_break(surface) {
        let note = "this run of coordinate breaks has no effect; read as planes";
        report.amend(surface.kind.1, ConversionOutcome::Approximated, note);
        ZemaxShape::default()
    } else {
        shape::surface_shape(surface, number)?
    };
    if let Some((line, note)) = form.note {
        report.amend(line, ConversionOutcome::Used, note);
    }
    let unit = file.unit;
    let scaled =
        form.asphere.iter().zip((4..).step_by(2)).map(|(a, power)| a * unit.powi(1 - power));
    Ok(Row {
        curvature: form.curvature / unit,
        conic: form.conic,
        asphere: scaled.collect(),
        thickness: thickness(surface, number)? * unit,
        medium,
        semi_diameter: semi_diameter(file, number, stop, report).map(|radius| radius * unit),
        obstruction: surface.obstruction.map(|(radius, _)| radius * unit),
        stop: number == stop,
        hyperhemisphere: false,
        decenter: [0.0; 2],
        tilt: [0.0; 2],
        comment: surface.comment.clone(),
    })
}

fn thickness(surface: &ZemaxSurface, number: usize) -> Result<f64, ParseError> {
    let (thickness, line) = surface.thickness.unwrap_or((0.0, surface.line));
    if thickness.abs() < INFINITE_GAP {
        return Ok(thickness);
    }
    let found = format!("an infinite thickness after surface {number}");
    let expected = "INFINITY only behind the object".to_owned();
    Err(ParseError { place: format!("line {line}"), found, expected })
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
