//! Queries of the library: words that the descriptions of lenses contain, and ranges that their
//! numbers lie in.

use super::{LibraryLens, library_lenses};
use std::ops::RangeInclusive;
use std::str::FromStr;

/// The numbers by which lenses are found, each with the name that a query gives it.
const QUANTITIES: [(&str, Quantity); 6] = [
    ("mm", Quantity::FocalLength),
    ("f", Quantity::FNumber),
    ("field", Quantity::HalfAngle),
    ("elements", Quantity::Elements),
    ("mirrors", Quantity::Mirrors),
    ("aspheres", Quantity::Aspheres),
];

/// A number of a lens that a range of a query is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Quantity {
    /// The focal length, in mm.
    FocalLength,
    FNumber,
    /// The largest angle of the field, in degrees.
    HalfAngle,
    Elements,
    Mirrors,
    Aspheres,
}

/// A condition on a lens.
#[derive(Debug, Clone, PartialEq)]
enum Condition {
    /// The description contains these characters, which are in lower case.
    Word(String),
    /// A number lies in a range; one of a zoom lens does so somewhere.
    Range(Quantity, RangeInclusive<f64>),
}

/// Conditions on the lenses of the library, all of which must hold.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LibraryQuery {
    conditions: Vec<Condition>,
}

/// A part of a query that cannot be meant.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LibraryQueryError {
    /// No number of a lens has this name.
    #[error("found the number `{0}`; expected mm, f, field, elements, mirrors or aspheres")]
    Quantity(String),
    /// The range is malformed.
    #[error("found the range `{0}`; expected `28..50`, `..2`, `90..` or one number")]
    Range(String),
}

impl LibraryQuery {
    /// The query of words and of ranges such as `mm=28..50`.
    ///
    /// # Errors
    /// A number or range that does not exist.
    pub fn new<'a>(words: impl IntoIterator<Item = &'a str>) -> Result<Self, LibraryQueryError> {
        let conditions = words.into_iter().map(str::parse).collect::<Result<_, _>>()?;
        Ok(Self { conditions })
    }

    /// The lenses that satisfy every condition, in the order of the library. A query that is the
    /// whole name of a lens finds that lens alone.
    pub fn find(&self) -> Vec<&'static LibraryLens> {
        let lenses = library_lenses();
        if let [Condition::Word(name)] = &self.conditions[..]
            && let Some(lens) = lenses.iter().find(|lens| lens.name == *name)
        {
            return vec![lens];
        }
        lenses.iter().filter(|lens| self.is_met_by(lens)).collect()
    }

    /// True if a lens satisfies every condition.
    pub fn is_met_by(&self, lens: &LibraryLens) -> bool {
        self.conditions.iter().all(|condition| condition.is_met_by(lens))
    }
}

impl Condition {
    fn is_met_by(&self, lens: &LibraryLens) -> bool {
        match self {
            Self::Word(word) => described(lens).contains(word),
            Self::Range(quantity, range) => match quantity.bounds(lens) {
                Some([low, high]) => low <= *range.end() && high >= *range.start(),
                None => false,
            },
        }
    }
}

/// Everything that describes a lens, in lower case.
fn described(lens: &LibraryLens) -> String {
    let LibraryLens { name, title, design, aperture, field, source, .. } = lens;
    format!("{name}\n{title}\n{design}\n{aperture}\n{field}\n{source}").to_lowercase()
}

impl FromStr for Condition {
    type Err = LibraryQueryError;

    fn from_str(text: &str) -> Result<Self, LibraryQueryError> {
        let Some((name, range)) = text.split_once('=') else {
            return Ok(Self::Word(text.to_lowercase()));
        };
        let quantity = QUANTITIES.iter().find(|(known, _)| *known == name);
        let (_, quantity) = quantity.ok_or_else(|| LibraryQueryError::Quantity(name.to_owned()))?;
        let range = parse_range(range).ok_or_else(|| LibraryQueryError::Range(range.to_owned()))?;
        Ok(Self::Range(*quantity, range))
    }
}

/// A range such as `28..50` whose ends may be left out, or one number; `None` for anything else.
pub fn parse_range(text: &str) -> Option<RangeInclusive<f64>> {
    let end = |text: &str, absent: f64| match text {
        "" => Some(absent),
        text => text.parse::<f64>().ok(),
    };
    let (low, high) = match text.split_once("..") {
        Some((low, high)) => (end(low, f64::NEG_INFINITY)?, end(high, f64::INFINITY)?),
        None => (text.parse().ok()?, text.parse().ok()?),
    };
    (low <= high).then_some(low..=high)
}

impl Quantity {
    /// The least and the greatest value of a lens; `None` if its source states none.
    fn bounds(self, lens: &LibraryLens) -> Option<[f64; 2]> {
        let one = |count: usize| Some([count as f64; 2]);
        match self {
            Self::FocalLength => bounds(&lens.focal_length),
            Self::FNumber => bounds(lens.aperture.f_number()?),
            Self::HalfAngle => bounds(lens.field.half_angle()?),
            Self::Elements => one(lens.elements),
            Self::Mirrors => one(lens.mirrors),
            Self::Aspheres => one(lens.aspheres),
        }
    }
}

fn bounds(values: &[f64]) -> Option<[f64; 2]> {
    let first = *values.first()?;
    Some([
        values.iter().copied().fold(first, f64::min),
        values.iter().copied().fold(first, f64::max),
    ])
}
