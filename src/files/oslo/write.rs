//! Writing of a lens as the text of a `.len` file.
//!
//! What the format, as this program reads it, cannot hold is refused by name if rays meet it, and listed as
//! dropped if they do not.

use crate::files::error::FileError;
use crate::files::first_order_beam::FirstOrderBeam;
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::files::text::{number, numbers};
use crate::files::zemax::named_medium;
use crate::lens::glass::{self, Glass};
use crate::lens::{
    Aperture, FieldKind, Lens, LensError, Medium, MediumPlace, Object, Pickup, Quantity, Row,
    SurfaceNumber,
};

/// The text of the file, and the report of everything that is not exact. `file` is its name in messages.
///
/// # Errors
/// An invalid lens, or a part of it that rays meet and the format cannot hold.
pub(in crate::files) fn write(
    lens: &Lens,
    file: &str,
) -> Result<(String, ConversionReport), FileError> {
    let unusable = |source| FileError::Lens { file: file.to_owned(), source };
    let lens = prepared(lens).map_err(unusable)?;
    if let Some(found) = unwritable(&lens) {
        let (file, expected) = (file.to_owned(), ".zmx, .seq or .json for it".to_owned());
        return Err(FileError::Unsuitable { file, found, expected });
    }
    let mut writer = OsloWriter { lens, text: String::new(), report: ConversionReport::default() };
    writer.header().map_err(unusable)?;
    writer.surfaces();
    writer.wavelengths();
    let image = writer.lens.surfaces.len() + 1;
    writer.line(format!("END {image}"));
    writer.report_losses();
    Ok((writer.text, writer.report))
}

/// The lens with its pickups, a single zoom position and the focus written into its rows.
fn prepared(lens: &Lens) -> Result<Lens, LensError> {
    lens.check()?;
    let mut lens = lens.with_pickups()?;
    if lens.zoom.len() == 1 {
        lens = crate::lens::at_zoom(&lens, 0);
    }
    Ok(lens)
}

/// The first part that the format cannot hold although rays meet it.
fn unwritable(lens: &Lens) -> Option<String> {
    if lens.zoom.len() > 1 {
        return Some(format!("{} zoom positions, which a .len file cannot hold", lens.zoom.len()));
    }
    let media = lens.surfaces.iter().map(|row| &row.medium);
    let unnamed = std::iter::once(&lens.object_medium).chain(media).find_map(unwritable_glass);
    unnamed.or_else(|| {
        lens.surfaces.iter().enumerate().find_map(|(i, row)| {
            let what = unwritable_row(row)?;
            let surface = SurfaceNumber::new(i);
            Some(format!("{what} of surface {surface}, which a .len file cannot hold here"))
        })
    })
}

/// A glass whose name alone means another one.
fn unwritable_glass(medium: &Medium) -> Option<String> {
    let Medium::Glass(name) = medium else { return None };
    let glass = glass::find(name)?;
    let found = named_medium(&short_name(glass), &[]).medium;
    if found == Medium::Glass(glass.full_name()) {
        return None;
    }
    let other = match found {
        Medium::Glass(other) => other,
        _ => "no glass".to_owned(),
    };
    let full = glass.full_name();
    Some(format!(
        "the glass {full}, whose name without its maker, as in a .len file, means {other}"
    ))
}

/// The name of a glass without blanks, which would end it.
fn short_name(glass: &Glass) -> String {
    glass.name.split_whitespace().collect()
}

fn unwritable_row(row: &Row) -> Option<&'static str> {
    if !row.apertures.is_empty() {
        return Some("an aperture that is no circle about the vertex");
    }
    let is_moved = row.decenter != [0.0; 2]
        || row.tilt != [0.0; 2]
        || row.break_before.is_some()
        || row.break_after.is_some();
    if is_moved {
        return Some("the decentre or tilt");
    }
    if row.freeform.is_some() {
        return Some("the freeform");
    }
    if row.ideal.is_some() {
        return Some("the ideal element");
    }
    if row.obstruction.is_some_and(|radius| radius > 0.0) {
        return Some("the obstruction");
    }
    matches!(row.medium, Medium::Grin(_)).then_some("the gradient-index medium")
}

/// A file that is being written.
struct OsloWriter {
    lens: Lens,
    text: String,
    report: ConversionReport,
}

/// A text in double quotes, on one line.
fn quoted(text: &str) -> String {
    let plain: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    format!("\"{}\"", plain.replace('"', "'").trim())
}

impl OsloWriter {
    fn line(&mut self, text: impl AsRef<str>) {
        self.text.push_str(text.as_ref().trim_end());
        self.text.push_str("\r\n");
    }

    fn record(&mut self, outcome: ConversionOutcome, what: impl AsRef<str>, note: &str) {
        self.report.add(outcome, what.as_ref(), note);
    }

    fn header(&mut self) -> Result<(), LensError> {
        let image = self.lens.surfaces.len() + 1;
        let beam = FirstOrderBeam::new(&self.lens)?;
        let focal_length = number(beam.focal_length.unwrap_or(0.0));
        self.line("// OSLO 6.1");
        self.line(format!("LEN NEW {} {focal_length} {image}", quoted(&self.lens.name)));
        self.beam(&beam);
        self.field();
        if !self.lens.source.is_empty() {
            self.line(format!("DES {}", quoted(&self.lens.source)));
        }
        self.line("UNI 1.0");
        let notes: Vec<String> = self.lens.notes.lines().map(quoted).collect();
        for (i, note) in notes.into_iter().filter(|note| note.len() > 2).enumerate() {
            self.line(format!("SNO{} {note}", i + 1));
        }
        Ok(())
    }

    /// The width of the beam: its radius for an object at infinity, else its numerical aperture.
    fn beam(&mut self, beam: &FirstOrderBeam) {
        match (self.lens.aperture, self.lens.object) {
            (Aperture::EntrancePupilDiameter(diameter), Object::Infinity) => {
                self.line(format!("EBR {}", number(0.5 * diameter)));
            }
            (Aperture::ObjectNa(na), Object::Finite(_)) => {
                self.line(format!("NAO {}", number(na)));
            }
            (_, Object::Infinity) => {
                self.line(format!("EBR {}", number(beam.pupil_radius)));
                let note = "as the radius of the paraxial entrance pupil";
                self.record(ConversionOutcome::Approximated, "aperture", note);
            }
            (_, Object::Finite(_)) => {
                self.line(format!("NAO {}", number(beam.object_na)));
                let note = "as the numerical aperture of the paraxial entrance pupil";
                self.record(ConversionOutcome::Approximated, "aperture", note);
            }
        }
    }

    /// The largest field, which is all that the format holds of the fields.
    fn field(&mut self) {
        let fields = self.lens.fields.clone();
        let keyword = match fields.kind {
            FieldKind::Angle => "ANG",
            FieldKind::ObjectHeight => "OBH",
            FieldKind::ImageHeight => "GIH",
        };
        let size = |point: &crate::lens::FieldPoint| point.x.hypot(point.y);
        let largest = fields.values.iter().max_by(|a, b| size(a).total_cmp(&size(b)));
        let Some(largest) = largest else { return };
        let value = if largest.x == 0.0 { largest.y } else { size(largest) };
        self.line(format!("{keyword} {}", number(value)));
        let note = "only the largest field is written; its 0, 0.7 and 1 fold are read back";
        let what = format!("fields: {} points", fields.values.len());
        self.record(ConversionOutcome::Approximated, what, note);
    }

    fn surfaces(&mut self) {
        let distance = match self.lens.object {
            Object::Infinity => "1.0e+20".to_owned(),
            Object::Finite(distance) => number(distance),
        };
        self.line("// SRF 0");
        let medium = self.lens.object_medium.clone();
        self.glass(&medium, MediumPlace::Object);
        self.line(format!("TH {distance}"));
        for i in 0..self.lens.surfaces.len() {
            self.line(format!("NXT  // SRF {}", i + 1));
            self.surface(i);
        }
        self.line(format!("NXT  // SRF {}", self.lens.surfaces.len() + 1));
        self.line("AIR");
        if let Some(offset) = self.lens.image_solve.filter(|offset| *offset != 0.0) {
            self.line(format!("TH {}", number(offset)));
        }
    }

    fn surface(&mut self, i: usize) {
        let row = self.lens.surfaces[i].clone();
        if !row.comment.is_empty() {
            self.line(format!("NOT {}", quoted(&row.comment)));
        }
        if row.curvature != 0.0 {
            self.line(format!("RD {}", number(row.curvature.recip())));
        }
        let is_solved = i + 1 == self.lens.surfaces.len() && self.lens.image_solve.is_some();
        self.line(if is_solved {
            "PY 0.0".to_owned()
        } else {
            format!("TH {}", number(row.thickness))
        });
        if row.conic != 0.0 {
            self.line(format!("CC {}", number(row.conic)));
        }
        let terms = ["AD", "AE", "AF", "AG", "AH", "AI", "AJ"].into_iter().zip(&row.asphere);
        for (keyword, a) in terms.filter(|(_, a)| **a != 0.0) {
            self.line(format!("{keyword} {}", number(*a)));
        }
        self.glass(&row.medium, MediumPlace::behind(i));
        if let Some(radius) = row.semi_diameter {
            self.line(format!("AP CHK {}", number(radius)));
        }
        if row.stop {
            self.line("AST");
        }
        self.pickups(i);
        self.report.add_row_losses(SurfaceNumber::new(i), &row);
        self.report.add_aperture_loss(SurfaceNumber::new(i), &row);
    }

    fn glass(&mut self, medium: &Medium, place: MediumPlace) {
        match medium {
            Medium::Air => self.line("AIR"),
            Medium::Mirror => self.line("RFL"),
            Medium::Index(n) => {
                let all = numbers(self.lens.wavelengths.iter().map(|_| *n));
                self.line(format!("GLA INDEX {all}"));
            }
            Medium::Model { nd, vd } => {
                self.line(format!("GLA MOD {}", numbers([*nd, *vd])));
                let note = "each program has its own dispersion formula for nd and vd";
                self.record(ConversionOutcome::Approximated, format!("model glass {place}"), note);
            }
            Medium::Glass(name) => {
                let glass = glass::find(name).map_or_else(|| name.clone(), short_name);
                self.line(format!("GLA {glass}"));
            }
            // Refused before.
            Medium::Grin(gradient) => self.glass(&gradient.base, place),
        }
    }

    /// The pickups of a row that the format has; the present value of others is written.
    fn pickups(&mut self, i: usize) {
        for pickup in self.lens.pickups.clone() {
            let Pickup { parameter, source, scale, offset } = pickup;
            if parameter.surface != i {
                continue;
            }
            let alike = parameter.quantity == source.quantity;
            let centred = parameter.zoom.is_none() && source.zoom.is_none();
            let thickness = parameter.quantity == Quantity::Thickness;
            if alike && centred && thickness && scale.abs() == 1.0 {
                let keyword = if scale > 0.0 { "TH" } else { "THM" };
                let from = source.surface + 1;
                self.line(format!("PK {keyword} {from} {}", number(offset)));
                continue;
            }
            let what = format!("pickup: {parameter} from the {source}");
            let note = "the present value, without the pickup";
            self.record(ConversionOutcome::Approximated, what, note);
        }
    }

    /// The wavelengths, the primary one first, as the format has it.
    fn wavelengths(&mut self) {
        let primary = self.lens.primary();
        let mut waves = self.lens.wavelengths.clone();
        waves[..=primary].rotate_right(1);
        self.line(format!("WV {}", numbers(waves.iter().map(|wave| wave.um))));
        self.line(format!("WW {}", numbers(waves.iter().map(|wave| wave.weight))));
    }

    fn report_losses(&mut self) {
        let dropped = [
            (self.lens.merit.is_some(), "merit function"),
            (self.lens.tolerances.is_some(), "tolerances"),
            (!self.lens.variables.is_empty(), "variables"),
        ];
        for (_, what) in dropped.into_iter().filter(|(is_there, _)| *is_there) {
            self.record(ConversionOutcome::Dropped, what, "they are not written");
        }
    }
}
