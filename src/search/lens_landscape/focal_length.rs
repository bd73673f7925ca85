//! The focal length as the reference for lengths of a lens.

use crate::lens::Lens;
use crate::paraxial::{Beam, first_order};

/// The focal length of a lens at its first zoom position, in mm; `None` for an afocal one.
pub(super) fn focal_length_of(lens: &Lens) -> Option<f64> {
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).ok()?;
    let efl = first_order(&system, &Beam::for_lens(lens, 0)).ok()?.efl?;
    efl.is_finite().then_some(efl)
}

/// The reference length of a lens: its focal length, or its track if it is afocal.
pub(super) fn reference_length(lens: &Lens) -> f64 {
    focal_length_of(lens).map_or_else(|| lens.total_track(), f64::abs).max(f64::MIN_POSITIVE)
}
