//! Fans of transverse aberration and of path differences: a row for each field, both sections beside each
//! other.

use super::{Subject, ms_text};
use crate::analysis::{Fan, FanPoint, PathFan, PathFanPoint};
use crate::plot::{ChartCurve, CurveChart};
use crate::report::{AnalysisFigure, CurveColors};

/// The transverse aberration in micrometres.
pub(super) fn fans(subject: &Subject<'_>) -> Option<AnalysisFigure> {
    let fans = subject.numbers.fans.as_ref()?;
    let along = |axis: usize| {
        move |point: &FanPoint| (point.pupil, point.error.map(|error| 1e3 * error[axis]))
    };
    let curves = |fans: &[Fan], section: fn(&Fan) -> &[FanPoint], axis: usize| {
        let curve = |fan: &Fan| {
            let name = subject.wavelength(fan.wavelength);
            ChartCurve::new(name, fan.wavelength, section(fan).iter().map(along(axis)))
        };
        fans.iter().map(curve).collect::<Vec<_>>()
    };
    let row = |(i, fans): (usize, &Vec<Fan>)| {
        let field = subject.field(i);
        let tangential = curves(fans, |fan| &fan.tangential, 1);
        let sagittal = curves(fans, |fan| &fan.sagittal, 0);
        vec![
            CurveChart::new(format!("{field} tangential"), ["pupil y", "εy, µm"], tangential),
            CurveChart::new(format!("{field} sagittal"), ["pupil x", "εx, µm"], sagittal),
        ]
    };
    let lit = |(i, fans)| Some(row((i, Result::as_ref(fans).ok()?)));
    let rays: usize =
        fans.value.iter().flatten().flatten().map(|fan| 2 * fan.tangential.len()).sum();
    let about = "distance from the image point of the chief ray of the primary wavelength";
    Some(AnalysisFigure {
        rows: fans.value.iter().enumerate().filter_map(lit).collect(),
        notes: notes(subject, about, &fans.value, (rays, fans.ms)),
        colors: CurveColors::Wavelengths(subject.wavelengths()),
        ..AnalysisFigure::default()
    })
}

/// The path differences in wavelengths.
pub(super) fn path_fans(subject: &Subject<'_>) -> Option<AnalysisFigure> {
    let fans = subject.numbers.path_fans.as_ref()?;
    let curves = |fans: &[PathFan], section: fn(&PathFan) -> &[PathFanPoint]| {
        let curve = |fan: &PathFan| {
            let name = subject.wavelength(fan.wavelength);
            let points = section(fan).iter().map(|point| (point.pupil, point.waves));
            ChartCurve::new(name, fan.wavelength, points)
        };
        fans.iter().map(curve).collect::<Vec<_>>()
    };
    let row = |(i, fans): (usize, &Vec<PathFan>)| {
        let field = subject.field(i);
        let tangential = curves(fans, |fan| &fan.tangential);
        let sagittal = curves(fans, |fan| &fan.sagittal);
        vec![
            CurveChart::new(format!("{field} tangential"), ["pupil y", "OPD, waves"], tangential),
            CurveChart::new(format!("{field} sagittal"), ["pupil x", "OPD, waves"], sagittal),
        ]
    };
    let lit = |(i, fans)| Some(row((i, Result::as_ref(fans).ok()?)));
    let rays: usize =
        fans.value.iter().flatten().flatten().map(|fan| 2 * fan.tangential.len()).sum();
    let about = "each wavelength in its own waves against the sphere about its own chief ray";
    Some(AnalysisFigure {
        rows: fans.value.iter().enumerate().filter_map(lit).collect(),
        notes: notes(subject, about, &fans.value, (rays, fans.ms)),
        colors: CurveColors::Wavelengths(subject.wavelengths()),
        ..AnalysisFigure::default()
    })
}

/// The meaning of the curves, rays and time, and the fields without them.
fn notes<T, E: ToString>(
    subject: &Subject<'_>,
    about: &str,
    fields: &[Result<T, E>],
    (rays, ms): (usize, f64),
) -> Vec<String> {
    let dark = fields.iter().enumerate();
    let dark = dark.filter_map(|(i, found)| {
        Some(format!("{}: {}", subject.field(i), found.as_ref().err()?.to_string()))
    });
    let rounding = "single rays, exact but for rounding";
    std::iter::once(about.to_owned())
        .chain([format!("{rounding}; {rays} rays, {}", ms_text(ms))])
        .chain(dark)
        .collect()
}
