//! The header: title, aperture, catalogues, fields, wavelengths.

use super::{ZemaxWriter, number, numbers, one_line};
use crate::files::report::ConversionOutcome;
use crate::files::zemax::glass as zemax_glass;
use crate::files::zemax::{SOURCE, ZOOM_NAME};
use crate::lens::glass;
use crate::lens::{Aperture, FieldKind, Medium, Object};

/// The number of field points that every version of the program reads.
const FIELD_SLOTS: usize = 12;

impl ZemaxWriter {
    pub(super) fn header(&mut self) {
        self.line("VERS 240130 21 31000");
        self.line("MODE SEQ");
        self.titles();
        self.line("UNIT MM X W X CM MR CPMM");
        self.aperture();
        self.line("ENVD 20.0 1.0 0");
        self.catalogues();
        let real = matches!(self.lens.aperture, Aperture::StopSemiDiameter(_));
        // Rays fill the real stop if its size is given, else the paraxial pupil.
        self.line(if real { "RAIM 0 2 1 1 0 0 0 0 0 1" } else { "RAIM 0 0 1 1 0 0 0 0 0 1" });
        self.fields();
        self.wavelengths();
    }

    fn titles(&mut self) {
        let name = format!("NAME {}", one_line(&self.lens.name));
        self.line(name);
        let source = one_line(&self.lens.source);
        let sources = (!source.is_empty()).then(|| format!("{SOURCE}{source}"));
        let notes = self.lens.notes.lines().map(one_line).collect::<Vec<_>>();
        let named = self.lens.zoom.iter().any(|position| !position.name.is_empty());
        let zoom = self.lens.zoom.iter().filter(|_| named);
        let names: Vec<String> =
            zoom.map(|position| format!("{ZOOM_NAME}{}", one_line(&position.name))).collect();
        for note in sources.into_iter().chain(notes).chain(names) {
            self.line(format!("NOTE 0 {note}"));
        }
    }

    fn aperture(&mut self) {
        let text = match self.lens.aperture {
            Aperture::EntrancePupilDiameter(v) => format!("ENPD {}", number(v)),
            Aperture::FNumber(v) if self.lens.object == Object::Infinity => {
                format!("FNUM {} 0", number(v))
            }
            Aperture::FNumber(v) => format!("FNUM {} 1", number(v)),
            Aperture::ObjectNa(v) => format!("OBNA {} 0", number(v)),
            Aperture::StopSemiDiameter(_) => "FLOA".to_owned(),
        };
        self.line(text);
    }

    /// The manufacturers of the glasses, in order of appearance.
    fn catalogues(&mut self) {
        let mut makers: Vec<&str> = Vec::new();
        let rows = self.lens.surfaces.iter().map(|row| &row.medium);
        for medium in std::iter::once(&self.lens.object_medium).chain(rows) {
            let Medium::Glass(name) = medium else { continue };
            // Materials without a manufacturer are in the general catalogue of the other program.
            let own = glass::find(name).filter(|glass| !zemax_glass::is_general(glass));
            let maker = own.map_or("MISC", |glass| glass.manufacturer.as_str());
            if !makers.contains(&maker) {
                makers.push(maker);
            }
        }
        if makers.is_empty() {
            makers.push("SCHOTT");
        }
        let text = format!("GCAT {}", makers.join(" "));
        self.line(text);
    }

    fn fields(&mut self) {
        let fields = self.lens.fields.clone();
        let kind = match fields.kind {
            FieldKind::Angle => 0,
            FieldKind::ObjectHeight => 1,
            FieldKind::ImageHeight => 2,
        };
        let (count, waves) = (fields.values.len(), self.lens.wavelengths.len());
        self.line(format!("FTYP {kind} 0 {count} {waves} 0 0 0 {count}"));
        let slots = count.max(FIELD_SLOTS);
        let padded = |values: Vec<f64>, padding: f64| {
            numbers(values.into_iter().chain(std::iter::repeat(padding)).take(slots))
        };
        let points = fields.projected_points();
        let [x, y] = [0, 1].map(|k| padded(points.iter().map(|point| point[k]).collect(), 0.0));
        let weights = padded(fields.values.iter().map(|field| field.weight).collect(), 1.0);
        for (keyword, values) in [("XFLN", x), ("YFLN", y), ("FWGN", weights)] {
            self.line(format!("{keyword} {values}"));
        }
        if count > FIELD_SLOTS {
            let note = format!("older versions of the program read {FIELD_SLOTS}");
            self.record(ConversionOutcome::Approximated, format!("fields: {count} points"), note);
        }
    }

    fn wavelengths(&mut self) {
        for (i, wave) in self.lens.wavelengths.clone().into_iter().enumerate() {
            self.line(format!("WAVM {} {} {}", i + 1, number(wave.um), number(wave.weight)));
        }
        let primary = self.lens.primary() + 1;
        self.line(format!("PWAV {primary}"));
    }
}
