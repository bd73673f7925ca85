//! The spots of lenses that are made as a histogram, and the interval of the yield at each limit.

use super::{AsBuiltSpot, ToleranceAnalysis, wilson_interval};

/// The fewest and the most bars of a histogram.
const BARS: [usize; 2] = [8, 30];
/// The number of places at which an interval is told.
const BAND: usize = 80;

/// Shares of lenses between limits of their rms in even steps.
#[derive(Debug, Clone, PartialEq)]
pub struct SpotHistogram {
    /// The first limit in mm.
    pub start: f64,
    /// The width of a bar in mm.
    pub step: f64,
    /// The share of lenses by their rays in each bar; empty without any.
    pub real: Vec<f64>,
    /// The share by the quadratic form.
    pub form: Vec<f64>,
}

/// The rms of the real lenses at a treatment of the focus, 0 for the fixed image plane, in mm; `None` for one
/// of which a ray does not arrive.
fn real_rms(analysis: &ToleranceAnalysis, which: usize) -> impl Iterator<Item = Option<f64>> + '_ {
    analysis.real.iter().map(move |lens| Some(lens.mean_square?[which].max(0.0).sqrt()))
}

/// The share of lenses by the form below an rms.
fn form_share(spot: &AsBuiltSpot, rms: f64) -> f64 {
    let Some(above) = spot.distribution.iter().position(|q| q.form > rms) else { return 1.0 };
    let Some(low) = above.checked_sub(1).map(|i| spot.distribution[i]) else { return 0.0 };
    let high = spot.distribution[above];
    let part = (rms - low.form) / (high.form - low.form);
    low.share + part * (high.share - low.share)
}

impl SpotHistogram {
    /// The histogram at a treatment of the focus, 0 for the fixed image plane; `None` if all lenses have the
    /// same spot.
    pub fn new(analysis: &ToleranceAnalysis, which: usize) -> Option<Self> {
        let spot = &analysis.spots[which];
        let real: Vec<f64> = real_rms(analysis, which).flatten().collect();
        let ends = [1, spot.distribution.len().checked_sub(2)?].map(|i| spot.distribution[i].form);
        let start = real.iter().copied().fold(ends[0], f64::min);
        let end = real.iter().copied().fold(ends[1], f64::max);
        let lenses = analysis.samples.max(1) as f64;
        let bars = (lenses.sqrt().round() as usize).clamp(BARS[0], BARS[1]);
        let count = if real.is_empty() { BARS[1] } else { bars };
        let step = (end - start) / count as f64;
        if !(step > 0.0 && step.is_finite()) {
            return None;
        }
        let limit = |i: usize| start + i as f64 * step;
        let form = (0..count).map(|i| form_share(spot, limit(i + 1)) - form_share(spot, limit(i)));
        let form = form.collect();
        let mut shares = vec![0.0; if real.is_empty() { 0 } else { count }];
        for rms in real {
            let place = ((rms - start) / step) as usize;
            shares[place.min(count - 1)] += 1.0 / lenses;
        }
        Some(Self { start, step, real: shares, form })
    }

    /// The middle of a bar in mm.
    pub fn middle(&self, i: usize) -> f64 {
        self.start + (i as f64 + 0.5) * self.step
    }
}

/// The share of real lenses up to an rms in mm and its interval, at even places.
pub fn yield_band(analysis: &ToleranceAnalysis, which: usize) -> Vec<(f64, [f64; 2])> {
    let all = analysis.real.len();
    let mut rms: Vec<f64> = real_rms(analysis, which).flatten().collect();
    rms.sort_unstable_by(f64::total_cmp);
    let (Some(first), Some(last)) = (rms.first(), rms.last()) else { return Vec::new() };
    let place = |i: usize| first + (last - first) * i as f64 / (BAND - 1) as f64;
    let at = |i: usize| {
        let limit = place(i);
        let good = rms.partition_point(|own| *own <= limit);
        (limit, wilson_interval(good, all))
    };
    (0..BAND).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::{bundled_lenses, json};
    use crate::lens::ToleranceGrade;
    use crate::tolerance::{ToleranceRequest, ToleranceScene, analyze, graded_sheet};

    #[test]
    fn bars_add_up_to_all_lenses_and_the_band_is_around_the_curve() {
        let found = bundled_lenses().iter().find(|own| own.name == "achromat_ac254_100").unwrap();
        let lens = json::read(found.text, found.name).unwrap();
        let scene = ToleranceScene::new(&lens, 0, 1e-2).unwrap();
        let sheet = graded_sheet(&lens, &scene.lens, ToleranceGrade::Precision);
        let request = ToleranceRequest { seed: 1, samples: 100, limit: None };
        let analysis = analyze(&scene, &sheet, request).unwrap();
        for which in [0, 1] {
            let found = SpotHistogram::new(&analysis, which).unwrap();
            let arrived = 1.0 - analysis.lost as f64 / analysis.samples as f64;
            assert!((found.real.iter().sum::<f64>() - arrived).abs() < 1e-9);
            let form: f64 = found.form.iter().sum();
            assert!(form > 0.9 && form < 1.0 + 1e-9, "{form}");
            let band = yield_band(&analysis, which);
            assert_eq!(band.len(), BAND);
            assert!(band.iter().all(|(_, [low, high])| low < high));
            let middle = &analysis.spots[which].distribution[25];
            let near = band.iter().find(|(rms, _)| *rms >= middle.corrected).unwrap();
            assert!(near.1[0] < 0.65 && near.1[1] > 0.35, "{near:?}");
        }
    }
}
