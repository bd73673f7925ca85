//! Tolerances and the lenses that are made as files: a table as CSV, charts as PNG.

use crate::lens::{Perturbation, SurfaceNumber, TableUnit, ToleranceSheet};
use crate::plot::{ChartCurve, CurveChart, CurveSheet};
use crate::tolerance::{
    AsBuiltSpot, FocusTreatment, SpotHistogram, ToleranceAnalysis, ToleranceError, yield_band,
};

/// The names of the treatments of the focus.
const FOCUS: [&str; 2] = ["fixed focus", "refocused"];
/// The number of errors in the chart of shares.
const SHOWN: usize = 20;
/// The number of those that have a colour and a name of their own.
const NAMED: usize = 7;
/// The lines that fill a bar, and its width.
const LINES: usize = 16;
const WIDTH: f64 = 0.7;

/// Further columns of the table of tolerances.
#[derive(Debug, Clone, Default)]
pub struct FurtherColumns {
    /// The heads, each behind a comma.
    pub heads: String,
    /// The cells of each error, likewise; none for no columns.
    pub cells: Vec<String>,
}

/// The tolerances with their effects, a line each, that with the largest share first; numbers are in the
/// unit of the line, as in tables: tilts in minutes of arc, the Abbe number in per cent. Surfaces are counted
/// from 1.
///
/// # Errors
/// Correlations that no errors can have.
pub fn tolerance_table(
    sheet: &ToleranceSheet,
    analysis: &ToleranceAnalysis,
    further: &FurtherColumns,
    order: FocusTreatment,
) -> Result<String, ToleranceError> {
    let mut text =
        "kind,first_surface,last_surface,unit,half_range (unit),sigma (unit),distribution,\
                    fixed_first (mm^2/unit),fixed_second (mm^2/unit^2),fixed_share,\
                    refocused_first (mm^2/unit),refocused_second (mm^2/unit^2),refocused_share"
            .to_owned();
    text.push_str(&further.heads);
    text.push_str("\r\n");
    for (i, [fixed, refocused]) in sorted_shares(sheet, analysis, order)? {
        let own = &sheet.errors[i];
        let TableUnit { name: unit, factor } = own.error.kind.table_unit();
        let distribution = serde_json::to_value(own.distribution).unwrap_or_default();
        let [by, adjusted] = analysis
            .forms
            .each_ref()
            .map(|form| form.derivatives(i).without_rounding(own.deviation()));
        let cells = [
            own.error.kind.name().replace(',', ""),
            SurfaceNumber::new(own.error.first).to_string(),
            SurfaceNumber::new(own.error.last).to_string(),
            unit.to_owned(),
            (factor * own.half_range).to_string(),
            (factor * own.deviation()).to_string(),
            distribution.as_str().unwrap_or_default().to_owned(),
            (by.first / factor).to_string(),
            (by.second / (factor * factor)).to_string(),
            fixed.to_string(),
            (adjusted.first / factor).to_string(),
            (adjusted.second / (factor * factor)).to_string(),
            refocused.to_string(),
        ];
        text.push_str(&cells.join(","));
        text.push_str(further.cells.get(i).map_or("", String::as_str));
        text.push_str("\r\n");
    }
    Ok(text)
}

/// The errors by their numbers with their shares, that with the largest one first, at the fixed image plane
/// or refocused.
fn sorted_shares(
    sheet: &ToleranceSheet,
    analysis: &ToleranceAnalysis,
    order: FocusTreatment,
) -> Result<Vec<(usize, [f64; 2])>, ToleranceError> {
    let mut shares: Vec<_> = analysis.growth_shares(sheet)?.into_iter().enumerate().collect();
    let plane = usize::from(order == FocusTreatment::Refocused);
    shares.sort_by(|a, b| b.1[plane].total_cmp(&a.1[plane]));
    Ok(shares)
}

/// Histograms, the yield with its interval, and the largest shares, as charts.
///
/// # Errors
/// Correlations that no errors can have.
pub fn tolerance_sheet(
    title: &str,
    sheet: &ToleranceSheet,
    analysis: &ToleranceAnalysis,
) -> Result<CurveSheet, ToleranceError> {
    let histograms = [0, 1].map(|which| histogram(analysis, which));
    let yields = [0, 1].map(|which| yield_chart(analysis, which));
    let bars = pareto(sheet, &sorted_shares(sheet, analysis, FocusTreatment::Refocused)?);
    Ok(CurveSheet {
        title: format!("{title}: lenses as made"),
        rows: vec![histograms.into(), yields.into(), vec![bars]],
        caption: Vec::new(),
    })
}

/// The largest shares of the growth after refocusing, and their sum.
fn pareto(sheet: &ToleranceSheet, shares: &[(usize, [f64; 2])]) -> CurveChart {
    let mut curves = Vec::new();
    let mut sums = vec![(0.0, Some(0.0))];
    let mut sum = 0.0;
    for (rank, (i, [_, refocused])) in shares.iter().take(SHOWN).enumerate() {
        let (place, share) = ((rank + 1) as f64, 100.0 * refocused);
        let Perturbation { kind, first, last } = sheet.errors[*i].error;
        let name = match rank {
            NAMED.. => "further errors".to_owned(),
            _ if first == last => format!("{} {}", kind.name(), SurfaceNumber::new(first)),
            _ => {
                let ends = [first, last].map(SurfaceNumber::new);
                format!("{} {}-{}", kind.name(), ends[0], ends[1])
            }
        };
        curves.push(bar(name, rank.min(NAMED), [place, share]));
        sum += share;
        sums.push((place, Some(sum)));
    }
    curves.push(ChartCurve::new("sum", 1, sums).dashed());
    let title = format!("the worst of {} errors, refocused", shares.len());
    CurveChart::new(title, ["rank", "share of the growth in %"], curves)
}

/// A bar of a height about a place, filled by upright lines.
fn bar(name: String, color: usize, [x, y]: [f64; 2]) -> ChartCurve {
    let line = |i: usize| [x + WIDTH * (i as f64 / (LINES - 1) as f64 - 0.5), y];
    let points: Vec<[f64; 2]> = (0..LINES).map(line).collect();
    ChartCurve::bars(name, color, &points, 0.0)
}

/// The shares of lenses by their spot: steps of the real ones, a line by the form.
fn histogram(analysis: &ToleranceAnalysis, which: usize) -> CurveChart {
    let mut curves = Vec::new();
    if let Some(found) = SpotHistogram::new(analysis, which) {
        let um = |mm: f64| 1e3 * mm;
        let edge = |i: usize| um(found.start + i as f64 * found.step);
        let step =
            |(i, share): (usize, &f64)| [(edge(i), Some(*share)), (edge(i + 1), Some(*share))];
        let real = found.real.iter().enumerate().flat_map(step);
        curves.push(ChartCurve::new("lenses by rays", 0, real));
        let form = found.form.iter().enumerate().map(|(i, s)| (um(found.middle(i)), Some(*s)));
        curves.push(ChartCurve::new("quadratic form", 1, form));
    }
    CurveChart::new(FOCUS[which], ["RMS over the fields, um", "share of lenses"], curves)
}

/// The share of lenses that a limit lets pass, with the interval of the real ones.
fn yield_chart(analysis: &ToleranceAnalysis, which: usize) -> CurveChart {
    let spot: &AsBuiltSpot = &analysis.spots[which];
    let curve = spot.distribution.iter().map(|q| (1e3 * q.corrected, Some(q.share)));
    let mut curves = vec![ChartCurve::new("yield", 1, curve)];
    let band = yield_band(analysis, which);
    for end in [0, 1] {
        let limit = band.iter().map(|(rms, interval)| (1e3 * rms, Some(interval[end])));
        curves.push(ChartCurve::new("95 % confidence", 0, limit).dashed());
    }
    CurveChart::new(FOCUS[which], ["largest RMS of a good lens, um", "yield"], curves)
}
