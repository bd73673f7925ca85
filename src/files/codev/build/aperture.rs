//! Apertures and obscurations of a surface.

use crate::files::codev::file::{CodeVOutline, CodeVSurface};
use crate::files::outline::{ForeignOutline, OutlineForm};
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::lens::{BlockedSide, Row};

/// The commands whose outcome depends on all apertures of a surface.
const COMMANDS: [&str; 7] = ["REX", "REY", "ELX", "ELY", "ADX", "ADY", "ARO"];

/// Writes the rim, the obstruction and the other apertures of a surface into its row.
pub(super) fn apply(
    surface: &CodeVSurface,
    unit: f64,
    row: &mut Row,
    report: &mut ConversionReport,
) {
    let rim = outlines(surface, surface.clip, surface.outline);
    let block = outlines(surface, surface.obstruction, surface.block);
    let rim = rim.into_iter().map(|own| (own, BlockedSide::Outside));
    let block = block.into_iter().map(|own| (own, BlockedSide::Inside));
    let all: Vec<(ForeignOutline, BlockedSide)> = rim.chain(block).collect();
    all.iter().for_each(|(own, blocks)| own.add_to(row, *blocks, unit));
    report_commands(surface, &all, report);
    // An obstruction as wide as the aperture would block everything.
    let outer = row.semi_diameter;
    row.obstruction = row.obstruction.filter(|inner| outer.is_none_or(|outer| *inner < outer));
}

/// The outlines of a circle and of half widths. A half width that is not given is as long as the other one.
fn outlines(
    surface: &CodeVSurface,
    circle: Option<f64>,
    outline: CodeVOutline,
) -> Vec<ForeignOutline> {
    let (offset, angle) = (surface.offset, surface.turn);
    let plain = |form, half| ForeignOutline { form, half, offset, angle };
    let circle = circle.filter(|radius| *radius > 0.0);
    let circle = circle.map(|radius| plain(OutlineForm::Circle, [radius; 2]));
    let form = if outline.is_ellipse { OutlineForm::Ellipse } else { OutlineForm::Rectangle };
    let [x, y] = outline.half;
    let other = x.or(y).zip(y.or(x)).map(|(x, y)| plain(form, [x, y]));
    circle.into_iter().chain(other).collect()
}

/// Reports the commands of apertures that are no centred circles.
fn report_commands(
    surface: &CodeVSurface,
    all: &[(ForeignOutline, BlockedSide)],
    report: &mut ConversionReport,
) {
    let notes = all.iter().map(|(own, blocks)| own.note(*blocks)).filter(|note| !note.is_empty());
    let notes: Vec<String> = notes.collect();
    let (outcome, note) = if all.is_empty() {
        let nothing = "there is no aperture on the surface that it could move or turn";
        (ConversionOutcome::Preserved, nothing.to_owned())
    } else {
        (ConversionOutcome::Used, notes.join("; "))
    };
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
