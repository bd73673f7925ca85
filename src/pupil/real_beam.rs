//! The beam of a lens: the rays that cross its stop, wherever the first-order pupil lies.

use super::field_source::{field_source, paraxial_map};
use super::ray_model::{Aiming, Dual2, RayModel, RayModelError};
use crate::lens::{Aperture, FieldPoint, Lens};

impl RayModel {
    /// A lens at a zoom position with its real beam: the rays that fill the stop and pass every
    /// rim, with the chief ray of each field and wavelength through the centre of the stop.
    ///
    /// # Errors
    /// A lens that cannot be resolved, or an aperture without meaning for it.
    pub fn from_lens(lens: &Lens, zoom: usize) -> Result<Self, RayModelError> {
        Ok(Self::with_aiming(lens, zoom, Aiming::Chief)?.limited_by_stop()?)
    }

    /// The radius of the stop in mm that a beam of the given aperture fills: as given, or the
    /// height at which the real marginal ray of the field on the axis crosses the stop at the
    /// primary wavelength. That of the paraxial ray if the real one does not get there.
    pub fn filled_stop_radius(&self) -> f64 {
        let paraxial = self.stop_radius();
        if matches!(self.beam.aperture, Aperture::StopSemiDiameter(_)) || paraxial == 0.0 {
            return paraxial;
        }
        self.marginal_stop_height().unwrap_or(paraxial)
    }

    /// The height of the real marginal ray of the field on the axis at the stop, in mm.
    fn marginal_stop_height(&self) -> Option<f64> {
        let axis = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
        let source = field_source(self, axis)?;
        let q = paraxial_map(self, &source).map([0.0, 1.0]);
        let open = &self.channels[self.primary].unclipped;
        let landing = open.trace_to(source.ray(q.map(Dual2::constant)), self.stop());
        let height = landing.ray.point.y.value.abs();
        (landing.fate.is_imaged() && height > 0.0 && height.is_finite()).then_some(height)
    }
}
