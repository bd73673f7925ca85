//! Aperture, fields and wavelengths.

use crate::files::error::ParseError;
use crate::files::report::{ConversionOutcome, ConversionReport};
use crate::files::vignetting::{PupilFactors, ZoomedFactors};
use crate::files::zemax::file::{ApertureLine, ConfigurationOperand, FACTORS, ZemaxFile};
use crate::lens::glass;
use crate::lens::{Aperture, FieldKind, FieldPoint, Fields, Lens, Medium, Object, Wavelength};
use crate::paraxial::{Beam, first_order};

/// The aperture of the whole lens.
pub(super) fn aperture(
    file: &ZemaxFile,
    stop: usize,
    object_medium: &Medium,
) -> Result<Aperture, ParseError> {
    let wrong = |line: usize, found: String, expected: &str| {
        Err(ParseError { place: format!("line {line}"), found, expected: expected.to_owned() })
    };
    let Some((aperture, line)) = file.aperture else {
        let line = file.surfaces[0].line;
        return wrong(line, "no aperture before it".to_owned(), "ENPD, FNUM, OBNA or FLOA");
    };
    match aperture {
        ApertureLine::Diameter(v) if v > 0.0 => Ok(Aperture::EntrancePupilDiameter(v * file.unit)),
        ApertureLine::FNumber { value, .. } if value > 0.0 => Ok(Aperture::FNumber(value)),
        ApertureLine::ObjectNa(v) if v > 0.0 => Ok(Aperture::ObjectNa(v)),
        ApertureLine::ObjectConeDegrees(v) if v > 0.0 && v < 90.0 => {
            Ok(Aperture::ObjectNa(index(object_medium) * v.to_radians().sin()))
        }
        ApertureLine::FloatByStop => match file.surfaces[stop].semi_diameter {
            Some(given) => Ok(Aperture::StopSemiDiameter(given.value * file.unit)),
            None => wrong(line, "FLOA and no DIAM on the stop".to_owned(), "a DIAM on the stop"),
        },
        other => wrong(line, format!("{other:?}"), "a number above 0, a cone below 90 degrees"),
    }
}

/// Replaces an f-number for an object at infinity by the entrance pupil diameter if the object is at a
/// finite distance, where an f-number here means the working one.
pub(super) fn infinite_f_number(file: &ZemaxFile, lens: &mut Lens, report: &mut ConversionReport) {
    let Some((ApertureLine::FNumber { value, working: false }, line)) = file.aperture else {
        return;
    };
    if lens.object == Object::Infinity {
        return;
    }
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).ok();
    let data = system.and_then(|system| first_order(&system, &Beam::for_lens(lens, 0)).ok());
    let Some(efl) = data.and_then(|data| data.efl) else { return };
    let diameter = efl.abs() / value;
    lens.aperture = Aperture::EntrancePupilDiameter(diameter);
    let note = format!("as the entrance pupil diameter {diameter} mm");
    report.amend(line, ConversionOutcome::Approximated, note);
}

fn index(medium: &Medium) -> f64 {
    match medium {
        Medium::Air | Medium::Mirror => 1.0,
        Medium::Index(n) | Medium::Model { nd: n, .. } => *n,
        Medium::Glass(name) => glass::find(name).map_or(1.0, |glass| glass.nd),
        Medium::Grin(gradient) => index(&gradient.base),
    }
}

/// The field points: the number that the file states, or in older files up to the last that is not 0.
pub(super) fn fields(file: &ZemaxFile) -> Result<Fields, ParseError> {
    let lines = &file.fields;
    let (kind, line) = lines.kind.unwrap_or((0, 0));
    let given = lines.x.len().max(lines.y.len()).max(1);
    let last = |values: &[f64]| values.iter().rposition(|v| *v != 0.0).map_or(1, |i| i + 1);
    let count = lines.count.unwrap_or(last(&lines.x).max(last(&lines.y))).min(given);
    let at = |values: &[f64], i: usize, default: f64| values.get(i).copied().unwrap_or(default);
    let scale = if matches!(kind, 0 | 4) { 1.0 } else { file.unit };
    let values: Vec<FieldPoint> = (0..count)
        .map(|i| {
            let [x, y] = [&lines.x, &lines.y].map(|values| at(values, i, 0.0) * scale);
            let weight = at(&lines.weights, i, 1.0);
            match kind {
                0 => FieldPoint::from_projected_angles([x, y], weight),
                _ => FieldPoint { x, y, weight },
            }
        })
        .collect();
    if kind == 4 && values.iter().any(|field| field.x != 0.0) {
        let found = "theodolite angles with fields in x".to_owned();
        let expected = "field angles (FTYP 0)".to_owned();
        return Err(ParseError { place: format!("line {line}"), found, expected });
    }
    let kind = match kind {
        1 => FieldKind::ObjectHeight,
        2 | 3 => FieldKind::ImageHeight,
        _ => FieldKind::Angle,
    };
    Ok(Fields { kind, values })
}

/// The vignetting factors of the fields at every zoom position; empty without any in the file.
pub(super) fn vignetting(file: &ZemaxFile, fields: usize) -> ZoomedFactors {
    let zoomed = || file.operands.iter().filter(|own| FACTORS.contains(&own.name.as_str()));
    if file.vignetting.iter().all(Vec::is_empty) && zoomed().next().is_none() {
        return Vec::new();
    }
    let at = |zoom: usize, kind: usize, field: usize| {
        let is_it = |own: &&ConfigurationOperand| {
            own.name == FACTORS[kind] && (own.configuration, own.target) == (zoom + 1, field + 1)
        };
        let base = file.vignetting[kind].get(field).copied().unwrap_or(0.0);
        zoomed().find(is_it).map_or(base, |own| own.value)
    };
    let factors = |zoom, field| PupilFactors {
        decenter: [at(zoom, 0, field), at(zoom, 1, field)],
        compression: [at(zoom, 2, field), at(zoom, 3, field)],
        angle: at(zoom, 4, field),
    };
    let position = |zoom| (0..fields).map(|field| factors(zoom, field)).collect();
    (0..file.configurations).map(position).collect()
}

/// Wavelength and weight of unused wavelength lines.
const PADDING: (f64, f64) = (0.55, 1.0);

/// The wavelengths: the number that the file states, or all before the unused ones.
pub(super) fn wavelengths(
    file: &ZemaxFile,
    report: &mut ConversionReport,
) -> Result<Vec<Wavelength>, ParseError> {
    let lines = &file.waves;
    let mut numbered = lines.numbered.clone();
    numbered.sort_by_key(|(index, ..)| *index);
    let mut all: Vec<(f64, f64)> =
        numbered.iter().map(|(_, um, weight, _)| (*um, *weight)).collect();
    if all.is_empty() {
        let weight = |i| lines.weights.get(i).copied().unwrap_or(1.0);
        all = lines.list.iter().enumerate().map(|(i, um)| (*um, weight(i))).collect();
    }
    let padding = all.iter().rev().take_while(|wave| **wave == PADDING).count();
    let unpadded = (all.len() - padding).max(1);
    all.truncate(lines.count.unwrap_or(unpadded));
    for (.., line) in numbered.iter().skip(all.len()) {
        report.amend(*line, ConversionOutcome::Preserved, "beyond the number of wavelengths");
    }
    if all.is_empty() {
        let place = format!("line {}", file.surfaces[0].line);
        let found = "no wavelengths before it".to_owned();
        return Err(ParseError { place, found, expected: "WAVM lines".to_owned() });
    }
    let primary = lines.primary.filter(|(index, _)| (1..=all.len()).contains(index));
    if let (None, Some((_, line))) = (primary, lines.primary) {
        report.amend(
            line,
            ConversionOutcome::Approximated,
            "no such wavelength: the middle one is primary",
        );
    }
    let marked = |i| primary.is_some_and(|(index, _)| index == i + 1);
    let waves = all.into_iter().enumerate();
    Ok(waves.map(|(i, (um, weight))| Wavelength { um, weight, primary: marked(i) }).collect())
}
