//! Writing of a lens as the text of a `.seq` file.
//!
//! Radii and wavelengths in nanometres, with the fewest digits that read back to the same bits; a
//! semi-diameter is a `CIR`, which clips there too.

mod surface;

pub(in crate::files) use surface::place;

use crate::files::outline::unwritten_aperture;
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::files::text::{number, numbers};
use crate::lens::{
    Aperture, FieldKind, Fields, Lens, LensError, Object, Parameter, Pickup, Quantity, Row,
    SystemError,
};

/// The commands of the numbers that can differ between the zoom positions.
const ZOOMED: [(&str, Quantity); 10] = [
    ("THI", Quantity::Thickness),
    ("CUY", Quantity::Curvature),
    ("K", Quantity::Conic),
    ("A", Quantity::Asphere(0)),
    ("B", Quantity::Asphere(1)),
    ("C", Quantity::Asphere(2)),
    ("D", Quantity::Asphere(3)),
    ("E", Quantity::Asphere(4)),
    ("F", Quantity::Asphere(5)),
    ("G", Quantity::Asphere(6)),
];

/// The size of an aperture of one kind; `None` for another one.
type ApertureSize = fn(Aperture) -> Option<f64>;

/// The commands of apertures that can differ between the zoom positions.
const APERTURES: [(&str, ApertureSize); 3] = [
    ("EPD", |own| match own {
        Aperture::EntrancePupilDiameter(v) => Some(v),
        _ => None,
    }),
    ("FNO", |own| match own {
        Aperture::FNumber(v) => Some(v),
        _ => None,
    }),
    ("NAO", |own| match own {
        Aperture::ObjectNa(v) => Some(v),
        _ => None,
    }),
];

/// The text of the file, and the report of everything that is not exact.
///
/// # Errors
/// An invalid lens, or a place of a surface that the format cannot hold.
pub fn write(lens: &Lens) -> Result<(String, ConversionReport), LensError> {
    lens.check()?;
    let unplaced = lens.surfaces.iter().position(|row| place(row).is_none());
    let unplaced = unplaced.or(lens.surfaces.iter().position(surface::has_no_form));
    if let Some(surface) = unplaced {
        let (what, hint) = ("the export as .seq", "; expected .zmx or the native format (.json)");
        return Err(SystemError::Posed { surface: surface.into(), what, hint }.into());
    }
    let is_stop = |row: &Row| row.stop && matches!(lens.aperture, Aperture::StopSemiDiameter(_));
    unwritten_aperture(lens, ".seq", |row| surface::aperture_lines(row, is_stop(row)).err())?;
    let (lens, report) = (lens.with_pickups()?, ConversionReport::default());
    let mut writer = CodeVWriter { lens, text: String::new(), report };
    writer.solve_focus();
    writer.header();
    writer.surfaces();
    writer.zoom();
    writer.pickups();
    writer.line("GO");
    writer.report_losses();
    Ok((writer.text, writer.report))
}

/// A file that is being written.
struct CodeVWriter {
    /// The lens, with pickups and focus resolved.
    lens: Lens,
    text: String,
    report: ConversionReport,
}

/// A text in quotes, on one line.
fn quoted(text: &str) -> String {
    let plain: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    format!("'{}'", plain.replace('\'', "\"").trim())
}

impl CodeVWriter {
    /// Writes one line. Long ones are continued, since the program reads lines of limited length.
    fn line(&mut self, text: impl AsRef<str>) {
        const LONGEST: usize = 78;
        let mut length = 0;
        for word in text.as_ref().split_inclusive(' ') {
            if length > 0 && length + word.len() > LONGEST && !text.as_ref().contains('\'') {
                self.text.push_str("&\r\n ");
                length = 1;
            }
            self.text.push_str(word);
            length += word.len();
        }
        self.text.push_str("\r\n");
    }

    fn record(&mut self, outcome: ConversionOutcome, what: impl AsRef<str>, note: &str) {
        self.report.add(outcome, what.as_ref(), note);
    }

    /// Writes the solved last gap into the lens. A solved gap cannot differ between zoom positions there:
    /// those of a zoom lens become numbers.
    fn solve_focus(&mut self) {
        if self.lens.image_solve.is_none() {
            return;
        }
        let last = self.lens.surfaces.len() - 1;
        let primary = self.lens.wavelengths[self.lens.primary()].um;
        let solved = |lens: &Lens, zoom| {
            lens.resolve(zoom, primary).ok().map(|system| system.surfaces[last].thickness)
        };
        let gaps: Vec<Option<f64>> =
            (0..self.lens.zoom_positions()).map(|zoom| solved(&self.lens, zoom)).collect();
        if let Some(gap) = gaps[0] {
            self.lens.surfaces[last].thickness = gap;
        }
        if self.lens.zoom.len() < 2 {
            return;
        }
        for (position, gap) in self.lens.zoom.iter_mut().zip(gaps) {
            gap.into_iter().for_each(|gap| position.set_number(last, Quantity::Thickness, gap));
        }
        self.lens.image_solve = None;
        let note = "the present gap at each zoom position is written, without the solve";
        self.record(ConversionOutcome::Approximated, "focus solve", note);
    }

    fn header(&mut self) {
        self.line("RDM;LEN");
        self.line(format!("TITLE {}", quoted(&self.lens.name)));
        self.aperture(self.lens.aperture);
        self.line("DIM M");
        let waves = self.lens.wavelengths.clone();
        self.line(format!("WL {}", numbers(waves.iter().map(|wave| wave.um * 1e3))));
        self.line(format!("REF {}", self.lens.primary() + 1));
        self.line(format!("WTW {}", numbers(waves.iter().map(|wave| wave.weight))));
        let fields = self.lens.fields.clone();
        let suffix = field_suffix(fields.kind);
        let points = fields.projected_points();
        for (k, axis) in ["X", "Y"].into_iter().enumerate() {
            let values = points.iter().map(|point| point[k]);
            self.line(format!("{axis}{suffix} {}", numbers(values)));
        }
        self.line(format!("WTF {}", numbers(fields.values.iter().map(|field| field.weight))));
        self.private_glasses();
    }

    fn aperture(&mut self, aperture: Aperture) {
        match aperture {
            Aperture::EntrancePupilDiameter(v) => self.line(format!("EPD {}", number(v))),
            Aperture::FNumber(v) => self.line(format!("FNO {}", number(v))),
            Aperture::ObjectNa(v) => self.line(format!("NAO {}", number(v))),
            // The stop's own CIR is the aperture.
            Aperture::StopSemiDiameter(_) => {}
        }
    }

    fn surfaces(&mut self) {
        let distance = match self.lens.object {
            Object::Infinity => "0.1E14".to_owned(),
            Object::Finite(distance) => number(distance),
        };
        let medium = self.lens.object_medium.clone();
        let glass = self.glass(&medium, crate::lens::MediumPlace::Object);
        self.line(format!("SO 0.0 {distance}{glass}"));
        for i in 0..self.lens.surfaces.len() {
            self.surface(i);
        }
        let defocus = self.lens.image_solve.unwrap_or(0.0);
        if self.lens.image_solve.is_some() {
            self.line("  PIM");
        }
        self.line(format!("SI 0.0 {}", number(defocus)));
    }

    /// Numbers of the zoom positions; the rest is reported.
    fn zoom(&mut self) {
        let positions = self.lens.zoom.len();
        if positions < 2 {
            return;
        }
        self.line(format!("ZOO {positions}"));
        for surface in 0..self.lens.surfaces.len() {
            for (name, quantity) in ZOOMED {
                if self.lens.is_zoomed(surface, quantity) {
                    let value = |zoom| Parameter::at_zoom(surface, quantity, zoom);
                    let value = |zoom| self.lens.get(value(zoom)).unwrap_or(0.0);
                    let values = numbers((0..positions).map(value));
                    self.line(format!("ZOO {name} S{} {values}", surface + 1));
                }
            }
        }
        self.zoomed_apertures();
        self.zoomed_fields();
        self.report_zoom_losses();
    }

    /// The aperture at every position, if it has one definition.
    fn zoomed_apertures(&mut self) {
        if self.lens.zoom.iter().all(|position| position.aperture.is_none()) {
            return;
        }
        let all = (0..self.lens.zoom.len()).map(|zoom| self.lens.aperture_at(zoom));
        let of_kind = |(name, size): (&'static str, ApertureSize)| {
            Some((name, all.clone().map(size).collect::<Option<Vec<f64>>>()?))
        };
        let Some((name, values)) = APERTURES.into_iter().find_map(of_kind) else {
            let note = "the aperture of the lens is used at every position";
            self.record(ConversionOutcome::Dropped, "apertures of the zoom positions", note);
            return;
        };
        self.line(format!("ZOO {name} {}", numbers(values)));
    }

    /// The fields at every position, if they differ in their coordinates alone.
    fn zoomed_fields(&mut self) {
        if self.lens.zoom.iter().all(|position| position.fields.is_none()) {
            return;
        }
        let all: Vec<Fields> =
            (0..self.lens.zoom.len()).map(|zoom| self.lens.fields_at(zoom).clone()).collect();
        if !all.iter().all(|fields| fields.are_like(&self.lens.fields)) {
            let note = "the fields of the lens are used at every position";
            self.record(ConversionOutcome::Dropped, "fields of the zoom positions", note);
            return;
        }
        let suffix = field_suffix(self.lens.fields.kind);
        let points: Vec<Vec<[f64; 2]>> = all.iter().map(Fields::projected_points).collect();
        let any_x = points.iter().flatten().any(|point| point[0] != 0.0);
        let axes = || ["X", "Y"].into_iter().enumerate().filter(|(k, _)| any_x || *k == 1);
        for field in 0..self.lens.fields.values.len() {
            for (k, axis) in axes() {
                let values = numbers(points.iter().map(|points| points[field][k]));
                self.line(format!("ZOO {axis}{suffix} F{} {values}", field + 1));
            }
        }
    }

    /// Records the numbers of zoom positions that are not written.
    fn report_zoom_losses(&mut self) {
        let is_written = |quantity| ZOOMED.iter().any(|(_, written)| *written == quantity);
        let numbers = self.lens.zoom.iter().enumerate();
        let lost: Vec<Parameter> = numbers
            .flat_map(|(zoom, at)| {
                let lost = at.numbers.iter().filter(|own| !is_written(own.quantity));
                lost.map(move |own| Parameter::at_zoom(own.surface, own.quantity, zoom))
            })
            .collect();
        for parameter in lost {
            let note = "the number of the lens is used at every position";
            self.record(ConversionOutcome::Dropped, parameter.to_string(), note);
        }
    }

    fn pickups(&mut self) {
        for pickup in self.lens.pickups.clone() {
            let Pickup { parameter, source, scale, offset } = pickup;
            let is_zoomed = parameter.zoom.is_some() || source.zoom.is_some();
            let name = match (parameter.quantity, source.quantity) {
                (Quantity::Thickness, Quantity::Thickness) if !is_zoomed => "THI",
                (Quantity::Curvature, Quantity::Curvature) if !is_zoomed && offset == 0.0 => "RDY",
                _ => {
                    let what = format!("pickup: {parameter} from the {source}");
                    let note = "the present value, without the pickup";
                    self.record(ConversionOutcome::Approximated, what, note);
                    continue;
                }
            };
            let scale = if name == "THI" { scale } else { scale.recip() };
            let [to, from] = [parameter.surface, source.surface].map(|surface| surface + 1);
            let factors = numbers([scale, offset]);
            self.line(format!("PIK {name} S{to} Z1 {name} S{from} Z1 {factors}"));
        }
    }

    fn is_variable(&self, surface: usize, quantity: Quantity) -> bool {
        self.lens.variable(Parameter::new(surface, quantity)).is_some()
    }

    fn report_losses(&mut self) {
        if self.lens.merit.is_some() {
            self.record(
                ConversionOutcome::Dropped,
                "merit function",
                "it has no counterpart there",
            );
        }
        if self.lens.tolerances.is_some() {
            self.record(ConversionOutcome::Dropped, "tolerances", "they are not written");
        }
        for variable in self.lens.variables.clone() {
            let known =
                matches!(variable.parameter.quantity, Quantity::Curvature | Quantity::Thickness);
            let bounded = variable.min.is_some() || variable.max.is_some();
            if !known || bounded {
                let note =
                    if known { "its bounds; it remains a variable" } else { "a constant there" };
                let what = format!("variable: {}", variable.parameter);
                self.record(ConversionOutcome::Dropped, what, note);
            }
        }
    }
}

fn field_suffix(kind: FieldKind) -> &'static str {
    match kind {
        FieldKind::Angle => "AN",
        FieldKind::ObjectHeight => "OB",
        FieldKind::ImageHeight => "IM",
    }
}
