//! Results from chief rays: distortion and field curvature.

use super::{AnalysisRun, AtField, SelectedField, TextLines, estimate_text};
use crate::analysis::{
    Estimate, GridPoint, check_light, check_some_light, distortion, distortion_grid,
    field_curvature,
};
use crate::cli::output::{ShortNumber, counted};
use crate::lens::FieldPoint;
use crate::measure::time_ms;
use crate::plot::{ChartCurve, CurveChart};
use serde::Serialize;

/// The distortion at a field.
#[derive(Serialize)]
pub(super) struct DistortionJson {
    height: Estimate,
    ideal: f64,
    distortion: Option<Estimate>,
    in_plane: Option<Estimate>,
    f_theta: Option<Estimate>,
}

pub(super) fn distortions(run: &AnalysisRun) -> Vec<AtField<DistortionJson>> {
    let at = |field: &SelectedField| {
        let (result, ms) = time_ms(|| {
            check_light(&run.model, field.traced)?;
            distortion(&run.model, field.traced, run.model.primary)
        });
        let keys = result.map(|d| {
            let height = run.single_ray_estimate(d.height, ms);
            let error = height.error + run.model.neglected.ray_shift;
            let height = Estimate { error, ..height };
            let relative =
                |value| Estimate { value, error: height.error / d.ideal.abs(), ..height };
            DistortionJson {
                height,
                ideal: d.ideal,
                distortion: d.distortion.map(relative),
                in_plane: d.in_plane.map(relative),
                f_theta: d.f_theta.map(relative),
            }
        });
        AtField::new(field, keys)
    };
    run.at_each_field(at)
}

impl TextLines for DistortionJson {
    const TITLE: &'static str =
        "distortion of the chief ray at the primary wavelength: heights in mm, ratios minus 1";

    fn lines(&self) -> Vec<String> {
        let mut lines = vec![estimate_text("chief ray height", &self.height)];
        lines.extend(self.distortion.iter().map(|e| estimate_text("against f tan(theta)", e)));
        let in_plane = self.in_plane.iter();
        lines.extend(
            in_plane.map(|e| estimate_text("against the paraxial chief ray in the plane", e)),
        );
        lines.extend(self.f_theta.iter().map(|e| estimate_text("against f theta", e)));
        lines
    }
}

/// The number of squares along a side of a grid.
const SQUARES: usize = 10;

/// The images of a square grid.
#[derive(Serialize)]
pub(super) struct GridJson {
    error: f64,
    rays: usize,
    milliseconds: f64,
    /// The largest distance from the ideal point over its height.
    largest: Option<f64>,
    points: Vec<GridPointJson>,
}

#[derive(Serialize)]
struct GridPointJson {
    field: [f64; 2],
    ideal: [f64; 2],
    real: Option<[f64; 2]>,
}

pub(super) fn grid(run: &AnalysisRun) -> Vec<AtField<GridJson>> {
    let axis = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
    let (found, milliseconds) = time_ms(|| {
        check_some_light(run.model.fields.iter().map(|field| (&run.model, *field)))?;
        distortion_grid(&run.model, run.model.primary, SQUARES)
    });
    let point = |point: &GridPoint| GridPointJson {
        field: [point.field.x, point.field.y],
        ideal: point.ideal,
        real: point.real.ok(),
    };
    let keys = found.map(|points| GridJson {
        error: run.rounding() + run.model.neglected.ray_shift,
        rays: points.iter().filter(|point| point.real.is_ok()).count(),
        milliseconds,
        largest: points.iter().filter_map(GridPoint::distortion).reduce(f64::max),
        points: points.iter().map(point).collect(),
    });
    vec![AtField::new(&SelectedField { given: axis, traced: axis }, keys)]
}

impl TextLines for GridJson {
    const TITLE: &'static str =
        "distortion grid at the primary wavelength: image points of chief rays, in mm";

    fn lines(&self) -> Vec<String> {
        let Self { error, rays, milliseconds, points, .. } = self;
        let largest = self.largest.map_or("-".to_owned(), |most| format!("{:.4} %", 100.0 * most));
        let counts =
            format!("{}, {milliseconds:.3} ms, error {error:.0e} mm", counted(*rays, "ray"));
        let mut lines = vec![counts, format!("largest distortion {largest}")];
        lines.push(
            ["field x", "y", "ideal x", "y", "x", "y"].map(|head| format!("{head:>11}")).concat(),
        );
        for GridPointJson { field, ideal, real } in points {
            let numbers = field.iter().chain(ideal).map(|v| Some(*v));
            let real = [0, 1].map(|k| real.map(|real| real[k]));
            let cell = |v: Option<f64>| v.map_or("-".to_owned(), |v| ShortNumber(v).to_string());
            let cells: Vec<String> =
                numbers.chain(real).map(|v| format!("{:>11}", cell(v))).collect();
            lines.push(cells.concat());
        }
        lines
    }

    fn charts(&self) -> Vec<CurveChart> {
        let line =
            |indices: Vec<usize>, color: usize, of: fn(&GridPointJson) -> Option<[f64; 2]>| {
                let points = indices.into_iter().filter_map(|i| of(&self.points[i])).collect();
                let name = if color == 0 { "image" } else { "without distortion" };
                ChartCurve { name: name.to_owned(), color, dashed: color > 0, pieces: vec![points] }
            };
        let count = SQUARES + 1;
        let rows = (0..count).map(|i| (0..count).map(|k| count * i + k).collect());
        let columns = (0..count).map(|i| (0..count).map(|k| count * k + i).collect());
        let lines: Vec<Vec<usize>> = rows.chain(columns).collect();
        let ideal = lines.iter().map(|of| line(of.clone(), 1, |point| Some(point.ideal)));
        let real = lines.iter().map(|of| line(of.clone(), 0, |point| point.real));
        let all = ideal.chain(real).collect();
        vec![CurveChart::map("distortion", ["x, mm", "y, mm"], all)]
    }
}

/// The foci at a field.
#[derive(Serialize)]
pub(super) struct FieldCurvatureJson {
    tangential: Option<Estimate>,
    sagittal: Option<Estimate>,
}

pub(super) fn curvatures(run: &AnalysisRun) -> Vec<AtField<FieldCurvatureJson>> {
    // Rays cross at the focus at a small angle, so rounding across the axis is enlarged along it.
    let cone = run.model.first_order.working_f_number.unwrap_or(1.0).abs().max(1.0);
    let at = |field: &SelectedField| {
        let (result, ms) = time_ms(|| {
            check_light(&run.model, field.traced)?;
            field_curvature(&run.model, field.traced, run.model.primary)
        });
        let estimate = |value: f64| {
            let one = run.single_ray_estimate(value, ms);
            Estimate { error: one.error * cone, ..one }
        };
        let keys = result.map(|c| FieldCurvatureJson {
            tangential: c.tangential.map(estimate),
            sagittal: c.sagittal.map(estimate),
        });
        AtField::new(field, keys)
    };
    run.at_each_field(at)
}

impl TextLines for FieldCurvatureJson {
    const TITLE: &'static str =
        "foci along the chief ray at the primary wavelength, in mm behind the image plane";

    fn lines(&self) -> Vec<String> {
        let line = |name: &str, focus: &Option<Estimate>| {
            focus.as_ref().map_or(format!("{name}: rays are parallel"), |e| estimate_text(name, e))
        };
        vec![line("tangential", &self.tangential), line("sagittal", &self.sagittal)]
    }
}
