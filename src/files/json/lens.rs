//! A lens as JSON: its keys, their defaults, and the object in front of it.

use super::medium::is_air;
use super::{VERSION, required_number, serialize_numbers};
use crate::lens::{
    Aperture, Environment, Fields, Goal, Lens, Medium, Object, Pickup, Row, StatedTolerances,
    ToleranceSheet, Variable, Wavelength, ZoomPosition,
};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error as _, MapAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

/// The keys of a lens file.
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
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "required_number"
    )]
    focus: Option<f64>,
    surfaces: Vec<Row>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    zoom: Vec<ZoomPosition>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    variables: Vec<Variable>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pickups: Vec<Pickup>,
    #[serde(default, skip_serializing_if = "Environment::is_default")]
    environment: Environment,
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "required_goal")]
    merit: Option<Goal>,
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "required_sheet")]
    tolerances: Option<SheetJson>,
}

/// Tolerances: as they are written, or as a file states them.
#[derive(Serialize)]
#[serde(untagged)]
enum SheetJson {
    Written(ToleranceSheet),
    #[serde(skip)]
    Stated(StatedTolerances),
}

/// Tolerances that are not null: a file without them has no key.
fn required_sheet<'de, D: Deserializer<'de>>(from: D) -> Result<Option<SheetJson>, D::Error> {
    StatedTolerances::deserialize(from).map(SheetJson::Stated).map(Some)
}

/// A merit function that is not null: a file without one has no key.
fn required_goal<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Goal>, D::Error> {
    Goal::deserialize(from).map(Some)
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
            environment: self.environment,
            merit: self.merit.clone(),
            tolerances: self.tolerances.clone().map(SheetJson::Written),
        }
        .serialize(to)
    }
}

impl<'de> Deserialize<'de> for Lens {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let keys = LensJson::deserialize(from)?;
        if keys.aplanat != VERSION {
            let found = Unexpected::Unsigned(keys.aplanat);
            return Err(D::Error::invalid_value(found, &format!("version {VERSION}").as_str()));
        }
        let tolerances = match keys.tolerances {
            None => None,
            Some(SheetJson::Written(sheet)) => Some(sheet),
            Some(SheetJson::Stated(stated)) => {
                Some(stated.resolved(&keys.surfaces).map_err(D::Error::custom)?)
            }
        };
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
            environment: keys.environment,
            merit: keys.merit,
            tolerances,
        })
    }
}

/// The keys of an object at a finite distance.
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
            Err(E::invalid_value(Unexpected::Str(text), &self))
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Object, A::Error> {
        let keys = ObjectJson::deserialize(MapAccessDeserializer::new(map))?;
        Ok(Object::Finite(keys.distance))
    }
}
