//! The set of rays that get through: where they start, where the set ends, quadrature over it.
//!
//! A [`RayModel`] is a lens with its beam, ready for rays. A [`Launch`] turns pupil coordinates of
//! one field and wavelength into rays. A [`Region`] knows which of them arrive: the whole disc, a
//! piece of it bounded by the rims that clip, or nothing at all. Its quadrature converges
//! spectrally in both cases, so the difference of two orders is an honest error estimate.
//!
//! After Forbes, "Optical system assessment for design: numerical ray tracing in the Gaussian
//! pupil", JOSA A 5 (1988), for the clear disc; the clipped pupil is split where one rim takes
//! over from another, so that every piece is smooth.
//!
//! Pupil coordinates `(px, py)` are 1 at the rim of the paraxial entrance pupil, or of the stop
//! where rays are aimed at it.

mod aim;
mod gauss_rules;
mod gradient;
mod launch;
mod patterns;
mod ray_model;
mod region;
mod stop_limited;

pub use gradient::{
    DerivativeError, DerivativeEstimator, Integrand, PupilDerivative, QuadraticIntegrand,
    WarpSampling, choose_estimator, differentiate,
};
pub use launch::{FixedLaunch, Launch, LaunchError};
pub use patterns::{PupilPattern, pattern_points};
pub use ray_model::{Aiming, Channel, Dual2, RayModel, RayModelError, WIDE_AIMING_THRESHOLD};
pub use region::{
    Accuracy, Annulus, Boundary, BoundaryArc, ConvergedValues, DarkPupil, EdgePoint, Nodes,
    OutlineSide, PolarFrame, PupilLimit, PupilMoments, PupilOutline, Region, RegionKind,
    TracedNodes, TracedPupil, converge,
};
pub use stop_limited::limited_by_stop;
