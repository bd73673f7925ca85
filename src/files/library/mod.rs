//! The library: published lenses, embedded in the program with an index that can be searched.
//!
//! The lenses are those of the folder `lenses/` and of `lenses/more/`; the index is
//! `assets/lens_index.json`. Nothing is read before the library is asked for something.

mod query;
mod scale;

pub use query::{LibraryQuery, LibraryQueryError, parse_range};
pub use scale::{LensScaleError, focal_length, focal_length_factor, scale_to_focal_length};

use super::{FileError, bundled_lenses, json};
use crate::lens::Lens;
use include_dir::{Dir, include_dir};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::OnceLock;

static MORE: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/lenses/more");

/// The name of the index in messages.
const INDEX: &str = "assets/lens_index.json";

/// A lens of the library, as its source describes it. A number that zooms has two values, those of
/// the ends of its range; any other has one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LibraryLens {
    /// The name by which it is found: that of its file, without `.json`.
    pub name: String,
    /// The title of the lens.
    pub title: String,
    /// The type of the design, such as `triplet`.
    #[serde(rename = "type")]
    pub design: String,
    /// The focal length, in mm.
    #[serde(rename = "focal_length_mm")]
    pub focal_length: Vec<f64>,
    /// The aperture.
    pub aperture: StatedAperture,
    /// The largest field.
    pub field: StatedField,
    /// The number of elements, each piece of a cemented group counted.
    pub elements: usize,
    /// The number of mirrors.
    pub mirrors: usize,
    /// The number of surfaces that are no spheres, conics counted.
    pub aspheres: usize,
    /// The publication, with the collection that the numbers were taken from in parentheses.
    pub source: String,
}

/// The aperture that the source of a lens states.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StatedAperture {
    /// The f-number.
    FNumber(Vec<f64>),
    /// The numerical aperture on the side of the object.
    ObjectNa(Vec<f64>),
}

/// The largest field that the source of a lens states.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StatedField {
    /// The angle with the axis, in degrees.
    HalfAngle(Vec<f64>),
    /// The height of the object, in mm.
    ObjectHeight(Vec<f64>),
    /// The height of the image, in mm.
    ImageHeight(Vec<f64>),
}

/// Every lens of the library, sorted by type.
pub fn library_lenses() -> &'static [LibraryLens] {
    static LENSES: OnceLock<Vec<LibraryLens>> = OnceLock::new();
    LENSES.get_or_init(|| {
        let index = include_str!("../../../assets/lens_index.json");
        // A test reads the index, which is part of the program.
        json::read_json(index, INDEX).unwrap_or_default()
    })
}

impl LibraryLens {
    /// The text of its lens file; `None` if the index names a file that does not exist.
    pub fn text(&self) -> Option<&'static str> {
        let bundled = bundled_lenses().iter().find(|bundled| bundled.name == self.name);
        bundled.map(|bundled| bundled.text).or_else(|| {
            MORE.get_file(format!("{}.json", self.name)).and_then(include_dir::File::contents_utf8)
        })
    }

    /// Reads the lens.
    ///
    /// # Errors
    /// A file that does not exist or is invalid, which tests exclude.
    pub fn open(&self) -> Result<Lens, FileError> {
        let file = format!("{}.json of the library", self.name);
        match self.text() {
            Some(text) => json::read(text, &file),
            None => Err(FileError::NotALens {
                file,
                found: "no such file".to_owned(),
                expected: "a lens",
            }),
        }
    }

    /// The number of elements and mirrors, as text.
    pub fn parts(&self) -> String {
        match self.mirrors {
            0 => self.elements.to_string(),
            1 => format!("{} + 1 mirror", self.elements),
            mirrors => format!("{} + {mirrors} mirrors", self.elements),
        }
    }
}

impl StatedAperture {
    /// The f-number; `None` if the source states another quantity.
    pub fn f_number(&self) -> Option<&[f64]> {
        match self {
            Self::FNumber(values) => Some(values),
            Self::ObjectNa(_) => None,
        }
    }
}

impl StatedField {
    /// The angle with the axis, in degrees; `None` if the source states a height.
    pub fn half_angle(&self) -> Option<&[f64]> {
        match self {
            Self::HalfAngle(values) => Some(values),
            Self::ObjectHeight(_) | Self::ImageHeight(_) => None,
        }
    }
}

impl fmt::Display for StatedAperture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FNumber(values) => write!(f, "f/{}", ShortRange(values)),
            Self::ObjectNa(values) => write!(f, "NA {}", ShortRange(values)),
        }
    }
}

impl fmt::Display for StatedField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::HalfAngle(values) => write!(f, "{} deg", ShortRange(values)),
            Self::ObjectHeight(values) => write!(f, "{} mm object", ShortRange(values)),
            Self::ImageHeight(values) => write!(f, "{} mm image", ShortRange(values)),
        }
    }
}

/// The values at the ends of a range, as text: `28-75`, or one value.
#[derive(Debug, Clone, Copy)]
pub struct ShortRange<'a>(pub &'a [f64]);

impl fmt::Display for ShortRange<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let texts: Vec<String> = self.0.iter().map(f64::to_string).collect();
        f.write_str(&texts.join("-"))
    }
}
