//! Apertures and obscurations of a surface.

use crate::files::outline::{ForeignOutline, OutlineForm};
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::files::zemax::file::{ApertureLine, OutlineLine, ZemaxFile, ZemaxSurface};
use crate::lens::{ApertureShape, BlockedSide, Row, SurfaceAperture};

/// Writes the rim, the obstruction and the other apertures of a surface into its row.
pub(super) fn apply(
    file: &ZemaxFile,
    number: usize,
    stop: usize,
    row: &mut Row,
    report: &mut ConversionReport,
) {
    let surface = &file.surfaces[number];
    let (outside, inside) = (BlockedSide::Outside, BlockedSide::Inside);
    let rims = outlines(surface, surface.clip, surface.outline);
    let holes = outlines(surface, surface.obstruction, surface.block);
    let own = rims.iter().map(|own| (own, outside)).chain(holes.iter().map(|own| (own, inside)));
    for ((found, line), blocks) in own {
        found.add_to(row, blocks, file.unit);
        report.amend(*line, ConversionOutcome::Used, found.note(blocks));
    }
    spider(surface, file.unit, row, report);
    report_offset(surface, row, report);
    if let Some((found, _)) = rims.first() {
        report_drawn(surface, found, report);
    } else {
        let outer = drawn(file, number, stop, report);
        row.semi_diameter = outer.map(|radius| radius * file.unit);
    }
    if !surface.other_apertures.is_empty() {
        keep_lines(file, number, row, report);
    }
}

/// Writes the arms of a spider into the row.
fn spider(surface: &ZemaxSurface, unit: f64, row: &mut Row, report: &mut ConversionReport) {
    let Some((arms, width, line)) = surface.spider else { return };
    let center = offset(surface);
    let shape = ApertureShape::Spider { arms, width };
    let aperture = SurfaceAperture { center, ..SurfaceAperture::obscuration(shape) };
    report.amend(line, ConversionOutcome::Used, format!("{aperture}: traced"));
    row.apertures.push(aperture.scaled(unit));
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

/// The place of the apertures beside the vertex.
fn offset(surface: &ZemaxSurface) -> [f64; 2] {
    surface.aperture_offset.map_or([0.0; 2], |(x, y, _)| [x, y])
}

/// The apertures or the obscurations, each with its line: a circular one and one of another form.
fn outlines(
    surface: &ZemaxSurface,
    circle: Option<(f64, usize)>,
    other: Option<OutlineLine>,
) -> Vec<(ForeignOutline, usize)> {
    let offset = offset(surface);
    let plain = |form, half| ForeignOutline { form, half, offset, angle: 0.0 };
    let circle = circle.map(|(radius, line)| (plain(OutlineForm::Circle, [radius; 2]), line));
    let other = other.map(|OutlineLine { form, half, line }| (plain(form, half), line));
    circle.into_iter().chain(other).collect()
}

/// Reports the displacement of the apertures.
fn report_offset(surface: &ZemaxSurface, row: &Row, report: &mut ConversionReport) {
    let Some((.., line)) = surface.aperture_offset else { return };
    if row.apertures.is_empty() {
        let note = "there is no aperture on the surface that it could move";
        report.amend(line, ConversionOutcome::Preserved, note);
    } else {
        report.amend(line, ConversionOutcome::Used, "the place of the apertures of the surface");
    }
}

/// Reports the drawn semi-diameter of a surface with an aperture, which alone clips.
fn report_drawn(surface: &ZemaxSurface, rim: &ForeignOutline, report: &mut ConversionReport) {
    let Some(given) = surface.semi_diameter else { return };
    if rim.centred_radius().is_none() {
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
