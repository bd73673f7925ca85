//! A medium as JSON: a name, an object of numbers, or a gradient index.

use super::serialize_numbers;
use crate::lens::{GradientIndex, Medium, ProfileLaw};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error as _, MapAccess, Unexpected, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

/// True for air, the default, which is not written.
pub(super) fn is_air(medium: &Medium) -> bool {
    *medium == Medium::Air
}

/// The keys of a medium that is given by numbers.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MediumJson {
    nd: Option<f64>,
    vd: Option<f64>,
    index: Option<f64>,
    gradient: Option<GradientIndexJson>,
}

/// The keys of a gradient-index medium.
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
            _ => Err(A::Error::invalid_value(
                Unexpected::Other("a glass with other keys"),
                &"{\"nd\", \"vd\"}, {\"index\"} or {\"gradient\"}",
            )),
        }
    }
}
