//! Apertures and obscurations of a surface.

use crate::files::codev::command::surface_word;
use crate::files::codev::file::{CodeVOutline, CodeVSurface};
use crate::files::outline::{ForeignOutline, OutlineForm, StandIn, is_free_plane};
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::lens::Row;

/// The commands whose outcome depends on all apertures of a surface.
const COMMANDS: [&str; 7] = ["REX", "REY", "ELX", "ELY", "ADX", "ADY", "ARO"];

/// Writes the rim and the obstruction of a surface into its row, whose shape and place are known.
pub(super) fn apply(
    surface: &CodeVSurface,
    unit: f64,
    row: &mut Row,
    report: &mut ConversionReport,
) {
    let plane = is_free_plane(row);
    let rim = outline(surface, surface.clip, surface.outline);
    let block = outline(surface, surface.obstruction, surface.block);
    let rim = rim.map(|outline| outline.aperture(plane));
    let block = block.map(|outline| outline.obscuration(plane));
    report_commands(surface, rim.iter().chain(&block), report);
    if rim.iter().chain(&block).any(|own| own.moves) {
        row.decenter = surface.offset.map(|length| length * unit);
    }
    let all = || rim.iter().chain(&block);
    let is_exact = all().all(|own| own.outcome == ConversionOutcome::Used);
    row.semi_diameter = rim.as_ref().and_then(|own| own.radius).map(|radius| radius * unit);
    let inner = block.as_ref().and_then(|own| own.radius).map(|radius| radius * unit);
    // An obstruction as wide as the aperture would block everything.
    row.obstruction = inner.filter(|inner| row.semi_diameter.is_none_or(|outer| *inner < outer));
    if !is_exact && unit == 1.0 {
        let is_kept = |line: &&String| {
            let name = line.split_whitespace().next().unwrap_or_default().to_ascii_uppercase();
            name == "CIR" || COMMANDS.contains(&name.as_str())
        };
        // The surface that a command names has another number in another file.
        let words = |line: &String| {
            let words = line.split_whitespace();
            words.filter(|word| surface_word(word).is_none()).collect::<Vec<_>>().join(" ")
        };
        row.keep_aperture("seq", surface.lines.iter().filter(is_kept).map(words).collect());
    }
}

/// The outline of a circle, or else of the half widths; `None` without either. A half width that is not
/// given is as long as the other one.
fn outline(
    surface: &CodeVSurface,
    circle: Option<f64>,
    outline: CodeVOutline,
) -> Option<ForeignOutline> {
    let (offset, turned) = (surface.offset, surface.is_turned);
    if let Some(radius) = circle.filter(|radius| *radius > 0.0) {
        let (form, half) = (OutlineForm::Circle, [radius; 2]);
        return Some(ForeignOutline { form, half, offset, turned });
    }
    let [x, y] = outline.half;
    let half = [x.or(y)?, y.or(x)?];
    let form = if outline.is_ellipse { OutlineForm::Ellipse } else { OutlineForm::Rectangle };
    Some(ForeignOutline { form, half, offset, turned })
}

/// Reports the commands of apertures that are no centred circles.
fn report_commands<'a>(
    surface: &CodeVSurface,
    apertures: impl Iterator<Item = &'a StandIn>,
    report: &mut ConversionReport,
) {
    let nothing = "there is no aperture on the surface that it could move or turn";
    let (outcome, note) = apertures
        .min_by_key(|own| own.outcome)
        .map_or((ConversionOutcome::Preserved, nothing), |own| (own.outcome, own.note.as_str()));
    let lines = report.rows.iter_mut().filter(|row| {
        row.outcome == ConversionOutcome::Used
            && COMMANDS.contains(&row.keyword.as_str())
            && row.line.is_some_and(|line| surface.aperture_lines.contains(&line))
    });
    for row in lines {
        row.outcome = outcome;
        note.clone_into(&mut row.note);
    }
}
