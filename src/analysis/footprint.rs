//! The footprint of a beam on a surface: the edge of its light there.

use super::{AnalysisError, lit_region};
use crate::lens::FieldPoint;
use crate::pupil::{RayModel, RegionKind};
use std::f64::consts::TAU;

/// The footprint of a field's beam on a surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Footprint {
    /// Points on its edge, x and y in mm, in order around it.
    pub outline: Vec<[f64; 2]>,
    /// The largest distance of the outline from the axis of the surface, in mm.
    pub reach: f64,
    /// The semi-diameter of the surface in mm; `None` if it clips nothing.
    pub semi_diameter: Option<f64>,
}

/// The footprint of a field at a wavelength on a surface, by about `count` rays along the edge of the pupil.
///
/// # Errors
/// No light, or a pupil whose edge is not known.
pub fn footprint(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    surface: usize,
    count: usize,
) -> Result<Footprint, AnalysisError> {
    let region = lit_region(model, field, wavelength)?;
    if matches!(region.kind, RegionKind::Irregular { annulus: None, .. }) {
        return Err(AnalysisError::IrregularPupil);
    }
    let channel = region.launch.channel();
    let point = |i: usize| {
        let radius = region.pupil_radius(TAU * i as f64 / count as f64)?;
        let ray = region.launch.ray(radius.point(1.0))?;
        let mut met = None;
        channel.tracer.visit(ray, |number, at| {
            if number == surface {
                met = Some([at.x, at.y]);
            }
        });
        met
    };
    let outline: Vec<[f64; 2]> = (0..count).filter_map(point).collect();
    if outline.is_empty() {
        return Err(AnalysisError::NoLight);
    }
    let reach = outline.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max);
    let semi_diameter = channel.system.surfaces.get(surface).map(|s| s.semi_diameter);
    Ok(Footprint { outline, reach, semi_diameter: semi_diameter.filter(|rim| rim.is_finite()) })
}
