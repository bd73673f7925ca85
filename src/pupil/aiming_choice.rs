//! The choice of aiming for a lens: paraxial, unless the real chief ray is too far from that.

use super::launch::Launch;
use super::ray_model::{Aiming, RayModel, RayModelError};
use crate::lens::{FieldPoint, Lens};

/// The largest distance of the paraxial chief ray from the centre of the stop, in stop radii, up to
/// which paraxial aiming is used: beyond it, much of the beam would be missed.
pub const WIDE_AIMING_THRESHOLD: f64 = 0.25;

impl RayModel {
    /// A lens at a zoom position, aimed as [`choose_aiming`](Self::choose_aiming) decides.
    ///
    /// # Errors
    /// A lens that cannot be resolved, or an aperture without meaning for it.
    pub fn from_lens(lens: &Lens, zoom: usize) -> Result<Self, RayModelError> {
        let mut model = Self::with_aiming(lens, zoom, Aiming::Paraxial)?;
        model.choose_aiming();
        Ok(model)
    }

    /// Chooses between paraxial aiming and aiming by the real chief ray: the latter if the paraxial
    /// chief ray of the farthest field misses the centre of the stop by more than
    /// [`WIDE_AIMING_THRESHOLD`]. Returns that miss, in stop radii; `None` if the ray does not reach
    /// the stop.
    pub fn choose_aiming(&mut self) -> Option<f64> {
        let miss = self.stop_miss();
        let wide = miss.is_none_or(|miss| miss > WIDE_AIMING_THRESHOLD);
        self.aiming = if wide { Aiming::Chief } else { Aiming::Paraxial };
        miss
    }

    /// The distance of the paraxial chief ray of the farthest field from the centre of the stop, in
    /// stop radii; `None` if the ray does not reach the stop.
    fn stop_miss(&self) -> Option<f64> {
        let edge = FieldPoint { x: 0.0, y: self.beam.edge, weight: 1.0 };
        let launch = Launch::new(self, edge, self.primary, Aiming::Paraxial).ok()?;
        let [x, y] = launch.stop_point([0.0, 0.0])?;
        let miss = x.hypot(y) / self.stop_radius();
        miss.is_finite().then_some(miss)
    }
}
