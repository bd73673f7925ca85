//! Half ranges in the units of shops.

use crate::cli::output::ShortNumber;
use crate::lens::{PerturbationKind, Tolerance, fringes_of_curvature, sag_of_conic, sag_of_fourth};
use crate::tolerance::NominalLens;
use serde::Serialize;
use std::fmt;

/// A half range of the curvature of a surface in the units of shops.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct PowerUnits {
    /// Fringes at 632.8 nm over the semi-diameter.
    fringes: f64,
    /// The change of the radius in per cent; `None` for a plane.
    percent: Option<f64>,
    /// The change of the radius in mm; `None` for a plane.
    radius_mm: Option<f64>,
}

impl PowerUnits {
    /// The half range of a tolerance of power; `None` for another one.
    pub(super) fn new(tolerance: &Tolerance, lens: &NominalLens) -> Option<Self> {
        let is_power = tolerance.error.kind == PerturbationKind::Curvature;
        let surface = is_power.then_some(tolerance.error.first)?;
        let system = &lens.systems[lens.primary];
        let (bend, rim) = (system.surfaces.get(surface)?, lens.semi_diameters.get(surface)?);
        let (half_range, curvature) = (tolerance.half_range, bend.shape.curvature().abs());
        let bent = (curvature > 0.0).then_some(curvature);
        Some(Self {
            fringes: fringes_of_curvature(half_range, *rim),
            percent: bent.map(|c| 100.0 * half_range / c),
            radius_mm: bent.map(|c| half_range / (c * c)),
        })
    }
}

impl fmt::Display for PowerUnits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} fringes", self.fringes)?;
        let Some((percent, radius)) = self.percent.zip(self.radius_mm) else { return Ok(()) };
        write!(f, ", {} %, {} mm", ShortNumber(percent), ShortNumber(radius))
    }
}

/// A half range with its unit: power in fringes and of the radius, conic constants and coefficients of r⁴ with the
/// change of the sag at the semi-diameter, angles in minutes of arc.
pub(super) fn half_range_text(tolerance: &Tolerance, lens: &NominalLens) -> String {
    if let Some(power) = PowerUnits::new(tolerance, lens) {
        return power.to_string();
    }
    let (kind, value) = (tolerance.error.kind, tolerance.half_range);
    let unit = match kind {
        _ if kind.is_angle() => return format!("{}'", ShortNumber(60.0 * value.to_degrees())),
        PerturbationKind::Abbe => return format!("{} %", ShortNumber(100.0 * value)),
        PerturbationKind::Conic | PerturbationKind::Asphere => {
            return format!("{}{}", ShortNumber(value), sag_text(tolerance, lens));
        }
        PerturbationKind::Index => "",
        PerturbationKind::Curvature => " /mm",
        _ => " mm",
    };
    format!("{}{unit}", ShortNumber(value))
}

/// The change of the sag at the semi-diameter by an error of a conic constant or of a coefficient of r⁴.
fn sag_text(tolerance: &Tolerance, lens: &NominalLens) -> String {
    let (surface, value) = (tolerance.error.first, tolerance.half_range);
    let system = &lens.systems[lens.primary];
    let own = system.surfaces.get(surface).zip(lens.semi_diameters.get(surface));
    let Some((own, rim)) = own.filter(|(_, rim)| **rim > 0.0) else { return String::new() };
    let sag = if tolerance.error.kind == PerturbationKind::Conic {
        sag_of_conic(value, own.shape.curvature(), *rim)
    } else {
        sag_of_fourth(value, *rim)
    };
    format!(" (sag {} um)", ShortNumber(1e3 * sag))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{ToleranceGrade, blank};
    use crate::tolerance::{ToleranceScene, graded_sheet};

    /// Three fringes of the precision class, of a radius of 50 mm and of a plane.
    #[test]
    fn power_is_told_in_fringes_and_of_the_radius() {
        let mut lens = blank();
        lens.surfaces[0].curvature = 0.02;
        let scene = ToleranceScene::new(&lens, 0, 1e-2).unwrap();
        let sheet = graded_sheet(&lens, &scene.lens, ToleranceGrade::Precision);
        let units: Vec<_> =
            sheet.errors.iter().filter_map(|t| PowerUnits::new(t, &scene.lens)).collect();
        let [bent, plane] = units[..] else { panic!("{units:?}") };
        assert!((bent.fringes - 3.0).abs() < 1e-9 && (plane.fringes - 3.0).abs() < 1e-9);
        // 3 × 632.8 nm over 10 mm.
        assert!((bent.percent.unwrap() - 100.0 * 1.8984e-5 / 0.02).abs() < 1e-9, "{bent}");
        assert!((bent.radius_mm.unwrap() - 1.8984e-5 * 2500.0).abs() < 1e-9, "{bent}");
        assert!(plane.percent.is_none() && plane.to_string() == "3.00 fringes");
    }
}
