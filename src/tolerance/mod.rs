//! Errors of making: what they do to a lens, and how good the lens is that is made.
//!
//! A [`Perturbation`](crate::lens::Perturbation) with a value changes a resolved lens
//! ([`perturb()`]). The mean square spot `S` is a smooth function of all errors `p`, so that two
//! derivatives of it are nearly everything: with errors that are independent and have the mean 0 and
//! the variances `σ²`,
//!
//! ```text
//! E[S] = S₀ + ½ Σ σᵢ² ∂²S/∂pᵢ² + O(σ⁴)
//! ```
//!
//! All but some 1e-4 of the second ones are mean products of what errors do to the rays, which one sweep
//! of these back through the lens tells for all errors at once ([`RayEffects`]). [`sensitivities`]
//! computes both derivatives of the spot, of the spot after refocusing and of the wavefront variance
//! exactly, by second-order jets: rays are traced once over numbers that carry the derivatives by an
//! error, from the first surface that it changes on.
//!
//! The mean products are the [`QuadraticForm`], whose distribution needs no further rays. [`real_lenses`] traces lenses with random errors; both
//! on the same draws tell how far the form is to be trusted, and their difference corrects it
//! ([`analyze`]).
//!
//! What is adjusted after assembly, focus first, is adjusted within its travel in both alike; errors that
//! are correlated are sums of independent ones.
//!
//! An error changes the lens and not the rays in object space, but it may change which of them get
//! through: the edge of the pupil moves. Where that matters ([`PupilMotion`]) the form has the edge's part
//! of the derivatives, and real lenses find their pupils anew; elsewhere the rays of the lens as designed
//! are held, and what rims would clip is measured and shown.

mod adjusted;
mod analysis;
mod as_built;
mod beam;
mod compensation;
mod contrast;
mod covariance;
mod draw;
mod effects;
mod error;
mod folded;
mod form;
mod grade;
mod groups;
mod histogram;
mod inverse;
mod linear_contrast;
mod loosest;
mod made;
mod merits;
mod mixture;
mod monte_carlo;
mod nominal;
mod perturb;
mod pupil_edge;
mod pupil_motion;
mod pupils;
mod real_merit;
mod reduced;
mod sensitivity;
mod spot;
mod sweep;
mod travel;
mod two_planes;
mod wave_beam;
mod wave_effects;
mod wavefront;
mod waves;

use error::refuse_if_stopped;

pub use crate::lens::ToleranceGrade;
pub use analysis::{
    AsBuiltSpot, ErrorModel, Quantile, ToleranceAnalysis, ToleranceRequest, YieldEstimate, analyze,
    form_spots,
};
pub use as_built::{AsBuiltGradient, FixedAndRefocused, as_built_gradient};
pub use beam::{Beam, ColourRays, FieldBeam};
pub use compensation::{Compensation, adjustments};
pub use contrast::{ContrastChange, ContrastChanges, ContrastSummary};
pub use covariance::{
    IndependentError, LeverArm, MadeKind, MadeNumber, NumberCovariance, TiltingBody,
    independent_errors,
};
pub use effects::{RayEffects, SecondDerivatives};
pub use error::{StopTest, ToleranceError, refuse_lost_lenses};
pub use form::{AdjustedForm, ErrorProducts, FocusTreatment, QuadraticForm};
pub use grade::{PriceClass, bounded_tolerances, graded_sheet, is_beside_grin, price_classes};
pub use groups::{KindShare, LensPart, PartShare, shares_by_kind, shares_by_part};
pub use histogram::{SpotHistogram, yield_band};
pub use inverse::{form_yield, loosest_for_yield, loosest_tolerances};
pub use loosest::{LoosestGoal, LoosestRequest, LoosestTolerances};
pub use made::{MadeLens, made_lens, worst_lens};
pub use merits::{MeritOptions, Merits, merits};
pub use monte_carlo::{KnownLens, RealLens, real_lenses, traced_lenses, wilson_interval};
pub use nominal::ToleranceScene;
pub use perturb::{NominalLens, perturb};
pub use pupil_motion::PupilMotion;
pub use pupils::{PupilTreatment, ScenePupils};
pub use real_merit::{RealMerit, RealMeritRequest};
pub use sensitivity::{Derivatives, Jet2, RaySensitivity, Sensitivity, sensitivities};
pub use spot::{SpotMoments, best_focus};
pub use travel::{AdjustmentTravel, StoppedLenses, TravelStatistics};
pub use wavefront::WavefrontVariance;
pub use waves::WavefrontModel;
