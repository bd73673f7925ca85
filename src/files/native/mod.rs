//! The native lens file: JSON with a version, one surface a line.
//!
//! A key that is not known is refused by name, with line and column; numbers are written with the
//! fewest digits that read back to the same bits; what has its default value is left out.
//!
//! ```json
//! { "aplanat": 1, "name": "Achromat", "object": "infinity",
//!   "aperture": {"entrance_pupil_diameter": 16.0},
//!   "fields": {"kind": "angle", "values": [{"y": 0.0, "weight": 1.0}]},
//!   "wavelengths": [{"um": 0.5875618, "primary": true}],
//!   "surfaces": [
//!     {"curvature": 0.0195, "thickness": 5.5, "glass": "SCHOTT N-BAK4", "stop": true},
//!     {"radius": -166.7, "conic": -1.0, "asphere": [1e-7], "thickness": 76.5} ] }
//! ```

mod layout;
mod place;

pub use layout::pretty;

use super::error::{FileError, ParseError};
use crate::lens::{
    Aperture, Fields, GradientIndex, Lens, Medium, Object, Pickup, ProfileLaw, Row, Variable,
    Wavelength, ZoomPosition,
};
use serde::de::value::MapAccessDeserializer;
use serde::de::{DeserializeOwned, Error as _, IgnoredAny, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

/// The version of the format that is written.
pub const VERSION: u64 = 1;

/// Reads a lens from the text of a native file; `file` is only for the message.
pub fn read(text: &str, file: &str) -> Result<Lens, FileError> {
    let malformed = |error: &serde_json::Error| translate_error(error, text).in_file(file);
    let probe: VersionProbe = serde_json::from_str(text).map_err(|e| malformed(&e))?;
    probe.check(text).map_err(|wrong| wrong.in_file(file))?;
    let lens: Lens = serde_json::from_str(text).map_err(|e| malformed(&e))?;
    lens.check().map_err(|source| FileError::Lens { file: file.to_owned(), source })?;
    Ok(lens)
}

/// Reads any other JSON, with errors that name place, found and expected as those of a lens do.
pub fn read_json<T: DeserializeOwned>(text: &str, file: &str) -> Result<T, FileError> {
    serde_json::from_str(text).map_err(|error| {
        let ParseError { place, found, expected } = translate_error(&error, text);
        // A parser looks at the next sign to find that something cannot be read, and has read all of
        // what lacks a key.
        let keys = place::keys(text, error.line(), error.column(), error.is_syntax());
        let place = if keys.is_empty() { place } else { format!("{place}, {keys}") };
        ParseError { place, found, expected }.in_file(file)
    })
}

/// The text of the native file of a lens.
pub fn write(lens: &Lens) -> String {
    pretty(lens)
}

/// The version alone, so that a newer file is refused for its version and not for its keys.
#[derive(Deserialize)]
struct VersionProbe {
    #[serde(default)]
    aplanat: Option<serde_json::Value>,
    #[serde(flatten)]
    _rest: IgnoredAny,
}

impl VersionProbe {
    fn check(&self, text: &str) -> Result<(), ParseError> {
        let expected = format!("`\"aplanat\": {VERSION}`, the version that this program reads");
        match &self.aplanat {
            Some(version) if version.as_u64() == Some(VERSION) => Ok(()),
            Some(version) => {
                let line = text.lines().position(|l| l.contains("\"aplanat\"")).unwrap_or(0);
                let place = format!("line {}", line + 1);
                Err(ParseError { place, found: format!("`\"aplanat\": {version}`"), expected })
            }
            None => {
                let found = "no key `aplanat`".to_owned();
                Err(ParseError { place: "line 1".to_owned(), found, expected })
            }
        }
    }
}

/// Splits the parser's message into place, found and expected.
fn translate_error(error: &serde_json::Error, text: &str) -> ParseError {
    let position = format!(" at line {} column {}", error.line(), error.column());
    let whole = error.to_string();
    let (element, message) = element(whole.strip_suffix(&position).unwrap_or(&whole));
    let place = format!("line {}, column {}{element}", error.line(), error.column());
    if error.is_eof() {
        let found = "the end of the file".to_owned();
        return ParseError {
            place,
            found,
            expected: "the rest of it; is it truncated?".to_owned(),
        };
    }
    if error.is_syntax() {
        let found = word_at(text, error.line(), error.column());
        // Sound JSON that stands where one of several things is named.
        let is_sound = serde_json::from_str::<serde_json::Value>(text).is_ok();
        let expected = if is_sound {
            "a name, or an object with one key".to_owned()
        } else {
            format!("JSON ({message})")
        };
        return ParseError { place, found, expected };
    }
    let plain = message.replace("expected f64", "expected a number");
    let plain = plain.strip_prefix("invalid type: ").unwrap_or(&plain);
    let (found, expected) = plain.split_once(", expected ").unwrap_or((plain, "it"));
    let found = match found.strip_prefix("missing field ") {
        Some(key) => format!("no key {key}"),
        None => found
            .replace("unit variant", "a name alone")
            .replace("unknown field", "the unknown key")
            .replace("unknown variant", "the unknown name"),
    };
    ParseError { place, found, expected: expected_text(expected) }
}

/// What the parser expects, without the words of the program's types.
fn expected_text(expected: &str) -> String {
    match expected {
        of if of.starts_with("struct ") => "an object with its keys: {\"key\": ...}",
        "usize" | "u64" | "u32" => "a whole number, 0 or more",
        "a sequence" => "a list",
        other => other,
    }
    .to_owned()
}

/// Splits off the number that a list has put in front of the message about one of its elements:
/// `ray 3: ` becomes `, ray 3`.
fn element(message: &str) -> (String, &str) {
    let Some((name, rest)) = message.split_once(": ") else { return (String::new(), message) };
    match name.split_once(' ') {
        Some((_, number)) if number.parse::<usize>().is_ok() => (format!(", {name}"), rest),
        _ => (String::new(), message),
    }
}

/// The word around a place, in quotes, for a message.
fn word_at(text: &str, line: usize, column: usize) -> String {
    let Some(line) = text.lines().nth(line.saturating_sub(1)) else {
        return "the end of the file".to_owned();
    };
    let bytes = line.as_bytes();
    let inside = |b: u8| b.is_ascii_alphanumeric() || b"+-._".contains(&b) || b >= 0x80;
    let at = column.saturating_sub(1).min(bytes.len());
    let start = bytes[..at].iter().rposition(|b| !inside(*b)).map_or(0, |i| i + 1);
    let end = bytes[at..].iter().position(|b| !inside(*b)).map_or(bytes.len(), |i| i + at);
    let end = end.max((start + 1).min(bytes.len())).min(start + 40);
    match String::from_utf8_lossy(&bytes[start.min(end)..end]) {
        word if word.is_empty() => "the end of the line".to_owned(),
        word => format!("`{word}`"),
    }
}

/// The keys of a lens.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LensJson {
    aplanat: u64,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    name: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    source: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    notes: String,
    object: Object,
    #[serde(default, skip_serializing_if = "is_air")]
    object_glass: Medium,
    aperture: Aperture,
    fields: Fields,
    wavelengths: Vec<Wavelength>,
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "given")]
    focus: Option<f64>,
    surfaces: Vec<Row>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    zoom: Vec<ZoomPosition>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    variables: Vec<Variable>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pickups: Vec<Pickup>,
}

/// A number where there is a key for it: `null`, which is what some programs write for a number
/// that is none, is refused.
fn given<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    f64::deserialize(from).map(Some)
}

fn is_air(medium: &Medium) -> bool {
    *medium == Medium::Air
}

impl Serialize for Lens {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let Self { object, aperture, image_solve: focus, .. } = *self;
        LensJson {
            aplanat: VERSION,
            name: self.name.clone(),
            source: self.source.clone(),
            notes: self.notes.clone(),
            object,
            object_glass: self.object_medium.clone(),
            aperture,
            fields: self.fields.clone(),
            wavelengths: self.wavelengths.clone(),
            focus,
            surfaces: self.surfaces.clone(),
            zoom: self.zoom.clone(),
            variables: self.variables.clone(),
            pickups: self.pickups.clone(),
        }
        .serialize(to)
    }
}

impl<'de> Deserialize<'de> for Lens {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let keys = LensJson::deserialize(from)?;
        if keys.aplanat != VERSION {
            let found = format!("version {}, expected {VERSION}", keys.aplanat);
            return Err(D::Error::custom(found));
        }
        Ok(Self {
            name: keys.name,
            source: keys.source,
            notes: keys.notes,
            object: keys.object,
            object_medium: keys.object_glass,
            aperture: keys.aperture,
            fields: keys.fields,
            wavelengths: keys.wavelengths,
            surfaces: keys.surfaces,
            zoom: keys.zoom,
            variables: keys.variables,
            pickups: keys.pickups,
            image_solve: keys.focus,
        })
    }
}

/// The keys of a surface. A `radius` is read but never written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RowJson {
    #[serde(default, skip_serializing, deserialize_with = "given")]
    radius: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "given")]
    curvature: Option<f64>,
    #[serde(default, skip_serializing_if = "is_plain_zero")]
    conic: f64,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    asphere: Vec<f64>,
    thickness: f64,
    #[serde(default, skip_serializing_if = "is_air")]
    glass: Medium,
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "given")]
    semi_diameter: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "given")]
    obstruction: Option<f64>,
    #[serde(default, skip_serializing_if = "is_false")]
    stop: bool,
    #[serde(default, skip_serializing_if = "is_false")]
    hyper: bool,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    comment: String,
}

/// A zero without sign, so that −0 is written and comes back with its sign.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn is_plain_zero(value: &f64) -> bool {
    value.to_bits() == 0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn is_false(value: &bool) -> bool {
    !*value
}

impl RowJson {
    /// One over the radius, whichever of the two is given.
    fn curvature(&self) -> Result<f64, &'static str> {
        match (self.curvature, self.radius) {
            (Some(_), Some(_)) => Err("both `curvature` and `radius`, expected one of them"),
            (None, Some(0.0)) => {
                Err("a `radius` of 0, expected another number, or none for a plane")
            }
            (None, Some(radius)) => Ok(1.0 / radius),
            (curvature, None) => Ok(curvature.unwrap_or(0.0)),
        }
    }
}

impl Serialize for Row {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        RowJson {
            radius: None,
            curvature: (!is_plain_zero(&self.curvature)).then_some(self.curvature),
            conic: self.conic,
            asphere: self.asphere.clone(),
            thickness: self.thickness,
            glass: self.medium.clone(),
            semi_diameter: self.semi_diameter,
            obstruction: self.obstruction,
            stop: self.stop,
            hyper: self.hyperhemisphere,
            comment: self.comment.clone(),
        }
        .serialize(to)
    }
}

impl<'de> Deserialize<'de> for Row {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_map(RowVisitor)
    }
}

struct RowVisitor;

impl<'de> Visitor<'de> for RowVisitor {
    type Value = Row;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a surface, {\"curvature\", \"thickness\", ...}")
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Row, A::Error> {
        let keys = RowJson::deserialize(MapAccessDeserializer::new(map))?;
        Ok(Row {
            curvature: keys.curvature().map_err(A::Error::custom)?,
            conic: keys.conic,
            asphere: keys.asphere,
            thickness: keys.thickness,
            medium: keys.glass,
            semi_diameter: keys.semi_diameter,
            obstruction: keys.obstruction,
            stop: keys.stop,
            hyperhemisphere: keys.hyper,
            comment: keys.comment,
        })
    }
}

/// The keys of an object that is not at infinity.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ObjectJson {
    distance: f64,
}

impl Serialize for Object {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Infinity => to.serialize_str("infinity"),
            Self::Finite(distance) => serialize_numbers(to, &[("distance", *distance)]),
        }
    }
}

impl<'de> Deserialize<'de> for Object {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(ObjectVisitor)
    }
}

struct ObjectVisitor;

impl<'de> Visitor<'de> for ObjectVisitor {
    type Value = Object;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("\"infinity\" or {\"distance\": mm}")
    }

    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Object, E> {
        if text == "infinity" {
            Ok(Object::Infinity)
        } else {
            Err(E::invalid_value(serde::de::Unexpected::Str(text), &self))
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Object, A::Error> {
        let keys = ObjectJson::deserialize(MapAccessDeserializer::new(map))?;
        Ok(Object::Finite(keys.distance))
    }
}

/// The keys of a medium that is not a name.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MediumJson {
    nd: Option<f64>,
    vd: Option<f64>,
    index: Option<f64>,
    gradient: Option<GradientIndexJson>,
}

/// The keys of a gradient.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct GradientIndexJson {
    base: Medium,
    #[serde(default, skip_serializing_if = "is_index")]
    of: ProfileLaw,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    radial: Vec<f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    axial: Vec<f64>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn is_index(law: &ProfileLaw) -> bool {
    *law == ProfileLaw::Index
}

impl From<&GradientIndex> for GradientIndexJson {
    fn from(gradient: &GradientIndex) -> Self {
        let GradientIndex { base, law, radial, axial } = gradient.clone();
        Self { base, of: law, radial, axial }
    }
}

impl From<GradientIndexJson> for GradientIndex {
    fn from(GradientIndexJson { base, of, radial, axial }: GradientIndexJson) -> Self {
        Self { base, law: of, radial, axial }
    }
}

impl Serialize for Medium {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Air => to.serialize_none(),
            Self::Mirror => to.serialize_str("mirror"),
            Self::Glass(name) => to.serialize_str(name),
            Self::Model { nd, vd } => serialize_numbers(to, &[("nd", *nd), ("vd", *vd)]),
            Self::Index(index) => serialize_numbers(to, &[("index", *index)]),
            Self::Grin(gradient) => {
                let mut map = to.serialize_map(Some(1))?;
                map.serialize_entry("gradient", &GradientIndexJson::from(&**gradient))?;
                map.end()
            }
        }
    }
}

/// An object of numbers.
fn serialize_numbers<S: Serializer>(to: S, numbers: &[(&str, f64)]) -> Result<S::Ok, S::Error> {
    let mut map = to.serialize_map(Some(numbers.len()))?;
    numbers.iter().try_for_each(|(key, value)| map.serialize_entry(key, value))?;
    map.end()
}

impl<'de> Deserialize<'de> for Medium {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(MediumVisitor)
    }
}

struct MediumVisitor;

impl<'de> Visitor<'de> for MediumVisitor {
    type Value = Medium;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a catalogue name, {\"nd\", \"vd\"}, {\"index\"}, {\"gradient\"} or \"mirror\"")
    }

    fn visit_unit<E>(self) -> Result<Medium, E> {
        Ok(Medium::Air)
    }

    fn visit_str<E>(self, text: &str) -> Result<Medium, E> {
        Ok(match text {
            "mirror" => Medium::Mirror,
            name => Medium::Glass(name.to_owned()),
        })
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Medium, A::Error> {
        let keys = MediumJson::deserialize(MapAccessDeserializer::new(map))?;
        match (keys.nd, keys.vd, keys.index, keys.gradient) {
            (Some(nd), Some(vd), None, None) => Ok(Medium::Model { nd, vd }),
            (None, None, Some(index), None) => Ok(Medium::Index(index)),
            (None, None, None, Some(keys)) => Ok(Medium::Grin(Box::new(keys.into()))),
            _ => Err(A::Error::custom(
                "a glass with other keys, expected {\"nd\", \"vd\"}, {\"index\"} or \
                 {\"gradient\"}",
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Parameter, Quantity, ZoomThickness};

    const ACHROMAT: &str = r#"{ "aplanat": 1, "name": "Achromat", "source": "", "notes": "",
  "object": "infinity",
  "aperture": {"entrance_pupil_diameter": 16.0},
  "fields": {"kind": "angle", "values": [{"y": 0.0, "weight": 1.0}, {"y": 5.0}]},
  "wavelengths": [{"um": 0.5875618, "weight": 1.0, "primary": true}],
  "surfaces": [
    {"curvature": 0.0195, "thickness": 5.5, "glass": "SCHOTT N-BAK4", "semi_diameter": 9.0},
    {"radius": -40, "thickness": 2.0, "glass": {"nd": 1.62004, "vd": 36.4}, "stop": true},
    {"curvature": -0.006, "conic": 0.0, "asphere": [1e-7], "thickness": 76.5}
  ] }"#;

    fn message(text: &str) -> String {
        read(text, "a.json").unwrap_err().to_string()
    }

    fn changed(from: &str, to: &str) -> String {
        assert!(ACHROMAT.contains(from), "{from}");
        message(&ACHROMAT.replacen(from, to, 1))
    }

    #[test]
    fn the_example_of_the_format_is_read() {
        let lens = read(ACHROMAT, "a.json").unwrap();
        assert_eq!(lens.surfaces[1].curvature, -0.025);
        assert_eq!(lens.surfaces[1].medium, Medium::Model { nd: 1.62004, vd: 36.4 });
        assert_eq!(lens.surfaces[2].asphere, [1e-7]);
        assert_eq!(lens.stop(), Some(1));
        assert_eq!(lens.fields.values[1].weight, 1.0);
    }

    #[test]
    fn whatever_is_written_reads_back_to_the_same_bits() {
        let mut lens = read(ACHROMAT, "a.json").unwrap();
        lens.name = "quotes \" and\nlines".to_owned();
        lens.object = Object::Finite(1.0 / 3.0);
        lens.object_medium = Medium::Index(1.33);
        lens.surfaces[0].conic = -0.0;
        lens.surfaces[0].curvature = 5e-324;
        lens.surfaces[0].hyperhemisphere = true;
        lens.surfaces[0].obstruction = Some(0.1 + 0.7);
        lens.surfaces[1].obstruction = Some(0.0);
        lens.surfaces[2].asphere = vec![0.1 + 0.2, -1.2345678901234567e-19];
        lens.image_solve = Some(0.0);
        let gap = ZoomThickness { surface: 0, thickness: 1e23 };
        let aperture = Some(Aperture::FNumber(2.0));
        lens.zoom = vec![ZoomPosition {
            name: "wide".into(),
            thicknesses: vec![gap],
            aperture,
            fields: None,
        }];
        let thickness = Parameter::new(0, Quantity::ZoomThickness(0));
        lens.variables = vec![Variable { parameter: thickness, min: Some(0.1), max: None }];
        lens.pickups = vec![Pickup {
            parameter: Parameter::new(2, Quantity::Asphere(1)),
            source: Parameter::new(0, Quantity::Conic),
            scale: -1.0,
            offset: 0.0,
        }];
        let text = write(&lens);
        let back = read(&text, "a.json").unwrap();
        assert_eq!(back, lens);
        assert!(back.surfaces[0].conic.is_sign_negative());
        assert_eq!(write(&back), text);
    }

    #[test]
    fn an_unknown_key_is_named_with_its_place() {
        let text = changed("\"asphere\"", "\"aspheric\"");
        assert!(text.starts_with("a.json, line 9, column 50: found"), "{text}");
        assert!(text.contains("the unknown key `aspheric`; expected one of `radius`"), "{text}");
        let text = changed("\"object\"", "\"objekt\"");
        assert!(text.contains("line 2") && text.contains("`objekt`"), "{text}");
        let text = changed("\"vd\": 36.4", "\"vd\": 36.4, \"ve\": 1");
        assert!(text.contains("line 8") && text.contains("`ve`"), "{text}");
    }

    #[test]
    fn another_version_is_refused_for_its_version() {
        let text = changed("\"aplanat\": 1", "\"aplanat\": 2, \"future\": 0");
        assert!(
            text.contains("line 1: found `\"aplanat\": 2`; expected `\"aplanat\": 1`"),
            "{text}"
        );
        let text = changed("\"aplanat\": 1", "\"aplanet\": 1");
        assert!(text.contains("found no key `aplanat`"), "{text}");
    }

    #[test]
    fn truncated_files_and_words_that_are_no_numbers_are_refused() {
        let half = &ACHROMAT[..ACHROMAT.len() / 2];
        assert!(message(half).contains("found the end of the file"), "{}", message(half));
        assert!(message("").contains("line 1, column 0: found the end of the file"));
        for word in ["NaN", "Infinity", "-Infinity", "nan"] {
            let text = changed("5.5", word);
            assert!(text.contains("line 7, column"), "{text}");
            assert!(text.contains(&format!("found `{word}`")), "{text}");
        }
        let text = changed("\"curvature\": 0.0195", "\"curvature\": null");
        assert!(
            text.contains("line 7") && text.contains("found null; expected a number"),
            "{text}"
        );
        assert!(changed("5.5", "1e999").contains("line 7"), "{}", changed("5.5", "1e999"));
        assert!(changed("5.5", "\"NaN\"").contains("string \"NaN\"; expected a number"));
    }

    #[test]
    fn contradictions_are_refused() {
        let text = changed("\"radius\": -40", "\"radius\": -40, \"curvature\": -0.025");
        assert!(
            text.contains("line 8") && text.contains("both `curvature` and `radius`"),
            "{text}"
        );
        assert!(changed("\"radius\": -40", "\"radius\": 0").contains("a `radius` of 0"));
        assert!(changed("\"vd\": 36.4", "\"index\": 1.5").contains("line 8"));
        assert!(changed("\"infinity\"", "\"far\"").contains("\"far\"; expected \"infinity\" or"));
        assert!(changed(", \"stop\": true", "").contains("no surface is the stop"));
        let text = changed("\"semi_diameter\": 9.0", "\"stop\": true");
        assert!(text.contains("surfaces 0 and 1 are both the stop"), "{text}");
        let text = changed("9.0", "-9.0");
        assert!(text.contains("semi-diameter of surface 0 is -9; expected zero or more"), "{text}");
        let text = changed("N-BAK4", "N-BAK99");
        assert!(text.contains("unknown glass `SCHOTT N-BAK99`"), "{text}");
    }
}
