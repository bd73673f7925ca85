//! The pupil: the set of rays of a field that get through the lens, its boundary, and quadrature
//! over it.
//!
//! A [`RayModel`] is a lens with its beam, ready for tracing. A [`Launch`] maps pupil coordinates
//! of one field and wavelength to rays. A [`Region`] is the set of pupil points whose rays arrive:
//! the whole disc, a part of it bounded by the rims that clip, or nothing. Its quadrature converges
//! spectrally in each case, so the difference of two orders is a reliable error estimate.
//!
//! The quadrature follows Forbes, "Optical system assessment for design: numerical ray tracing in
//! the Gaussian pupil", JOSA A 5 (1988), for the clear disc; a clipped pupil is split where one
//! limit takes over from another, so that the integrand is smooth on every part.
//!
//! A real beam ([`RayModel::from_lens`]) is what the rims of a lens let through, that of the stop
//! among them, and its chief rays cross the centre of the stop; coordinates only name its rays.
//!
//! Pupil coordinates `(px, py)` have length 1 at the rim of the paraxial entrance pupil, or of the
//! stop if every ray is aimed at it.

mod field_source;
mod found_pupils;
mod gauss_rules;
mod gradient;
mod launch;
mod patterns;
mod ray_aiming;
mod ray_model;
mod real_beam;
mod region;
mod stop_limited;

pub use found_pupils::FoundPupils;
pub use gradient::{
    DerivativeError, DerivativeEstimator, Integrand, PupilDerivative, QuadraticIntegrand,
    WarpSampling, choose_estimator, differentiate,
};
pub use launch::{FixedLaunch, Launch, LaunchError};
pub(crate) use patterns::additive_sequence;
pub use patterns::{PupilPattern, pattern_points};
pub use ray_model::{Aiming, Channel, Dual2, Neglected, PupilMeasure, RayModel, RayModelError};
pub use real_beam::filled_stop_radius;
pub use region::{
    Accuracy, Annulus, AxialRim, Boundary, BoundaryArc, ConvergedList, ConvergedValues, DarkPupil,
    EdgeArc, EdgeCurves, EdgePoint, EdgeRay, Nodes, OutlineSide, PolarFrame, PupilLimit,
    PupilMoments, PupilOutline, PupilRadius, Region, RegionKind, TracedNodes, TracedPupil,
    converge, converge_every_order, converge_list, converge_resolved,
};
pub use stop_limited::limited_by_stop;
