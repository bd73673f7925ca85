//! The description of a mutation as data; its text is made where it is displayed.

use crate::lens::{Parameter, Quantity, SurfaceNumber};
use crate::search::projection::Projection;
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt::{self, Display};

/// The step by which a search arrived at the start of a descent: a mutation, a random draw, or the
/// start of the search.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StructureChange {
    /// The start of the search.
    Start,
    /// The continuation of a descent of maximum length.
    Continuation,
    /// A random lens.
    RandomDraw,
    /// A lens that another run has found.
    Received,
    /// Added a singlet.
    AddSinglet {
        /// The glass of the singlet.
        glass: String,
        /// Its first surface in the new lens.
        first: SurfaceNumber,
    },
    /// Removed a singlet.
    RemoveSinglet {
        /// Its first surface in the old lens.
        first: SurfaceNumber,
    },
    /// Cemented two elements.
    Glue {
        /// The first of the two facing surfaces in the old lens.
        first: SurfaceNumber,
    },
    /// Split a cemented interface.
    Split {
        /// The interface in the old lens.
        surface: SurfaceNumber,
    },
    /// Removed an outer piece of a cemented group.
    DropLayer {
        /// The first surface of the group in the old lens.
        first: SurfaceNumber,
        /// True for the front piece, false for the rear piece.
        front: bool,
    },
    /// Bent an element.
    Bend {
        /// Its first surface.
        first: SurfaceNumber,
        /// Its last surface.
        last: SurfaceNumber,
        /// The change of its curvatures, in 1/mm.
        by: f64,
    },
    /// Reversed an element.
    Flip {
        /// Its first surface.
        first: SurfaceNumber,
        /// Its last surface.
        last: SurfaceNumber,
    },
    /// Exchanged a glass.
    ExchangeGlass {
        /// The surface in front of the glass.
        surface: SurfaceNumber,
        /// The old glass.
        from: String,
        /// The new glass.
        to: String,
    },
    /// Moved the stop.
    MoveStop {
        /// The surface in front of the new stop.
        surface: SurfaceNumber,
        /// The distance of the stop from that surface along the light, in mm.
        distance: f64,
    },
    /// Let a surface become aspheric.
    AddAsphere {
        /// The surface.
        surface: SurfaceNumber,
        /// The number that varies from now on: the conic constant, or a coefficient.
        quantity: Quantity,
    },
    /// Made an aspheric surface spherical.
    RemoveAsphere {
        /// The surface.
        surface: SurfaceNumber,
    },
    /// Displaced all variables by normal deviates.
    Displacement {
        /// The standard deviation, in units that deflect rays by similar amounts.
        size: f64,
    },
    /// A change of another landscape, or one that an earlier version recorded as text.
    Text(String),
}

impl Display for StructureChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Start => f.write_str("the start"),
            Self::Continuation => f.write_str("continuation"),
            Self::RandomDraw => f.write_str("drawn at random"),
            Self::Received => f.write_str("found by another run"),
            Self::AddSinglet { glass, first } => {
                write!(f, "added a singlet of {glass} as {}", SurfacePair(*first))
            }
            Self::RemoveSinglet { first } => {
                write!(f, "removed the singlet of {}", SurfacePair(*first))
            }
            Self::Glue { first } => write!(f, "cemented {}", SurfacePair(*first)),
            Self::Split { surface } => write!(f, "split the cemented surface {surface}"),
            Self::DropLayer { first, front } => {
                let end = if *front { "front" } else { "rear" };
                write!(f, "removed the {end} piece of the group at surface {first}")
            }
            Self::Bend { first, last, by } => {
                write!(f, "bent the element of surfaces {first} to {last} by {by:.5}/mm")
            }
            Self::Flip { first, last } => {
                write!(f, "reversed the element of surfaces {first} to {last}")
            }
            Self::ExchangeGlass { surface, from, to } => {
                write!(f, "exchanged {from} behind surface {surface} for {to}")
            }
            Self::MoveStop { surface, distance } => {
                write!(f, "moved the stop to {distance:.3} mm behind surface {surface}")
            }
            Self::AddAsphere { surface, quantity } => {
                let parameter = Parameter::new(surface.index(), *quantity);
                write!(f, "made the {parameter} variable")
            }
            Self::RemoveAsphere { surface } => write!(f, "made surface {surface} spherical"),
            Self::Displacement { size } => {
                write!(f, "displaced all variables by {size:.3} units")
            }
            Self::Text(text) => f.write_str(text),
        }
    }
}

/// A surface and the next one.
struct SurfacePair(SurfaceNumber);

impl Display for SurfacePair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "surfaces {} and {}", self.0, SurfaceNumber::new(self.0.index() + 1))
    }
}

/// A change with the projection that followed it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MutationRecord {
    /// The change.
    pub change: StructureChange,
    /// The projection to a paraxially equivalent lens, if there was one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub projection: Option<Projection>,
}

impl From<StructureChange> for MutationRecord {
    fn from(change: StructureChange) -> Self {
        Self { change, projection: None }
    }
}

impl Display for MutationRecord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.change)?;
        match self.projection {
            Some(projection) => write!(f, "; {projection}"),
            None => Ok(()),
        }
    }
}

/// Reads a record, or the text that an earlier version wrote in its place.
pub(in crate::search) fn read_record<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<MutationRecord, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum TextOrRecord {
        Text(String),
        Record(MutationRecord),
    }
    Ok(match TextOrRecord::deserialize(deserializer)? {
        TextOrRecord::Text(text) => StructureChange::Text(text).into(),
        TextOrRecord::Record(record) => record,
    })
}
