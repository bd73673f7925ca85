//! First-order numbers that formats state which define the beam by another quantity than the lens does.

use crate::lens::{Lens, LensError, Object};
use crate::paraxial::{Beam, first_order};

/// First-order numbers of a lens at its first zoom position and its primary wavelength.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FirstOrderBeam {
    /// The focal length in mm; `None` for an afocal lens.
    pub(super) focal_length: Option<f64>,
    /// The radius of the paraxial entrance pupil, in mm; 0 if there is none.
    pub(super) pupil_radius: f64,
    /// The numerical aperture in object space of a ray from the axis to the edge of that pupil; 0 for an
    /// object at infinity.
    pub(super) object_na: f64,
}

impl FirstOrderBeam {
    /// The numbers of a lens.
    ///
    /// # Errors
    /// A lens that cannot be resolved.
    pub(super) fn new(lens: &Lens) -> Result<Self, LensError> {
        let system = lens.resolve(0, lens.wavelengths[lens.primary()].um)?;
        let data = first_order(&system, &Beam::for_lens(lens, 0)).ok();
        let pupil = data.as_ref().map(|data| data.entrance_pupil);
        let pupil_radius = pupil.and_then(|pupil| pupil.diameter).map_or(0.0, |d| 0.5 * d.abs());
        let position = pupil.and_then(|pupil| pupil.position).unwrap_or(0.0);
        let object_na = match lens.object {
            Object::Infinity => 0.0,
            Object::Finite(distance) => {
                let way = distance + position;
                system.index_before * pupil_radius / pupil_radius.hypot(way)
            }
        };
        Ok(Self { focal_length: data.and_then(|data| data.efl), pupil_radius, object_na })
    }
}
