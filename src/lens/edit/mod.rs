//! Edits of a lens: every change that a designer can make, and the lens that follows from it.
//!
//! An [`Edit`] either gives another lens that [`Lens::check`] accepts, or an [`EditError`]; the lens
//! that it was applied to stays as it was. [`apply_edit`] is the only code that carries edits out: a
//! table cell that tests an entry and the session that changes the design both call it.

mod apply;
mod element;
mod error;
mod rows;
mod scale;

pub use apply::apply_edit;
pub use element::ElementEdit;
pub use error::EditError;

use super::{
    Aperture, Fields, Goal, Lens, Medium, Object, Parameter, Pickup, Quantity, Row,
    SurfaceAperture, SurfaceNumber, ToleranceSheet, Variable, Wavelength, ZoomPosition,
};
use serde::{Deserialize, Serialize};

/// A change of a lens. Surfaces and zoom positions are indices from 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Edit {
    /// Sets a parameter.
    Set {
        /// The parameter.
        parameter: Parameter,
        /// The new value, in the unit of the parameter.
        value: f64,
    },
    /// Sets the clear semi-diameter of a surface; without one the surface clips no ray.
    SetSemiDiameter {
        /// The surface.
        surface: usize,
        /// The semi-diameter, in mm.
        value: Option<f64>,
    },
    /// Replaces all asphere coefficients of a surface.
    SetAsphere {
        /// The surface.
        surface: usize,
        /// The coefficients of r⁴, r⁶ and so on.
        terms: Vec<f64>,
    },
    /// Sets the medium after a surface, or makes the surface a mirror.
    SetMedium {
        /// The surface.
        surface: usize,
        /// The medium.
        medium: Medium,
    },
    /// Sets the medium in front of the first surface.
    SetObjectMedium(Medium),
    /// Makes a surface the aperture stop.
    SetStop(usize),
    /// Sets whether rays may meet the far half of a spherical surface.
    SetHyperhemisphere {
        /// The surface.
        surface: usize,
        /// True if they may.
        hyper: bool,
    },
    /// Sets the comment on a surface.
    SetComment {
        /// The surface.
        surface: usize,
        /// The comment.
        text: String,
    },
    /// Replaces a surface and the gap after it.
    SetRow {
        /// The surface.
        surface: usize,
        /// The new row.
        row: Row,
    },
    /// Inserts a surface and the gap after it.
    InsertRow {
        /// The index of the new surface; the number of surfaces appends it.
        at: usize,
        /// The new row.
        row: Row,
    },
    /// Removes a surface and the gap after it.
    RemoveRow(usize),
    /// Reverses a group of surfaces, so that its last surface comes first.
    ReverseRows {
        /// The first surface of the group.
        first: usize,
        /// The last surface of the group.
        last: usize,
    },
    /// Changes a whole element.
    Element(ElementEdit),
    /// Multiplies every length by a factor.
    Scale(f64),
    /// Sets the name of the lens.
    SetName(String),
    /// Sets the source of the prescription.
    SetSource(String),
    /// Sets the notes on the lens.
    SetNotes(String),
    /// Sets the position of the object.
    SetObject(Object),
    /// Sets the aperture of the beam.
    SetAperture(Aperture),
    /// Sets the field points.
    SetFields(Fields),
    /// Sets the wavelengths.
    SetWavelengths(Vec<Wavelength>),
    /// Solves the last thickness for the paraxial image, displaced by this many millimetres. `None`
    /// removes the solve and leaves the image plane in place.
    SetImageSolve(Option<f64>),
    /// Adds a parameter to the variables, or replaces its bounds.
    AddVariable(Variable),
    /// Removes a parameter from the variables.
    RemoveVariable(Parameter),
    /// Replaces all variables.
    SetVariables(Vec<Variable>),
    /// Replaces the tolerances; `None` removes them.
    SetTolerances(Option<ToleranceSheet>),
    /// Makes a parameter follow another one.
    SetPickup(Pickup),
    /// Removes the pickup of a parameter, which keeps its value.
    RemovePickup(Parameter),
    /// Inserts a zoom position.
    InsertZoom {
        /// The index of the new position; the number of positions appends it.
        at: usize,
        /// The new position.
        position: ZoomPosition,
    },
    /// Removes a zoom position.
    RemoveZoom(usize),
    /// Replaces a zoom position.
    SetZoom {
        /// The index of the position.
        at: usize,
        /// The new position.
        position: ZoomPosition,
    },
    /// Sets the merit function; `None` for the one that the program proposes.
    SetMerit(Option<Goal>),
    /// Replaces the whole lens.
    Replace(Box<Lens>),
    /// Several edits one after the other; only the lens after the last one must be valid.
    Sequence {
        /// The title in a menu.
        title: String,
        /// The edits, in order.
        edits: Vec<Self>,
    },
    /// Sets the radius of the central obstruction of a surface; without one it blocks no ray.
    SetObstruction {
        /// The surface.
        surface: usize,
        /// The radius, in mm.
        value: Option<f64>,
    },
    /// Sets the apertures of a surface that are no circles about its vertex.
    SetApertures {
        /// The surface.
        surface: usize,
        /// All of them.
        apertures: Vec<SurfaceAperture>,
    },
}

/// The cell of a table to which an edit writes; consecutive edits of one cell are one undo step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EditedCell {
    /// The value of a parameter.
    Number(Parameter),
    /// The comment on a surface.
    Comment(usize),
    /// The name of the lens.
    Name,
    /// The source of the prescription.
    Source,
    /// The notes on the lens.
    Notes,
}

impl Edit {
    /// Sets the radius of a surface, in mm; 0 and infinity give a plane.
    pub fn set_radius(surface: usize, radius: f64) -> Self {
        Self::set_curvature(Parameter::new(surface, Quantity::Curvature), radius)
    }

    /// Sets a curvature, at all zoom positions or at one of them, to that of a radius in mm; 0 and
    /// infinity give a plane.
    pub fn set_curvature(parameter: Parameter, radius: f64) -> Self {
        let value = if radius == 0.0 { 0.0 } else { 1.0 / radius };
        Self::Set { parameter, value }
    }

    /// The cell to which the edit writes, if it writes to a single one.
    pub fn cell(&self) -> Option<EditedCell> {
        match self {
            Self::Set { parameter, .. } => Some(EditedCell::Number(*parameter)),
            Self::SetComment { surface, .. } => Some(EditedCell::Comment(*surface)),
            Self::SetName(_) => Some(EditedCell::Name),
            Self::SetSource(_) => Some(EditedCell::Source),
            Self::SetNotes(_) => Some(EditedCell::Notes),
            _ => None,
        }
    }

    /// The title of the edit in a menu, as in `Undo insert surface`.
    pub fn title(&self) -> String {
        let number = |surface: &usize| SurfaceNumber::new(*surface);
        match self {
            Self::Set { parameter, .. } => parameter.shown_name(),
            Self::SetSemiDiameter { surface, .. } => {
                format!("semi-diameter of surface {}", number(surface))
            }
            Self::SetAsphere { surface, .. } => format!("asphere of surface {}", number(surface)),
            Self::SetMedium { surface, .. } => format!("glass after surface {}", number(surface)),
            Self::SetObjectMedium(_) => "object medium".to_owned(),
            Self::SetStop(surface) => format!("stop to surface {}", number(surface)),
            Self::SetHyperhemisphere { surface, .. } => {
                format!("hyperhemisphere of surface {}", number(surface))
            }
            Self::SetComment { surface, .. } => format!("comment on surface {}", number(surface)),
            Self::SetRow { surface, .. } => format!("surface {}", number(surface)),
            Self::InsertRow { at, .. } => format!("insert surface {}", number(at)),
            Self::RemoveRow(surface) => format!("remove surface {}", number(surface)),
            Self::ReverseRows { first, last } => {
                format!("reverse surfaces {} to {}", number(first), number(last))
            }
            Self::Element(edit) => edit.title(),
            Self::Scale(factor) => format!("scale by {factor}"),
            Self::SetName(_) => "name".to_owned(),
            Self::SetSource(_) => "source".to_owned(),
            Self::SetNotes(_) => "notes".to_owned(),
            Self::SetObject(_) => "object".to_owned(),
            Self::SetAperture(_) => "aperture".to_owned(),
            Self::SetFields(_) => "fields".to_owned(),
            Self::SetWavelengths(_) => "wavelengths".to_owned(),
            Self::SetImageSolve(_) => "image solve".to_owned(),
            Self::AddVariable(variable) => {
                format!("vary the {}", variable.parameter.shown_name())
            }
            Self::RemoveVariable(parameter) => format!("fix the {}", parameter.shown_name()),
            Self::SetVariables(_) => "variables".to_owned(),
            Self::SetTolerances(_) => "tolerances".to_owned(),
            Self::SetPickup(pickup) => format!("pickup of the {}", pickup.parameter.shown_name()),
            Self::RemovePickup(parameter) => {
                format!("remove the pickup of the {}", parameter.shown_name())
            }
            Self::InsertZoom { at, .. } => format!("insert zoom position {}", at + 1),
            Self::RemoveZoom(at) => format!("remove zoom position {}", at + 1),
            Self::SetZoom { at, .. } => format!("zoom position {}", at + 1),
            Self::SetMerit(_) => "merit function".to_owned(),
            Self::Replace(_) => "replace the lens".to_owned(),
            Self::Sequence { title, .. } => title.clone(),
            Self::SetObstruction { surface, .. } => {
                format!("obstruction of surface {}", number(surface))
            }
            Self::SetApertures { surface, .. } => {
                format!("apertures of surface {}", number(surface))
            }
        }
    }
}
