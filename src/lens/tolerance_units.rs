//! Units in which shops and drawings state errors of surfaces: fringes, per cent of the radius, and the
//! change of the sag at the rim.
//!
//! A fringe is half a wavelength of 632.8 nm between a surface and its test plate. One of power, counted
//! from the vertex to the rim at the semi-diameter `r`, is a curvature of `λ/r²`; a change of the radius
//! `R` by the share `q` is one of `q/R`. An error of the conic constant or of the coefficient of `r⁴`
//! changes the sag by `κ c³ r⁴/8` and `A r⁴`.

use super::{Compensator, ErrorCorrelation, ErrorDistribution, ToleranceSheet};
use super::{Perturbation, PerturbationKind, Row, SurfaceNumber, Tolerance};
use serde::Deserialize;

/// The wavelength of test plates, in mm.
pub const TEST_WAVELENGTH: f64 = 0.000_632_8;

/// The curvature in 1/mm of fringes of power over a semi-diameter in mm.
pub fn curvature_of_fringes(fringes: f64, semi_diameter: f64) -> f64 {
    fringes * TEST_WAVELENGTH / (semi_diameter * semi_diameter)
}

/// The fringes of power over a semi-diameter in mm of a curvature in 1/mm.
pub fn fringes_of_curvature(curvature: f64, semi_diameter: f64) -> f64 {
    curvature * semi_diameter * semi_diameter / TEST_WAVELENGTH
}

/// The error of a conic constant that changes the sag at a semi-diameter in mm by a length in mm; `None`
/// for a plane, whose sag does not depend on it.
pub fn conic_of_sag(sag: f64, curvature: f64, semi_diameter: f64) -> Option<f64> {
    let conic = 8.0 * sag / (curvature.abs().powi(3) * semi_diameter.powi(4));
    conic.is_finite().then_some(conic)
}

/// The error of the coefficient of r⁴ in mm⁻³ that changes the sag at a semi-diameter in mm by a length
/// in mm.
pub fn fourth_of_sag(sag: f64, semi_diameter: f64) -> f64 {
    sag / semi_diameter.powi(4)
}

/// The change of the sag in mm at a semi-diameter in mm by an error of the conic constant.
pub fn sag_of_conic(conic: f64, curvature: f64, semi_diameter: f64) -> f64 {
    conic * curvature.abs().powi(3) * semi_diameter.powi(4) / 8.0
}

/// The change of the sag in mm at a semi-diameter in mm by an error of the coefficient of r⁴ in mm⁻³.
pub fn sag_of_fourth(fourth: f64, semi_diameter: f64) -> f64 {
    fourth * semi_diameter.powi(4)
}

/// Tolerances as a file states them, with half ranges in any of the units.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StatedTolerances {
    errors: Vec<StatedTolerance>,
    #[serde(default)]
    focus_travel: Option<f64>,
    #[serde(default)]
    compensators: Vec<Compensator>,
    #[serde(default)]
    correlations: Vec<ErrorCorrelation>,
}

/// A tolerance as a file states it.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct StatedTolerance {
    kind: PerturbationKind,
    first: usize,
    #[serde(default)]
    last: Option<usize>,
    /// In the unit of the error; angles in degrees.
    #[serde(default)]
    half_range: Option<f64>,
    /// Of power, over the semi-diameter of the surface.
    #[serde(default)]
    fringes: Option<f64>,
    /// Of power: of the radius.
    #[serde(default)]
    percent: Option<f64>,
    /// Of a conic constant or a coefficient of r⁴: the change of the sag at the rim, in mm.
    #[serde(default)]
    sag: Option<f64>,
    #[serde(default)]
    distribution: ErrorDistribution,
}

impl StatedTolerances {
    /// The tolerances of a lens with these rows.
    ///
    /// # Errors
    /// A half range that is stated twice or not at all, or one in a unit that its surface does not have, in
    /// words.
    pub fn resolved(self, rows: &[Row]) -> Result<ToleranceSheet, String> {
        let resolved = |(place, stated): (usize, &StatedTolerance)| {
            let why = |why| format!("errors[{place}] of the tolerances: {why}");
            stated.resolved(rows).map_err(why)
        };
        let errors = self.errors.iter().enumerate().map(resolved);
        Ok(ToleranceSheet {
            errors: errors.collect::<Result<_, _>>()?,
            focus_travel: self.focus_travel,
            compensators: self.compensators,
            correlations: self.correlations,
        })
    }
}

/// The keys of a half range, as an expectation.
const HALF_RANGES: &str = "one of half_range, fringes, percent and sag";

impl StatedTolerance {
    fn resolved(&self, rows: &[Row]) -> Result<Tolerance, String> {
        let Self { kind, first, last, distribution, .. } = *self;
        let refuse = |found: &str, expected: &str| {
            let name = kind.name();
            let surface = SurfaceNumber::new(first);
            Err(format!("`{name}` of surface {surface}: found {found}; expected {expected}"))
        };
        let row = rows.get(first);
        let rim = row.and_then(|row| row.semi_diameter).filter(|rim| *rim > 0.0);
        let no_rim = || refuse("no semi-diameter of it", "one, or a `half_range`");
        let stated = [self.half_range, self.fringes, self.percent, self.sag];
        match stated.iter().flatten().count() {
            0 => return refuse("no half range", HALF_RANGES),
            1 => {}
            _ => return refuse("several half ranges", HALF_RANGES),
        }
        let curvature = row.map_or(0.0, |row| row.curvature);
        let half_range = match (kind, stated) {
            (_, [Some(value), ..]) if kind.is_angle() => value.to_radians(),
            (_, [Some(value), ..]) => value,
            (PerturbationKind::Curvature, [_, Some(fringes), ..]) => match rim {
                Some(rim) => curvature_of_fringes(fringes, rim),
                None => return no_rim(),
            },
            (PerturbationKind::Curvature, [_, _, Some(percent), _]) if curvature != 0.0 => {
                0.01 * percent * curvature.abs()
            }
            (PerturbationKind::Curvature, [_, _, Some(_), _]) => {
                return refuse("a share of the radius of a plane", "fringes or a half_range");
            }
            (PerturbationKind::Asphere, [.., Some(sag)]) => match rim {
                Some(rim) => fourth_of_sag(sag, rim),
                None => return no_rim(),
            },
            (PerturbationKind::Conic, [.., Some(sag)]) => match rim {
                Some(rim) => match conic_of_sag(sag, curvature, rim) {
                    Some(conic) => conic,
                    None => return refuse("a sag of a plane", "a curved surface"),
                },
                None => return no_rim(),
            },
            _ => return refuse("a unit that it does not have", "a half_range"),
        };
        let error = Perturbation { kind, first, last: last.unwrap_or(first) };
        Ok(Tolerance { error, half_range, distribution })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolved(tolerance: &str) -> Result<f64, String> {
        let text = format!(r#"{{"errors": [{tolerance}]}}"#);
        let stated: StatedTolerances = serde_json::from_str(&text).unwrap();
        let bent = Row { curvature: 0.02, semi_diameter: Some(10.0), ..Row::default() };
        let rows = [bent, Row::default()];
        stated.resolved(&rows).map(|sheet| sheet.errors[0].half_range)
    }

    /// One fringe over 10 mm: 632.8 nm/100 mm². One per cent of a radius of 50 mm: 0.01/50.
    #[test]
    fn power_is_stated_in_fringes_or_per_cent_and_an_asphere_by_its_sag() {
        let near = |text: &str, value: f64| {
            let found = resolved(text).unwrap();
            assert!((found / value - 1.0).abs() < 1e-12, "{text}: {found}");
        };
        near(r#"{"kind": "curvature", "first": 0, "fringes": 1}"#, 6.328e-6);
        near(r#"{"kind": "curvature", "first": 0, "percent": 1}"#, 2e-4);
        near(r#"{"kind": "curvature", "first": 0, "half_range": 1e-5}"#, 1e-5);
        near(r#"{"kind": "asphere", "first": 0, "sag": 1e-3}"#, 1e-7);
        near(r#"{"kind": "conic", "first": 0, "sag": 1e-3}"#, 0.1);
        near(r#"{"kind": "surface_tilt_x", "first": 0, "half_range": 1}"#, 1.0_f64.to_radians());
        assert!((fringes_of_curvature(6.328e-6, 10.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_unit_that_a_surface_does_not_have_is_refused_by_name() {
        for (text, why) in [
            (r#"{"kind": "curvature", "first": 1, "fringes": 1}"#, "semi-diameter"),
            (r#"{"kind": "curvature", "first": 1, "percent": 1}"#, "plane"),
            (r#"{"kind": "thickness", "first": 0, "fringes": 1}"#, "half_range"),
            (r#"{"kind": "curvature", "first": 0}"#, "no half range"),
            (r#"{"kind": "curvature", "first": 0, "fringes": 1, "percent": 1}"#, "several"),
        ] {
            let found = resolved(text).unwrap_err();
            assert!(found.contains(why) && found.contains("surface"), "{found}");
        }
    }
}
