//! The wavefront: RMS, map, fans of path differences and Zernike sums.

use super::{AnalysisRun, AtField, SelectedField, TextLines, estimate_text};
use crate::analysis::{
    AnalysisError, ChiefPath, Estimate, PathDifference, PathError, ReferenceForm, ZernikeMethod,
    ZernikeOrder, aberration_name, field_paths, grid_sides, path_map, wavefront, zernike,
};
use crate::cli::output::{ShortNumber, counted, or_dash};
use crate::measure::time_ms;
use crate::plot::{ChartCurve, ContourGrid, CurveChart, contour_curves};
use serde::Serialize;

/// The wavefront of a field.
#[derive(Serialize)]
pub(super) struct WavefrontJson {
    rms: Estimate,
    rms_without_tilt: Option<Estimate>,
    mean: Estimate,
    reached: bool,
    reference: ReferenceForm,
    missed: f64,
    chief: ChiefJson,
    map: Vec<PathJson>,
    /// The path differences over the pupil, if they are drawn.
    #[serde(skip)]
    grid: Option<ContourGrid>,
}

/// The chief ray, and the sphere on which the paths of the map are compared with its own.
#[derive(Serialize)]
struct ChiefJson {
    x: f64,
    y: f64,
    path: f64,
    reference: ReferenceForm,
}

impl ChiefJson {
    const fn new(chief: &ChiefPath) -> Self {
        let ChiefPath { point: [x, y], path, reference } = *chief;
        Self { x, y, path, reference }
    }
}

/// The path difference at a pupil point.
#[derive(Serialize)]
struct PathJson {
    px: f64,
    py: f64,
    waves: Option<f64>,
    /// The direction cosines of the line from the point of the sphere to its centre.
    alpha: Option<f64>,
    beta: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    why: Option<String>,
}

/// The steps of the map from −1 to 1.
const MAP_STEPS: i32 = 10;

/// The points of a map of the pupil.
fn map_points() -> Vec<[f64; 2]> {
    let side = |i: i32| f64::from(2 * i - MAP_STEPS) / f64::from(MAP_STEPS);
    let points = (0..=MAP_STEPS).flat_map(|j| (0..=MAP_STEPS).map(move |i| [side(i), side(j)]));
    points.filter(|p| p[0].hypot(p[1]) <= 1.0 + 1e-12).collect()
}

pub(super) fn wavefronts(run: &AnalysisRun, asked: &[[f64; 2]]) -> Vec<AtField<WavefrontJson>> {
    let points = if asked.is_empty() { map_points() } else { asked.to_vec() };
    let at = |field: &SelectedField| {
        let light = run.wavelength();
        let (found, ms) = time_ms(|| wavefront(&run.model, field.traced, light, run.accuracy));
        let keys = found.and_then(|found| {
            let timed = |e| Estimate { milliseconds: Some(ms), ..e };
            let (chief, map) = paths(run, field, &points)?;
            let grid = run.is_drawn.then(|| path_grid(run, field)).transpose()?;
            Ok(WavefrontJson {
                rms: timed(found.rms),
                rms_without_tilt: found.rms_without_tilt.map(timed),
                mean: timed(found.mean),
                reached: found.converged,
                reference: found.reference,
                missed: found.missed,
                chief,
                map,
                grid,
            })
        });
        AtField::new(field, keys)
    };
    run.at_each_field(at)
}

/// The number of columns of the map of a drawing.
const MAP: usize = 81;

/// The path differences over the pupil, to be drawn.
fn path_grid(run: &AnalysisRun, field: &SelectedField) -> Result<ContourGrid, AnalysisError> {
    let map = path_map(&run.model, field.traced, run.wavelength(), MAP)?;
    let side = grid_sides(map.count, map.half_width);
    Ok(ContourGrid { places: [side.clone(), side], values: map.values })
}

/// The chief ray and the path differences at some pupil points.
fn paths(
    run: &AnalysisRun,
    field: &SelectedField,
    points: &[[f64; 2]],
) -> Result<(ChiefJson, Vec<PathJson>), AnalysisError> {
    let (chief, found) = field_paths(&run.model, field.traced, run.wavelength(), points)?;
    let keys = |(p, found): (&[f64; 2], Result<PathDifference, PathError>)| PathJson {
        px: p[0],
        py: p[1],
        waves: found.ok().map(|path| path.waves),
        alpha: found.ok().map(|path| path.cosines[0]),
        beta: found.ok().map(|path| path.cosines[1]),
        why: found.err().map(|why| why.to_string()),
    };
    Ok((ChiefJson::new(&chief), points.iter().zip(found).map(keys).collect()))
}

impl TextLines for WavefrontJson {
    const TITLE: &'static str = "wavefront, in wavelengths; --json lists the map";

    fn error_unit(_key: &str) -> &'static str {
        " waves"
    }

    fn lines(&self) -> Vec<String> {
        let mut lines = vec![estimate_text("rms", &self.rms)];
        let without_tilt = self.rms_without_tilt.iter();
        lines.extend(without_tilt.map(|rms| estimate_text("rms without tilt", rms)));
        lines.push(estimate_text("mean", &self.mean));
        if let ReferenceForm::Replaced(radius) = self.reference {
            let radius = ShortNumber(radius);
            lines.push(format!("exit pupil at the image: sphere of {radius} mm instead"));
        }
        if self.missed > 0.0 {
            lines.push(format!("{:.2e} of the light misses the sphere", self.missed));
        }
        if !self.reached {
            lines.push("the tolerance was not reached".to_owned());
        }
        lines
    }

    /// The contour lines over the pupil.
    fn charts(&self) -> Vec<CurveChart> {
        let curves = self.grid.as_ref().map(|grid| contour_curves(grid, "wavelengths"));
        let curves = curves.unwrap_or_default();
        let range = self.grid.as_ref().and_then(ContourGrid::range);
        let title = range.map_or("wavefront".to_owned(), |[least, most]| {
            let [low, high, between] = [least, most, most - least].map(ShortNumber);
            format!("wavefront, {low} to {high} wavelengths, peak to valley {between}")
        });
        vec![CurveChart::map(&title, ["pupil x", "pupil y"], curves)]
    }
}

/// The fans of path differences of a field.
#[derive(Serialize)]
pub(super) struct PathFanJson {
    error: f64,
    rays: usize,
    milliseconds: f64,
    tangential: Vec<PathJson>,
    sagittal: Vec<PathJson>,
}

/// The rays of a fan.
const FAN_POINTS: i32 = 20;

pub(super) fn path_fans(run: &AnalysisRun) -> Vec<AtField<PathFanJson>> {
    let at = |field: &SelectedField| {
        let side = |i: i32| f64::from(2 * i - FAN_POINTS) / f64::from(FAN_POINTS);
        let section = |axis: usize| {
            let point = |i: i32| if axis == 0 { [side(i), 0.0] } else { [0.0, side(i)] };
            let points: Vec<_> = (0..=FAN_POINTS).map(point).collect();
            Ok(paths(run, field, &points)?.1)
        };
        let (found, milliseconds) = time_ms(|| Ok((section(1)?, section(0)?)));
        let lit = found.and_then(|(tangential, sagittal)| {
            let mut paths = tangential.iter().chain(&sagittal);
            // The ray through the centre alone carries no light.
            let dark = paths.all(|path| path.waves.is_none() || (path.px == 0.0 && path.py == 0.0));
            if dark { Err(AnalysisError::NoLight) } else { Ok((tangential, sagittal)) }
        });
        let keys = lit.map(|(tangential, sagittal)| PathFanJson {
            error: run.rounding() / (run.light_um() * 1e-3),
            rays: tangential.len() + sagittal.len(),
            milliseconds,
            tangential,
            sagittal,
        });
        AtField::new(field, keys)
    };
    run.at_each_field(at)
}

impl TextLines for PathFanJson {
    const TITLE: &'static str = "fans of path differences, in wavelengths";

    fn error_unit(_key: &str) -> &'static str {
        " waves"
    }

    fn lines(&self) -> Vec<String> {
        let Self { error, rays, milliseconds, .. } = self;
        let mut lines = vec![format!(
            "{}, {milliseconds:.3} ms, error {error:.0e} waves",
            counted(*rays, "ray")
        )];
        lines.push("   pupil      tangential        sagittal".to_owned());
        for (t, s) in self.tangential.iter().zip(&self.sagittal) {
            let [along, across] = [t.waves, s.waves].map(or_dash);
            lines.push(format!("{:>8}  {along:>14}  {across:>14}", ShortNumber(t.py)));
        }
        lines
    }

    fn charts(&self) -> Vec<CurveChart> {
        let tangential = self.tangential.iter().map(|path| (path.py, path.waves));
        let sagittal = self.sagittal.iter().map(|path| (path.px, path.waves));
        let curves = vec![
            ChartCurve::new("tangential", 0, tangential),
            ChartCurve::new("sagittal", 1, sagittal),
        ];
        let axes = ["pupil", "wavelengths"];
        vec![CurveChart::new("path differences", axes, curves)]
    }
}

/// The Zernike sums of a field.
#[derive(Serialize)]
pub(super) struct ZernikeJson {
    method: ZernikeMethod,
    noll: Vec<Estimate>,
    fringe: Vec<Estimate>,
    rest: Estimate,
    reached: bool,
}

/// The number of polynomials.
const TERMS: usize = 37;

pub(super) fn zernikes(run: &AnalysisRun) -> Vec<AtField<ZernikeJson>> {
    let at = |field: &SelectedField| {
        let sum = |order| {
            zernike(&run.model, field.traced, run.wavelength(), (order, TERMS), run.accuracy)
        };
        let (found, ms) = time_ms(|| Ok((sum(ZernikeOrder::Noll)?, sum(ZernikeOrder::Fringe)?)));
        let timed = |e: Estimate| Estimate { milliseconds: Some(ms), ..e };
        let keys = found.map(|(noll, fringe)| ZernikeJson {
            method: noll.method,
            rest: timed(noll.rest),
            reached: noll.reached && fringe.reached,
            noll: noll.coefficients.into_iter().map(timed).collect(),
            fringe: fringe.coefficients.into_iter().map(timed).collect(),
        });
        AtField::new(field, keys)
    };
    run.at_each_field(at)
}

impl TextLines for ZernikeJson {
    const TITLE: &'static str = "Zernike coefficients of the wavefront over the unit disc of the pupil, in \
         wavelengths: Noll's order (RMS 1) and the fringe order (1 at the rim)";

    fn error_unit(_key: &str) -> &'static str {
        " waves"
    }

    fn lines(&self) -> Vec<String> {
        let method = match self.method {
            ZernikeMethod::Projection => "projections over the clear disc".to_owned(),
            ZernikeMethod::LeastSquares(condition) => fit_text(condition),
        };
        let mut lines = vec![method, estimate_text("rms of the rest", &self.rest)];
        lines.push(format!("{:>4}  {:>20}  {:<22}  {:>20}", "", "Noll", "", "fringe"));
        let names = [ZernikeOrder::Noll, ZernikeOrder::Fringe].map(|order| order.indices(TERMS));
        for (i, (noll, fringe)) in self.noll.iter().zip(&self.fringe).enumerate() {
            let [noll, fringe] = [noll, fringe].map(coefficient_text);
            let [first, second] = [names[0][i], names[1][i]].map(aberration_name);
            lines.push(format!("{:>4}  {noll:>20}  {first:<22}  {fringe:>20}  {second}", i + 1));
        }
        if !self.reached {
            lines.push("the tolerance was not reached".to_owned());
        }
        lines
    }

    /// The coefficients as bars.
    fn charts(&self) -> Vec<CurveChart> {
        let bars = |name: &str, color: usize, list: &[Estimate], shift: f64| {
            let place = |(i, e): (usize, &Estimate)| [i as f64 + 1.0 + shift, e.value];
            let points: Vec<_> = list.iter().enumerate().map(place).collect();
            ChartCurve::bars(name, color, &points, 0.0)
        };
        let curves = vec![bars("Noll", 0, &self.noll, 0.0), bars("fringe", 1, &self.fringe, 0.3)];
        vec![CurveChart::new("Zernike coefficients", ["number", "wavelengths"], curves)]
    }
}

/// The largest condition number of a fit over a full disc.
const FULL_DISC: f64 = 1.01;

/// The description of a fit.
fn fit_text(condition: f64) -> String {
    if condition < FULL_DISC {
        return format!("least-squares fit (condition number {})", ShortNumber(condition));
    }
    format!(
        "least-squares fit over a clipped pupil (condition number {}): its coefficients differ from \
         projections over the clear disc",
        ShortNumber(condition)
    )
}

/// A coefficient with its error; 0 where no digit is left.
fn coefficient_text(estimate: &Estimate) -> String {
    let Estimate { value, error, .. } = *estimate;
    if value.abs() < 5e-7 {
        return format!("0 ± {error:.0e}");
    }
    format!("{value:.6} ± {error:.0e}")
}
