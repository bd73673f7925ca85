//! The footprint of a beam on a surface: the edge of its light there.

use super::{AnalysisError, lit_region};
use crate::lens::{FieldPoint, Surface};
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
    let all = footprints(model, field, wavelength, count)?;
    all.into_iter().nth(surface).ok_or(AnalysisError::NoLight)
}

/// The footprints of a field at a wavelength on all surfaces, the image plane last.
///
/// # Errors
/// As of [`footprint`].
pub fn footprints(
    model: &RayModel,
    field: FieldPoint,
    wavelength: usize,
    count: usize,
) -> Result<Vec<Footprint>, AnalysisError> {
    let region = lit_region(model, field, wavelength)?;
    if matches!(region.kind, RegionKind::Irregular { annulus: None, .. }) {
        return Err(AnalysisError::IrregularPupil);
    }
    let channel = region.launch.channel();
    let surfaces = &channel.system.surfaces;
    let mut outlines = vec![Vec::with_capacity(count); surfaces.len()];
    for i in 0..count {
        let radius = region.pupil_radius(TAU * i as f64 / count as f64);
        let Some(ray) = radius.and_then(|radius| region.launch.ray(radius.point(1.0))) else {
            continue;
        };
        channel.tracer.visit(ray, |number, at| outlines[number].push([at.x, at.y]));
    }
    if outlines.iter().any(Vec::is_empty) {
        return Err(AnalysisError::NoLight);
    }
    let print = |(outline, surface): (Vec<[f64; 2]>, &Surface<f64>)| Footprint {
        reach: outline.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max),
        semi_diameter: Some(surface.semi_diameter).filter(|rim| rim.is_finite()),
        outline,
    };
    Ok(outlines.into_iter().zip(surfaces).map(print).collect())
}
