//! Error against time.

use super::{Subject, ms_text};
use crate::plot::{ChartCurve, CurveChart};
use crate::report::AnalysisFigure;
use crate::session::analysis::{AccuracyCurves, AccuracyPoint};
use crate::session::clock::Timed;

/// The error of contrast against the time that it takes.
pub(super) fn contrast(subject: &Subject<'_>) -> Result<Option<AnalysisFigure>, String> {
    let found = subject.numbers.contrast_accuracy.as_deref();
    found.map(|found| figure(found, "lg error of contrast")).transpose()
}

/// The error of the point spread against the time that it takes.
pub(super) fn point_spread(subject: &Subject<'_>) -> Result<Option<AnalysisFigure>, String> {
    let found = subject.numbers.point_spread_accuracy.as_deref();
    found.map(|found| figure(found, "lg error, share of a perfect peak")).transpose()
}

/// The error of a picture against the time that it takes.
pub(super) fn picture(subject: &Subject<'_>) -> Result<Option<AnalysisFigure>, String> {
    let found = subject.numbers.picture_accuracy.as_deref();
    found.map(|found| figure(found, "lg error, share of mid grey")).transpose()
}

/// The smallest error that has a logarithm in the chart.
const LEAST: f64 = 1e-12;

fn figure(
    found: &Timed<Result<AccuracyCurves, String>>,
    axis: &'static str,
) -> Result<AnalysisFigure, String> {
    let curves = found.value.as_ref().map_err(Clone::clone)?;
    let chart = |axes: [&'static str; 2], of: fn(&AccuracyPoint) -> [f64; 2]| {
        let curve = |(i, (name, points)): (usize, &(String, Vec<AccuracyPoint>))| {
            let mut places: Vec<[f64; 2]> = points.iter().map(of).collect();
            // One way has one error: a cross in place of a curve.
            if let [place] = places[..] {
                return ChartCurve::crosses(name, i, &[place], 0.1);
            }
            places.sort_by(|a, b| a[0].total_cmp(&b[0]));
            ChartCurve::new(name, i, places.into_iter().map(|[x, y]| (x, Some(y))))
        };
        let drawn = curves.ways.iter().enumerate().filter(|(_, (_, points))| !points.is_empty());
        CurveChart::new("Accuracy and time", axes, drawn.map(curve).collect())
    };
    let logarithm =
        |point: &AccuracyPoint| [point.ms.max(LEAST).log10(), point.error.max(LEAST).log10()];
    let refused = curves.refused.iter().cloned();
    Ok(AnalysisFigure {
        rows: vec![vec![chart(["lg time, ms", axis], logarithm)]],
        tables: vec![chart(["time, ms", "error"], |point| [point.ms, point.error])],
        notes: std::iter::once(curves.about.clone())
            .chain(refused)
            .chain([format!("measured in {}", ms_text(found.ms))])
            .collect(),
        ..AnalysisFigure::default()
    })
}
