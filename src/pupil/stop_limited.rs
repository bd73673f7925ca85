//! Beams that the rim of the stop limits: the pupil then has a derivative by every semi-diameter.

use super::ray_model::{Aiming, Channel, RayModel, RayModelError};
use crate::lens::{Aperture, Lens, Quantity, SystemError};
use crate::paraxial::Beam;
use crate::trace::Tracer;

/// The same lens limited by its stop: an aperture given as a pupil or a cone becomes the
/// semi-diameter of the stop that its paraxial marginal ray touches, or that of the stop's rim if
/// that is smaller; separately at every zoom position. A lens without a stop has it at the first
/// surface. The focal ratio stays what it was; the real beam changes as far as the real marginal
/// ray of the lens as given does not cross the stop there ([`RayModel::filled_stop_radius`]).
///
/// The pupil is then what the semi-diameters of the lens let through and nothing else, and has a
/// derivative by each of them.
///
/// # Errors
/// A lens that cannot be resolved, or an aperture without meaning for it.
pub fn limited_by_stop(lens: &Lens) -> Result<Lens, RayModelError> {
    let mut limited = lens.clone();
    let stop = lens.stop().unwrap_or(0);
    limited.surfaces[stop].stop = true;
    let rim = |zoom: usize| {
        let parameter = lens.parameter_at(zoom, stop, Quantity::SemiDiameter);
        lens.get(parameter).unwrap_or(f64::INFINITY)
    };
    let radius = |zoom| match lens.aperture_at(zoom) {
        Aperture::StopSemiDiameter(radius) => Ok(radius),
        _ => RayModel::with_aiming(lens, zoom, Aiming::Paraxial)
            .map(|model| model.stop_radius().min(rim(zoom))),
    };
    let radii: Vec<f64> = (0..lens.zoom_positions()).map(radius).collect::<Result<_, _>>()?;
    let first = radii[0];
    if radii.iter().any(|radius| *radius != first) {
        for (position, radius) in limited.zoom.iter_mut().zip(&radii) {
            position.aperture = Some(Aperture::StopSemiDiameter(*radius));
        }
    } else {
        limited.zoom.iter_mut().for_each(|position| position.aperture = None);
    }
    for position in &mut limited.zoom {
        position.remove_number(stop, Quantity::SemiDiameter);
    }
    let widest = radii.iter().fold(0.0, |widest: f64, radius| widest.max(*radius));
    limited.aperture = Aperture::StopSemiDiameter(widest);
    limited.surfaces[stop].semi_diameter = Some(widest);
    Ok(limited)
}

impl RayModel {
    /// The same beam limited by the rim of the stop, which moves with its semi-diameter; rays are
    /// aimed at the stop by the chief ray alone where each was aimed by itself.
    ///
    /// # Errors
    /// Numbers that cannot be traced.
    pub fn limited_by_stop(&self) -> Result<Self, SystemError> {
        let stop = self.stop();
        let rim = self.channels[self.primary].system.surfaces[stop].semi_diameter;
        let radius = rim.min(self.filled_stop_radius());
        let channel = |channel: &Channel| {
            let mut system = channel.system.clone();
            let rim = &mut system.surfaces[stop].semi_diameter;
            *rim = rim.min(radius);
            let tracer = Tracer::new(&system)?;
            Ok(Channel { system, tracer, ..channel.clone() })
        };
        let channels: Result<_, SystemError> = self.channels.iter().map(channel).collect();
        let beam = Beam { aperture: Aperture::StopSemiDiameter(radius), ..self.beam };
        let aiming = if self.aiming == Aiming::Stop { Aiming::Chief } else { self.aiming };
        Ok(Self { channels: channels?, beam, aiming, ..self.clone() })
    }
}
