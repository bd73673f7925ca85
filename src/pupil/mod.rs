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
mod bench;
mod boundary;
mod follow;
mod gradient;
mod launch;
mod lit;
mod moments;
mod outline;
mod quadrature;
mod region;
mod ring;
mod rules;
mod sample;
mod shadow;
mod stopped;

pub use bench::{Aiming, Channel, Dual2, RayModel, RayModelError, WIDE_AIMING_THRESHOLD};
pub use boundary::{Boundary, BoundaryArc, EdgePoint, PolarFrame, PupilLimit};
pub use gradient::{
    DerivativeError, DerivativeEstimator, Integrand, PupilDerivative, QuadraticIntegrand,
    WarpSampling, choose_estimator, differentiate,
};
pub use launch::{FixedLaunch, Launch, LaunchError};
pub use lit::TracedPupil;
pub use moments::PupilMoments;
pub use outline::{OutlineSide, PupilOutline};
pub use quadrature::{Accuracy, ConvergedValues, Nodes, TracedNodes, converge};
pub use region::{Region, RegionKind};
pub use ring::Annulus;
pub use sample::{PupilPattern, pattern_points};
pub use shadow::DarkPupil;
pub use stopped::limited_by_stop;
