//! The spot over the whole field.

use super::{AnalysisRun, AtField, SelectedField, TextLines};
use crate::analysis::{Estimate, SpotMap, check_some_light, grid_nodes, grid_sides, spot_map};
use crate::cli::output::{ShortNumber, counted};
use crate::lens::FieldPoint;
use crate::measure::time_ms;
use crate::plot::{ChartCurve, ContourGrid, CurveChart, contour_curves};
use serde::Serialize;

/// The number of columns and of rows.
const COLUMNS: usize = 21;

/// The spot at every node of a grid over the field.
#[derive(Serialize)]
pub(super) struct SpotMapJson {
    rays: usize,
    milliseconds: f64,
    points: Vec<MapPointJson>,
    #[serde(skip)]
    grid: ContourGrid,
}

#[derive(Serialize)]
struct MapPointJson {
    field: [f64; 2],
    #[serde(skip_serializing_if = "Option::is_none")]
    rms: Option<Estimate>,
    #[serde(skip_serializing_if = "Option::is_none")]
    dark: Option<String>,
}

pub(super) fn map(run: &AnalysisRun) -> Vec<AtField<SpotMapJson>> {
    let axis = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
    let (found, milliseconds) = time_ms(|| {
        check_some_light(run.model.fields.iter().map(|field| (&run.model, *field)))?;
        spot_map(&run.model, COLUMNS, run.accuracy, || false)
    });
    let keys = found.map(|map| SpotMapJson::new(&map, milliseconds));
    vec![AtField::new(&SelectedField { given: axis, traced: axis }, keys)]
}

impl SpotMapJson {
    fn new(map: &SpotMap, milliseconds: f64) -> Self {
        let SpotMap { grid, rays } = map;
        let nodes = grid_nodes(grid.count, grid.half_width).into_iter().zip(&grid.values);
        let point = |(field, found): ([f64; 2], &Option<Result<Estimate, _>>)| {
            let found = found.as_ref()?;
            let dark = found.as_ref().err().map(ToString::to_string);
            Some(MapPointJson { field, rms: found.as_ref().ok().copied(), dark })
        };
        let points: Vec<MapPointJson> = nodes.filter_map(point).collect();
        let side = grid_sides(grid.count, grid.half_width);
        let value =
            |found: &Option<Result<Estimate, _>>| Some(found.as_ref()?.as_ref().ok()?.value);
        let values = grid.values.iter().map(value).collect();
        Self {
            rays: *rays,
            milliseconds,
            points,
            grid: ContourGrid { places: [side.clone(), side], values },
        }
    }
}

impl TextLines for SpotMapJson {
    const TITLE: &'static str = "RMS spot radius over the field, all wavelengths, in mm";

    fn lines(&self) -> Vec<String> {
        let Self { rays, milliseconds, points, .. } = self;
        let mut lines = vec![format!("{}, {milliseconds:.3} ms", counted(*rays, "ray"))];
        if let Some([least, most]) = self.grid.range() {
            lines.push(format!("from {} to {} mm", ShortNumber(least), ShortNumber(most)));
        }
        lines.push(["field x", "y", "rms", "error"].map(|head| format!("{head:>13}")).concat());
        for MapPointJson { field: [x, y], rms, dark } in points {
            let [x, y] = [x, y].map(|v| format!("{:>13}", ShortNumber(*v).to_string()));
            let number = |v: f64| format!("{:>13}", ShortNumber(v).to_string());
            let found = rms.map(|rms| number(rms.value) + &format!("{:>13.1e}", rms.error));
            let found = found.or_else(|| dark.as_ref().map(|why| format!("  {why}")));
            lines.push(x + &y + &found.unwrap_or_default());
        }
        lines
    }

    /// The contour lines over the field.
    fn charts(&self) -> Vec<CurveChart> {
        let curves: Vec<ChartCurve> = contour_curves(&self.grid, "mm");
        vec![CurveChart::map("RMS spot radius", ["field x", "field y"], curves)]
    }
}
