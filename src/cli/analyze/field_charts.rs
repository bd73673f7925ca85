//! Results that are drawn against the field, from the axis to the edge: distortion, field curvature, lateral
//! colour and illumination.

use super::{AnalysisKind, AnalysisRun};
use crate::analysis::{FieldCurvePoint, field_curves};
use crate::lens::FieldKind;
use crate::plot::{ChartCurve, CurveChart};

/// The charts of a result over the field; none for a result that belongs to each field, and for a lens all
/// of whose fields are on the axis.
pub(super) fn charts(run: &AnalysisRun) -> Vec<CurveChart> {
    let curves: fn(&AnalysisRun, &[FieldCurvePoint]) -> (&'static str, Vec<ChartCurve>) =
        match run.what {
            AnalysisKind::Distortion => distortion,
            AnalysisKind::FieldCurvature => field_curvature,
            AnalysisKind::LateralColor => lateral_color,
            AnalysisKind::Illumination => illumination,
            _ => return Vec::new(),
        };
    let points = field_curves(&run.model, run.accuracy).points;
    if points.is_empty() {
        return Vec::new();
    }
    let field = match run.model.beam.field {
        FieldKind::Angle => "field, degrees",
        FieldKind::ObjectHeight => "field, mm at the object",
        FieldKind::ImageHeight => "field, mm at the image",
    };
    let (name, curves) = curves(run, &points);
    vec![CurveChart::new("over the field", [field, name], curves)]
}

/// A curve of a number of each point.
fn curve(
    name: impl Into<String>,
    color: usize,
    points: &[FieldCurvePoint],
    number: impl Fn(&FieldCurvePoint) -> Option<f64>,
) -> ChartCurve {
    ChartCurve::new(name, color, points.iter().map(|point| (point.height, number(point))))
}

fn distortion(_: &AnalysisRun, points: &[FieldCurvePoint]) -> (&'static str, Vec<ChartCurve>) {
    let percent = |share: Option<f64>| 100.0 * share.unwrap_or(0.0);
    let tangent = |point: &FieldCurvePoint| {
        point.distortion.as_ref().ok().map(|found| percent(found.distortion))
    };
    let in_plane = |point: &FieldCurvePoint| {
        point.distortion.as_ref().ok().map(|found| percent(found.in_plane))
    };
    let angle = |point: &FieldCurvePoint| {
        point.distortion.as_ref().ok().map(|found| percent(found.f_theta))
    };
    let mut curves = vec![
        curve("against f tan(theta)", 0, points, tangent),
        curve("against the paraxial chief ray in the plane", 2, points, in_plane),
    ];
    let has_angle =
        |point: &FieldCurvePoint| point.distortion.as_ref().is_ok_and(|d| d.f_theta.is_some());
    if points.iter().any(has_angle) {
        curves.push(curve("against f theta", 1, points, angle).dashed());
    }
    ("distortion, %", curves)
}

fn field_curvature(_: &AnalysisRun, points: &[FieldCurvePoint]) -> (&'static str, Vec<ChartCurve>) {
    let tangential = |point: &FieldCurvePoint| point.curvature.as_ref().ok()?.tangential;
    let sagittal = |point: &FieldCurvePoint| point.curvature.as_ref().ok()?.sagittal;
    let curves = vec![
        curve("tangential", 0, points, tangential),
        curve("sagittal", 1, points, sagittal).dashed(),
    ];
    ("focus behind the image plane, mm", curves)
}

fn lateral_color(run: &AnalysisRun, points: &[FieldCurvePoint]) -> (&'static str, Vec<ChartCurve>) {
    let of = |(i, um): (usize, f64)| {
        let shift = |point: &FieldCurvePoint| {
            point.lateral_color.as_ref().ok()?.get(i).map(|shift| 1e3 * shift)
        };
        curve(format!("{um} um"), i, points, shift)
    };
    let wavelengths = run.model.channels.iter().map(|channel| channel.um).enumerate();
    ("shift of the chief ray, um", wavelengths.map(of).collect())
}

fn illumination(_: &AnalysisRun, points: &[FieldCurvePoint]) -> (&'static str, Vec<ChartCurve>) {
    let percent = |point: &FieldCurvePoint| Some(100.0 * point.illumination.relative?.value);
    ("relative illumination, %", vec![curve("irradiance", 0, points, percent)])
}
