//! A surface as JSON, with the gap behind it.

use super::medium::is_air;
use super::required_number;
use crate::lens::{
    AxisBreak, ForeignAperture, Freeform, IdealElement, LockedSurface, Medium, Row, SurfaceAperture,
};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

/// The keys of a surface. `radius` is read in place of `curvature` and never written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RowJson {
    #[serde(default, skip_serializing, deserialize_with = "required_number")]
    radius: Option<f64>,
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "required_number"
    )]
    curvature: Option<f64>,
    #[serde(default, skip_serializing_if = "is_plain_zero")]
    conic: f64,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    asphere: Vec<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    freeform: Option<Freeform<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    ideal: Option<IdealElement>,
    thickness: f64,
    #[serde(default, skip_serializing_if = "is_air")]
    glass: Medium,
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "required_number"
    )]
    semi_diameter: Option<f64>,
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "required_number"
    )]
    obstruction: Option<f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    apertures: Vec<SurfaceAperture>,
    #[serde(default, skip_serializing_if = "is_false")]
    stop: bool,
    #[serde(default, skip_serializing_if = "is_false")]
    hyper: bool,
    #[serde(default, skip_serializing_if = "is_plain_zeros")]
    decenter: [f64; 2],
    #[serde(default, skip_serializing_if = "is_plain_zeros")]
    tilt: [f64; 2],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    break_before: Option<AxisBreak>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    break_after: Option<AxisBreak>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    locked: Option<LockedSurface>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    foreign_aperture: Option<ForeignAperture>,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    comment: String,
}

/// True for +0, the default. −0 is written, so that its sign is read back.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn is_plain_zero(value: &f64) -> bool {
    value.to_bits() == 0
}

/// True if both numbers are +0.
fn is_plain_zeros(values: &[f64; 2]) -> bool {
    values.iter().all(is_plain_zero)
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn is_false(value: &bool) -> bool {
    !*value
}

impl RowJson {
    /// The curvature, from either of the two keys.
    fn curvature<E: Error>(&self) -> Result<f64, E> {
        let refuse = |found, expected: &str| E::invalid_value(Unexpected::Other(found), &expected);
        match (self.curvature, self.radius) {
            (Some(_), Some(_)) => Err(refuse("both `curvature` and `radius`", "one of them")),
            (None, Some(0.0)) => {
                Err(refuse("a `radius` of 0", "another number, or none for a plane"))
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
            freeform: self.freeform.clone(),
            ideal: self.ideal,
            thickness: self.thickness,
            glass: self.medium.clone(),
            semi_diameter: self.semi_diameter,
            obstruction: self.obstruction,
            apertures: self.apertures.clone(),
            stop: self.stop,
            hyper: self.hyperhemisphere,
            decenter: self.decenter,
            tilt: self.tilt,
            break_before: self.break_before,
            break_after: self.break_after,
            locked: self.locked.clone(),
            foreign_aperture: self.foreign_aperture.clone(),
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
            curvature: keys.curvature()?,
            conic: keys.conic,
            asphere: keys.asphere,
            freeform: keys.freeform,
            ideal: keys.ideal,
            thickness: keys.thickness,
            medium: keys.glass,
            semi_diameter: keys.semi_diameter,
            obstruction: keys.obstruction,
            apertures: keys.apertures,
            stop: keys.stop,
            hyperhemisphere: keys.hyper,
            decenter: keys.decenter,
            tilt: keys.tilt,
            break_before: keys.break_before,
            break_after: keys.break_after,
            locked: keys.locked,
            foreign_aperture: keys.foreign_aperture,
            comment: keys.comment,
        })
    }
}
