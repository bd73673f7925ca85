//! Results over the field, over the zones of the pupil, and surface by surface.

use super::{Subject, ms_text};
use crate::analysis::{FieldCurvePoint, GridPoint, LongitudinalAberration};
use crate::paraxial::{SEIDEL_SUM_NAMES, SeidelSums};
use crate::plot::{ChartCurve, CurveChart};
use crate::report::{AnalysisFigure, CurveColors, note_number};

/// A curve of a number of each point of the field.
fn curve(
    name: impl Into<String>,
    color: usize,
    points: &[FieldCurvePoint],
    number: impl Fn(&FieldCurvePoint) -> Option<f64>,
) -> ChartCurve {
    ChartCurve::new(name, color, points.iter().map(|point| (point.height, number(point))))
}

/// Distortion, field curvature, lateral colour where there are several wavelengths, and illumination.
pub(super) fn curves(subject: &Subject<'_>) -> Option<AnalysisFigure> {
    let found = subject.numbers.field_curves.as_ref()?;
    let points = &found.value.points[..];
    let axis = subject.field_axis();
    let mut charts = vec![distortion(points, axis)];
    let focus = |point: &FieldCurvePoint| point.curvature.as_ref().ok().copied();
    let foci = vec![
        curve("tangential", 0, points, |point| focus(point)?.tangential),
        curve("sagittal", 1, points, |point| focus(point)?.sagittal).dashed(),
    ];
    charts.push(CurveChart::new("Field curvature, mm", [axis, "mm"], foci));
    if subject.wavelengths().len() > 1 {
        charts.push(lateral_color(subject, points, axis));
    }
    let light = |point: &FieldCurvePoint| Some(100.0 * point.illumination.relative?.value);
    let light = vec![curve("illumination", 0, points, light)];
    charts.push(CurveChart::new("Relative illumination, %", [axis, "%"], light));
    let lights = || points.iter().filter_map(|point| point.illumination.relative);
    let error = lights().map(|light| 100.0 * light.error).fold(0.0, f64::max);
    let rays: usize = lights().map(|light| light.rays).sum();
    let about = format!("primary wavelength {}", subject.primary());
    let cost = format!("illumination ± {error:.1e} %; {rays} rays, {}", ms_text(found.ms));
    Some(AnalysisFigure {
        rows: charts.chunks(2).map(<[CurveChart]>::to_vec).collect(),
        notes: vec![about, cost],
        ..AnalysisFigure::default()
    })
}

/// The distortion in the image plane, and that of the paraxial image where a defocus tells them apart. On
/// the axis both heights vanish, and their ratio has no value.
fn distortion(points: &[FieldCurvePoint], axis: &'static str) -> CurveChart {
    let number = |point: &FieldCurvePoint| {
        let found = point.distortion.as_ref().ok()?;
        let [plane, focus] = [found.in_plane.or(found.distortion)?, found.distortion?];
        Some([plane, focus].map(|share| 100.0 * share))
    };
    let both: Vec<(f64, [f64; 2])> =
        points.iter().filter_map(|point| Some((point.height, number(point)?))).collect();
    let of = |k: usize| both.iter().map(move |(height, v)| (*height, Some(v[k])));
    let mut curves = vec![ChartCurve::new("image plane", 0, of(0))];
    if both.iter().any(|(_, [plane, focus])| (plane - focus).abs() > 1e-3) {
        curves.push(ChartCurve::new("paraxial image", 1, of(1)).dashed());
    }
    CurveChart::new("Distortion, %", [axis, "%"], curves)
}

/// The lateral colour: a curve for each wavelength but the primary one.
fn lateral_color(
    subject: &Subject<'_>,
    points: &[FieldCurvePoint],
    axis: &'static str,
) -> CurveChart {
    let primary = subject.numbers.ray_model.value.primary;
    let others = (0..subject.wavelengths().len()).filter(|i| *i != primary);
    let of = |(k, i): (usize, usize)| {
        let shift =
            |point: &FieldCurvePoint| Some(1e3 * point.lateral_color.as_ref().ok()?.get(i)?);
        let found = curve(subject.wavelength(i), k, points, shift);
        if k > 0 { found.dashed() } else { found }
    };
    let curves = others.enumerate().map(of).collect();
    CurveChart::new("Lateral colour, µm", [axis, "µm"], curves)
}

/// The crossings with the axis over the pupil, which stands upright, and axial colour.
pub(super) fn longitudinal(subject: &Subject<'_>) -> Option<AnalysisFigure> {
    let found = subject.numbers.longitudinal.as_ref()?;
    let colors = match &found.value {
        Ok(colors) => colors,
        Err(why) => {
            return Some(AnalysisFigure { notes: vec![why.to_string()], ..Default::default() });
        }
    };
    let curve = |color: &LongitudinalAberration| {
        let zones = color.zones.iter().map(|zone| (zone.pupil, zone.focus));
        let name = subject.wavelength(color.wavelength);
        ChartCurve::new(name, color.wavelength, zones).transposed()
    };
    let axes = ["focus behind the image plane, mm", "pupil"];
    let curves = colors.iter().map(curve).collect();
    let paraxial = |color: &LongitudinalAberration| color.zones.first().and_then(|zone| zone.focus);
    let primary = colors.get(subject.numbers.ray_model.value.primary).and_then(paraxial);
    let axial = colors.iter().filter_map(|color| {
        let shift = paraxial(color)? - primary?;
        let name = subject.wavelength(color.wavelength);
        Some(format!("axial colour {name}: {} mm", note_number(shift)))
    });
    let rays: usize = colors.iter().map(|color| color.zones.len()).sum();
    let zones = colors.iter().flat_map(|color| &color.zones);
    let error = zones.map(|zone| zone.error).filter(|error| error.is_finite()).fold(0.0, f64::max);
    let cost = format!("± {error:.0e} mm by rounding, {rays} rays, {}", ms_text(found.ms));
    Some(AnalysisFigure {
        rows: vec![vec![CurveChart::new("Longitudinal aberration", axes, curves)]],
        notes: axial.chain([cost]).collect(),
        colors: CurveColors::Wavelengths(subject.wavelengths()),
        ..AnalysisFigure::default()
    })
}

/// The image of a square grid as crosses over the grid of a lens without distortion.
pub(super) fn grid(subject: &Subject<'_>) -> Option<AnalysisFigure> {
    let found = subject.numbers.grid.as_ref()?;
    let points = match &found.value {
        Ok(points) => points,
        Err(why) => {
            return Some(AnalysisFigure { notes: vec![why.to_string()], ..Default::default() });
        }
    };
    let side = (points.len() as f64).sqrt().round() as usize;
    let lines = |at: &dyn Fn(&GridPoint) -> Option<[f64; 2]>| {
        let of = |index: &dyn Fn(usize, usize) -> usize| {
            let line = |i: usize| (0..side).filter_map(|j| at(&points[index(i, j)])).collect();
            (0..side).map(line).collect::<Vec<Vec<[f64; 2]>>>()
        };
        [of(&|i, j| i * side + j), of(&|i, j| j * side + i)].concat()
    };
    let curve = |name: &str, color, pieces: Vec<Vec<[f64; 2]>>| {
        let pieces = pieces.into_iter().filter(|piece| !piece.is_empty()).collect();
        ChartCurve { name: name.to_owned(), color, dashed: false, pieces }
    };
    let ideal = curve("without distortion", 1, lines(&|point| Some(point.ideal))).dashed();
    let real = curve("chief rays", 0, lines(&|point| point.real.ok()));
    let largest = points.iter().filter_map(GridPoint::distortion).fold(0.0, f64::max);
    let rays = points.iter().filter(|point| point.real.is_ok()).count();
    let about = format!(
        "largest distance from the ideal point: {} % of its height",
        note_number((1e6 * largest).round() / 1e4)
    );
    let lost = points.len() - rays;
    let lost = (lost > 0).then(|| format!("{lost} points of the grid have no chief ray"));
    let cost = format!("{rays} rays, {}", ms_text(found.ms));
    Some(AnalysisFigure {
        rows: vec![vec![CurveChart::map("Distortion grid", ["x, mm", "y, mm"], vec![ideal, real])]],
        tables: grid_tables(points),
        notes: std::iter::once(about).chain(lost).chain([cost]).collect(),
        ..AnalysisFigure::default()
    })
}

/// The points of the grid in the order of the grid, each as often as its chief ray arrives.
fn grid_tables(points: &[GridPoint]) -> Vec<CurveChart> {
    let curve = |name: &str, color, places: Vec<[f64; 2]>| ChartCurve {
        name: name.to_owned(),
        color,
        dashed: false,
        pieces: vec![places],
    };
    let ideal = points.iter().map(|point| point.ideal).collect();
    let real = points.iter().filter_map(|point| point.real.ok()).collect();
    let curves = vec![curve("ideal", 1, ideal), curve("real", 0, real)];
    vec![CurveChart::map("points, row by row from below", ["x, mm", "y, mm"], curves)]
}

/// The third-order sums as bars over the surfaces, the whole lens last, in micrometres.
pub(super) fn seidel(subject: &Subject<'_>) -> Result<AnalysisFigure, String> {
    let found = &subject.numbers.seidel;
    let Some(seidel) = &found.value else {
        return Err("the lens has no third-order sums".to_owned());
    };
    let count = seidel.surfaces.len();
    let chart = |(k, (symbol, meaning)): (usize, &(&str, &str))| {
        let bar = |(i, sums): (usize, &SeidelSums<f64>)| [(i + 1) as f64, 1e3 * sums.to_array()[k]];
        let bars: Vec<[f64; 2]> = seidel.surfaces.iter().enumerate().map(bar).collect();
        let sum = [[(count + 1) as f64, 1e3 * seidel.total.to_array()[k]]];
        let curves =
            vec![ChartCurve::bars("surface", 0, &bars, 0.0), ChartCurve::bars("sum", 1, &sum, 0.0)];
        CurveChart::new(format!("{symbol} {meaning}, µm"), ["surface", "µm"], curves)
    };
    let charts: Vec<CurveChart> = SEIDEL_SUM_NAMES.iter().enumerate().map(chart).collect();
    let tables = charts.iter().map(without_floors).collect();
    let about = "third-order wave aberrations at the edge of pupil and field, after Welford";
    Ok(AnalysisFigure {
        rows: charts.chunks(2).map(<[CurveChart]>::to_vec).collect(),
        tables,
        notes: vec![about.to_owned(), format!("exact sums, no rays, {}", ms_text(found.ms))],
        ..AnalysisFigure::default()
    })
}

/// Bars as their upper ends alone.
fn without_floors(chart: &CurveChart) -> CurveChart {
    let curve = |curve: &ChartCurve| {
        let ends = curve.pieces.iter().filter_map(|piece| piece.last().copied()).collect();
        ChartCurve { pieces: vec![ends], ..curve.clone() }
    };
    CurveChart { curves: chart.curves.iter().map(curve).collect(), ..chart.clone() }
}
