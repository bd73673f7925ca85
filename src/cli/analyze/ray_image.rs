//! The image of a point by rays alone: its density, and the light within circles.

use super::encircled::{SHARES, ShareRadii};
use super::{AnalysisRun, AtField, SelectedField, TextLines, estimate_text};
use crate::analysis::{
    AnalysisError, Estimate, RayImage, RayImageRequest, grid_sides, ray_image, spot,
};
use crate::cli::output::{ShortNumber, counted};
use crate::measure::time_ms;
use crate::plot::{ChartCurve, CurveChart};
use serde::Serialize;

/// The image of a field by rays.
#[derive(Serialize)]
pub(super) struct RayImageJson {
    center: [f64; 2],
    /// The error of the largest density, as a share of it.
    error: f64,
    reached: bool,
    rays: usize,
    milliseconds: f64,
    /// The number of columns and of rows, and the place of the last one in mm.
    columns: usize,
    half_width: f64,
    /// The densities in 1/mm², row by row from below.
    density: Vec<f64>,
}

/// The number of columns.
const COLUMNS: usize = 41;
/// The largest radius of the spot over the half width of its image.
const MARGIN: f64 = 1.05;

/// The half width of the image of a field: all of its light, in mm.
fn half_width(run: &AnalysisRun, field: &SelectedField) -> Result<f64, AnalysisError> {
    let found = spot(&run.model, field.traced, run.accuracy)?;
    let least = run.primary_um() * 1e-3;
    Ok((MARGIN * (found.radius.value + found.radius.error)).max(least))
}

fn image(
    run: &AnalysisRun,
    field: &SelectedField,
    half_width: f64,
    radii: &[f64],
) -> Result<RayImage, AnalysisError> {
    let request = RayImageRequest { count: COLUMNS, half_width, radii, shares: &SHARES };
    ray_image(&run.model, field.traced, request, run.accuracy, &|| false)
}

pub(super) fn images(run: &AnalysisRun) -> Vec<AtField<RayImageJson>> {
    let at = |field: &SelectedField| {
        let (found, milliseconds) = time_ms(|| {
            let half_width = half_width(run, field)?;
            image(run, field, half_width, &[])
        });
        let keys = found.map(|found| RayImageJson {
            center: found.center,
            error: found.error,
            reached: found.reached,
            rays: found.rays,
            milliseconds,
            columns: found.density.count,
            half_width: found.density.half_width,
            density: found.density.values,
        });
        AtField::new(field, keys)
    };
    run.at_each_field(at)
}

impl RayImageJson {
    /// The densities along x and along y through the centre, with their places in mm.
    fn profiles(&self) -> [Vec<(f64, f64)>; 2] {
        let (side, middle) = (grid_sides(self.columns, self.half_width), self.columns / 2);
        let place = |i: usize, at: usize| (side[i], self.density[at]);
        [
            (0..self.columns).map(|i| place(i, middle * self.columns + i)).collect(),
            (0..self.columns).map(|i| place(i, i * self.columns + middle)).collect(),
        ]
    }

    fn peak(&self) -> f64 {
        self.density.iter().copied().fold(f64::MIN_POSITIVE, f64::max)
    }
}

impl TextLines for RayImageJson {
    const TITLE: &'static str = "image of a point by rays, all wavelengths: share of the light in 1/mm2, places in mm \
         from the image point of the chief ray";

    fn error_unit(_key: &str) -> &'static str {
        " of the peak"
    }

    fn lines(&self) -> Vec<String> {
        let Self { error, rays, milliseconds, .. } = self;
        let rays = counted(*rays, "ray");
        let left = if self.reached { "" } else { ": the tolerance was not reached" };
        let mut lines = vec![
            format!("{rays}, {milliseconds:.3} ms, error {:.1} % of the peak{left}", 100.0 * error),
            format!("{:>12}  {:>14}  {:>14}", "distance, mm", "along x", "along y"),
        ];
        let [x, y] = self.profiles();
        lines.extend(x.iter().zip(&y).map(|((at, x), (_, y))| {
            let [at, x, y] = [*at, *x, *y].map(|v| ShortNumber(v).to_string());
            format!("{at:>12}  {x:>14}  {y:>14}")
        }));
        lines
    }

    /// The profiles, linear and logarithmic.
    fn charts(&self) -> Vec<CurveChart> {
        let profiles = self.profiles();
        let chart = |title: &str, axis: &'static str, number: &dyn Fn(f64) -> Option<f64>| {
            let curve = |(i, name): (usize, &str)| {
                let points = profiles[i].iter().map(|(at, v)| (1e3 * at, number(v / self.peak())));
                ChartCurve::new(name, i, points)
            };
            let curves = ["along x", "along y"].into_iter().enumerate().map(curve).collect();
            CurveChart::new(title, ["distance, um", axis], curves)
        };
        let logarithm = |share: f64| (share > 0.0).then(|| share.log10());
        vec![
            chart("density of rays over its peak", "density", &|share| Some(share)),
            chart("its logarithm", "lg density", &logarithm),
        ]
    }
}

/// The light of a field within circles, by rays.
#[derive(Serialize)]
pub(super) struct RayEnergyJson {
    center: [f64; 2],
    reached: bool,
    #[serde(flatten)]
    shares: ShareRadii,
    circles: Vec<RayCircleJson>,
    /// The circles of the drawn curve.
    #[serde(skip)]
    curve: Vec<RayCircleJson>,
}

#[derive(Clone, Copy, Serialize)]
struct RayCircleJson {
    radius: f64,
    energy: Estimate,
}

/// The number of circles if none are asked for, and those between them of a drawn curve.
const CIRCLES: usize = 10;
const DRAWN: usize = 6;

pub(super) fn energies(run: &AnalysisRun, asked: &[f64]) -> Vec<AtField<RayEnergyJson>> {
    let at = |field: &SelectedField| {
        let (found, ms) = time_ms(|| {
            let half_width = half_width(run, field)?;
            let part = |k: usize| half_width / MARGIN * (k + 1) as f64 / CIRCLES as f64;
            let usual: Vec<f64> = (0..CIRCLES).map(part).collect();
            let listed = if asked.is_empty() { usual } else { asked.to_vec() };
            let reach = listed.iter().copied().fold(0.0, f64::max);
            let count = if run.is_drawn { CIRCLES * DRAWN } else { 0 };
            let drawn = (0..count).map(|k| reach * (k + 1) as f64 / count as f64);
            let radii: Vec<f64> = listed.iter().copied().chain(drawn).collect();
            image(run, field, half_width, &radii).map(|image| (image, radii, listed.len()))
        });
        let keys = found.map(|(image, radii, listed)| {
            let circle = |(radius, energy): (f64, Estimate)| RayCircleJson {
                radius,
                energy: Estimate { milliseconds: Some(ms), ..energy },
            };
            let shares: Vec<_> = image.share_radii.iter().copied().map(Some).collect();
            let mut circles: Vec<_> = radii.into_iter().zip(image.energy).map(circle).collect();
            let curve = circles.split_off(listed);
            RayEnergyJson {
                center: image.center,
                reached: image.reached,
                shares: ShareRadii::new(&shares, ms),
                circles,
                curve,
            }
        });
        AtField::new(field, keys)
    };
    run.at_each_field(at)
}

impl TextLines for RayEnergyJson {
    const TITLE: &'static str = "encircled energy by rays, all wavelengths: share of the light within circles about \
         the image point of the chief ray, radii in mm";

    fn error_unit(key: &str) -> &'static str {
        if key.starts_with("radius") { " mm" } else { "" }
    }

    fn lines(&self) -> Vec<String> {
        let line = |circle: &RayCircleJson| {
            estimate_text(&ShortNumber(circle.radius).to_string(), &circle.energy)
        };
        let head = format!("{:<22} {:>13}", "radius, mm", "share");
        let left = (!self.reached).then(|| "the tolerance was not reached".to_owned());
        let mut lines = self.shares.lines();
        lines.push(head);
        lines.extend(self.circles.iter().map(line).chain(left));
        lines
    }

    fn charts(&self) -> Vec<CurveChart> {
        let circles = self.curve.iter().map(|circle| (circle.radius, Some(circle.energy.value)));
        let points = std::iter::once((0.0, Some(0.0))).chain(circles);
        let axes = ["radius, mm", "share of the light"];
        let mut curves = vec![ChartCurve::new("rays", 0, points)];
        curves.extend(self.shares.marks(1));
        vec![CurveChart::new("encircled energy", axes, curves)]
    }
}
