//! Transverse ray fans: the distances of the rays of a pupil section from the image point of the
//! chief ray.

use super::AnalysisError;
use crate::lens::FieldPoint;
use crate::pupil::RayModel;
use crate::trace::{Fate, Ray};

/// A ray of a fan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FanPoint {
    /// Its coordinate along the section, −1 to 1 between the rims of the stop, or of the disc of
    /// the entrance pupil if that limits the beam.
    pub pupil: f64,
    /// The distance of its image point from that of the chief ray, x and y in mm; `None` if it is
    /// lost.
    pub error: Option<[f64; 2]>,
    /// Its fate; `None` if it could not be launched.
    pub fate: Option<Fate>,
}

/// The two fans of a field at one wavelength.
#[derive(Debug, Clone, PartialEq)]
pub struct Fan {
    /// The index of the wavelength.
    pub wavelength: usize,
    /// Along y of the pupil.
    pub tangential: Vec<FanPoint>,
    /// Along x of the pupil.
    pub sagittal: Vec<FanPoint>,
}

/// The fans of a field at each wavelength, of `count` rays each, relative to the chief ray of the
/// primary wavelength.
///
/// # Errors
/// The chief ray does not reach the image, or the field has no rays.
pub fn fan(model: &RayModel, field: FieldPoint, count: usize) -> Result<Vec<Fan>, AnalysisError> {
    let chief = model.chief_point(field, model.primary)?;
    let one = |wavelength: usize| {
        let launch = model.launch(field, wavelength).map_err(AnalysisError::NoRays)?;
        let point = |(pupil, ray): (f64, Option<Ray<f64>>)| {
            let landing = ray.map(|ray| launch.channel().tracer.trace(ray));
            let arrived = landing.filter(|landing| landing.fate.is_imaged());
            let error = |at: crate::math::Vec3<f64>| [at.x - chief[0], at.y - chief[1]];
            FanPoint {
                pupil,
                error: arrived.map(|landing| error(landing.ray.point)),
                fate: landing.map(|landing| landing.fate),
            }
        };
        let at = |i: usize| 2.0 * i as f64 / count.saturating_sub(1).max(1) as f64 - 1.0;
        let section = |place: fn(f64) -> [f64; 2]| {
            let points: Vec<_> = (0..count).map(|i| place(at(i))).collect();
            let rays = launch.rays_through_stop(&points);
            (0..count).map(at).zip(rays).map(point).collect()
        };
        Ok(Fan { wavelength, tangential: section(|y| [0.0, y]), sagittal: section(|x| [x, 0.0]) })
    };
    (0..model.channels.len()).map(one).collect()
}
