//! Writing of a lens as the text of a `.zmx` file.
//!
//! Curvatures, not radii, with the fewest digits that read back to the same bits. A semi-diameter is
//! written as a fixed one with a circular aperture, since a semi-diameter alone does not clip there.

mod header;
mod place;
mod surface;
mod table;

use crate::files::outline::unwritten_aperture;
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::files::text::{number, numbers};
use crate::files::zemax::INFINITE_GAP;
use crate::files::zemax::freeform::{self, FormLines};
use crate::files::zemax::tolerance;
use crate::lens::{
    Lens, LensError, Parameter, Pickup, Quantity, Row, SurfaceNumber, SystemError, Variable,
    at_zoom,
};
pub(super) use place::FileNumbers;
use place::{RowBreaks, file_numbers, row_breaks};

/// The text of the file, and the report of everything that is not exact.
///
/// # Errors
/// An invalid lens, or a gap that the format cannot hold.
pub fn write(lens: &Lens) -> Result<(String, ConversionReport), LensError> {
    lens.check()?;
    check_thicknesses(lens)?;
    let special = |row: &Row| row.freeform.is_some() || row.ideal.is_some();
    let lost = |row: &Row| special(row) && freeform::row_lines(row).is_none();
    if let Some(surface) = lens.surfaces.iter().position(lost) {
        let (what, hint) = ("the export as .zmx", "; expected the native format (.json)");
        return Err(SystemError::Posed { surface: surface.into(), what, hint }.into());
    }
    unwritten_aperture(lens, ".zmx", |row| surface::aperture_lines(row).err())?;
    let breaks = row_breaks(lens);
    let mut export = ZemaxWriter {
        lens: lens.with_pickups()?,
        numbers: file_numbers(&breaks),
        breaks,
        text: String::new(),
        report: ConversionReport::default(),
    };
    export.flatten_single_position();
    export.apply_focus_solve();
    export.header();
    export.surfaces();
    export.tolerances();
    export.table();
    export.report_losses();
    Ok((export.text, export.report))
}

/// Refuses gaps that the other program takes for infinite ones.
fn check_thicknesses(lens: &Lens) -> Result<(), LensError> {
    let gaps = lens.surfaces.iter().enumerate();
    let gaps = gaps.map(|(i, row)| (Parameter::new(i, Quantity::Thickness), row.thickness));
    let zoomed = lens.zoom.iter().enumerate().flat_map(|(zoom, position)| {
        let gaps = position.numbers.iter().filter(|own| own.quantity == Quantity::Thickness);
        gaps.map(move |gap| (Parameter::at_zoom(gap.surface, gap.quantity, zoom), gap.value))
    });
    match gaps.chain(zoomed).find(|(_, thickness)| !(thickness.abs() < INFINITE_GAP)) {
        Some((gap, found)) => Err(LensError::InvalidNumber {
            what: gap.to_string(),
            found,
            expected: "less than 1e18 mm, from which on a gap of a .zmx file is infinite",
        }),
        None => Ok(()),
    }
}

/// A file that is being written.
struct ZemaxWriter {
    /// The lens, with pickups and focus resolved.
    lens: Lens,
    /// The coordinate breaks around every surface, and the numbers of the surfaces among them.
    breaks: Vec<RowBreaks>,
    numbers: Vec<FileNumbers>,
    text: String,
    report: ConversionReport,
}

/// A text on one line.
fn one_line(text: &str) -> String {
    text.split(['\n', '\r']).map(str::trim).collect::<Vec<_>>().join(" ").trim().to_owned()
}

impl ZemaxWriter {
    fn line(&mut self, text: impl AsRef<str>) {
        self.text.push_str(text.as_ref().trim_end());
        self.text.push_str("\r\n");
    }

    /// A line of a surface.
    fn surface_line(&mut self, text: impl AsRef<str>) {
        self.text.push_str("  ");
        self.line(text);
    }

    fn record(
        &mut self,
        outcome: ConversionOutcome,
        what: impl AsRef<str>,
        note: impl Into<String>,
    ) {
        self.report.add(outcome, what.as_ref(), note);
    }

    /// True if the focus solve can be written as a solve of the other program.
    fn has_focus_solve(&self) -> bool {
        self.lens.image_solve == Some(0.0)
    }

    fn tolerances(&mut self) {
        let (lines, remarks) = tolerance::operand_lines(&self.lens, &self.numbers);
        lines.iter().for_each(|line| self.line(line));
        for (outcome, what, note) in remarks {
            self.record(outcome, what, note);
        }
    }

    /// Turns a single zoom position into the lens itself: one configuration is not a zoom lens there.
    fn flatten_single_position(&mut self) {
        if self.lens.zoom.len() != 1 {
            return;
        }
        self.lens = at_zoom(&self.lens, 0);
        let note = "one position is written as a lens that does not zoom";
        self.record(ConversionOutcome::Approximated, "zoom positions: 1", note);
    }

    /// Writes the solved last gap into the lens, at every zoom position if the solve itself cannot be
    /// written.
    fn apply_focus_solve(&mut self) {
        let Some(offset) = self.lens.image_solve else { return };
        let primary = self.lens.wavelengths[self.lens.primary()].um;
        let last = self.lens.surfaces.len() - 1;
        let solved = |lens: &Lens, zoom| {
            lens.resolve(zoom, primary).ok().map(|system| system.surfaces[last].thickness)
        };
        let gaps: Vec<Option<f64>> =
            (0..self.lens.zoom_positions()).map(|zoom| solved(&self.lens, zoom)).collect();
        if let Some(gap) = gaps[0] {
            self.lens.surfaces[last].thickness = gap;
        }
        for (zoom, gap) in gaps.into_iter().enumerate().take(self.lens.zoom.len()) {
            let position = &mut self.lens.zoom[zoom];
            position.remove_number(last, Quantity::Thickness);
            if let Some(thickness) = gap.filter(|_| offset != 0.0) {
                position.set_number(last, Quantity::Thickness, thickness);
            }
        }
        if offset != 0.0 {
            let note = "a displaced focus cannot be solved there: the present thickness is written";
            self.record(
                ConversionOutcome::Approximated,
                format!("focus solve displaced by {offset} mm"),
                note,
            );
        }
    }

    /// Reports everything that the file cannot represent, or represents differently.
    fn report_losses(&mut self) {
        let lens = self.lens.clone();
        let clipping = lens.surfaces.iter().filter(|row| row.semi_diameter.is_some()).count();
        if clipping > 0 {
            let note =
                "written with circular apertures, since semi-diameters alone do not clip there";
            self.record(
                ConversionOutcome::Used,
                format!("{clipping} semi-diameters that clip"),
                note,
            );
        }
        let obstructing = lens.surfaces.iter().filter(|row| row.obstruction.is_some()).count();
        if obstructing > 0 {
            let note = "written as obscurations, or as inner radii of the circular apertures";
            self.record(ConversionOutcome::Used, format!("{obstructing} obstructions"), note);
        }
        for (i, row) in lens.surfaces.iter().enumerate() {
            self.report_freeform(i, row);
            if row.kept_aperture("zmx").is_none() {
                self.report.add_aperture_loss(SurfaceNumber::new(i), row);
            }
            if let Some(locked) = &row.locked {
                let what = format!("surface {}: {}", SurfaceNumber::new(i), locked.kind);
                let note = "written back with the lines of its file; rays meet its conic here";
                self.record(ConversionOutcome::Locked, what, note);
            }
        }
        if lens.merit.is_some() {
            let note = "the terms have no counterpart there";
            self.record(ConversionOutcome::Dropped, "merit function", note);
        }
        for variable in &lens.variables {
            self.report_variable(variable);
        }
        for pickup in &lens.pickups {
            self.report_pickup(pickup);
        }
    }

    /// Records the convention of a freeform.
    fn report_freeform(&mut self, i: usize, row: &Row) {
        let Some(form) = row.freeform.as_ref().filter(|_| row.ideal.is_none()) else { return };
        let Some(lines) = freeform::form_lines(row, form) else { return };
        let what = format!("surface {}: {}", SurfaceNumber::new(i), form.kind.name());
        if lines.kind.ends_with("ZERNSAG") {
            let note =
                "the order and the sign of the angle are those that the other program prints";
            self.record(ConversionOutcome::Used, what, note);
        }
    }

    /// Records what a variable loses.
    fn report_variable(&mut self, variable: &Variable) {
        let is_bounded = variable.min.is_some() || variable.max.is_some();
        let has_both_bounds = variable.min.is_some() && variable.max.is_some();
        let Parameter { quantity, zoom, .. } = variable.parameter;
        let is_written = matches!(
            quantity,
            Quantity::Curvature | Quantity::Conic | Quantity::Thickness | Quantity::SemiDiameter
        );
        let note = match quantity {
            _ if zoom.is_some() && !is_written => "the number has no operand in the file",
            Quantity::SemiDiameter => "semi-diameters cannot be variables there",
            Quantity::Freeform(k) if !self.is_varied_there(variable.parameter.surface, k) => {
                "this number cannot be a variable in the file"
            }
            Quantity::Thickness if has_both_bounds => return,
            _ if is_bounded => "its bounds; it remains a variable",
            _ => return,
        };
        self.record(ConversionOutcome::Dropped, format!("variable: {}", variable.parameter), note);
    }

    fn is_varied_there(&self, surface: usize, number: usize) -> bool {
        let row = &self.lens.surfaces[surface];
        let lines = row.freeform.as_ref().and_then(|form| freeform::form_lines(row, form));
        let varies = |lines: FormLines| {
            let mut parameters = lines.parameters.iter();
            parameters.any(|(i, _)| freeform::varied_number(lines.kind, *i) == Some(number))
        };
        lines.is_some_and(varies)
    }

    /// Records a pickup that the format does not know.
    fn report_pickup(&mut self, pickup: &Pickup) {
        let Pickup { parameter, source, .. } = pickup;
        let like = parameter.quantity == source.quantity && source.zoom.is_none();
        let is_supported = parameter.zoom.is_none()
            && matches!(parameter.quantity, Quantity::Curvature | Quantity::Thickness);
        if !(like && is_supported) {
            let what = format!("pickup: {} from the {}", pickup.parameter, pickup.source);
            let note = "the present value, without the pickup";
            self.record(ConversionOutcome::Approximated, what, note);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_back_to_the_same_bits() {
        let values = [0.0, -0.0, 1.0, 0.1 + 0.2, 5e-324, -1e99, 2.0491803278688523e-2, 1e15, 1e-5];
        for value in values {
            let back: f64 = number(value).parse().unwrap();
            assert_eq!(back.to_bits(), value.to_bits(), "{}", number(value));
        }
        assert_eq!(number(5.5), "5.5");
        assert_eq!(number(1e-7), "1E-7");
    }
}
