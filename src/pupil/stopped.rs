//! An aperture that is a hole in the lens.

use super::bench::{Aiming, RayModel, RayModelError};
use crate::lens::{Aperture, Lens};

/// The same lens limited by its stop: an aperture given as a pupil or a cone becomes the
/// semi-diameter of the stop that its paraxial marginal ray touches, or the rim of the stop where
/// that is smaller; at every zoom position its own. A lens without a stop has it at the first
/// surface.
///
/// So the pupil is what the rims of the lens let through and nothing else, and has a derivative by
/// every one of them.
///
/// # Errors
/// A lens that cannot be set up.
pub fn limited_by_stop(lens: &Lens) -> Result<Lens, RayModelError> {
    let mut limited = lens.clone();
    let stop = lens.stop().unwrap_or(0);
    limited.surfaces[stop].stop = true;
    let rim = lens.surfaces[stop].semi_diameter.unwrap_or(f64::INFINITY);
    let radius = |zoom| match lens.aperture_at(zoom) {
        Aperture::StopSemiDiameter(radius) => Ok(radius),
        _ => RayModel::with_aiming(lens, zoom, Aiming::Paraxial).map(|b| b.stop_radius().min(rim)),
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
    let widest = radii.iter().fold(0.0, |widest: f64, radius| widest.max(*radius));
    limited.aperture = Aperture::StopSemiDiameter(widest);
    limited.surfaces[stop].semi_diameter = Some(widest);
    Ok(limited)
}
