//! The prescription: surfaces, glasses, stop, fields, wavelengths, zoom positions, variables.
//!
//! A [`Lens`] is the prescription as the designer writes it, with names and glasses; a [`System`] is
//! the same lens resolved at one wavelength and one zoom position, in plain numbers.
//!
//! Rows have indices from 0; texts number surfaces from 1, as a [`SurfaceNumber`] does. Thickness
//! and medium of a row belong to the gap behind its surface; the last thickness leads to the image
//! plane, which has no row. The curvature is stored, the radius is displayed.

mod absorption;
mod aperture_section;
mod aperture_text;
mod axis_break;
mod check;
mod compensator;
mod correlation;
mod diff;
mod edit;
mod element;
mod environment;
mod freeform;
mod geometry;
pub mod glass;
mod goal;
mod grin;
mod ideal;
mod operand;
mod parameter;
mod perturbation;
mod pose;
mod resolve;
mod rows;
mod section;
mod spectrum;
mod starting;
mod surface_aperture;
mod surface_number;
mod system;
mod thermal;
mod tolerance;
mod tolerance_units;
mod variables;
mod zoom;

pub use crate::grin::field::{
    AXIAL_TERMS, PROFILE_TERMS, ProfileCoefficients, ProfileLaw, RADIAL_TERMS, RotationalProfile,
};
pub use aperture_section::HeightInterval;
pub use aperture_text::{apertures_text, parse_apertures};
pub use axis_break::AxisBreak;
pub use check::LensError;
pub use compensator::{AdjustedPart, Compensator};
pub use correlation::{CorrelatedErrors, ErrorCorrelation};
pub use diff::added_glass;
pub use edit::{Edit, EditError, EditedCell, ElementEdit, apply_edit};
pub use element::{ElementForm, NewElement};
pub use environment::{Environment, ROOM_CELSIUS};
pub use freeform::{BASE_NUMBERS, BaseSag, FREEFORM_NUMBERS, Freeform, FreeformKind};
pub use goal::{Goal, LimitTreatment, PupilEdge, Term, WeightedTerm};
pub use grin::{GradientIndex, ParaxialGrin};
pub use ideal::{IdealAction, IdealElement};
pub use operand::{IndexRange, OperandKind, TermScope, TermSelection, last_index};
pub use parameter::{Parameter, Quantity};
pub use perturbation::{Perturbation, PerturbationKind, TableUnit};
pub use pose::{Pose, RigidMotion};
pub use resolve::paraxial_image_distance;
pub use section::LensSection;
pub use spectrum::WavelengthPreset;
pub use starting::{StartingForm, StartingLens};
pub(crate) use surface_aperture::turn;
pub use surface_aperture::{
    APERTURE_NUMBERS, ApertureShape, BlockedSide, MAX_APERTURES, MAX_ARMS, MAX_CORNERS,
    SurfaceAperture,
};
pub use surface_number::{MediumPlace, SurfaceNumber};
pub use system::{Shape, Surface, System, SystemError};
pub use thermal::TemperatureChange;
pub use tolerance::{ErrorDistribution, Tolerance, ToleranceGrade, ToleranceSheet};
pub use tolerance_units::{
    StatedTolerances, TEST_WAVELENGTH, conic_of_sag, curvature_of_fringes, fourth_of_sag,
    fringes_of_curvature, sag_of_conic, sag_of_fourth,
};
pub use variables::{ParameterKind, add_variable, add_variables, at_zoom};
pub use zoom::{ZoomNumber, ZoomPosition};

use serde::{Deserialize, Serialize};

/// The largest number of coefficients of an even asphere, r⁴ to r¹⁶.
pub const ASPHERE_TERMS: usize = 7;

/// A lens as the designer writes it.
#[derive(Debug, Clone, PartialEq)]
pub struct Lens {
    /// The name of the lens.
    pub name: String,
    /// The source of the data, such as a patent or a book.
    pub source: String,
    /// Further remarks.
    pub notes: String,
    /// The position of the object.
    pub object: Object,
    /// The medium in front of the first surface.
    pub object_medium: Medium,
    /// The system aperture, which sets the width of the beam.
    pub aperture: Aperture,
    /// The field points.
    pub fields: Fields,
    /// The wavelengths, one of them primary.
    pub wavelengths: Vec<Wavelength>,
    /// The surfaces in the order in which light meets them.
    pub surfaces: Vec<Row>,
    /// The zoom positions; empty for a lens with a fixed focal length.
    pub zoom: Vec<ZoomPosition>,
    /// The parameters that an optimizer may change, with their bounds.
    pub variables: Vec<Variable>,
    /// The parameters that follow other parameters.
    pub pickups: Vec<Pickup>,
    /// The displacement in mm of the image plane from the paraxial image, to which the last
    /// thickness is solved; `None` if the last thickness is as written.
    pub image_solve: Option<f64>,
    /// The temperature and the mount.
    pub environment: Environment,
    /// The merit function; `None` for the one that the program proposes.
    pub merit: Option<Goal>,
    /// The tolerances; `None` for a lens that has none yet.
    pub tolerances: Option<ToleranceSheet>,
}

/// The position of the object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Object {
    /// At infinity: every field is a collimated beam.
    Infinity,
    /// At this distance in front of the first vertex, in mm; positive for a real object.
    Finite(f64),
}

/// The system aperture: the quantity that limits the axial beam.
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
    /// The semi-diameter of the stop in mm; the beam consists of the real rays through it.
    StopSemiDiameter(f64),
}

/// The quantity that gives the coordinates of a field point.
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

/// True if all fields with a weight lie on one ray from the axis: in a lens that is symmetric about it they
/// stand for those opposite to them too.
pub fn lie_on_one_side(fields: &[FieldPoint]) -> bool {
    let lit = || fields.iter().filter(|field| field.weight > 0.0);
    let square = |field: &FieldPoint| field.x * field.x + field.y * field.y;
    let Some(outer) = lit().max_by(|a, b| square(a).total_cmp(&square(b))) else { return true };
    lit().all(|field| {
        let across = field.x * outer.y - field.y * outer.x;
        let along = field.x * outer.x + field.y * outer.y;
        across.abs() <= 1e-12 * square(outer) && along >= 0.0
    })
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
    /// The weight in merit functions.
    #[serde(default = "one")]
    pub weight: f64,
}

impl FieldPoint {
    /// The field of angles in degrees in the planes of x and y, as other programs state them: their
    /// tangents are the slopes of its direction. Angles of 90 degrees and more are taken as they are.
    pub fn from_projected_angles([x, y]: [f64; 2], weight: f64) -> Self {
        let is_skew = x != 0.0 && y != 0.0 && x.abs() < 90.0 && y.abs() < 90.0;
        if !is_skew {
            return Self { x, y, weight };
        }
        let [across, along] = [x, y].map(|angle| angle.to_radians().tan());
        let slope = across.hypot(along);
        let scale = slope.atan().to_degrees() / slope;
        Self { x: scale * across, y: scale * along, weight }
    }

    /// The angles in degrees in the planes of x and y of a field that is an angle.
    pub fn projected_angles(&self) -> [f64; 2] {
        let size = self.x.hypot(self.y);
        if self.x == 0.0 || self.y == 0.0 || size >= 90.0 {
            return [self.x, self.y];
        }
        let scale = size.to_radians().tan() / size;
        [self.x, self.y].map(|part| (scale * part).atan().to_degrees())
    }
}

/// The field points of a lens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fields {
    /// The quantity that the coordinates are.
    pub kind: FieldKind,
    /// The points in the order in which they are displayed.
    pub values: Vec<FieldPoint>,
}

impl Fields {
    /// The points in x and y as other programs state them: angles as
    /// [`FieldPoint::projected_angles`], heights as they are.
    pub fn projected_points(&self) -> Vec<[f64; 2]> {
        let point = |field: &FieldPoint| match self.kind {
            FieldKind::Angle => field.projected_angles(),
            FieldKind::ObjectHeight | FieldKind::ImageHeight => [field.x, field.y],
        };
        self.values.iter().map(point).collect()
    }

    /// True if these fields differ from others in their coordinates alone.
    pub fn are_like(&self, other: &Self) -> bool {
        let weights = |fields: &Self| fields.values.iter().map(|f| f.weight).collect::<Vec<_>>();
        self.kind == other.kind && weights(self) == weights(other)
    }

    /// Sets x (`axis` 0) or y (1) of a point as other programs state it; false if there is no such point.
    pub fn set_projected(&mut self, point: usize, axis: usize, value: f64) -> bool {
        let Some(field) = self.values.get_mut(point) else { return false };
        if self.kind != FieldKind::Angle {
            *[&mut field.x, &mut field.y][axis] = value;
            return true;
        }
        let mut angles = field.projected_angles();
        angles[axis] = value;
        *field = FieldPoint::from_projected_angles(angles, field.weight);
        true
    }
}

/// One wavelength.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wavelength {
    /// The wavelength, in micrometres.
    pub um: f64,
    /// The weight in polychromatic results.
    #[serde(default = "one")]
    pub weight: f64,
    /// True for the wavelength at which first-order data and pupils are computed.
    #[serde(default, skip_serializing_if = "is_false")]
    pub primary: bool,
}

/// One surface and the gap behind it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Row {
    /// The reciprocal of the radius of curvature, in 1/mm; 0 for a plane.
    pub curvature: f64,
    /// The conic constant: 0 a sphere, -1 a paraboloid.
    pub conic: f64,
    /// Coefficients of r⁴, r⁶, ... r¹⁶, in mm⁻³, mm⁻⁵, ...
    pub asphere: Vec<f64>,
    /// The form that the sag has beside; `None` for a conic with these coefficients alone.
    pub freeform: Option<Freeform<f64>>,
    /// The rule by which the surface deflects light beside refraction or reflection; `None` for none.
    pub ideal: Option<IdealElement>,
    /// The distance along the axis to the next vertex, or from the last one to the image plane, in
    /// mm.
    pub thickness: f64,
    /// The medium in the gap behind the surface.
    pub medium: Medium,
    /// The radius of the clear aperture in mm; rays that meet the surface farther from the axis are
    /// clipped. `None` clips nothing.
    pub semi_diameter: Option<f64>,
    /// The radius of the central obstruction, or of the hole of a mirror, in mm; rays that meet the
    /// surface nearer to the axis are clipped. `None` clips nothing.
    pub obstruction: Option<f64>,
    /// The apertures and obscurations that are no circles about the vertex.
    pub apertures: Vec<SurfaceAperture>,
    /// True for the aperture stop.
    pub stop: bool,
    /// True for a hyperhemisphere: the far half of the sphere or ellipsoid belongs to the surface
    /// too.
    pub hyperhemisphere: bool,
    /// The displacement of the vertex across the axis along x and y, in mm; surfaces behind stay.
    pub decenter: [f64; 2],
    /// The tilt about x, then about y, at the decentred vertex, in degrees; see [`Pose`].
    pub tilt: [f64; 2],
    /// The break of the axis at the vertex in front of the surface, before its own decentre and tilt;
    /// the surface and everything behind it stand on the new axis.
    pub break_before: Option<AxisBreak>,
    /// The break of the axis behind the surface: the thickness is measured along the new axis.
    pub break_after: Option<AxisBreak>,
    /// The lines of a foreign file on a surface that cannot be traced; `None` for a surface that can.
    pub locked: Option<LockedSurface>,
    /// The apertures of a foreign file that a row cannot have; `None` for a row that has none.
    pub foreign_aperture: Option<ForeignAperture>,
    /// A remark on the surface.
    pub comment: String,
}

/// The lines of a foreign file on apertures and obscurations that a row cannot have, and the circles that
/// stand for them. An export to the same format writes the lines back as long as the row has these circles.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForeignAperture {
    /// The extension of the format, such as `zmx`.
    pub format: String,
    /// The lines.
    pub lines: Vec<String>,
    /// The semi-diameter in mm that stands for them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub semi_diameter: Option<f64>,
    /// The obstruction in mm that stands for them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub obstruction: Option<f64>,
    /// The apertures of the row that are among them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub apertures: Vec<SurfaceAperture>,
}

/// The description of a surface that this program cannot trace, as the file has it. Rays meet the
/// conic of the row in its place.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LockedSurface {
    /// The surface type, as the file names it.
    pub kind: String,
    /// The lines of the file that describe it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lines: Vec<String>,
}

/// The medium that fills a gap, or the mirror at its beginning.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Medium {
    /// Air, with index 1.
    #[default]
    Air,
    /// A catalogue glass by manufacturer and name, such as `SCHOTT N-BK7`.
    Glass(String),
    /// A model glass: refractive index and Abbe number at the d line.
    Model {
        /// Index at 587.5618 nm.
        nd: f64,
        /// Abbe number.
        vd: f64,
    },
    /// A medium with the same index at every wavelength.
    Index(f64),
    /// A mirror; the gap behind it has the same medium as the gap in front.
    Mirror,
    /// A gradient-index (GRIN) medium.
    Grin(Box<GradientIndex>),
}

/// A parameter that an optimizer may change.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variable {
    /// The parameter.
    pub parameter: Parameter,
    /// The lower bound; `None` for unbounded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// The upper bound; `None` for unbounded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
}

/// A parameter that follows another one: `offset + scale × source`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pickup {
    /// The parameter that follows.
    pub parameter: Parameter,
    /// The parameter that it follows.
    pub source: Parameter,
    /// The factor of the source.
    #[serde(default = "one")]
    pub scale: f64,
    /// The constant that is added.
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

impl Row {
    /// Keeps the lines of a file on apertures; the present circles stand for them.
    pub fn keep_aperture(&mut self, format: &str, lines: Vec<String>) {
        let (semi_diameter, obstruction) = (self.semi_diameter, self.obstruction);
        let format = format.to_owned();
        let apertures = self.apertures.clone();
        let kept = ForeignAperture { format, lines, semi_diameter, obstruction, apertures };
        self.foreign_aperture = Some(kept);
    }

    /// The lines on apertures that an export to a format writes back; `None` without any, and once another
    /// circle stands in their place.
    pub fn kept_aperture(&self, format: &str) -> Option<&[String]> {
        let kept = self.foreign_aperture.as_ref().filter(|kept| kept.format == format)?;
        let same = (kept.semi_diameter, kept.obstruction) == (self.semi_diameter, self.obstruction);
        (same && kept.apertures == self.apertures).then_some(&kept.lines)
    }
}

impl Lens {
    /// The index of the row of the aperture stop; `None` if no row is marked.
    pub fn stop(&self) -> Option<usize> {
        self.surfaces.iter().position(|row| row.stop)
    }

    /// The index of the primary wavelength: the marked one, or else the middle one.
    pub fn primary(&self) -> usize {
        let marked = self.wavelengths.iter().position(|w| w.primary);
        marked.unwrap_or(self.wavelengths.len() / 2)
    }

    /// The number of zoom positions; 1 for a lens with a fixed focal length.
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

    /// The variable of a parameter; `None` if the parameter is not a variable.
    pub fn variable(&self, parameter: Parameter) -> Option<&Variable> {
        self.variables.iter().find(|v| v.parameter == parameter)
    }
}

/// A new lens: a plane-parallel plate of N-BK7 whose front is the stop, and one field on the axis.
pub fn blank() -> Lens {
    let row = |thickness: f64, medium: Medium, stop: bool| Row {
        thickness,
        medium,
        stop,
        semi_diameter: Some(10.0),
        ..Row::default()
    };
    Lens {
        name: "New lens".to_owned(),
        source: String::new(),
        notes: String::new(),
        object: Object::Infinity,
        object_medium: Medium::Air,
        aperture: Aperture::EntrancePupilDiameter(10.0),
        fields: Fields {
            kind: FieldKind::Angle,
            values: vec![FieldPoint { x: 0.0, y: 0.0, weight: 1.0 }],
        },
        wavelengths: vec![Wavelength { um: glass::line::D, weight: 1.0, primary: true }],
        surfaces: vec![
            row(5.0, Medium::Glass("SCHOTT N-BK7".to_owned()), true),
            row(50.0, Medium::Air, false),
        ],
        zoom: Vec::new(),
        variables: Vec::new(),
        pickups: Vec::new(),
        image_solve: None,
        environment: Environment::default(),
        merit: None,
        tolerances: None,
    }
}
