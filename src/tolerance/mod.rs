//! Errors of making: what they do to a lens, and how good the lens is that is made.
//!
//! A [`Perturbation`](crate::lens::Perturbation) with a value changes a resolved lens
//! ([`perturb`]). The mean square spot `S` is a smooth function of all errors `p`, so that two
//! derivatives of it are nearly everything: with errors that are independent and have the mean 0 and
//! the variances `σ²`,
//!
//! ```text
//! E[S] = S₀ + ½ Σ σᵢ² ∂²S/∂pᵢ² + O(σ⁴)
//! ```
//!
//! [`sensitivities`] computes both derivatives of the spot, of the spot after refocusing and of the
//! wavefront variance by second-order jets: rays are traced once over numbers that carry the
//! derivatives by an error, from the first surface that it changes on.
//!
//! Rays are held: an error changes the lens and not the rays in object space, and rims clip nothing.

mod beam;
mod error;
mod merits;
mod perturb;
mod sensitivity;
mod spot;
mod wavefront;

pub use beam::{Beam, ColourRays, FieldBeam};
pub use error::ToleranceError;
pub use merits::{MeritOptions, Merits, merits};
pub use perturb::{NominalLens, perturb};
pub use sensitivity::{Derivatives, Jet2, Sensitivity, sensitivities};
pub use spot::{SpotMoments, best_focus};
pub use wavefront::WavefrontVariance;
