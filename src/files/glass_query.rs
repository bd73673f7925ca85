//! A search among glasses: words of maker and name, and ranges of numbers.

use super::library::parse_range;
use crate::lens::glass::Glass;
use std::ops::RangeInclusive;

/// Conditions on a glass, all of which must hold.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GlassQuery(Vec<GlassCondition>);

/// A condition on a glass.
#[derive(Debug, Clone, PartialEq)]
enum GlassCondition {
    /// The maker or the name contains these letters, which are capitals.
    Word(String),
    Index(RangeInclusive<f64>),
    Abbe(RangeInclusive<f64>),
}

/// The fault of a search among glasses.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum GlassQueryError {
    /// A range that is none.
    #[error("found the range `{0}`; expected `1.6..1.7`, `50..` or one number")]
    Range(String),
    /// A range of a number that glasses are not searched by.
    #[error("glasses are not searched by `{0}`; expected nd or vd")]
    Quantity(String),
}

impl GlassQuery {
    /// The search of some words: parts of maker and name, or ranges such as `nd=1.6..1.7` and `vd=50..`.
    ///
    /// # Errors
    /// A range that is none, or one of another number than nd and vd.
    pub fn new<'a>(words: impl IntoIterator<Item = &'a str>) -> Result<Self, GlassQueryError> {
        words.into_iter().map(GlassCondition::new).collect::<Result<_, _>>().map(Self)
    }

    /// True if a glass meets all conditions.
    pub fn is_met_by(&self, glass: &Glass) -> bool {
        self.0.iter().all(|condition| condition.is_met_by(glass))
    }
}

impl GlassCondition {
    fn new(word: &str) -> Result<Self, GlassQueryError> {
        let Some((name, text)) = word.split_once('=') else {
            return Ok(Self::Word(word.to_uppercase()));
        };
        let range = parse_range(text).ok_or_else(|| GlassQueryError::Range(text.to_owned()))?;
        match name.to_lowercase().as_str() {
            "nd" => Ok(Self::Index(range)),
            "vd" => Ok(Self::Abbe(range)),
            _ => Err(GlassQueryError::Quantity(name.to_owned())),
        }
    }

    fn is_met_by(&self, glass: &Glass) -> bool {
        match self {
            Self::Word(word) => glass.full_name().to_uppercase().contains(word),
            Self::Index(range) => range.contains(&glass.nd),
            Self::Abbe(range) => range.contains(&glass.vd),
        }
    }
}
