//! The prescription: surfaces, glasses, stop, fields, wavelengths, zoom positions, variables.
//!
//! A [`Lens`] is what a person wrote, names and all; a [`System`] is the same lens at one
//! wavelength and one zoom position: plain numbers, nothing to look up.
//!
//! Rows are counted from 0. Thickness and medium of a row belong to the gap behind it; the last
//! thickness leads to the image plane, which has no row. Curvature is stored, radius is shown.

mod blank;
mod check;
mod diff;
mod edit;
mod geometry;
pub mod glass;
mod gradient;
mod parameter;
mod resolve;
mod reversed;
mod rows;
mod surface_number;
mod system;
mod vary;

pub use blank::blank;
pub use check::LensError;
pub use diff::added_glass;
pub use edit::{Edit, EditError, EditedCell, apply_edit};
pub use gradient::{GradientIndex, ParaxialGrin};
pub use parameter::{Parameter, Quantity};
pub use resolve::paraxial_image_distance;
pub use surface_number::SurfaceNumber;
pub use system::{Shape, Surface, System, SystemError};
pub use vary::{ParameterKind, add_variable, add_variables, at_zoom};

pub use crate::grin::field::{
    AXIAL_TERMS, PROFILE_TERMS, ProfileCoefficients, ProfileLaw, RADIAL_TERMS, RotationalProfile,
};

use serde::{Deserialize, Serialize};

/// How many coefficients an even asphere may have: r⁴ to r¹⁶.
pub const ASPHERE_TERMS: usize = 7;

/// A lens as a designer writes it.
#[derive(Debug, Clone, PartialEq)]
pub struct Lens {
    /// What it is called.
    pub name: String,
    /// Where the numbers come from.
    pub source: String,
    /// Anything else worth knowing.
    pub notes: String,
    /// Where the light comes from.
    pub object: Object,
    /// The medium in front of the first surface.
    pub object_medium: Medium,
    /// How wide the beam is.
    pub aperture: Aperture,
    /// The field points.
    pub fields: Fields,
    /// The wavelengths, one of them primary.
    pub wavelengths: Vec<Wavelength>,
    /// The surfaces in the order in which light meets them.
    pub surfaces: Vec<Row>,
    /// The zoom positions; empty for a lens that has only one.
    pub zoom: Vec<ZoomPosition>,
    /// The numbers that an optimizer may change, with their bounds.
    pub variables: Vec<Variable>,
    /// The numbers that follow others.
    pub pickups: Vec<Pickup>,
    /// Whether the last thickness is solved so that the image plane lies at the paraxial focus,
    /// displaced by this many millimetres.
    pub image_solve: Option<f64>,
}

/// Where the object is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Object {
    /// At infinity: every field is a collimated beam.
    Infinity,
    /// At this distance in front of the first vertex, in mm; positive for a real object.
    Finite(f64),
}

/// What limits the beam on the axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Aperture {
    /// The diameter of the paraxial entrance pupil, in mm.
    EntrancePupilDiameter(f64),
    /// The paraxial image-space f-number: focal length over entrance pupil diameter for an object
    /// at infinity, the paraxial working f-number for a finite one.
    FNumber(f64),
    /// The numerical aperture in object space (finite objects only).
    ObjectNa(f64),
    /// The semi-diameter of the stop, in mm; the real rays through it are the beam.
    StopSemiDiameter(f64),
}

/// What a field point is measured in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FieldKind {
    /// The angle of the chief ray with the axis in object space, in degrees.
    Angle,
    /// The height of the object point, in mm (finite objects only).
    ObjectHeight,
    /// The paraxial height of the image point, in mm.
    ImageHeight,
}

/// One field point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FieldPoint {
    /// Sagittal coordinate, in the unit of the [`FieldKind`].
    #[serde(default, skip_serializing_if = "is_zero")]
    pub x: f64,
    /// Tangential coordinate, in the unit of the [`FieldKind`].
    pub y: f64,
    /// Its share in merit functions.
    #[serde(default = "one")]
    pub weight: f64,
}

/// The field points of a lens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fields {
    /// What the values are measured in.
    pub kind: FieldKind,
    /// The points, in the order in which they are shown.
    pub values: Vec<FieldPoint>,
}

/// One wavelength.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wavelength {
    /// In micrometres.
    pub um: f64,
    /// Its share in polychromatic results.
    #[serde(default = "one")]
    pub weight: f64,
    /// Whether first-order data and pupils are computed at this one.
    #[serde(default, skip_serializing_if = "is_false")]
    pub primary: bool,
}

/// One surface and the gap behind it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Row {
    /// One over the radius, in 1/mm; 0 for a plane.
    pub curvature: f64,
    /// The conic constant: 0 a sphere, -1 a paraboloid.
    pub conic: f64,
    /// Coefficients of r⁴, r⁶, ... r¹⁶, in mm⁻³, mm⁻⁵, ...
    pub asphere: Vec<f64>,
    /// The distance along the axis to the next vertex, or from the last one to the image, in mm.
    pub thickness: f64,
    /// What fills the gap behind the surface.
    pub medium: Medium,
    /// Rays that meet the surface farther from the axis are clipped, in mm; `None` clips nothing.
    pub semi_diameter: Option<f64>,
    /// Rays that meet the surface nearer to the axis are clipped, in mm: a central obstruction, or
    /// the hole of a mirror; `None` clips nothing.
    pub obstruction: Option<f64>,
    /// Whether this is the aperture stop.
    pub stop: bool,
    /// Whether the far half of the sphere or ellipsoid counts too (a hyper-hemisphere).
    pub hyperhemisphere: bool,
    /// A remark on the surface.
    pub comment: String,
}

/// What fills a gap, or what stands at its beginning.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Medium {
    /// Air, with index 1.
    #[default]
    Air,
    /// A glass of the catalogue, by maker and name: `SCHOTT N-BK7`.
    Glass(String),
    /// A glass known by its index and Abbe number at the d line.
    Model {
        /// Index at 587.5618 nm.
        nd: f64,
        /// Abbe number.
        vd: f64,
    },
    /// The same index at every wavelength.
    Index(f64),
    /// The surface is a mirror; the gap is filled with what was before it.
    Mirror,
    /// An index that varies from place to place.
    Grin(Box<GradientIndex>),
}

/// One position of a zoom lens: what differs from the prescription.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub struct ZoomPosition {
    /// What the position is called.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// The thicknesses that move.
    pub thicknesses: Vec<ZoomThickness>,
    /// The aperture at this position, if it differs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aperture: Option<Aperture>,
    /// The field points at this position, if they differ.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fields: Option<Fields>,
}

/// A thickness at one zoom position.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ZoomThickness {
    /// The row in front of the gap.
    pub surface: usize,
    /// The gap, in mm.
    pub thickness: f64,
}

/// A number that an optimizer may change.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variable {
    /// Which number.
    pub parameter: Parameter,
    /// It may not become smaller than this.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// It may not become larger than this.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
}

/// A number that follows another: `offset + scale × source`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pickup {
    /// The number that follows.
    pub parameter: Parameter,
    /// The number that it follows.
    pub source: Parameter,
    /// By what the source is multiplied.
    #[serde(default = "one")]
    pub scale: f64,
    /// What is added.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub offset: f64,
}

fn one() -> f64 {
    1.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn is_false(value: &bool) -> bool {
    !*value
}

impl Lens {
    /// The row of the aperture stop; `None` where no row is marked.
    pub fn stop(&self) -> Option<usize> {
        self.surfaces.iter().position(|row| row.stop)
    }

    /// The index of the primary wavelength: the marked one, or the middle one.
    pub fn primary(&self) -> usize {
        let marked = self.wavelengths.iter().position(|w| w.primary);
        marked.unwrap_or(self.wavelengths.len() / 2)
    }

    /// How many zoom positions there are; one for a lens that does not zoom.
    pub fn zoom_positions(&self) -> usize {
        self.zoom.len().max(1)
    }

    /// The aperture at a zoom position.
    pub fn aperture_at(&self, zoom: usize) -> Aperture {
        self.zoom.get(zoom).and_then(|z| z.aperture).unwrap_or(self.aperture)
    }

    /// The field points at a zoom position.
    pub fn fields_at(&self, zoom: usize) -> &Fields {
        self.zoom.get(zoom).and_then(|z| z.fields.as_ref()).unwrap_or(&self.fields)
    }

    /// The variable that frees `parameter`, if it is one.
    pub fn variable(&self, parameter: Parameter) -> Option<&Variable> {
        self.variables.iter().find(|v| v.parameter == parameter)
    }
}
