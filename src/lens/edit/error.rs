//! The reasons for which an edit is refused.

use crate::lens::{LensError, Parameter, SurfaceNumber};
use crate::math::format_short;

/// The reason for which an edit is refused; the lens stays as it was.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EditError {
    /// The edit would leave a lens that cannot be used.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// The lens has no such surface.
    #[error("there is no surface {surface}; expected 1 to {last}")]
    UnknownSurface {
        /// The surface that was named.
        surface: SurfaceNumber,
        /// The last surface of the lens.
        last: SurfaceNumber,
    },
    /// The lens has no such zoom position.
    #[error("there is no zoom position {at}; the lens has {count}")]
    UnknownZoomPosition {
        /// The position that was named.
        at: usize,
        /// The number of zoom positions.
        count: usize,
    },
    /// The lens has no such parameter.
    #[error("this lens has no {0}")]
    UnknownParameter(Parameter),
    /// The first parameter follows the second one by a pickup.
    #[error("the {0} follows the {1}; remove that pickup first")]
    PickedUp(Parameter, Parameter),
    /// The last thickness is solved.
    #[error("the last thickness is solved for the paraxial image; remove that solve first")]
    Solved,
    /// The surface to be removed is the stop.
    #[error("surface {0} is the stop; make another surface the stop first")]
    RemovedStop(SurfaceNumber),
    /// The surface to be removed is the only one.
    #[error("the only surface cannot be removed")]
    OnlySurface,
    /// The last surface of the group comes before the first one.
    #[error("surfaces {first} to {last}: expected the first one in front of the last one")]
    ReversedRange {
        /// The first surface of the group.
        first: SurfaceNumber,
        /// The last surface of the group.
        last: SurfaceNumber,
    },
    /// The group to be reversed has a mirror.
    #[error("surface {0} is a mirror; a group with a mirror cannot be reversed")]
    Mirror(SurfaceNumber),
    /// The group to be reversed has an index that varies along the axis, from its first vertex.
    #[error(
        "the index after surface {0} varies along the axis; a group with it cannot be reversed"
    )]
    AxialGrin(SurfaceNumber),
    /// The scale is no positive number.
    #[error("the scale is {0}; expected a number above 0")]
    InvalidScale(f64),
    /// The new element has no surfaces.
    #[error("the new element has no surfaces")]
    NoElement,
    /// The gap in which an element would be inserted is not air.
    #[error("the gap after surface {0} is not air; expected air, into which an element goes")]
    NotInAir(SurfaceNumber),
    /// The surface belongs to no element.
    #[error("surface {0} belongs to no element; expected a surface of glass")]
    NotAnElement(SurfaceNumber),
    /// The stop stands alone between the elements that are to be cemented.
    #[error(
        "surface {0}, the stop, stands between the elements; make a surface of one of them the stop \
         and remove this one first"
    )]
    StopBetween(SurfaceNumber),
    /// No element follows the one of the surface across a gap of air.
    #[error("no element follows that of surface {0}; expected one behind it to cement it to")]
    NothingToCement(SurfaceNumber),
    /// The surface is an outer one of a cemented group.
    #[error(
        "surface {0} is the outside of a cemented group; expected one of its cemented surfaces"
    )]
    NothingToSplit(SurfaceNumber),
    /// There is too little air to move an element.
    #[error("there are only {} mm of air after surface {surface}; expected {} mm",
        format_short(*room), format_short(*needed))]
    NoRoom {
        /// The surface in front of the gap.
        surface: SurfaceNumber,
        /// The air there, in mm.
        room: f64,
        /// The air that the move needs, in mm.
        needed: f64,
    },
}
