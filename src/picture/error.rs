//! The reasons for which there is no picture.

use crate::analysis::{AnalysisError, GhostError};
use crate::grin::GrinSetupError;
use crate::grin_design::GrinTaskError;
use crate::lens::{SurfaceNumber, SystemError};
use crate::pupil::RayModelError;

/// A picture that cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PictureError {
    /// The lens has no beam, or no index at a wavelength of the picture.
    #[error(transparent)]
    Model(#[from] RayModelError),
    /// The lens cannot be traced backwards.
    #[error(transparent)]
    System(#[from] SystemError),
    /// The directions from which light arrives at the image are not known.
    #[error("at {radius:.4} mm from the axis of the image: {source}")]
    Directions {
        /// The distance from the axis, in mm.
        radius: f64,
        /// The reason.
        source: AnalysisError,
    },
    /// The lens has surfaces whose reflections are not known.
    #[error(transparent)]
    Reflection(#[from] GhostError),
    /// No light arrives anywhere in the picture.
    #[error("no light arrives anywhere in the picture")]
    NoLight,
    /// The lens is not rotationally symmetric.
    #[error(
        "surface {0} is decentred, tilted, irregular or an ideal element; expected a centred lens of real \
         surfaces, since the directions of light are tabulated over the distance from the axis"
    )]
    NotCentred(SurfaceNumber),
    /// The lens has an aperture that a turn about the axis changes.
    #[error(
        "surface {0} has an aperture that is no circle about its vertex; expected a lens without one, since \
         the directions of light are tabulated over the distance from the axis"
    )]
    NotRound(SurfaceNumber),
    /// The lens forms no image on a plane behind it.
    #[error("the lens has no focal length; expected a lens that forms an image")]
    Afocal,
    /// The image of an object at the distance is not behind the lens.
    #[error(
        "an object {distance} mm in front of the lens has no real image; expected one beyond the front \
         focal point"
    )]
    NotImaged {
        /// The distance, in mm.
        distance: f64,
    },
    /// No way of the focus group focuses at the distance.
    #[error(
        "no way of the focus group within its gaps focuses at {distance} mm; expected another distance or group"
    )]
    NotFocused {
        /// The distance, in mm.
        distance: f64,
    },
    /// A size of the picture is no positive number, or there are too many pixels.
    #[error("{what} is {found}; expected {expected}")]
    Size {
        /// The name of the size.
        what: &'static str,
        /// The value.
        found: f64,
        /// The accepted values.
        expected: &'static str,
    },
}

/// Light that cannot be followed onto a screen.
#[derive(Debug, thiserror::Error)]
pub enum ProjectionError {
    /// A size of the beam or of the image is no number that light can be followed with.
    #[error("{what} is {found}; expected {expected}")]
    Size {
        /// The name of the size.
        what: &'static str,
        /// The value.
        found: f64,
        /// The accepted values.
        expected: &'static str,
    },
    /// No ray can be traced through the field.
    #[error(transparent)]
    Setup(#[from] GrinSetupError),
    /// The light of a task is not known.
    #[error(transparent)]
    Task(#[from] GrinTaskError),
}
