//! Errors of colour and of the zones of the pupil: lateral and axial colour, longitudinal aberration.
//!
//! Lateral colour is the shift of chief rays across the image with the wavelength. Longitudinal aberration
//! is the shift along the axis of the crossings of rays from the axial point, zone by zone; its limit in the
//! middle of the pupil is the paraxial focus, whose change with the wavelength is axial colour.

use super::{AnalysisError, field_curvature, rounding_error};
use crate::lens::FieldPoint;
use crate::pupil::RayModel;

/// The image point of a chief ray at a wavelength against that at the primary one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LateralColor {
    /// The index of the wavelength.
    pub wavelength: usize,
    /// The shift along x and y, in mm.
    pub shift: [f64; 2],
}

/// The crossing of a ray from the axial point with the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ZoneFocus {
    /// The height in the pupil, 0 to 1.
    pub pupil: f64,
    /// The distance of the crossing from the image plane, positive along z, in mm; `None` for a ray that
    /// is lost or parallel to the axis.
    pub focus: Option<f64>,
    /// The error of the crossing by rounding, in mm.
    pub error: f64,
}

/// The foci of the zones of the pupil at a wavelength.
#[derive(Debug, Clone, PartialEq)]
pub struct LongitudinalAberration {
    /// The index of the wavelength.
    pub wavelength: usize,
    /// The foci from the middle of the pupil, which has the paraxial one, to its rim.
    pub zones: Vec<ZoneFocus>,
}

/// The lateral colour of a field at every wavelength.
///
/// # Errors
/// The chief ray of a wavelength does not reach the image.
pub fn lateral_color(
    model: &RayModel,
    field: FieldPoint,
) -> Result<Vec<LateralColor>, AnalysisError> {
    let primary = model.chief_point(field, model.primary)?;
    let shift = |wavelength: usize| {
        let point = model.chief_point(field, wavelength)?;
        let shift = [point[0] - primary[0], point[1] - primary[1]];
        Ok(LateralColor { wavelength, shift })
    };
    (0..model.channels.len()).map(shift).collect()
}

/// The longitudinal aberration at every wavelength, at evenly spaced heights in the pupil.
///
/// # Errors
/// The axial point has no rays, or none that reaches the image, or the lens is not symmetric about its axis.
pub fn longitudinal_aberration(
    model: &RayModel,
    zones: usize,
) -> Result<Vec<LongitudinalAberration>, AnalysisError> {
    let wavelengths = 0..model.channels.len();
    wavelengths.map(|wavelength| longitudinal(model, wavelength, zones.max(1))).collect()
}

fn longitudinal(
    model: &RayModel,
    wavelength: usize,
    zones: usize,
) -> Result<LongitudinalAberration, AnalysisError> {
    if !model.channels[wavelength].system.has_rotational_symmetry() {
        return Err(AnalysisError::NotSymmetric);
    }
    let axis = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
    let launch = model.launch(axis, wavelength).map_err(AnalysisError::NoRays)?;
    let rounding = rounding_error(model);
    let focus = |y: f64, slope: f64| (slope != 0.0).then(|| -y / slope);
    let zone = |pupil: f64| {
        let traced = launch.ray([0.0, pupil]).map(|ray| launch.channel().tracer.trace(ray));
        let landed = traced.filter(|traced| traced.fate.is_imaged()).map(|traced| traced.ray);
        let slope = landed.map_or(0.0, |ray| ray.direction.y / ray.direction.z);
        let focus = landed.and_then(|ray| focus(ray.point.y, slope).map(|z| z + ray.point.z));
        let error = if slope == 0.0 { 0.0 } else { rounding / slope.abs() };
        ZoneFocus { pupil, focus, error }
    };
    let paraxial = field_curvature(model, axis, wavelength)?.tangential;
    let middle = ZoneFocus { pupil: 0.0, focus: paraxial, error: zone(1.0 / zones as f64).error };
    let others = (1..=zones).map(|i| zone(i as f64 / zones as f64));
    let zones: Vec<ZoneFocus> = std::iter::once(middle).chain(others).collect();
    if zones.iter().skip(1).all(|zone| zone.focus.is_none()) {
        return Err(AnalysisError::NoLight);
    }
    Ok(LongitudinalAberration { wavelength, zones })
}
