//! A lens at another focal length: every length times a factor.

use crate::lens::{Aperture, Edit, EditError, Lens, LensError, apply_edit};
use crate::math::format_short;
use crate::paraxial::{Beam, ParaxialError, first_order};

/// A reason for which a lens cannot be scaled to a focal length.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LensScaleError {
    /// The focal length is no positive number.
    #[error("found the focal length {0}; expected more than 0 mm")]
    FocalLength(f64),
    /// The lens focuses nothing.
    #[error("the lens has no focal length that could be scaled")]
    Afocal,
    /// The lens cannot be resolved.
    #[error(transparent)]
    Lens(#[from] LensError),
    /// The lens has no first-order data.
    #[error(transparent)]
    Paraxial(#[from] ParaxialError),
    /// The scaled lens is invalid.
    #[error(transparent)]
    Edit(#[from] EditError),
}

/// The lens at this focal length, in mm, at its primary wavelength and first zoom position: every
/// length is multiplied by one factor, which its notes tell. Angles, f-numbers and the sign of the
/// focal length stay.
///
/// # Errors
/// A focal length that is no positive number, and a lens without one.
pub fn scale_to_focal_length(lens: &Lens, mm: f64) -> Result<Lens, LensScaleError> {
    let factor = focal_length_factor(lens, 0, mm)?;
    let mut scaled = apply_edit(lens, &Edit::Scale(factor))?;
    let note = format!("Scaled by {} to a focal length of {} mm.", short(factor), short(mm));
    let notes = [scaled.notes.as_str(), &note].into_iter().filter(|text| !text.is_empty());
    scaled.notes = notes.collect::<Vec<_>>().join("\n");
    Ok(scaled)
}

/// The factor of every length that gives a lens this focal length, in mm, at its primary wavelength
/// and a zoom position.
///
/// # Errors
/// As [`scale_to_focal_length`].
pub fn focal_length_factor(lens: &Lens, zoom: usize, mm: f64) -> Result<f64, LensScaleError> {
    if !(mm > 0.0 && mm.is_finite()) {
        return Err(LensScaleError::FocalLength(mm));
    }
    Ok(mm / focal_length(lens, zoom)?.abs())
}

/// The focal length of a lens in mm, at its primary wavelength and a zoom position.
///
/// # Errors
/// An afocal lens, and one that cannot be resolved.
pub fn focal_length(lens: &Lens, zoom: usize) -> Result<f64, LensScaleError> {
    let system = lens.resolve(zoom, lens.wavelengths[lens.primary()].um)?;
    // The focal length does not depend on the beam: a stop of some size has a meaning for any lens.
    let beam = Beam { aperture: Aperture::StopSemiDiameter(1.0), ..Beam::for_lens(lens, zoom) };
    first_order(&system, &beam)?.efl.ok_or(LensScaleError::Afocal)
}

/// A number in notes, with six digits.
fn short(value: f64) -> String {
    let rounded = format!("{value:.5e}").parse().unwrap_or(value);
    format_short(rounded)
}
