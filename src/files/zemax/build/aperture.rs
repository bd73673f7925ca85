//! Apertures and obscurations of a surface.

use crate::files::outline::{ForeignOutline, OutlineForm, StandIn, is_free_plane};
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::files::zemax::file::{ApertureLine, OutlineLine, ZemaxFile, ZemaxSurface};
use crate::lens::Row;

/// Writes the rim and the obstruction of a surface into its row, whose shape and place are known.
pub(super) fn apply(
    file: &ZemaxFile,
    number: usize,
    stop: usize,
    row: &mut Row,
    report: &mut ConversionReport,
) {
    let surface = &file.surfaces[number];
    let plane = is_free_plane(row);
    let (rim, rim_line) = rim(surface, plane).unzip();
    let (block, block_line) = obscuration(surface, plane).unzip();
    let moves = [&rim, &block].into_iter().flatten().any(|own| own.moves);
    for (own, line) in rim.iter().zip(rim_line).chain(block.iter().zip(block_line)) {
        report.amend(line, own.outcome, own.note.clone());
    }
    report_offset(surface, rim.iter().chain(&block), report);
    let outer = match &rim {
        Some(own) => {
            report_drawn(surface, own, report);
            own.radius
        }
        None => drawn(file, number, stop, report),
    };
    let unit = file.unit;
    row.semi_diameter = outer.map(|radius| radius * unit);
    row.obstruction = block.as_ref().and_then(|own| own.radius).map(|radius| radius * unit);
    if let (true, Some((x, y, _))) = (moves, surface.aperture_offset) {
        row.decenter = [x * unit, y * unit];
    }
    let is_exact =
        [&rim, &block].into_iter().flatten().all(|own| own.outcome == ConversionOutcome::Used);
    if !(is_exact && surface.other_apertures.is_empty()) {
        keep_lines(file, number, row, report);
    }
}

/// The keywords of apertures and obscurations.
const KEYWORDS: [&str; 11] =
    ["CLAP", "FLAP", "OBSC", "SQAP", "ELAP", "SQOB", "ELOB", "UDAD", "UDOB", "SPID", "OBDC"];

/// Keeps the lines on apertures, which an export writes back. Lengths in another unit are not kept.
fn keep_lines(file: &ZemaxFile, number: usize, row: &mut Row, report: &mut ConversionReport) {
    let surface = &file.surfaces[number];
    if file.unit == 1.0 {
        let is_kept = |line: &&String| {
            line.split_whitespace().next().is_some_and(|keyword| KEYWORDS.contains(&keyword))
        };
        row.keep_aperture("zmx", surface.lines.iter().filter(is_kept).cloned().collect());
    }
    let kept = if file.unit == 1.0 { "; an export as .zmx writes the line back" } else { "" };
    for line in &surface.other_apertures {
        let note = format!("no aperture of this form is traced: it clips nothing here{kept}");
        report.amend(*line, ConversionOutcome::Dropped, note);
    }
}

fn circle(radius: f64, offset: [f64; 2]) -> ForeignOutline {
    ForeignOutline { form: OutlineForm::Circle, half: [radius; 2], offset, turned: false }
}

/// The place of the apertures beside the vertex.
fn offset(surface: &ZemaxSurface) -> [f64; 2] {
    surface.aperture_offset.map_or([0.0; 2], |(x, y, _)| [x, y])
}

/// The circle that stands for the aperture, with its line: of a circular one, else of another form.
fn rim(surface: &ZemaxSurface, plane: bool) -> Option<(StandIn, usize)> {
    let offset = offset(surface);
    let circle = surface.clip.map(|(radius, line)| {
        let outline = circle(radius, offset);
        (outline.aperture(plane), line)
    });
    circle.or_else(|| {
        let OutlineLine { form, half, line } = surface.outline?;
        Some((ForeignOutline { form, half, offset, turned: false }.aperture(plane), line))
    })
}

/// The circle that stands for the obscuration, with its line.
fn obscuration(surface: &ZemaxSurface, plane: bool) -> Option<(StandIn, usize)> {
    let offset = offset(surface);
    let circle = surface.obstruction.map(|(radius, line)| {
        let outline = circle(radius, offset);
        (outline.obscuration(plane), line)
    });
    circle.or_else(|| {
        let OutlineLine { form, half, line } = surface.block?;
        Some((ForeignOutline { form, half, offset, turned: false }.obscuration(plane), line))
    })
}

/// Reports the displacement of the apertures.
fn report_offset<'a>(
    surface: &ZemaxSurface,
    apertures: impl Iterator<Item = &'a StandIn>,
    report: &mut ConversionReport,
) {
    let Some((.., line)) = surface.aperture_offset else { return };
    if let Some(own) = apertures.min_by_key(|own| own.outcome) {
        report.amend(line, own.outcome, own.note.clone());
    } else {
        let note = "there is no aperture on the surface that it could move";
        report.amend(line, ConversionOutcome::Preserved, note);
    }
}

/// Reports the drawn semi-diameter of a surface with an aperture, which alone clips.
fn report_drawn(surface: &ZemaxSurface, rim: &StandIn, report: &mut ConversionReport) {
    let Some(given) = surface.semi_diameter else { return };
    if rim.outcome != ConversionOutcome::Used {
        let note = "drawn in the file; the aperture of the surface clips";
        report.amend(given.line, ConversionOutcome::Preserved, note);
    }
}

/// The clipping radius of a surface without an aperture. In the file only apertures clip: a fixed
/// semi-diameter is drawn there and clips here, an automatic one is wide enough for every ray and is not
/// read.
fn drawn(
    file: &ZemaxFile,
    number: usize,
    stop: usize,
    report: &mut ConversionReport,
) -> Option<f64> {
    let surface = &file.surfaces[number];
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
