//! A search among glasses: words of maker and name, ranges of numbers, status, and marks for glass without
//! lead.

use super::library::parse_range;
use crate::lens::glass::{Glass, GlassStatus};
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
    /// The price relative to that of N-BK7, of its class where none is stated.
    Price(RangeInclusive<f64>),
    /// The density in g/cm³.
    Density(RangeInclusive<f64>),
    Status(GlassStatus),
    /// The maker marks it as free of lead.
    LeadFree,
}

/// The fault of a search among glasses.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum GlassQueryError {
    /// A range that is none.
    #[error("found the range `{0}`; expected `1.6..1.7`, `50..` or one number")]
    Range(String),
    /// A range of a number that glasses are not searched by.
    #[error("glasses are not searched by `{0}`; expected nd, vd, price, density, status or lead")]
    Quantity(String),
    /// A status that no glass can have.
    #[error("found the status `{0}`; expected standard, preferred, special, melt or obsolete")]
    Status(String),
    /// Another word than `no` about lead: no catalogue says that a glass has any.
    #[error("found `lead={0}`; expected lead=no, the glasses that their makers mark as free of it")]
    Lead(String),
}

impl GlassQuery {
    /// The search of some words: parts of maker and name, ranges such as `nd=1.6..1.7`, `vd=50..`,
    /// `price=..3` and `density=..4`, `status=preferred` and `lead=no`. A glass whose catalogue does not have
    /// what a word asks for does not match.
    ///
    /// # Errors
    /// A range that is none, one of another number, an unknown status, or another word than `no` about lead.
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
        let range = || parse_range(text).ok_or_else(|| GlassQueryError::Range(text.to_owned()));
        Ok(match name.to_lowercase().as_str() {
            "nd" => Self::Index(range()?),
            "vd" => Self::Abbe(range()?),
            "price" => Self::Price(range()?),
            "density" => Self::Density(range()?),
            "status" => Self::Status(parse_status(text)?),
            "lead" if text.eq_ignore_ascii_case("no") => Self::LeadFree,
            "lead" => return Err(GlassQueryError::Lead(text.to_owned())),
            _ => return Err(GlassQueryError::Quantity(name.to_owned())),
        })
    }

    fn is_met_by(&self, glass: &Glass) -> bool {
        match self {
            Self::Word(word) => glass.full_name().to_uppercase().contains(word),
            Self::Index(range) => range.contains(&glass.nd),
            Self::Abbe(range) => range.contains(&glass.vd),
            Self::Density(range) => glass.density.is_some_and(|density| range.contains(&density)),
            Self::Price(range) => range.contains(&glass.price().relative),
            Self::Status(status) => {
                glass.properties().and_then(|known| known.status) == Some(*status)
            }
            Self::LeadFree => glass.is_marked_lead_free(),
        }
    }
}

fn parse_status(text: &str) -> Result<GlassStatus, GlassQueryError> {
    let named = |status: &GlassStatus| status.name().eq_ignore_ascii_case(text);
    let found = GlassStatus::ALL.into_iter().find(named);
    found.ok_or_else(|| GlassQueryError::Status(text.to_owned()))
}
