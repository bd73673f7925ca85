//! Fans of path differences: the wavefront along two sections of the pupil.

use super::{AnalysisError, path_differences};
use crate::lens::FieldPoint;
use crate::pupil::RayModel;

/// A ray of a fan of path differences.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathFanPoint {
    /// Its coordinate along the section of the pupil, −1 to 1.
    pub pupil: f64,
    /// The path of the chief ray less its own on the reference sphere, in wavelengths; `None` if it is lost.
    pub waves: Option<f64>,
}

/// The two fans of a field at one wavelength.
#[derive(Debug, Clone, PartialEq)]
pub struct PathFan {
    /// The index of the wavelength, in which paths are counted.
    pub wavelength: usize,
    /// Along y of the pupil.
    pub tangential: Vec<PathFanPoint>,
    /// Along x of the pupil.
    pub sagittal: Vec<PathFanPoint>,
}

/// The fans of a field at each wavelength, of `count` rays each, against the reference sphere about the image
/// point of the chief ray of that wavelength: lateral colour is no path difference. A wavelength without
/// light has none.
///
/// # Errors
/// No wavelength has a chief ray that reaches the image, or no ray beside it does.
pub fn path_fans(
    model: &RayModel,
    field: FieldPoint,
    count: usize,
) -> Result<Vec<PathFan>, AnalysisError> {
    let of = |wavelength: usize| path_fan(model, field, wavelength, count);
    let fans: Vec<_> = (0..model.channels.len()).map(of).collect();
    match fans.iter().find_map(|fan| fan.as_ref().err()) {
        Some(why) if fans.iter().all(Result::is_err) => Err(*why),
        _ => Ok(fans.into_iter().flatten().collect()),
    }
}

fn path_fan(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    count: usize,
) -> Result<PathFan, AnalysisError> {
    let at = |i: usize| 2.0 * i as f64 / count.saturating_sub(1).max(1) as f64 - 1.0;
    let section = |place: fn(f64) -> [f64; 2]| {
        let points: Vec<[f64; 2]> = (0..count).map(|i| place(at(i))).collect();
        let paths = path_differences(model, field, wavelength, &points)?;
        let point =
            |(i, path): (usize, Result<f64, _>)| PathFanPoint { pupil: at(i), waves: path.ok() };
        Ok(paths.into_iter().enumerate().map(point).collect::<Vec<_>>())
    };
    let (tangential, sagittal) = (section(|y| [0.0, y])?, section(|x| [x, 0.0])?);
    let mut points = tangential.iter().chain(&sagittal);
    // The ray through the centre alone carries no light.
    if points.all(|point| point.waves.is_none() || point.pupil == 0.0) {
        return Err(AnalysisError::NoLight);
    }
    Ok(PathFan { wavelength, tangential, sagittal })
}
