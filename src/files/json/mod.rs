//! The lens file: JSON with a version, one surface a line.
//!
//! An unknown key is refused by name, with line, column and the keys that lead to it. Numbers are
//! written with the fewest digits that read back to the same bits; default values are left out.
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
mod lens;
mod medium;
mod message;
mod mismatch;
mod strict;
mod surface;

pub use layout::pretty;

use super::error::{FileError, ParseError};
use crate::lens::Lens;
use serde::de::DeserializeOwned;
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serializer};

/// The version of the format that is written.
pub const VERSION: u64 = 1;

/// Reads a lens from JSON text; `file` is its name in messages.
///
/// # Errors
/// Text that is not JSON, another version, an unknown or missing key, and a lens that does not pass
/// [`Lens::check`].
pub fn read(text: &str, file: &str) -> Result<Lens, FileError> {
    let version: VersionProbe = read_json(text, file)?;
    version.check(text).map_err(|error| error.in_file(file))?;
    let lens: Lens = read_json(text, file)?;
    lens.check().map_err(|source| FileError::Lens { file: file.to_owned(), source })?;
    Ok(lens)
}

/// Reads any other value from JSON text; `file` is its name in messages.
///
/// # Errors
/// Text that is not JSON or not such a value, with line, column and keys of the place.
pub fn read_json<T: DeserializeOwned>(text: &str, file: &str) -> Result<T, FileError> {
    message::parse(text).map_err(|error| error.in_file(file))
}

/// The JSON text of a lens.
pub fn write(lens: &Lens) -> String {
    pretty(lens)
}

/// The version alone, so that a newer file is refused because of its version and not of its keys.
#[derive(Deserialize)]
struct VersionProbe {
    #[serde(default)]
    aplanat: Option<serde_json::Value>,
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

/// Deserializes the number of an optional key. `null`, which some programs write for a number that
/// does not exist, is refused.
fn required_number<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    f64::deserialize(from).map(Some)
}

/// Serializes an object of numbers.
fn serialize_numbers<S: Serializer>(to: S, numbers: &[(&str, f64)]) -> Result<S::Ok, S::Error> {
    let mut map = to.serialize_map(Some(numbers.len()))?;
    numbers.iter().try_for_each(|(key, value)| map.serialize_entry(key, value))?;
    map.end()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{
        Aperture, Medium, Object, Parameter, Pickup, Quantity, Variable, ZoomNumber, ZoomPosition,
    };

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
        lens.surfaces[1].decenter = [0.1 + 0.2, -0.0];
        lens.surfaces[2].tilt = [0.0, -0.7];
        lens.surfaces[2].asphere = vec![0.1 + 0.2, -1.2345678901234567e-19];
        lens.image_solve = Some(0.0);
        let radius = ZoomNumber { surface: 1, quantity: Quantity::Curvature, value: -0.1 - 0.2 };
        let aperture = Some(Aperture::FNumber(2.0));
        lens.zoom = vec![ZoomPosition {
            name: "wide".into(),
            numbers: vec![ZoomNumber::thickness(0, 1e23), radius],
            aperture,
            fields: None,
        }];
        let free = |parameter: Parameter| Variable { parameter, min: Some(-1.0), max: None };
        lens.variables = vec![
            free(Parameter::at_zoom(0, Quantity::Thickness, 0)),
            free(Parameter::at_zoom(1, Quantity::Curvature, 0)),
        ];
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
        assert!(
            text.starts_with("a.json, line 9, column 50, surfaces[2].aspheric: found"),
            "{text}"
        );
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
    fn a_value_of_another_type_is_named_in_the_words_of_json() {
        let type_names =
            ["struct ", "f64", "usize", "sequence", "boolean", "variant", "VersionProbe"];
        for (from, to, expected) in [
            ("\"name\": \"Achromat\"", "\"name\": 5", "name: found 5; expected a string"),
            ("\"stop\": true", "\"stop\": 1", "found 1; expected true or false"),
            ("[1e-7]", "{}", "asphere: found an object; expected a list"),
            ("{\"y\": 5.0}", "[5.0]", "found a list; expected an object with its keys"),
            ("\"y\": 5.0", "\"x\": 1, \"x\": 2", "found the key `x` twice; expected it once"),
            ("{\"entrance_pupil_diameter\": 16.0}", "5", "expected a name, or an object with one"),
            ("\"thickness\": 5.5,", "5.5,", "expected JSON (key must be a string"),
        ] {
            let text = changed(from, to);
            assert!(text.contains(expected), "{text}");
            assert!(!type_names.iter().any(|name| text.contains(name)), "{text}");
        }
        for text in ["[]", "5", "null"] {
            assert!(
                message(text).contains("expected an object with its keys"),
                "{}",
                message(text)
            );
        }
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
        assert!(text.contains("surfaces 1 and 2 are both the stop"), "{text}");
        let text = changed("9.0", "-9.0");
        assert!(text.contains("semi-diameter of surface 1 is -9; expected zero or more"), "{text}");
        let text = changed("N-BAK4", "N-BAK99");
        assert!(text.contains("unknown glass `SCHOTT N-BAK99`"), "{text}");
    }
}
