//! The third-order sums of every surface.

use super::{AnalysisRun, AtField, SelectedField, TextLines};
use crate::analysis::check_some_light;
use crate::cli::error::CliError;
use crate::cli::output::ShortNumber;
use crate::lens::{FieldPoint, SurfaceNumber};
use crate::measure::time_ms;
use crate::paraxial::{SEIDEL_SUM_NAMES, SeidelSums};
use crate::plot::{ChartCurve, CurveChart};
use serde::Serialize;

/// The sums of a lens, in mm: they belong to the edge of its field.
#[derive(Serialize)]
pub(super) struct SeidelJson {
    /// The error by rounding, in mm.
    error: f64,
    rays: usize,
    milliseconds: f64,
    surfaces: Vec<SurfaceSumsJson>,
    total: SeidelSums<f64>,
}

#[derive(Serialize)]
struct SurfaceSumsJson {
    /// The index of the surface, from 0.
    surface: usize,
    #[serde(flatten)]
    sums: SeidelSums<f64>,
}

/// The sums of a lens.
///
/// # Errors
/// A lens without third-order sums.
pub(super) fn sums(run: &AnalysisRun) -> Result<Vec<AtField<SeidelJson>>, CliError> {
    let (found, milliseconds) = time_ms(|| run.model.seidel());
    let Some(seidel) = found else {
        let why = if run.model.has_grin() {
            "those of a gradient-index medium are not implemented"
        } else {
            "the lens has no paraxial chief ray; expected a field beside the axis"
        };
        let text = format!("{}: no third-order sums: {why}", run.opened.file);
        return Err(CliError::Input(text));
    };
    let largest =
        seidel.surfaces.iter().flat_map(SeidelSums::to_array).map(f64::abs).fold(0.0, f64::max);
    let surface =
        |(surface, sums): (usize, &SeidelSums<f64>)| SurfaceSumsJson { surface, sums: *sums };
    let found = SeidelJson {
        error: 16.0 * f64::EPSILON * largest,
        rays: 0,
        milliseconds,
        surfaces: seidel.surfaces.iter().enumerate().map(surface).collect(),
        total: seidel.total,
    };
    let lit = check_some_light(run.model.fields.iter().map(|field| (&run.model, *field)));
    let axis = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
    let place = SelectedField { given: axis, traced: axis };
    Ok(vec![AtField::new(&place, lit.map(|()| found))])
}

impl TextLines for SeidelJson {
    const TITLE: &'static str = "Seidel sums of every surface in mm: third-order wave aberrations at the edge of \
         pupil and field, after Welford";

    fn lines(&self) -> Vec<String> {
        let cells = |first: &str, sums: &SeidelSums<f64>| {
            let numbers =
                sums.to_array().map(|v| format!("{:>14}", ShortNumber(v + 0.0).to_string()));
            format!("{first:>7}{}", numbers.concat())
        };
        let heads = SEIDEL_SUM_NAMES.map(|(symbol, _)| format!("{symbol:>14}")).concat();
        let mut lines = vec![
            format!("exact but for rounding ({:.0e} mm), {:.3} ms", self.error, self.milliseconds),
            format!("{:>7}{heads}", "surface"),
        ];
        let number = |surface: usize| SurfaceNumber::new(surface).to_string();
        lines.extend(self.surfaces.iter().map(|s| cells(&number(s.surface), &s.sums)));
        lines.push(cells("sum", &self.total));
        lines
    }

    /// Bars over the surfaces, the sum behind them.
    fn charts(&self) -> Vec<CurveChart> {
        let chart = |(k, (symbol, meaning)): (usize, &(&str, &str))| {
            let bar = |s: &SurfaceSumsJson| [(s.surface + 1) as f64, 1e3 * s.sums.to_array()[k]];
            let bars: Vec<[f64; 2]> = self.surfaces.iter().map(bar).collect();
            let sum = [[(self.surfaces.len() + 1) as f64, 1e3 * self.total.to_array()[k]]];
            let curves = vec![
                ChartCurve::bars("surface", 0, &bars, 0.0),
                ChartCurve::bars("sum", 1, &sum, 0.0),
            ];
            CurveChart::new(format!("{symbol} {meaning}"), ["surface", "um"], curves)
        };
        SEIDEL_SUM_NAMES.iter().enumerate().map(chart).collect()
    }
}
