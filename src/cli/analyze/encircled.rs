//! The encircled energy of a point by diffraction: the share of its light within circles.

use super::point_spread::{circle_of_rays, unit};
use super::{
    AnalysisRun, AtField, SelectedField, TextLines, dark_text, estimate_text, not_reached_text,
};
use crate::analysis::{
    AnalysisError, ContrastLimit, EncircledEnergy, EncircledRequest, Estimate,
    encircled_energy_unless,
};
use crate::cli::error::CliError;
use crate::cli::output::ShortNumber;
use crate::measure::time_ms;
use crate::plot::{ChartCurve, CurveChart};
use serde::Serialize;

/// The encircled energy of a field.
#[derive(Serialize)]
pub(super) struct EncircledJson {
    reached: bool,
    /// The cause of errors above the tolerance; `None` if it was reached.
    limit: Option<ContrastLimit>,
    /// The share of the weight of wavelengths without light.
    dark_share: f64,
    #[serde(flatten)]
    shares: ShareRadii,
    circles: Vec<CircleJson>,
    /// The circles of the drawn curve.
    #[serde(skip)]
    curve: Vec<CircleJson>,
}

/// The radii in mm that hold 50 % and 80 % of the light; `None` beyond the largest circle.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub(super) struct ShareRadii {
    radius_50: Option<Estimate>,
    radius_80: Option<Estimate>,
}

/// A circle.
#[derive(Clone, Copy, Serialize)]
struct CircleJson {
    radius: f64,
    energy: Estimate,
    /// The share of the same pupil without aberrations.
    perfect: Estimate,
}

/// The shares of the light whose circles are reported.
pub(super) const SHARES: [f64; 2] = [0.5, 0.8];

impl ShareRadii {
    /// The radii that were found for [`SHARES`], with the milliseconds that they took.
    pub(super) fn new(found: &[Option<Estimate>], ms: f64) -> Self {
        let timed = |estimate: Estimate| Estimate { milliseconds: Some(ms), ..estimate };
        let at = |k: usize| found.get(k).copied().flatten().map(timed);
        Self { radius_50: at(0), radius_80: at(1) }
    }

    /// The radii with their shares.
    fn both(&self) -> [(f64, Option<Estimate>); 2] {
        [(SHARES[0], self.radius_50), (SHARES[1], self.radius_80)]
    }

    pub(super) fn lines(&self) -> Vec<String> {
        let line = |(share, radius): (f64, Option<Estimate>)| {
            let name = format!("radius of {:.0} %, mm", 100.0 * share);
            radius.map_or_else(
                || format!("{name:<22} {:>13}", "beyond"),
                |radius| estimate_text(&name, &radius),
            )
        };
        self.both().into_iter().map(line).collect()
    }

    /// The radii as lines from the axes to the curve, in a colour.
    pub(super) fn marks(&self, color: usize) -> Vec<ChartCurve> {
        let mark = |(share, radius): (f64, Option<Estimate>)| {
            let radius = radius?.value;
            let name = format!("{:.0} % within {:.3} um", 100.0 * share, 1e3 * radius);
            let corner = [(0.0, Some(share)), (radius, Some(share)), (radius, Some(0.0))];
            Some(ChartCurve::new(name, color, corner).dashed())
        };
        self.both().into_iter().filter_map(mark).collect()
    }
}

/// The radii of the circles, in λF, unless the blur is larger: then they grow with it.
const RADII: [f64; 10] = [0.25, 0.5, 0.75, 1.0, 1.22, 1.5, 2.0, 3.0, 4.0, 6.0];
/// The largest of them.
const USUAL_RADIUS: f64 = 6.0;
/// The share of the light that the largest circle is to hold, and the factor by which it grows until it does.
const HELD: f64 = 0.95;
const GROWTH: f64 = 1.5;
/// The largest radius of a circle that is not asked for, in λF: the time grows with its fourth power. A blur that is
/// wider is left to rays.
const LARGEST_USUAL: f64 = 30.0;
/// The largest radius of a circle in λF: beyond, no affordable nodes resolve the fringes.
const LARGEST_RADIUS: f64 = 200.0;
/// The circles of a drawn curve.
const DRAWN: usize = 60;

/// Refuses circles that are too large.
pub(super) fn check_radii(run: &AnalysisRun, asked: &[f64]) -> Result<(), CliError> {
    let most = LARGEST_RADIUS * unit(run);
    match asked.iter().find(|radius| **radius > most) {
        Some(found) => {
            let most = ShortNumber(most);
            let text = format!(
                "--radii: found {found}; expected mm, at most {most}, {LARGEST_RADIUS} lambda F"
            );
            Err(CliError::Input(text))
        }
        None => Ok(()),
    }
}

pub(super) fn encircled(run: &AnalysisRun, asked: &[f64]) -> Vec<AtField<EncircledJson>> {
    let at = |field: &SelectedField| {
        let (found, ms) = time_ms(|| {
            if asked.is_empty() { usual_circles(run, field) } else { circles(run, field, asked) }
        });
        AtField::new(field, found.map(|found| found.keys(run, ms)))
    };
    run.at_each_field(at)
}

/// Circles with the light within them: those that are listed, and those of a drawing.
struct FoundCircles {
    listed: Vec<CircleJson>,
    curve: Vec<CircleJson>,
    found: EncircledEnergy,
}

impl FoundCircles {
    fn keys(self, run: &AnalysisRun, ms: f64) -> EncircledJson {
        let timed = |estimate: Estimate| Estimate { milliseconds: Some(ms), ..estimate };
        let circle = |circle: CircleJson| CircleJson {
            energy: timed(circle.energy),
            perfect: timed(circle.perfect),
            ..circle
        };
        let largest = self.listed.iter().map(|circle| circle.energy.error).fold(0.0, f64::max);
        let reached = largest <= run.accuracy.tolerance;
        EncircledJson {
            reached,
            limit: (!reached).then_some(ContrastLimit::Nodes(largest)),
            dark_share: self.found.dark_share,
            shares: ShareRadii::new(&self.found.share_radii, ms),
            circles: self.listed.into_iter().map(circle).collect(),
            curve: self.curve,
        }
    }
}

/// The light within circles of some radii in mm, and within those of a drawing.
fn circles(
    run: &AnalysisRun,
    field: &SelectedField,
    asked: &[f64],
) -> Result<FoundCircles, AnalysisError> {
    let largest = asked.iter().copied().fold(0.0, f64::max);
    let part = |k: usize| largest * (k + 1) as f64 / DRAWN as f64;
    let drawn = if run.is_drawn { DRAWN } else { 0 };
    let mut radii: Vec<f64> = (0..drawn).map(part).chain(asked.iter().copied()).collect();
    radii.sort_by(f64::total_cmp);
    radii.dedup();
    let request = EncircledRequest { center: [0.0; 2], radii: &radii, shares: &SHARES };
    let image = (run.image_light, request);
    let found = encircled_energy_unless(&run.model, field.traced, image, run.accuracy, &|| false)?;
    let circle = |k: usize| CircleJson {
        radius: radii[k],
        energy: found.energy[k],
        perfect: found.perfect[k],
    };
    let place = |radius: &f64| radii.iter().position(|known| known == radius);
    let listed = asked.iter().filter_map(place).map(circle).collect();
    let curve = if run.is_drawn { (0..radii.len()).map(circle).collect() } else { Vec::new() };
    Ok(FoundCircles { listed, curve, found })
}

/// The light within circles the largest of which holds nearly all of it, if that is not too far.
fn usual_circles(run: &AnalysisRun, field: &SelectedField) -> Result<FoundCircles, AnalysisError> {
    let rays = circle_of_rays(run, field, HELD).unwrap_or(0.0) / unit(run);
    let is_wide = rays > LARGEST_USUAL;
    // Diffraction adds its own width to a blur.
    let wide = rays + 0.5 * USUAL_RADIUS;
    let mut largest = if is_wide { USUAL_RADIUS } else { wide.clamp(USUAL_RADIUS, LARGEST_USUAL) };
    loop {
        let radii = RADII.map(|radius| radius / USUAL_RADIUS * largest * unit(run));
        let found = circles(run, field, &radii)?;
        let held = found.listed.last().map_or(1.0, |circle| circle.energy.value);
        if held >= HELD || is_wide || largest >= LARGEST_USUAL {
            return Ok(found);
        }
        largest = (GROWTH * largest).min(LARGEST_USUAL);
    }
}

impl TextLines for EncircledJson {
    const TITLE: &'static str = "encircled energy by diffraction: share of the light within circles about the image \
         point of the chief ray, radii in mm";

    fn error_unit(key: &str) -> &'static str {
        if key.starts_with("radius") { " mm" } else { "" }
    }

    fn lines(&self) -> Vec<String> {
        let line = |circle: &CircleJson| {
            let text = estimate_text(&ShortNumber(circle.radius).to_string(), &circle.energy);
            format!("{text}; without aberrations {:.4}", circle.perfect.value)
        };
        let head = format!("{:<22} {:>13}{}", "radius, mm", "share", not_reached_text(self.limit));
        let mut lines = self.shares.lines();
        lines.extend(dark_text(self.dark_share));
        lines.push(head);
        lines.extend(self.circles.iter().map(line));
        if self.shares.radius_80.is_none() {
            let more = "more light lies beyond these circles: --radii reaches farther, geometric-energy all of it";
            lines.push(more.to_owned());
        }
        lines
    }

    fn charts(&self) -> Vec<CurveChart> {
        let curve = |name: &str, color: usize, of: fn(&CircleJson) -> f64| {
            let circles = self.curve.iter().map(|circle| (circle.radius, Some(of(circle))));
            ChartCurve::new(name, color, std::iter::once((0.0, Some(0.0))).chain(circles))
        };
        let mut curves = vec![
            curve("diffraction", 0, |circle| circle.energy.value),
            curve("without aberrations", 0, |circle| circle.perfect.value).neutral().dashed(),
        ];
        curves.extend(self.shares.marks(1));
        let axes = ["radius, mm", "share of the light"];
        vec![CurveChart::new("encircled energy", axes, curves)]
    }
}
