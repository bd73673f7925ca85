//! Contrast against spatial frequency, over the field and through focus: tangential full, sagittal dashed.

use super::{Subject, ms_text};
use crate::analysis::{ContrastAtHeight, MtfPoint};
use crate::plot::{ChartCurve, CurveChart};
use crate::report::{AnalysisFigure, note_number};

/// Both sections of some points, over the number that each names.
fn sections(name: &str, color: usize, points: &[MtfPoint]) -> [ChartCurve; 2] {
    let curve = |section: &str, of: fn(&MtfPoint) -> f64| {
        let points = points.iter().map(|point| (point.frequency, Some(of(point))));
        ChartCurve::new(format!("{name} {section}"), color, points)
    };
    [
        curve("T", |point| point.tangential.modulus.value),
        curve("S", |point| point.sagittal.modulus.value).dashed(),
    ]
}

/// The largest error of some points.
fn largest_error<'a>(points: impl IntoIterator<Item = &'a MtfPoint>) -> f64 {
    let both = points.into_iter().flat_map(|point| [point.tangential, point.sagittal]);
    both.map(|value| value.modulus.error).fold(0.0, f64::max)
}

/// The contrast of the fields against frequency, with the limit that diffraction sets.
pub(super) fn over_frequency(subject: &Subject<'_>) -> Option<AnalysisFigure> {
    let found = subject.numbers.contrasts.as_ref()?;
    let (mut curves, mut notes) = (Vec::new(), vec!["all wavelengths by their weights".to_owned()]);
    if let Some(limit) = &found.value.limit {
        let points = found.value.frequencies.iter().zip(limit).map(|(nu, v)| (*nu, Some(*v)));
        curves.push(ChartCurve::new("diffraction limit", 0, points).neutral().dashed());
    }
    for (i, field) in found.value.fields.iter().enumerate() {
        let name = subject.field(i);
        match &field.value {
            Ok(contrast) => {
                let curve = &contrast.curve;
                curves.extend(sections(&name, i, &curve.points));
                let error = largest_error(&curve.points);
                let rays =
                    contrast.without_diffraction.map(|why| format!(", by rays alone: {why}"));
                let (rays, ms) = (rays.unwrap_or_default(), ms_text(field.ms));
                notes.push(format!("{name}: ± {error:.0e}, {} rays, {ms}{rays}", curve.rays));
            }
            Err(why) => notes.push(format!("{name}: {why}")),
        }
    }
    let chart = CurveChart::new("Contrast", ["cycles/mm", "contrast"], curves);
    Some(AnalysisFigure { rows: vec![vec![chart]], notes, ..AnalysisFigure::default() })
}

/// The contrast at a few frequencies over the field.
pub(super) fn over_field(subject: &Subject<'_>) -> Option<AnalysisFigure> {
    let found = subject.numbers.field_contrast.as_ref()?;
    let points = &found.value.points;
    let mut curves = Vec::new();
    for (k, nu) in found.value.frequencies.iter().enumerate() {
        let at = |of: fn(&MtfPoint) -> f64| {
            points.iter().map(move |point| {
                (point.height, point.curve.as_ref().ok().map(|curve| of(&curve.points[k])))
            })
        };
        let name = format!("{}/mm", note_number(*nu));
        let tangential = at(|point| point.tangential.modulus.value);
        curves.push(ChartCurve::new(format!("{name} T"), k, tangential));
        let sagittal = at(|point| point.sagittal.modulus.value);
        curves.push(ChartCurve::new(format!("{name} S"), k, sagittal).dashed());
    }
    let lit = || points.iter().filter_map(|point| point.curve.as_ref().ok());
    let error = largest_error(lit().flat_map(|curve| &curve.points));
    let rays: usize = lit().map(|curve| curve.rays).sum();
    let cost = format!("± {error:.0e}, {rays} rays, {}", ms_text(found.ms));
    let mut notes = vec!["all wavelengths by their weights".to_owned(), cost];
    let dark = |point: &ContrastAtHeight| {
        let why = point.curve.as_ref().err()?;
        Some(format!("field {}: {why}", note_number(point.height)))
    };
    notes.extend(points.iter().filter_map(dark));
    let by_rays = points.iter().filter(|point| point.without_diffraction.is_some()).count();
    if by_rays > 0 {
        notes.push(format!("by rays alone at {by_rays} of {} heights", points.len()));
    }
    let chart = CurveChart::new("Contrast", [subject.field_axis(), "contrast"], curves);
    Some(AnalysisFigure { rows: vec![vec![chart]], notes, ..AnalysisFigure::default() })
}

/// The contrast of the fields at a frequency through focus.
pub(super) fn through_focus(subject: &Subject<'_>) -> Option<AnalysisFigure> {
    let found = subject.numbers.focus_contrasts.as_ref()?;
    let frequency = note_number(found.value.frequency);
    let about = format!("{frequency} cycles/mm by diffraction at {}", subject.primary());
    let (mut curves, mut notes) = (Vec::new(), vec![about]);
    for (i, field) in found.value.fields.iter().enumerate() {
        let name = subject.field(i);
        match &field.value {
            Ok(points) => {
                curves.extend(sections(&name, i, points));
                let rays = points.first().map_or(0, |point| point.tangential.modulus.rays);
                let (error, ms) = (largest_error(points), ms_text(field.ms));
                notes.push(format!("{name}: ± {error:.0e}, {rays} rays, {ms}"));
            }
            Err(why) => notes.push(format!("{name}: {why}")),
        }
    }
    let axes = ["shift of the image plane, mm", "contrast"];
    let chart = CurveChart::new(format!("{frequency} cycles/mm"), axes, curves);
    Some(AnalysisFigure { rows: vec![vec![chart]], notes, ..AnalysisFigure::default() })
}
