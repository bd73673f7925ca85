//! Diffraction at a pupil of any shape, by sums that converge spectrally.
//!
//! Light on the [reference sphere](super::ReferenceForm) is counted in the direction cosines
//! `(α, β) = (C − Q)/R` of its points as seen from the centre: a spatial frequency ν in the image is
//! exactly a shift `λν` of the pupil there, with obliquity and pupil distortion included. The
//! amplitude keeps the energy of the arriving beam, `A² dα dβ = dp`. With W the path difference:
//!
//! ```text
//! U(x, y) = ∫ A exp(2πi (−W + α x + β y)/λ) dα dβ
//! OTF(ν)  = ∫ A₊ A₋ exp(−2πi (W₊ − W₋)/λ) dα dβ / ∫ A² dα dβ,   ± at (α, β) ± λν/2
//! ```
//!
//! U is a sum over the quadrature nodes of the pupil itself. For the OTF, W and A are polynomials
//! fitted to rays, and the overlap of the two shifted pupils is integrated between its own edges; where
//! polynomials leave more than the tolerance, each node of that integral has a ray of its own.
//! Light is a scalar here, which is not enough beyond a numerical aperture of about 0.6.

mod blur;
mod brightest;
mod column_sum;
mod contrast;
mod encircled;
mod image_light;
mod outline;
mod overlap;
mod overlap_slopes;
mod point_spread;
mod polynomial;
mod pupil_function;
mod pupil_samples;
mod pupil_traces;
mod ray_pupil;
mod ray_transfer;
mod round_pupil;
mod strehl;

/// A test that is asked often whether a computation is to end early.
type Interruption<'a> = dyn Fn() -> bool + Sync + 'a;

fn never() -> bool {
    false
}

pub use contrast::{
    DiffractionGate, diffraction_gate, diffraction_mtf, polychromatic_diffraction_mtf,
    polychromatic_diffraction_mtf_unless, through_focus_mtf,
};
pub use encircled::{EncircledEnergy, EncircledRequest, encircled_energy, encircled_energy_unless};
pub use image_light::ImageLight;
pub use outline::PupilCurve;
pub use point_spread::{PointSpread, point_spread, point_spread_unless};
pub use pupil_function::PupilFunction;
pub use pupil_samples::PupilSamples;
pub use ray_transfer::{RayTransfer, TransferAtFrequency, TransferRays};
pub use round_pupil::RoundPupil;
pub use strehl::{Strehl, strehl, strehl_unless};
