//! The errors that make a tolerance analysis impossible.

use crate::lens::{LensError, Perturbation, SurfaceNumber, SystemError};
use crate::trace::Fate;

/// Refuses means over lenses of which most are lost.
///
/// # Errors
/// More than half of the lenses.
pub fn refuse_lost_lenses(
    lost: usize,
    samples: usize,
    what: &'static str,
) -> Result<(), ToleranceError> {
    if 2 * lost <= samples { Ok(()) } else { Err(ToleranceError::MostLost { lost, samples, what }) }
}

/// Tells whether work is to stop; asked between its parts, from any thread.
pub type StopTest<'a> = &'a (dyn Fn() -> bool + Sync);

/// Ends work that is to stop.
///
/// # Errors
/// [`ToleranceError::Stopped`] if it is.
pub(super) fn refuse_if_stopped(stop: StopTest<'_>) -> Result<(), ToleranceError> {
    if stop() { Err(ToleranceError::Stopped) } else { Ok(()) }
}

/// A fault that makes a tolerance analysis impossible.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ToleranceError {
    /// The lens cannot be resolved.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// The perturbed lens cannot be traced.
    #[error(transparent)]
    System(#[from] SystemError),
    /// An error of making names surfaces that the lens does not have, or not in order.
    #[error(
        "the error `{}` names surfaces {} to {}; expected surfaces from 1 to {surfaces}",
        .what.kind.name(), SurfaceNumber::new(.what.first), SurfaceNumber::new(.what.last)
    )]
    NoSuchSurface {
        /// The error of making.
        what: Perturbation,
        /// The number of surfaces without the image plane.
        surfaces: usize,
    },
    /// An error of making does not exist on its surface.
    #[error("the error `{}` of surface {} {why}", .what.kind.name(), SurfaceNumber::new(.what.first))]
    NotPossible {
        /// The error of making.
        what: Perturbation,
        /// The reason, as the rest of a sentence.
        why: &'static str,
    },
    /// A ray of the beam does not arrive.
    #[error(
        "ray {} of field {} is lost at surface {}: {}",
        .ray + 1, .field + 1, SurfaceNumber::new(.fate.surface().unwrap_or(0)), .fate.name()
    )]
    RayLost {
        /// The field, counted from 0.
        field: usize,
        /// The ray, counted from 0.
        ray: usize,
        /// Its end.
        fate: Fate,
    },
    /// Most lenses with random errors lose rays: means over the others tell nothing.
    #[error(
        "{lost} of {samples} lenses with {what} lose rays, so that no mean or quantile tells anything of \
         them; expected tighter tolerances: a tighter grade or smaller half ranges"
    )]
    MostLost {
        /// The number of lenses that lose rays.
        lost: usize,
        /// The number of lenses.
        samples: usize,
        /// The tolerances, in words.
        what: &'static str,
    },
    /// Tolerances are asked for with which lenses are better than the one without errors.
    #[error(
        "an rms of {found} mm is asked for; expected more than {nominal:.6} mm, that of the lens without errors"
    )]
    BelowNominal {
        /// The rms spot radius that is asked for in mm.
        found: f64,
        /// That of the lens without errors in mm.
        nominal: f64,
    },
    /// The analysis was told to stop before it had a result.
    #[error("stopped before there is a result")]
    Stopped,
    /// Something else about the lens or the request.
    #[error("{0}")]
    Other(String),
}
