//! The reasons for which an edit is refused.

use crate::lens::{LensError, Parameter, SurfaceNumber};

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
}
