//! The results of `tolerance` as a picture: the worst errors, the distribution of the lenses that are
//! made, and the yield against the limit.

use super::{SensitivityRow, surfaces};
use crate::cli::error::CliError;
use crate::files;
use crate::plot::{ChartCurve, CurveChart, CurveSheet, svg_text};
use crate::report::has_extension;
use crate::tolerance::{AsBuiltSpot, Quantile, wilson_interval};
use std::path::Path;

/// The extensions of the files that can be written.
pub(super) const EXTENSIONS: [&str; 2] = ["png", "svg"];

/// The bars of errors, and those that have a colour and a name of their own.
const BARS: usize = 20;
const NAMED: usize = 7;
/// The lines that fill a bar, and its width.
const LINES: usize = 16;
const WIDTH: f64 = 0.7;
/// The bins of a histogram, and the share of the lenses up to which it reaches.
const BINS: usize = 25;
const REACH: f64 = 0.98;

/// Draws the results into a file.
pub(super) fn save(
    path: &Path,
    lens: &str,
    rows: &[SensitivityRow],
    (spots, samples): (&[AsBuiltSpot; 2], usize),
) -> Result<(), CliError> {
    let lenses = vec![histogram(spots), yields(spots, samples)];
    let rows = vec![vec![pareto(rows)], lenses];
    let sheet = CurveSheet { title: format!("{lens}: lenses that are made"), rows };
    let fail = |why: String| CliError::Failed(format!("{}: {why}", path.display()));
    let bytes = if has_extension(path, "png") {
        sheet.canvas().png().map_err(|why| fail(why.to_string()))?
    } else {
        svg_text(&sheet.drawing()).into_bytes()
    };
    Ok(files::write_atomic(path, &bytes)?)
}

/// A bar of a height about a place, filled by upright lines.
fn bar(name: String, color: usize, [x, y]: [f64; 2], width: f64) -> ChartCurve {
    let line = |i: usize| [x + width * (i as f64 / (LINES - 1) as f64 - 0.5), y];
    let points: Vec<[f64; 2]> = (0..LINES).map(line).collect();
    ChartCurve::bars(name, color, &points, 0.0)
}

/// The largest shares of the growth after refocusing, and their sum.
fn pareto(rows: &[SensitivityRow]) -> CurveChart {
    let mut curves = Vec::new();
    let mut sums = vec![(0.0, Some(0.0))];
    let mut sum = 0.0;
    for (i, row) in rows.iter().take(BARS).enumerate() {
        let (place, share) = ((i + 1) as f64, 100.0 * row.refocused.share);
        let name = if i < NAMED {
            format!("{} {}", row.kind.name(), surfaces(row.first, row.last))
        } else {
            "further errors".to_owned()
        };
        curves.push(bar(name, i.min(NAMED), [place, share], WIDTH));
        sum += share;
        sums.push((place, Some(sum)));
    }
    curves.push(ChartCurve::new("sum", 1, sums).dashed());
    CurveChart::new("the worst errors, refocused", ["rank", "share of the growth in %"], curves)
}

/// The share of lenses up to an rms in mm, between the quantiles of a distribution.
fn share_up_to(distribution: &[Quantile], rms: f64) -> f64 {
    let above = distribution.partition_point(|quantile| quantile.corrected <= rms);
    match (above.checked_sub(1).map(|i| distribution[i]), distribution.get(above)) {
        (None, _) => 0.0,
        (Some(_), None) => 1.0,
        (Some(low), Some(high)) => {
            let width = (high.corrected - low.corrected).max(f64::MIN_POSITIVE);
            low.share + (high.share - low.share) * (rms - low.corrected) / width
        }
    }
}

/// The names and the colours of both spots.
const FOCUS: [(&str, usize); 2] = [("fixed focus", 1), ("refocused", 0)];

/// The share of the lenses in even bins of their rms.
fn histogram(spots: &[AsBuiltSpot; 2]) -> CurveChart {
    let mut curves = Vec::new();
    for (spot, (name, color)) in spots.iter().zip(FOCUS) {
        let of = &spot.distribution;
        let low = of.first().map_or(0.0, |quantile| quantile.corrected);
        let high = of.iter().rev().find(|quantile| quantile.share <= REACH);
        let width = (high.map_or(low, |quantile| quantile.corrected) - low) / BINS as f64;
        let mut outline = vec![(1e3 * low, Some(0.0))];
        for bin in 0..BINS {
            let [from, to] = [bin, bin + 1].map(|i| low + i as f64 * width);
            let share = 100.0 * (share_up_to(of, to) - share_up_to(of, from));
            outline.extend([(1e3 * from, Some(share)), (1e3 * to, Some(share))]);
        }
        outline.push((1e3 * (low + BINS as f64 * width), Some(0.0)));
        curves.push(ChartCurve::new(name, color, outline));
    }
    CurveChart::new("lenses by their rms", ["rms spot radius in um", "% of the lenses"], curves)
}

/// The share of good lenses against the limit, with the interval of the real ones.
fn yields(spots: &[AsBuiltSpot; 2], samples: usize) -> CurveChart {
    let mut curves = Vec::new();
    for (spot, (name, color)) in spots.iter().zip(FOCUS) {
        let points = spot.distribution.iter().map(|q| (1e3 * q.corrected, Some(100.0 * q.share)));
        curves.push(ChartCurve::new(name, color, points));
        for end in 0..2 {
            let real = spot.real_rms.iter().enumerate();
            let of = |(i, rms): (usize, &f64)| {
                (1e3 * rms, Some(100.0 * wilson_interval(i + 1, samples)[end]))
            };
            curves.push(ChartCurve::new("interval", color, real.map(of)).dashed());
        }
    }
    let title = "yield (dashed: 95 % interval by rays)";
    CurveChart::new(title, ["largest rms of a good lens in um", "% of the lenses"], curves)
}
