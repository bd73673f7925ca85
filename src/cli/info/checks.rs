//! Warnings about a lens that cannot be manufactured: negative gaps, semi-diameters beyond the surface.

use crate::lens::{Medium, SurfaceNumber, System};
use crate::trace::Fates;
use serde::Serialize;

/// A warning about a lens.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct LensCheck {
    /// The surface, or the one in front of the gap; `None` for the whole lens.
    #[serde(skip_serializing_if = "Option::is_none")]
    surface: Option<usize>,
    /// The text of the warning.
    found: String,
}

impl LensCheck {
    pub(super) fn line(&self) -> String {
        let place = self
            .surface
            .map(|i| format!("surface {}: ", SurfaceNumber::new(i)))
            .unwrap_or_default();
        format!("  {place}{}", self.found)
    }
}

/// Checks the gaps and semi-diameters of a lens, and the fates of its rays.
pub(super) fn checks(system: &System<f64>, media: &[Medium], fates: Fates) -> Vec<LensCheck> {
    let rows = media.len();
    let mut checks: Vec<LensCheck> = (0..rows).filter_map(|i| rim(system, i)).collect();
    // Behind a mirror gaps are negative, and the edge thickness has another meaning.
    let straight = media.iter().position(|m| *m == Medium::Mirror).unwrap_or(rows);
    checks.extend((0..straight.min(rows - 1)).filter_map(|i| gap(system, i)));
    let lost = fates.total() - fates.imaged;
    if fates.imaged == 0 && lost > 0 {
        let found = format!("no light: none of {lost} rays reaches the image");
        checks.push(LensCheck { surface: None, found });
    }
    checks
}

/// Checks that the surface extends to its semi-diameter.
fn rim(system: &System<f64>, i: usize) -> Option<LensCheck> {
    let surface = &system.surfaces[i];
    let sd = surface.semi_diameter;
    if !sd.is_finite() || surface.hyperhemisphere || surface.shape.sag(sd * sd).is_some() {
        return None;
    }
    let found = format!("the semi-diameter {sd} mm is beyond the edge of the surface");
    Some(LensCheck { surface: Some(i), found })
}

/// Checks the thickness of a gap on the axis and at the edge.
fn gap(system: &System<f64>, i: usize) -> Option<LensCheck> {
    let [before, behind] = [&system.surfaces[i], &system.surfaces[i + 1]];
    let check = |found| Some(LensCheck { surface: Some(i), found });
    if before.thickness < 0.0 {
        return check(format!("the gap behind it is {} mm", before.thickness));
    }
    let rims = [before.semi_diameter, behind.semi_diameter];
    let height = rims.into_iter().filter(|sd| sd.is_finite()).reduce(f64::min)?;
    let sag = |surface: &crate::lens::Surface<f64>| Some(surface.shape.sag(height * height)?.0);
    let edge = before.thickness + sag(behind)? - sag(before)?;
    if edge >= 0.0 {
        return None;
    }
    check(format!("the gap behind it is {edge:.4} mm at {height} mm from the axis"))
}
