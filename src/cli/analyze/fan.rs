//! Transverse ray errors along the two sections of the pupil.

use super::{AnalysisRun, AtField, SelectedField, TextLines};
use crate::analysis::{AnalysisError, Fan, FanPoint, fan};
use crate::cli::output::{ShortNumber, counted, or_dash};
use crate::measure::time_ms;
use crate::plot::{ChartCurve, CurveChart};
use serde::Serialize;

/// Rays of a fan, which is a curve to look at and not an integral.
const POINTS: usize = 21;

/// The fans of a field.
#[derive(Serialize)]
pub(super) struct FanJson {
    error: f64,
    rays: usize,
    milliseconds: f64,
    colors: Vec<ColorFanJson>,
}

#[derive(Serialize)]
struct ColorFanJson {
    wavelength_um: f64,
    tangential: Vec<FanPointJson>,
    sagittal: Vec<FanPointJson>,
}

#[derive(Serialize)]
struct FanPointJson {
    pupil: f64,
    dx: Option<f64>,
    dy: Option<f64>,
    fate: Option<&'static str>,
    surface: Option<usize>,
}

pub(super) fn fans(run: &AnalysisRun) -> Vec<AtField<FanJson>> {
    let at = |field: &SelectedField| {
        let (result, milliseconds) = time_ms(|| fan(&run.model, field.traced, POINTS));
        let keys = |fans: Vec<Fan>| FanJson {
            error: run.rounding() + run.model.neglected.ray_shift,
            rays: 2 * POINTS * fans.len(),
            milliseconds,
            colors: fans.iter().map(|fan| ColorFanJson::new(run, fan)).collect(),
        };
        let lit = result.and_then(|fans| {
            let mut points = fans.iter().flat_map(|fan| fan.tangential.iter().chain(&fan.sagittal));
            // The ray through the centre alone carries no light.
            let dark = points.all(|point| point.error.is_none() || point.pupil == 0.0);
            if dark { Err(AnalysisError::NoLight) } else { Ok(fans) }
        });
        AtField::new(field, lit.map(keys))
    };
    run.at_each_field(at)
}

impl ColorFanJson {
    fn new(run: &AnalysisRun, fan: &Fan) -> Self {
        let keys = |points: &[FanPoint]| points.iter().map(FanPointJson::new).collect();
        Self {
            wavelength_um: run.model.channels[fan.wavelength].um,
            tangential: keys(&fan.tangential),
            sagittal: keys(&fan.sagittal),
        }
    }
}

impl FanPointJson {
    fn new(point: &FanPoint) -> Self {
        Self {
            pupil: point.pupil,
            dx: point.error.map(|e| e[0]),
            dy: point.error.map(|e| e[1]),
            fate: point.fate.map(crate::trace::Fate::name),
            surface: point.fate.and_then(crate::trace::Fate::surface),
        }
    }
}

impl TextLines for FanJson {
    const TITLE: &'static str =
        "ray fans: distance from the chief ray of the primary wavelength, in mm";

    fn lines(&self) -> Vec<String> {
        let Self { error, rays, milliseconds, colors } = self;
        let mut lines =
            vec![format!("{}, {milliseconds:.3} ms, error {error:.0e} mm", counted(*rays, "ray"))];
        for color in colors {
            lines.push(format!("{} um", color.wavelength_um));
            lines.push("   pupil   tangential dy  sagittal dx  sagittal dy".to_owned());
            for (t, s) in color.tangential.iter().zip(&color.sagittal) {
                let [t, sx, sy] = [t.dy, s.dx, s.dy].map(or_dash);
                lines.push(format!("{:>8}  {t:>14}  {sx:>11}  {sy:>11}", ShortNumber(s.pupil)));
            }
        }
        lines
    }

    fn charts(&self) -> Vec<CurveChart> {
        type Section = fn(&ColorFanJson) -> &[FanPointJson];
        type Error = fn(&FanPointJson) -> Option<f64>;
        let chart = |title: &str, error_name, section: Section, error: Error| {
            let curve = |(i, color): (usize, &ColorFanJson)| {
                let points = section(color).iter().map(|point| (point.pupil, error(point)));
                ChartCurve::new(format!("{} um", color.wavelength_um), i, points)
            };
            let curves = self.colors.iter().enumerate().map(curve).collect();
            CurveChart::new(title, ["pupil", error_name], curves)
        };
        vec![
            chart("tangential", "dy, mm", |color| &color.tangential, |point| point.dy),
            chart("sagittal", "dx, mm", |color| &color.sagittal, |point| point.dx),
        ]
    }
}
