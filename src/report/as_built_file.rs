//! Tolerances and the lenses that are made as files: a table as CSV, charts as PNG.

use crate::lens::ToleranceSheet;
use crate::plot::{ChartCurve, CurveChart, CurveSheet};
use crate::tolerance::{AsBuiltSpot, SpotHistogram, ToleranceAnalysis, ToleranceError, yield_band};

/// The names of the treatments of the focus.
const FOCUS: [&str; 2] = ["fixed focus", "refocused"];
/// The number of errors in the chart of shares.
const SHOWN: usize = 20;

/// The tolerances with their effects, a line each, that with the largest refocused share first; angles
/// are in radians and surfaces are counted from 0.
///
/// # Errors
/// Correlations that no errors can have.
pub fn tolerance_table(
    sheet: &ToleranceSheet,
    analysis: &ToleranceAnalysis,
) -> Result<String, ToleranceError> {
    let mut text = "kind,first,last,half_range,sigma,distribution,fixed_first,fixed_second,\
                    fixed_share,refocused_first,refocused_second,refocused_share\r\n"
        .to_owned();
    for (i, [fixed, refocused]) in sorted_shares(sheet, analysis)? {
        let own = &sheet.errors[i];
        let distribution = serde_json::to_value(own.distribution).unwrap_or_default();
        let [by, adjusted] = &analysis.forms;
        let cells = [
            own.error.kind.name().replace(',', ""),
            own.error.first.to_string(),
            own.error.last.to_string(),
            own.half_range.to_string(),
            own.deviation().to_string(),
            distribution.as_str().unwrap_or_default().to_owned(),
            by.first[i].to_string(),
            by.second.of(i, i).to_string(),
            fixed.to_string(),
            adjusted.first[i].to_string(),
            adjusted.second.of(i, i).to_string(),
            refocused.to_string(),
        ];
        text.push_str(&cells.join(","));
        text.push_str("\r\n");
    }
    Ok(text)
}

/// The errors by their numbers with their shares, that with the largest refocused one first.
fn sorted_shares(
    sheet: &ToleranceSheet,
    analysis: &ToleranceAnalysis,
) -> Result<Vec<(usize, [f64; 2])>, ToleranceError> {
    let mut shares: Vec<_> = analysis.growth_shares(sheet)?.into_iter().enumerate().collect();
    shares.sort_by(|a, b| b.1[1].total_cmp(&a.1[1]));
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
    let shares = sorted_shares(sheet, analysis)?;
    let bars = [0, 1].map(|which| {
        let shown = shares.iter().take(SHOWN).enumerate();
        let points: Vec<[f64; 2]> =
            shown.map(|(place, (_, own))| [(place + 1) as f64, 100.0 * own[which]]).collect();
        ChartCurve::bars(FOCUS[which], which, &points, 0.0)
    });
    let title_of_bars = format!("largest shares of {} errors", shares.len());
    let bars =
        CurveChart::new(title_of_bars, ["error, by its refocused share", "share, %"], bars.into());
    Ok(CurveSheet {
        title: format!("{title}: lenses as made"),
        rows: vec![histograms.into(), yields.into(), vec![bars]],
    })
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
