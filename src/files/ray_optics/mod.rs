//! The models of the program ray-optics, `.roa`: reading and writing.
//!
//! A model is JSON that names the classes of the program. What this program has no counterpart of, a
//! hologram, becomes a locked row with its JSON.

mod write;

pub(super) use write::write;

use super::codev::{Placement, frames};
use super::error::{FileError, ParseError};
use super::report::{ConversionOutcome, ConversionReport};
use super::zemax::named_medium;
use crate::files::outline::{ForeignOutline, OutlineForm};
use crate::lens::{
    ASPHERE_TERMS, Aperture, BlockedSide, FieldKind, FieldPoint, Fields, Freeform, FreeformKind,
    IdealElement, Lens, LockedSurface, Medium, Object, Row, SurfaceNumber, Wavelength,
};
use serde_json::Value;

/// Object distances from this on are infinite.
const INFINITE_DISTANCE: f64 = 1e10;

/// The largest accepted number of surfaces.
const MAX_SURFACES: usize = 1000;

/// The key of nd and vd beside the table of indices of a model glass.
const MODEL_KEY: &str = "nd_vd";

/// True for JSON that is a model of ray-optics, and no lens of this program.
pub(super) fn is_model(text: &str) -> bool {
    let start = text.trim_start().strip_prefix('{').map(str::trim_start);
    start.is_some_and(|text| text.starts_with("\"optical_model\""))
}

/// Reads a lens from the text of a file. `file` is its name in messages, and the name of a lens that has
/// none.
///
/// # Errors
/// Malformed JSON, a part that is missing, or an invalid lens.
pub(super) fn read(text: &str, file: &str) -> Result<(Lens, ConversionReport), FileError> {
    let json: Value = serde_json::from_str(&without_infinities(text)).map_err(|error| {
        wrong(&format!("line {}", error.line()), &error.to_string(), "JSON").in_file(file)
    })?;
    let mut report = ConversionReport::default();
    let model = attributes(&json["optical_model"]);
    let mut lens = lens(model, &mut report).map_err(|wrong| wrong.in_file(file))?;
    super::set_origin(&mut lens, file);
    lens.check().map_err(|source| FileError::Lens { file: file.to_owned(), source })?;
    Ok((lens, report))
}

/// The text with `null` for the words `NaN` and `Infinity`, which are no JSON.
pub(super) fn without_infinities(text: &str) -> String {
    let mut quoted = false;
    let mut plain = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let word = ["-Infinity", "Infinity", "NaN"].into_iter().find(|word| rest.starts_with(word));
        let length = match word.filter(|_| !quoted) {
            Some(word) => {
                plain.push_str("null");
                word.len()
            }
            None if quoted && c == '\\' => {
                let pair: String = rest.chars().take(2).collect();
                plain.push_str(&pair);
                pair.len()
            }
            None => {
                quoted ^= c == '"';
                plain.push(c);
                c.len_utf8()
            }
        };
        rest = &rest[length..];
    }
    plain
}

fn wrong(place: &str, found: &str, expected: &str) -> ParseError {
    let [place, found, expected] = [place, found, expected].map(str::to_owned);
    ParseError { place, found, expected }
}

/// The attributes of an object of a class; an object without a class is its own.
fn attributes(value: &Value) -> &Value {
    value.get("attributes").unwrap_or(value)
}

/// The name of the class of an object.
fn class(value: &Value) -> &str {
    value["__instance_type__"][1].as_str().unwrap_or_default()
}

/// The numbers of a list or an array.
fn numbers(value: &Value) -> Vec<f64> {
    let list = value.get("__ndarray__").unwrap_or(value).as_array();
    list.into_iter().flatten().filter_map(Value::as_f64).collect()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(0.0)
}

fn lens(model: &Value, report: &mut ConversionReport) -> Result<Lens, ParseError> {
    let sequence = attributes(&model["seq_model"]);
    let list = |key: &str| sequence[key].as_array().map(Vec::as_slice).unwrap_or_default();
    let (surfaces, gaps) = (list("ifcs"), list("gaps"));
    if surfaces.len() < 3 || surfaces.len() > MAX_SURFACES || gaps.len() + 1 != surfaces.len() {
        let found = format!("{} surfaces and {} gaps", surfaces.len(), gaps.len());
        let expected = "an object, up to 998 surfaces and an image, with a gap between any two";
        return Err(wrong("seq_model", &found, expected));
    }
    let unit = unit(attributes(&model["system_spec"]))?;
    let distance = number(&attributes(&gaps[0])["thi"]);
    let infinite = distance.abs() >= INFINITE_DISTANCE;
    let object = if infinite { Object::Infinity } else { Object::Finite(distance * unit) };
    if distance == 0.0 {
        return Err(wrong("gaps[0]", "an object at the first surface", "another distance"));
    }
    let spec = attributes(&model["optical_spec"]);
    let title = attributes(&model["system_spec"])["title"].as_str().unwrap_or_default();
    let mut lens = Lens {
        name: title.to_owned(),
        object,
        object_medium: medium(attributes(&gaps[0]), "object", report),
        aperture: aperture(attributes(&spec["pupil"]), unit)?,
        fields: fields(attributes(&spec["field_of_view"]), unit, infinite, report)?,
        wavelengths: wavelengths(attributes(&spec["spectral_region"])),
        ..crate::lens::blank()
    };
    let stop = sequence["stop_surface"].as_u64().and_then(|stop| usize::try_from(stop).ok());
    let stop = stop.filter(|stop| (1..surfaces.len() - 1).contains(stop)).unwrap_or_else(|| {
        let note = "no stop in the file: the first surface";
        report.add(ConversionOutcome::Approximated, "stop_surface", note);
        1
    });
    let profiles = &model["profile_dict"];
    let rows = (1..surfaces.len() - 1).map(|k| {
        let source = RowSource { surface: &surfaces[k], gap: attributes(&gaps[k]), profiles, unit };
        Row { stop: k == stop, ..source.row(k, report) }
    });
    lens.surfaces = rows.collect();
    Ok(lens)
}

/// Millimetres per unit.
fn unit(system: &Value) -> Result<f64, ParseError> {
    let name = system.get("_dimensions").or_else(|| system.get("dimensions"));
    match name.and_then(Value::as_str).unwrap_or("mm").to_ascii_lowercase().as_str() {
        "mm" | "m" => Ok(1.0),
        "cm" | "c" => Ok(10.0),
        "inches" | "inch" | "in" | "i" => Ok(25.4),
        "feet" | "ft" => Ok(304.8),
        other => Err(wrong("system_spec", &format!("the unit `{other}`"), "mm, cm or inches")),
    }
}

/// The words of a key such as `["aperture", "image", "f/#"]`, behind the first.
fn key(spec: &Value) -> [&str; 2] {
    let key = spec.get("_key").or_else(|| spec.get("key")).unwrap_or(&Value::Null);
    [1, 2].map(|i| key[i].as_str().unwrap_or_default())
}

fn aperture(pupil: &Value, unit: f64) -> Result<Aperture, ParseError> {
    let value = number(&pupil["value"]);
    if !(value > 0.0) {
        return Err(wrong("pupil", &format!("the aperture {value}"), "a number above 0"));
    }
    match key(pupil) {
        ["object", "epd" | "pupil"] => Ok(Aperture::EntrancePupilDiameter(value * unit)),
        ["object", "na" | "NA"] => Ok(Aperture::ObjectNa(value)),
        ["object", "f/#"] => Ok(Aperture::ObjectNa(0.5 / value)),
        ["image", "f/#"] => Ok(Aperture::FNumber(value)),
        ["image", "na" | "NA"] => Ok(Aperture::FNumber(0.5 / value)),
        other => Err(wrong("pupil", &format!("the key {other:?}"), "epd, f/# or NA")),
    }
}

fn fields(
    view: &Value,
    unit: f64,
    infinite: bool,
    report: &mut ConversionReport,
) -> Result<Fields, ParseError> {
    let (kind, scale) = match key(view) {
        ["object", "angle"] => (FieldKind::Angle, 1.0),
        ["object", "height"] if infinite => {
            let note = "object heights of an object at infinity: only the axis is kept";
            report.add(ConversionOutcome::Dropped, "field_of_view", note);
            (FieldKind::Angle, 0.0)
        }
        ["object", "height"] => (FieldKind::ObjectHeight, unit),
        ["image", "height" | "real height"] => (FieldKind::ImageHeight, unit),
        other => {
            let expected = "angles, object heights or image heights";
            return Err(wrong("field_of_view", &format!("the key {other:?}"), expected));
        }
    };
    let relative = view["is_relative"].as_bool() == Some(true);
    let scale = if relative { scale * number(&view["value"]) } else { scale };
    let point = |field: &Value| {
        let field = attributes(field);
        let weight = field["wt"].as_f64().unwrap_or(1.0);
        // Newer versions of the program have a line in front of the names.
        let value = |key: &str| field.get(key).or_else(|| field.get(format!("_{key}")));
        let [x, y] = ["x", "y"].map(|key| value(key).map_or(0.0, number) * scale);
        match kind {
            FieldKind::Angle => FieldPoint::from_projected_angles([x, y], weight),
            FieldKind::ObjectHeight | FieldKind::ImageHeight => FieldPoint { x, y, weight },
        }
    };
    let values: Vec<FieldPoint> =
        view["fields"].as_array().into_iter().flatten().map(point).collect();
    if values.is_empty() {
        return Err(wrong("field_of_view", "no field", "one at least"));
    }
    Ok(Fields { kind, values })
}

fn wavelengths(region: &Value) -> Vec<Wavelength> {
    let weights = numbers(&region["spectral_wts"]);
    let reference = region["reference_wvl"].as_u64();
    let wave = |(i, nm): (usize, f64)| Wavelength {
        um: nm * 1e-3,
        weight: weights.get(i).copied().unwrap_or(1.0),
        primary: reference == Some(i as u64),
    };
    numbers(&region["wavelengths"]).into_iter().enumerate().map(wave).collect()
}

/// The medium of a gap.
fn medium(gap: &Value, place: &str, report: &mut ConversionReport) -> Medium {
    let glass = &gap["medium"];
    let data = attributes(glass);
    match class(glass) {
        "Air" | "" => return Medium::Air,
        "ModelGlass" => return Medium::Model { nd: number(&data["n"]), vd: number(&data["v"]) },
        "ConstantIndex" => return Medium::Index(number(&data["n"])),
        _ => {}
    }
    if let [nd, vd] = numbers(&data[MODEL_KEY])[..] {
        return Medium::Model { nd, vd };
    }
    let name = data["gname"].as_str().or_else(|| data["label"].as_str()).unwrap_or_default();
    let maker = match data["_catalog"].as_str() {
        Some(maker) => maker.to_ascii_uppercase(),
        None => class(glass).trim_end_matches("Glass").to_ascii_uppercase(),
    };
    let imported = named_medium(name, &[maker]);
    if imported.outcome != ConversionOutcome::Used {
        let what = format!("glass {name} of {place}");
        report.add(imported.outcome, &what, imported.note);
    }
    imported.medium
}

/// One surface of a model.
struct RowSource<'a> {
    surface: &'a Value,
    gap: &'a Value,
    profiles: &'a Value,
    unit: f64,
}

impl RowSource<'_> {
    fn row(&self, number_in_file: usize, report: &mut ConversionReport) -> Row {
        let place = format!("surface {}", SurfaceNumber::new(number_in_file - 1));
        let data = attributes(self.surface);
        let mirror = data["interact_mode"] == "reflect";
        let behind = medium(self.gap, &place, report);
        let mut row = Row {
            thickness: number(&self.gap["thi"]) * self.unit,
            medium: if mirror { Medium::Mirror } else { behind },
            comment: data["label"].as_str().unwrap_or_default().to_owned(),
            ..Row::default()
        };
        self.clip(data, &place, &mut row, report);
        let shape = self.shape(data, &mut row);
        let phase = data.get("phase_element").filter(|phase| !phase.is_null());
        let kind = match (class(self.surface), phase) {
            ("Surface", None) => shape.err(),
            ("Surface", Some(phase)) if shape.is_ok() && row.freeform.is_none() => {
                row.freeform = self.phase(phase);
                row.freeform.is_none().then(|| class(phase).to_owned())
            }
            ("ThinLens", _) => match self.thin_lens(data) {
                None => Some("ThinLens".to_owned()),
                found => {
                    (row.ideal, row.curvature) = (found, 0.0);
                    let note = "a paraxial lens in place of a hologram of two points";
                    let what = format!("{place}: ThinLens");
                    report.add(ConversionOutcome::Approximated, &what, note);
                    None
                }
            },
            ("Surface", Some(phase)) => Some(class(phase).to_owned()),
            (other, _) => Some(other.to_owned()),
        };
        if let Some(kind) = kind {
            row.freeform = None;
            let note = "cannot be traced: the row is locked and rays meet its conic alone";
            report.add(ConversionOutcome::Locked, &format!("{place}: {kind}"), note);
            row.locked = Some(LockedSurface { kind, lines: vec![self.surface.to_string()] });
        }
        self.place(data, &mut row);
        row
    }

    /// Writes the clear apertures into a row.
    fn clip(&self, data: &Value, place: &str, row: &mut Row, report: &mut ConversionReport) {
        for aperture in data["clear_apertures"].as_array().into_iter().flatten() {
            let numbers = attributes(aperture);
            let of = |key: &str| number(&numbers[key]);
            let halves = [of("x_half_width"), of("y_half_width")];
            let (form, half) = match class(aperture) {
                "Circular" => (OutlineForm::Circle, [of("radius"); 2]),
                "Rectangular" => (OutlineForm::Rectangle, halves),
                "Elliptical" => (OutlineForm::Ellipse, halves),
                kind => {
                    let note = "an aperture of this form is not traced: it clips nothing here";
                    report.add(ConversionOutcome::Dropped, &format!("{place}: {kind}"), note);
                    continue;
                }
            };
            if !half.iter().all(|half| *half > 0.0) {
                continue;
            }
            let obscures = numbers["is_obscuration"] == true;
            let blocks = if obscures { BlockedSide::Inside } else { BlockedSide::Outside };
            let (offset, angle) = ([of("x_offset"), of("y_offset")], of("rotation") % 360.0);
            let outline = ForeignOutline { form, half, offset, angle };
            outline.add_to(row, blocks, self.unit);
            if outline.centred_radius().is_none() {
                let what = format!("{place}: aperture");
                report.add(ConversionOutcome::Used, &what, outline.note(blocks));
            }
        }
    }

    /// Writes the shape into a row; the error is the class of a shape that cannot be traced.
    fn shape(&self, data: &Value, row: &mut Row) -> Result<(), String> {
        let named = || self.profiles.get(data["profile_id"].as_str()?);
        let profile = data.get("profile").or_else(named).unwrap_or(&Value::Null);
        let numbers = attributes(profile);
        row.curvature = number(&numbers["cv"]) / self.unit;
        row.conic = match numbers.get("ec") {
            Some(square) => number(square) - 1.0,
            None => number(&numbers["cc"]),
        };
        let first = match class(profile) {
            "" | "Spherical" | "Conic" => return Ok(()),
            "EvenPolynomial" => 2,
            "RadialPolynomial" => 1,
            other => return Err(other.to_owned()),
        };
        let terms = self::numbers(&numbers["coefs"]);
        let powers: Vec<(usize, f64)> =
            (first..).step_by(first).zip(terms).filter(|(_, a)| *a != 0.0).collect();
        let is_asphere = |(power, _): &(usize, f64)| {
            power.is_multiple_of(2) && (4..2 * ASPHERE_TERMS + 4).contains(power)
        };
        let last = powers.last().map_or(0, |(power, _)| *power);
        if powers.iter().all(is_asphere) {
            row.asphere = vec![0.0; (last / 2).saturating_sub(1)];
            for (power, a) in powers {
                let scale = self.unit.powi(1 - i32::try_from(power).unwrap_or(i32::MAX));
                row.asphere[power / 2 - 2] = a * scale;
            }
            return Ok(());
        }
        let mut numbers = vec![0.0; last];
        powers.into_iter().for_each(|(power, a)| numbers[power - 1] = a);
        let form = Freeform { kind: FreeformKind::OddAsphere, numbers }.scaled(self.unit);
        if form.fault().is_some() {
            return Err(format!("{} with a term in r^{last}", class(profile)));
        }
        row.freeform = Some(form);
        Ok(())
    }

    /// The paraxial lens in air of the power of a thin lens; `None` for one without any.
    fn thin_lens(&self, data: &Value) -> Option<IdealElement> {
        let power = data.get("_power").or_else(|| data.get("power"))?.as_f64()?;
        let focal_length = self.unit / power;
        (focal_length.abs() < 1e50).then_some(IdealElement::Lens { focal_length })
    }

    /// The phase of a diffractive element, whose coefficients are optical paths at its wavelength; `None`
    /// for another element, and for a function that is not known.
    fn phase(&self, element: &Value) -> Option<Freeform<f64>> {
        let data = attributes(element);
        let known =
            class(element) == "DiffractiveElement" && data["phase_fct_name"] == "radial_phase_fct";
        let (nm, order) = (number(&data["ref_wl"]), data["order"].as_f64()?);
        let per_mm = std::f64::consts::TAU / (nm * 1e-6);
        let numbers = numbers(&data["coefficients"]).into_iter().map(|c| c * per_mm).collect();
        let kind = FreeformKind::RadialPhase { radius: 1.0, order };
        let form = Freeform { kind, numbers }.scaled(self.unit);
        (known && nm > 0.0 && form.fault().is_none()).then_some(form)
    }

    fn place(&self, data: &Value, row: &mut Row) {
        let Some(moved) = data.get("decenter").filter(|moved| !moved.is_null()) else { return };
        let numbers = attributes(moved);
        let list = |key: &str| {
            let list = self::numbers(&numbers[key]);
            [0, 1, 2].map(|i| list.get(i).copied().unwrap_or(0.0))
        };
        let kind = numbers.get("_dtype").or_else(|| numbers.get("dtype"));
        let placement = match kind.and_then(Value::as_str).unwrap_or_default() {
            "reverse" => Placement::Reverse,
            "dec and return" => Placement::Return,
            "bend" => Placement::Bend,
            _ => Placement::Basic,
        };
        let decenter = list("dec").map(|length| length * self.unit);
        let (before, after) = frames(placement, decenter, list("euler"));
        row.place_on_axis(&before, &after);
    }
}
