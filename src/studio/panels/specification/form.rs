//! The form of a specification: three numbers, and limits each of which may be left open.

use egui::{Context, DragValue, Grid, Id, TextEdit, Ui};

use super::text::{filled_text, other_filled};
use crate::lens::WavelengthPreset;
use crate::search::design::{
    AS_BUILT_GRADES, DesignSettings, FilledValue, GlassList, LensRequirements, LensSpecification,
    LensWish, SpecificationError,
};
use crate::session::SpecificationRequest;
use crate::studio::form::{choice, number_field};

/// The quantity that gives the aperture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ApertureQuantity {
    FNumber,
    NumericalAperture,
}

/// The quantity that gives the field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FieldQuantity {
    HalfAngle,
    ImageHeight,
}

/// A limit that is a number, as a row of the form.
struct NumberRow {
    /// The name of its check box.
    title: &'static str,
    /// The key of the specification.
    key: &'static str,
    unit: &'static str,
    /// The number of the form over that of the specification.
    scale: f64,
    /// The number at first.
    value: f64,
    hint: &'static str,
}

const BACK_FOCUS: usize = 0;
const TRACK: usize = 1;
const DIAMETER: usize = 2;
const DISTORTION: usize = 3;
const ILLUMINATION: usize = 4;
const MAGNIFICATION: usize = 5;
const CONTRAST: usize = 6;

const NUMBER_ROWS: [NumberRow; 7] = [
    NumberRow {
        title: "Back focus at least",
        key: "min_back_focus_mm",
        unit: " mm",
        scale: 1.0,
        value: 10.0,
        hint: "From the last vertex to the image",
    },
    NumberRow {
        title: "Track at most",
        key: "max_track_mm",
        unit: " mm",
        scale: 1.0,
        value: 100.0,
        hint: "From the first vertex to the image",
    },
    NumberRow {
        title: "Diameter at most",
        key: "max_semi_diameter_mm",
        unit: " mm",
        scale: 2.0,
        value: 40.0,
        hint: "Of every surface",
    },
    NumberRow {
        title: "Distortion at most",
        key: "max_abs_distortion",
        unit: " %",
        scale: 100.0,
        value: 2.0,
        hint: "Of the chief ray against f tan θ, in either direction",
    },
    NumberRow {
        title: "Illumination at least",
        key: "min_relative_illumination",
        unit: " %",
        scale: 100.0,
        value: 30.0,
        hint: "Of every field, relative to the axis",
    },
    NumberRow {
        title: "Near object, magnified by",
        key: "magnification",
        unit: "",
        scale: 1.0,
        value: 0.5,
        hint: "Of a near object at the distance that a thin lens of this focal length needs; a distant one if \
            it is not stated",
    },
    NumberRow {
        title: "Contrast at cycles/mm",
        key: "wish",
        unit: "",
        scale: 1.0,
        value: 30.0,
        hint: "The frequency at which contrast is wished in place of small spots",
    },
];

/// A limit that is a count, as a row of the form.
const COUNT_ROWS: [(&str, &str, &str); 2] = [
    ("Elements at most", "max_elements", "Pieces of glass"),
    (
        "Aspheric surfaces at most",
        "max_aspheric_surfaces",
        "Surfaces that are neither spheres nor planes",
    ),
];

/// A value that may be left open.
#[derive(Debug, Clone, Copy)]
struct Optional<T> {
    is_stated: bool,
    value: T,
}

impl<T: Copy> Optional<T> {
    const fn open(value: T) -> Self {
        Self { is_stated: false, value }
    }

    fn stated(self) -> Option<T> {
        self.is_stated.then_some(self.value)
    }
}

/// The text as it was typed.
#[derive(Debug)]
pub(super) struct SpecificationForm {
    focal_length: f64,
    aperture: ApertureQuantity,
    aperture_value: f64,
    field: FieldQuantity,
    field_value: f64,
    /// The index of a preset; `None` for the usual ones.
    wavelengths: Option<usize>,
    numbers: [Optional<f64>; 7],
    counts: [Optional<usize>; 2],
    /// Names of glasses, separated by commas; empty for any.
    glasses: String,
    /// The index of a class of care in making; `None` for the usual one.
    as_built: Option<usize>,
    minutes: f64,
    seed: u64,
}

impl Default for SpecificationForm {
    fn default() -> Self {
        Self {
            focal_length: 50.0,
            aperture: ApertureQuantity::FNumber,
            aperture_value: 2.8,
            field: FieldQuantity::HalfAngle,
            field_value: 20.0,
            wavelengths: None,
            numbers: NUMBER_ROWS.map(|row| Optional::open(row.value)),
            counts: [Optional::open(4), Optional::open(0)],
            glasses: String::new(),
            as_built: None,
            minutes: 5.0,
            seed: 1,
        }
    }
}

/// The specification of the form with what is taken for all that is not stated, or the reason for which
/// no lens is designed to it.
pub(super) type Completed = Result<(LensRequirements, Vec<FilledValue>), SpecificationError>;

impl SpecificationForm {
    /// The request of the form.
    pub(super) fn request(&self) -> SpecificationRequest {
        SpecificationRequest {
            specification: self.specification(),
            settings: DesignSettings::with_seed(self.seed),
            minutes: self.minutes,
        }
    }

    pub(super) fn complete(&self) -> Completed {
        LensRequirements::complete(&self.specification())
    }

    fn specification(&self) -> LensSpecification {
        let number = |row: usize| self.numbers[row].stated().map(|v| v / NUMBER_ROWS[row].scale);
        let [f_number, numerical_aperture] = match self.aperture {
            ApertureQuantity::FNumber => [Some(self.aperture_value), None],
            ApertureQuantity::NumericalAperture => [None, Some(self.aperture_value)],
        };
        let [half_field_deg, image_height_mm] = match self.field {
            FieldQuantity::HalfAngle => [Some(self.field_value), None],
            FieldQuantity::ImageHeight => [None, Some(self.field_value)],
        };
        let spec = LensSpecification {
            focal_length_mm: Some(self.focal_length),
            magnification: number(MAGNIFICATION),
            wish: number(CONTRAST).map(LensWish::Mtf),
            f_number,
            numerical_aperture,
            half_field_deg,
            image_height_mm,
            min_back_focus_mm: number(BACK_FOCUS),
            max_track_mm: number(TRACK),
            max_semi_diameter_mm: number(DIAMETER),
            max_abs_distortion: number(DISTORTION),
            max_elements: self.counts[0].stated(),
            max_aspheric_surfaces: self.counts[1].stated(),
            glasses: self.glass_list(),
            as_built: self.as_built.map(|i| AS_BUILT_GRADES[i].0.to_owned()),
            ..self.with_wavelengths()
        };
        let light = number(ILLUMINATION).map(|least| vec![least; field_count(&spec)]);
        LensSpecification { min_relative_illumination: light, ..spec }
    }

    fn with_wavelengths(&self) -> LensSpecification {
        let preset = self.wavelengths.and_then(|i| WavelengthPreset::ALL.get(i));
        let lines = preset.map(WavelengthPreset::wavelengths);
        let list = |of: fn(&crate::lens::Wavelength) -> f64| {
            lines.as_ref().map(|lines| lines.iter().map(of).collect())
        };
        LensSpecification {
            wavelengths_um: list(|line| line.um),
            wavelength_weights: list(|line| line.weight),
            ..LensSpecification::default()
        }
    }

    fn glass_list(&self) -> Option<GlassList> {
        let names = self.glasses.split(',').map(str::trim).filter(|name| !name.is_empty());
        let names: Vec<String> = names.map(str::to_owned).collect();
        (!names.is_empty()).then_some(GlassList::Names(names))
    }

    /// Shows the form; what is not stated shows what is taken for it.
    pub(super) fn ui(&mut self, ui: &mut Ui, completed: &Completed) {
        let filled = completed.as_ref().map_or(&[][..], |(_, filled)| filled);
        Grid::new("specification").num_columns(2).spacing([12.0, 5.0]).show(ui, |ui| {
            self.required_rows(ui);
            for (row, entry) in NUMBER_ROWS.iter().zip(&mut self.numbers) {
                number_row(ui, row, entry, filled);
            }
            for (row, entry) in COUNT_ROWS.iter().zip(&mut self.counts) {
                count_row(ui, *row, entry, filled);
            }
            self.glass_row(ui);
            self.as_built_row(ui);
            self.run_rows(ui);
        });
        let others =
            other_filled(filled, NUMBER_ROWS.map(|row| row.key), COUNT_ROWS.map(|row| row.1));
        ui.weak(others);
    }

    fn required_rows(&mut self, ui: &mut Ui) {
        ui.label("Focal length").on_hover_text(
            "The object is at infinity: lenses for near objects are not designed from a \
             specification",
        );
        number_field(ui, "Focal length of the specification", &mut self.focal_length, " mm");
        ui.end_row();
        ui.label("Aperture");
        ui.horizontal(|ui| self.aperture(ui));
        ui.end_row();
        ui.label("Field");
        ui.horizontal(|ui| self.field(ui));
        ui.end_row();
        ui.label("Wavelengths");
        let presets = WavelengthPreset::ALL.iter().enumerate().map(|(i, p)| (Some(i), p.title));
        let all: Vec<(Option<usize>, &str)> =
            std::iter::once((None, "not stated: F, d, C")).chain(presets).collect();
        choice(ui, "Wavelengths of the specification", &mut self.wavelengths, &all);
        ui.end_row();
    }

    fn aperture(&mut self, ui: &mut Ui) {
        let kinds = [
            (ApertureQuantity::FNumber, "f-number"),
            (ApertureQuantity::NumericalAperture, "numerical aperture, image"),
        ];
        let before = self.aperture;
        choice(ui, "Aperture of the specification", &mut self.aperture, &kinds);
        if self.aperture != before && self.aperture_value != 0.0 {
            // Either is half the inverse of the other.
            self.aperture_value = 0.5 / self.aperture_value;
        }
        number_field(ui, "Aperture value of the specification", &mut self.aperture_value, "");
    }

    fn field(&mut self, ui: &mut Ui) {
        let kinds = [
            (FieldQuantity::HalfAngle, "half field angle"),
            (FieldQuantity::ImageHeight, "image height"),
        ];
        let before = self.field;
        choice(ui, "Field of the specification", &mut self.field, &kinds);
        if self.field != before {
            let (value, f) = (self.field_value, self.focal_length);
            self.field_value = match self.field {
                FieldQuantity::HalfAngle => (value / f).atan().to_degrees(),
                FieldQuantity::ImageHeight => f * value.to_radians().tan(),
            };
        }
        let unit = if self.field == FieldQuantity::HalfAngle { "°" } else { " mm" };
        number_field(ui, "Largest field of the specification", &mut self.field_value, unit);
    }

    fn glass_row(&mut self, ui: &mut Ui) {
        ui.label("Glasses");
        let line = TextEdit::singleline(&mut self.glasses)
            .id(glasses_id())
            .hint_text("any glass of the catalogue")
            .desired_width(220.0);
        let hint = "Names, separated by commas: SCHOTT N-BK7, SCHOTT N-SF5";
        ui.add(line).on_hover_text(hint).accessible_name("Glasses of the specification");
        ui.end_row();
    }

    fn as_built_row(&mut self, ui: &mut Ui) {
        ui.label("As built").on_hover_text(
            "The care in making for which the lenses are refined at the end, within all limits",
        );
        let grades = AS_BUILT_GRADES.iter().enumerate().map(|(i, (key, _))| {
            let words =
                if *key == "none" { "as designed alone".to_owned() } else { key.replace('_', " ") };
            (Some(i), words)
        });
        let all: Vec<(Option<usize>, String)> =
            std::iter::once((None, "not stated: precision".to_owned())).chain(grades).collect();
        let all: Vec<(Option<usize>, &str)> = all.iter().map(|(i, text)| (*i, &**text)).collect();
        choice(ui, "Care in making of the specification", &mut self.as_built, &all);
        ui.end_row();
    }

    fn run_rows(&mut self, ui: &mut Ui) {
        ui.label("Time");
        ui.horizontal(|ui| {
            let minutes = DragValue::new(&mut self.minutes).range(0.01..=10_000.0).speed(0.1);
            let hint = "For the search; rims, limits and focus of the lenses come after it";
            ui.add(minutes.suffix(" min")).on_hover_text(hint).accessible_name("Minutes");
            ui.weak("seed");
            let seed = DragValue::new(&mut self.seed).speed(0.1);
            let hint = "Of all random numbers: another one gives other lenses";
            ui.add(seed).on_hover_text(hint).accessible_name("Seed");
        });
        ui.end_row();
    }
}

/// True while the names of glasses are typed.
pub(super) fn is_typing(context: &Context) -> bool {
    context.memory(|memory| memory.has_focus(glasses_id()))
}

fn glasses_id() -> Id {
    Id::unique("glasses of the specification")
}

/// The number of fields at which a lens of this specification is judged.
fn field_count(spec: &LensSpecification) -> usize {
    LensRequirements::complete(spec).map_or(1, |(asked, _)| asked.fields.len())
}

fn number_row(ui: &mut Ui, row: &NumberRow, entry: &mut Optional<f64>, filled: &[FilledValue]) {
    let taken = filled.iter().find(|value| value.key == row.key);
    let checked = ui.checkbox(&mut entry.is_stated, row.title).on_hover_text(row.hint);
    if checked.changed()
        && let Some(value) = taken.and_then(|taken| taken.value.parse::<f64>().ok())
    {
        entry.value = value * row.scale;
    }
    if entry.is_stated {
        number_field(ui, &format!("{}:", row.title), &mut entry.value, row.unit);
    } else {
        ui.weak(filled_text(taken, row.scale, row.unit));
    }
    ui.end_row();
}

fn count_row(
    ui: &mut Ui,
    (title, key, hint): (&str, &str, &str),
    entry: &mut Optional<usize>,
    filled: &[FilledValue],
) {
    let taken = filled.iter().find(|value| value.key == key);
    let checked = ui.checkbox(&mut entry.is_stated, title).on_hover_text(hint);
    if checked.changed()
        && let Some(value) = taken.and_then(|taken| taken.value.parse().ok())
    {
        entry.value = value;
    }
    if entry.is_stated {
        let drag = DragValue::new(&mut entry.value).range(0..=40).speed(0.05);
        ui.add(drag).accessible_name(format!("{title}:"));
    } else {
        ui.weak(filled_text(taken, 1.0, ""));
    }
    ui.end_row();
}
