//! Names and units of errors of making, as the panel shows them.

use crate::lens::{
    AdjustedPart, ErrorDistribution, Perturbation, PerturbationKind, SurfaceNumber,
    fringes_of_curvature,
};
use crate::studio::number;

/// The factor and the unit in which the half range of an error is shown; that of power in fringes where its
/// surface has a semi-diameter.
pub(super) fn shown_unit(error: Perturbation, semi_diameters: &[f64]) -> (f64, &'static str) {
    let rim = semi_diameters.get(error.first).copied().filter(|rim| *rim > 0.0);
    if let (PerturbationKind::Curvature, Some(rim)) = (error.kind, rim) {
        return (fringes_of_curvature(1.0, rim), " fringes");
    }
    match error.kind {
        kind if kind.is_angle() => ANGLE,
        PerturbationKind::Abbe => (100.0, " %"),
        PerturbationKind::Curvature => (1.0, " /mm"),
        PerturbationKind::Conic | PerturbationKind::Asphere | PerturbationKind::Index => (1.0, ""),
        _ => LENGTH,
    }
}

/// Minutes of arc.
const ANGLE: (f64, &str) = (60.0 * 180.0 / std::f64::consts::PI, "'");
/// Micrometres.
const LENGTH: (f64, &str) = (1e3, " µm");

/// The factor and the unit in which the travel of a compensator is shown.
pub(super) fn travel_unit(part: AdjustedPart) -> (f64, &'static str) {
    if part.is_angle() { ANGLE } else { LENGTH }
}

/// The name of a compensator with its surfaces.
pub(super) fn part_name(part: AdjustedPart) -> String {
    part.in_lens().map_or_else(|| travel_name(part).to_owned(), error_name)
}

/// The name of an error with its surfaces.
pub(super) fn error_name(error: Perturbation) -> String {
    format!("{} {}", title(error.kind), surfaces(error))
}

/// A half range with its unit.
pub(super) fn half_range_text(
    error: Perturbation,
    semi_diameters: &[f64],
    half_range: f64,
) -> String {
    let (factor, unit) = shown_unit(error, semi_diameters);
    format!("{}{unit}", number::format_digits(factor * half_range, 3))
}

/// The name of an error in a line of its own.
pub(super) const fn title(kind: PerturbationKind) -> &'static str {
    match kind {
        PerturbationKind::Curvature => "Curvature",
        PerturbationKind::Conic => "Conic constant",
        PerturbationKind::Asphere => "Asphere, r⁴",
        PerturbationKind::Irregularity => "Irregularity",
        PerturbationKind::AsphereSlope => "Slope of asphere",
        PerturbationKind::Thickness => "Thickness",
        PerturbationKind::ThicknessAdjusted => "Thickness, adjusted",
        PerturbationKind::Index => "Index",
        PerturbationKind::Abbe => "Abbe number",
        PerturbationKind::SurfaceDecenterX => "Surface decentre x",
        PerturbationKind::SurfaceDecenterY => "Surface decentre y",
        PerturbationKind::SurfaceTiltX => "Surface tilt x",
        PerturbationKind::SurfaceTiltY => "Surface tilt y",
        PerturbationKind::ElementDecenterX => "Element decentre x",
        PerturbationKind::ElementDecenterY => "Element decentre y",
        PerturbationKind::ElementTiltX => "Element tilt x",
        PerturbationKind::ElementTiltY => "Element tilt y",
        PerturbationKind::ElementRollX => "Element roll x",
        PerturbationKind::ElementRollY => "Element roll y",
    }
}

/// The name of a kind whatever its direction.
pub(super) fn kind_name(kind: PerturbationKind) -> &'static str {
    let name = title(kind);
    name.strip_suffix(" x").or_else(|| name.strip_suffix(" y")).unwrap_or(name)
}

/// The surfaces of an error, counted from 1.
pub(super) fn surfaces(error: Perturbation) -> String {
    place((error.first, error.last))
}

/// Surfaces counted from 1.
pub(super) fn place((first, last): (usize, usize)) -> String {
    let numbers = [first, last].map(SurfaceNumber::new);
    if first == last { numbers[0].to_string() } else { format!("{}–{}", numbers[0], numbers[1]) }
}

/// The name of a kind of compensator.
pub(super) const fn travel_name(part: AdjustedPart) -> &'static str {
    match part {
        AdjustedPart::Focus => "Focus",
        AdjustedPart::SensorTiltX => "Sensor tilt x",
        AdjustedPart::SensorTiltY => "Sensor tilt y",
        AdjustedPart::Lens(own) => title(own.kind),
    }
}

/// Every distribution with a short name and a full one.
pub(super) const DISTRIBUTIONS: [(ErrorDistribution, &str, &str); 5] = [
    (ErrorDistribution::NormalCut, "normal", "Normal, cut at two deviations"),
    (ErrorDistribution::Normal, "uncut", "Normal, not cut"),
    (ErrorDistribution::Uniform, "uniform", "Uniform"),
    (ErrorDistribution::Parabolic, "parabolic", "Parabolic: parts near the ends"),
    (ErrorDistribution::Ends, "ends", "Always at one of the ends"),
];
