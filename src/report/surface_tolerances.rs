//! The tolerances of a surface in a few words, to stand beside it in a prescription.

use crate::lens::{Lens, Perturbation, PerturbationKind, SurfaceNumber, Tolerance};
use crate::math::ShortNumber;

/// The half ranges of a surface, of the gap behind it, and of the elements that begin with it, as in
/// `R 0.1 %, t 0.05, tilt 2'`: lengths in mm, angles in minutes of arc; both directions are told once where
/// they are alike. Empty without tolerances.
pub fn surface_tolerances(lens: &Lens, surface: usize) -> String {
    let Some(sheet) = &lens.tolerances else { return String::new() };
    let own: Vec<&Tolerance> =
        sheet.errors.iter().filter(|own| own.error.first == surface).collect();
    let mut words: Vec<String> = Vec::with_capacity(own.len());
    for tolerance in &own {
        let Perturbation { kind, first, last } = tolerance.error;
        let (name, direction) = short_name(kind);
        let is_twin = |other: &&&Tolerance| {
            let (twin, along) = short_name(other.error.kind);
            let place = (other.error.first, other.error.last) == (first, last);
            twin == name && along != direction && place && other.half_range == tolerance.half_range
        };
        let has_twin = !direction.is_empty() && own.iter().any(|other| is_twin(&other));
        if has_twin && direction == "y" {
            continue;
        }
        let body = if kind.moves_a_body() {
            format!("{}-{} ", SurfaceNumber::new(first), SurfaceNumber::new(last))
        } else {
            String::new()
        };
        let along =
            if direction.is_empty() || has_twin { String::new() } else { format!(" {direction}") };
        let value = value_text(lens, tolerance);
        words.push(format!("{body}{name}{along} {value}"));
    }
    words.join(", ")
}

/// The short name of a kind, and its direction.
const fn short_name(kind: PerturbationKind) -> (&'static str, &'static str) {
    match kind {
        PerturbationKind::Curvature => ("R", ""),
        PerturbationKind::Conic => ("conic", ""),
        PerturbationKind::Asphere => ("r\u{2074}", ""),
        PerturbationKind::Irregularity => ("irr", ""),
        PerturbationKind::AsphereSlope => ("slope", ""),
        PerturbationKind::Thickness => ("t", ""),
        PerturbationKind::ThicknessAdjusted => ("t adjusted", ""),
        PerturbationKind::Index => ("n", ""),
        PerturbationKind::Abbe => ("v", ""),
        PerturbationKind::SurfaceDecenterX | PerturbationKind::ElementDecenterX => {
            ("decentre", "x")
        }
        PerturbationKind::SurfaceDecenterY | PerturbationKind::ElementDecenterY => {
            ("decentre", "y")
        }
        PerturbationKind::SurfaceTiltX | PerturbationKind::ElementTiltX => ("tilt", "x"),
        PerturbationKind::SurfaceTiltY | PerturbationKind::ElementTiltY => ("tilt", "y"),
        PerturbationKind::ElementRollX => ("roll", "x"),
        PerturbationKind::ElementRollY => ("roll", "y"),
    }
}

/// A half range with its unit; that of a curvature as a part of the radius.
fn value_text(lens: &Lens, Tolerance { error, half_range, .. }: &Tolerance) -> String {
    let short = |value: f64| ShortNumber(rounded(value));
    match error.kind {
        kind if kind.is_angle() => format!("{}'", short(60.0 * half_range.to_degrees())),
        PerturbationKind::Abbe => format!("{} %", short(100.0 * half_range)),
        PerturbationKind::Curvature => {
            let curvature = lens.surfaces.get(error.first).map_or(0.0, |row| row.curvature);
            if curvature == 0.0 {
                format!("plane, {} /mm", short(*half_range))
            } else {
                format!("{} %", short(100.0 * half_range / curvature.abs()))
            }
        }
        _ => short(*half_range).to_string(),
    }
}

/// A number with three digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::{bundled_lenses, json};
    use crate::lens::{ErrorDistribution, ToleranceSheet};
    use PerturbationKind as Kind;

    #[test]
    fn a_surface_has_its_half_ranges_in_a_few_words() {
        let found = bundled_lenses().iter().find(|own| own.name == "achromat_ac254_100").unwrap();
        let mut lens = json::read(found.text, found.name).unwrap();
        assert_eq!(surface_tolerances(&lens, 0), "");
        let c = lens.surfaces[0].curvature;
        let minute = (1.0_f64 / 60.0).to_radians();
        let tolerance = |kind, (first, last): (usize, usize), half_range: f64| Tolerance {
            error: Perturbation { kind, first, last },
            half_range,
            distribution: ErrorDistribution::default(),
        };
        let errors = vec![
            tolerance(Kind::Curvature, (0, 0), 0.001 * c),
            tolerance(Kind::Thickness, (0, 0), 0.05),
            tolerance(Kind::SurfaceTiltX, (0, 0), 2.0 * minute),
            tolerance(Kind::SurfaceTiltY, (0, 0), 2.0 * minute),
            tolerance(Kind::ElementDecenterX, (0, 2), 0.02),
            tolerance(Kind::ElementDecenterY, (0, 2), 0.01),
        ];
        lens.tolerances = Some(ToleranceSheet::of_errors(errors));
        let expected = "R 0.1 %, t 0.05, tilt 2', 1-3 decentre x 0.02, 1-3 decentre y 0.01";
        assert_eq!(surface_tolerances(&lens, 0), expected);
        assert_eq!(surface_tolerances(&lens, 1), "");
    }
}
