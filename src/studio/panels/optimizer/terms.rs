//! The title, the unit, the explanation and the default of every term.

use super::scope;
use crate::lens::OperandKind;
use crate::merit::{self, LensFigures, Term, WeightedTerm};
use crate::session::{Analyses, SessionView};
use crate::studio::number;
use crate::studio::panels::{design_results, mean_pupil_area};

/// The deviation below which a term counts as satisfied, relative to its targets: it is of the size of
/// rounding errors.
const ROUNDING: f64 = 1e-12;

/// The title of a term.
pub(super) const fn title(term: Term) -> &'static str {
    match term {
        Term::Spot => "Spot",
        Term::AsBuilt { .. } => "As built",
        Term::SpotIntegral => "Spot × light",
        Term::Wavefront => "RMS wavefront",
        Term::Strehl => "Strehl ratio",
        Term::GeometricMtf { .. } => "Geometric MTF",
        Term::Mtf { .. } => "Diffraction MTF",
        Term::Ghosts { .. } => "Ghosts",
        Term::Throughput => "Throughput",
        Term::ThroughputLoss(_) => "Throughput loss",
        Term::Light(_) => "Light",
        Term::MeanLight(_) => "Mean light",
        Term::RelativeIllumination { .. } => "Relative illumination",
        Term::FNumber(_) => "F-number",
        Term::FocalLength(_) => "Focal length",
        Term::Distortion => "Distortion",
        Term::GlassCenter { .. } => "Glass thickness",
        Term::GlassEdge(_) => "Glass edge",
        Term::AirCenter { .. } => "Air gap",
        Term::AirEdge(_) => "Air edge",
        Term::TotalTrack(_) => "Total track",
        Term::BackFocus(_) => "Back focus",
        Term::Steepness(_) => "Steepness",
        Term::SemiDiameter { .. } => "Semi-diameter",
        Term::Operand { kind, .. } => scope::title(kind),
    }
}

/// The explanation of a term.
pub(super) const fn hint(term: Term) -> &'static str {
    match term {
        Term::Spot => "Mean square spot radius over fields and wavelengths, about the centroids",
        Term::AsBuilt { .. } => {
            "Expected mean square spot radius of lenses that are made with the tolerances of the lens \
             or of a class, each refocused: sharp, and easy to build"
        }
        Term::SpotIntegral => {
            "Square distance from the centroid, integrated over all light that gets through \
             instead of averaged: it falls when light is lost, so combine it with a term for light"
        }
        Term::Wavefront => {
            "Mean square path difference from the sphere about the best image point, in waves: \
             sharpness of a lens near the diffraction limit"
        }
        Term::Strehl => {
            "What the Strehl ratio about the brightest image point lacks of 1: for a lens close to the \
             diffraction limit"
        }
        Term::GeometricMtf { .. } => "Contrast of rays at a spatial frequency below this minimum",
        Term::Mtf { .. } => "Contrast by diffraction at a spatial frequency below this minimum",
        Term::Ghosts { .. } => "Ghosts brighter than this share of the light at the entrance",
        Term::Throughput => {
            "As much light as possible: minus the mean area of the pupils. It has no target; its \
             weight sets how much blur a square millimetre is worth"
        }
        Term::ThroughputLoss(_) => {
            "As much light as possible, counted as a share: one minus the mean area of the pupils \
             over this one"
        }
        Term::Light(_) => {
            "At least this share of the present light of each field: 1 retains it, 1.2 asks for \
             20 % more"
        }
        Term::MeanLight(_) => {
            "At least this share of the present light, as the mean over the fields"
        }
        Term::RelativeIllumination { .. } => {
            "The light of a field over that on the axis not below this share: the ratio of the \
             pupils' areas times cos⁴ of the field angle"
        }
        Term::FNumber(_) => {
            "The f-number of the light that gets through on the axis: focal length over the \
             diameter of a disc as large as the pupil"
        }
        Term::FocalLength(_) => "Square of the deviation of the focal length from the target",
        Term::Distortion => "Distance of the chief rays' image points from the paraxial image",
        Term::GlassCenter { .. } => "Glass thinner or thicker than this on the axis",
        Term::GlassEdge(_) => "Glass thinner than this at the rim",
        Term::AirCenter { .. } => "Air thinner or thicker than this on the axis",
        Term::AirEdge(_) => "Air thinner than this at the rim",
        Term::TotalTrack(_) => "From the first vertex to the image longer than this",
        Term::BackFocus(_) => "From the last vertex to the image shorter than this",
        Term::Steepness(_) => {
            "Curvature times semi-diameter larger than this at some surface; 1 is a hemisphere"
        }
        Term::SemiDiameter { .. } => "Semi-diameters smaller or larger than this",
        Term::Operand { kind, .. } => scope::hint(kind),
    }
}

/// The unit of its targets.
pub(super) const fn unit(term: Term) -> &'static str {
    match term {
        Term::ThroughputLoss(_) => "mm²",
        Term::Light(_) | Term::MeanLight(_) => "× now",
        Term::RelativeIllumination { .. } => "× axis",
        Term::Spot
        | Term::AsBuilt { .. }
        | Term::SpotIntegral
        | Term::Wavefront
        | Term::Strehl
        | Term::GeometricMtf { .. }
        | Term::Mtf { .. }
        | Term::Ghosts { .. }
        | Term::Throughput
        | Term::Distortion
        | Term::FNumber(_)
        | Term::Steepness(_) => "",
        Term::Operand { kind, .. } if kind.is_angle() => "°",
        Term::Operand { kind: OperandKind::Distortion, .. } => "%",
        Term::FocalLength(_)
        | Term::GlassCenter { .. }
        | Term::GlassEdge(_)
        | Term::AirCenter { .. }
        | Term::AirEdge(_)
        | Term::TotalTrack(_)
        | Term::BackFocus(_)
        | Term::Operand { .. }
        | Term::SemiDiameter { .. } => "mm",
    }
}

/// The targets of a term with their names.
pub(super) fn targets(term: &mut Term) -> Vec<(&'static str, &mut f64)> {
    match term {
        Term::Spot
        | Term::AsBuilt { .. }
        | Term::SpotIntegral
        | Term::Wavefront
        | Term::Strehl
        | Term::Throughput
        | Term::Distortion
        | Term::Operand { .. } => Vec::new(),
        Term::GeometricMtf { frequency, min } | Term::Mtf { frequency, min } => {
            vec![("Cycles/mm", frequency), ("Minimum", min)]
        }
        Term::Ghosts { irradiance, reflectance } => {
            let reflectance = reflectance.as_mut().map(|share| ("Reflectance", share));
            std::iter::once(("Irradiance", irradiance)).chain(reflectance).collect()
        }
        Term::GlassCenter { min, max }
        | Term::AirCenter { min, max }
        | Term::SemiDiameter { min, max } => vec![("Minimum", min), ("Maximum", max)],
        Term::FocalLength(target) | Term::FNumber(target) => vec![("Target", target)],
        Term::ThroughputLoss(full) => vec![("Full light", full)],
        Term::Light(least)
        | Term::MeanLight(least)
        | Term::RelativeIllumination { min: least, .. }
        | Term::GlassEdge(least)
        | Term::AirEdge(least)
        | Term::BackFocus(least) => vec![("Minimum", least)],
        Term::TotalTrack(most) | Term::Steepness(most) => vec![("Maximum", most)],
    }
}

/// The value of a term as it is easiest to read.
pub(super) fn value_text(term: Term, value: f64) -> String {
    let short = |value: f64| number::format_digits(value, 3);
    let root = value.max(0.0).sqrt();
    match term {
        Term::SpotIntegral => format!("{} mm⁴", short(value)),
        Term::Throughput => format!("{} mm²", number::format_digits(-value, 4)),
        Term::ThroughputLoss(_) => format!("{} %", short(100.0 * value)),
        Term::Wavefront => format!("{} waves", short(root)),
        Term::Strehl => format!("{} of 1", short(1.0 - value)),
        _ if root < ROUNDING * target_size(term) => "satisfied".to_owned(),
        Term::Light(_) | Term::MeanLight(_) | Term::RelativeIllumination { .. } => {
            format!("{} % short", short(100.0 * root))
        }
        Term::FNumber(_) => format!("off by {}", short(root)),
        Term::GeometricMtf { .. } | Term::Mtf { .. } | Term::Ghosts { .. } => {
            format!("{} short", short(root))
        }
        Term::Steepness(_) => format!("{} over", short(root)),
        Term::Operand { kind, .. } if kind.is_angle() => format!("{}° off", short(root)),
        Term::Operand { kind: OperandKind::Distortion, .. } => format!("{} % off", short(root)),
        _ => format!("{}{}", length_text(root), deviation(term)),
    }
}

/// The size of the numbers that a term asks for, at least 1.
fn target_size(mut term: Term) -> f64 {
    let bounds = match term {
        Term::Operand { min, max, .. } => [min, max],
        _ => [None, None],
    };
    let targets = targets(&mut term).into_iter().map(|(_, target)| *target);
    targets.chain(bounds.into_iter().flatten()).fold(1.0, |size, target| size.max(target.abs()))
}

fn length_text(mm: f64) -> String {
    let short = |value: f64| number::format_digits(value, 3);
    if mm < 0.1 { format!("{} µm", short(1e3 * mm)) } else { format!("{} mm", short(mm)) }
}

/// The word behind a length that is no size but the distance from a target or beyond a limit.
const fn deviation(term: Term) -> &'static str {
    match term {
        Term::FocalLength(_) | Term::Operand { .. } => " off",
        Term::GlassEdge(_) | Term::AirEdge(_) | Term::BackFocus(_) => " short",
        Term::TotalTrack(_) => " over",
        Term::GlassCenter { .. } | Term::AirCenter { .. } | Term::SemiDiameter { .. } => " beyond",
        _ => "",
    }
}

/// True if the term may ask for more light than the lens has.
pub(super) fn can_ask_for_more_light(term: Term) -> bool {
    match term {
        Term::Light(share) | Term::MeanLight(share) => share > 1.0,
        Term::Throughput | Term::ThroughputLoss(_) | Term::FNumber(_) => true,
        _ => false,
    }
}

/// Every term with its default targets and weights for the current lens, rounded.
pub(super) fn default_terms(view: &SessionView) -> Vec<WeightedTerm> {
    let results = design_results(view);
    let figures = LensFigures {
        focal_length: results.and_then(|results| results.first_order().efl),
        light: results.map(mean_pupil_area),
        axial_light: results.and_then(on_axis),
        mean_square_spot: results.and_then(mean_square),
    };
    let terms = merit::default_terms(&view.lens, view.settings.zoom, &figures);
    terms.into_iter().map(rounded).collect()
}

/// The area of the pupil on the axis in mm², the mean over wavelengths.
fn on_axis(numbers: &Analyses) -> Option<f64> {
    let model = &numbers.ray_model.value;
    let spots = numbers.spots.value.iter().flatten();
    let spot = spots.into_iter().find(|spot| spot.field.x == 0.0 && spot.field.y == 0.0)?;
    let weights: f64 = model.channels.iter().map(|color| color.weight).sum();
    let lit = spot.channels.iter().zip(&model.channels);
    let area = lit.filter_map(|(spot, color)| Some(color.weight * spot.as_ref().ok()?.light.value));
    Some(area.sum::<f64>() / weights)
}

fn mean_square(numbers: &Analyses) -> Option<f64> {
    let squares: Vec<f64> =
        numbers.spots.value.iter().flatten().map(|spot| spot.rms.value.powi(2)).collect();
    (!squares.is_empty()).then(|| squares.iter().sum::<f64>() / squares.len() as f64)
}

/// A term with numbers rounded to four digits.
fn rounded(mut weighted: WeightedTerm) -> WeightedTerm {
    let short = |value: f64| number::format_digits(value, 4).parse().unwrap_or(value);
    weighted.weight = short(weighted.weight);
    for (_, target) in targets(&mut weighted.term) {
        *target = short(*target);
    }
    weighted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deviation_is_not_taken_for_the_quantity_itself() {
        let square = |mm: f64| mm * mm;
        let shown = |term, mm| value_text(term, square(mm));
        assert_eq!(shown(Term::Spot, 0.0847), "84.7 µm");
        assert_eq!(shown(Term::FocalLength(35.0), 9.05), "9.05 mm off");
        assert_eq!(shown(Term::GlassEdge(0.5), 0.02), "20 µm short");
        assert_eq!(shown(Term::TotalTrack(50.0), 1.99), "1.99 mm over");
        assert_eq!(shown(Term::FocalLength(35.0), 0.0), "satisfied");
        assert_eq!(shown(Term::FocalLength(49.389), 9.15e-12), "satisfied", "rounding of its size");
        assert_eq!(shown(Term::GlassEdge(0.5), 9.15e-12), "9.15e-9 µm short");
    }
}
