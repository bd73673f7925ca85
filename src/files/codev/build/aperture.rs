//! Apertures and obscurations of a surface.

use crate::files::codev::file::{CodeVOutline, CodeVSurface};
use crate::files::outline::{ForeignOutline, OutlineForm, StandIn, is_free_plane};
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::lens::Row;

/// The commands whose outcome depends on all apertures of a surface.
const COMMANDS: [&str; 6] = ["REX", "REY", "ELX", "ELY", "ADX", "ADY"];

/// Writes the rim and the obstruction of a surface into its row, whose shape and place are known.
pub(super) fn apply(
    surface: &CodeVSurface,
    unit: f64,
    row: &mut Row,
    report: &mut ConversionReport,
) {
    let plane = is_free_plane(row);
    let rim = outline(surface.clip, surface.outline, surface.offset);
    let block = outline(surface.obstruction, surface.block, surface.offset);
    let rim = rim.map(|outline| outline.aperture(plane));
    let block = block.map(|outline| outline.obscuration(plane));
    report_commands(surface, rim.iter().chain(&block), report);
    if rim.iter().chain(&block).any(|own| own.moves) {
        row.decenter = surface.offset.map(|length| length * unit);
    }
    row.semi_diameter = rim.and_then(|own| own.radius).map(|radius| radius * unit);
    let inner = block.and_then(|own| own.radius).map(|radius| radius * unit);
    // An obstruction as wide as the aperture would block everything.
    row.obstruction = inner.filter(|inner| row.semi_diameter.is_none_or(|outer| *inner < outer));
}

/// The outline of a circle, or else of the half widths; `None` without either. A half width that is not
/// given is as long as the other one.
fn outline(circle: Option<f64>, outline: CodeVOutline, offset: [f64; 2]) -> Option<ForeignOutline> {
    if let Some(radius) = circle.filter(|radius| *radius > 0.0) {
        return Some(ForeignOutline { form: OutlineForm::Circle, half: [radius; 2], offset });
    }
    let [x, y] = outline.half;
    let half = [x.or(y)?, y.or(x)?];
    let form = if outline.is_ellipse { OutlineForm::Ellipse } else { OutlineForm::Rectangle };
    Some(ForeignOutline { form, half, offset })
}

/// Reports the commands of apertures that are no centred circles.
fn report_commands<'a>(
    surface: &CodeVSurface,
    apertures: impl Iterator<Item = &'a StandIn>,
    report: &mut ConversionReport,
) {
    let Some(own) = apertures.min_by_key(|own| own.outcome) else { return };
    let lines = report.rows.iter_mut().filter(|row| {
        row.outcome == ConversionOutcome::Used
            && COMMANDS.contains(&row.keyword.as_str())
            && row.line.is_some_and(|line| surface.aperture_lines.contains(&line))
    });
    for row in lines {
        row.outcome = own.outcome;
        row.note.clone_from(&own.note);
    }
}
