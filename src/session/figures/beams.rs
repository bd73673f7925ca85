//! Spots, beams on surfaces, the spot over the field, and reflected light.

use super::{Subject, estimate_note, ms_text};
use crate::analysis::{Estimate, Ghost, SpotPoints, grid_sides};
use crate::lens::{Quantity, SurfaceNumber};
use crate::plot::{ChartCurve, ContourGrid, CurveChart, contour_curves};
use crate::report::{AnalysisFigure, CurveColors, note_number};
use std::f64::consts::TAU;

/// The charts beside each other.
const COLUMNS: usize = 3;
/// The number of corners of a drawn rim.
const CORNERS: usize = 96;
/// The size of a point of a spot over that of the spot.
const POINT: f64 = 0.02;

/// The spot diagrams about their centroids, in micrometres.
pub(super) fn spots(subject: &Subject<'_>) -> AnalysisFigure {
    let (mut charts, mut tables, mut notes) = (Vec::new(), Vec::new(), Vec::new());
    for (i, spot) in subject.numbers.spots.value.iter().enumerate() {
        let name = subject.field(i);
        let spot = match spot {
            Ok(spot) => spot,
            Err(why) => {
                notes.push(format!("{name}: {why}"));
                continue;
            }
        };
        let center = [0, 1].map(|k| spot.centroid[k].value);
        let size = 2e3 * POINT * spot.radius.value;
        let of_field = subject.numbers.spot_points.value.iter().filter(|dots| dots.field == i);
        let places = |dots: &SpotPoints| -> Vec<[f64; 2]> {
            dots.points.iter().map(|p| [0, 1].map(|k| 1e3 * (p[k] - center[k]))).collect()
        };
        let (mut crosses, mut points) = (Vec::new(), Vec::new());
        for dots in of_field {
            let (color, places) = (dots.wavelength, places(dots));
            let name = subject.wavelength(color);
            crosses.push(ChartCurve::crosses(name.clone(), color, &places, size));
            points.push(ChartCurve { name, color, dashed: false, pieces: vec![places] });
        }
        charts.push(CurveChart::map(name.clone(), ["x, µm", "y, µm"], crosses));
        tables.push(CurveChart::map(name.clone(), ["x, µm", "y, µm"], points));
        notes.push(estimate_note(&format!("{name} RMS radius"), &spot.rms, " mm"));
        notes.push(estimate_note(&format!("{name} largest radius"), &spot.radius, " mm"));
    }
    AnalysisFigure {
        rows: charts.chunks(COLUMNS).map(<[CurveChart]>::to_vec).collect(),
        tables,
        notes,
        colors: CurveColors::Wavelengths(subject.wavelengths()),
        ..AnalysisFigure::default()
    }
}

/// The edges of the beams on a surface, and its rim.
pub(super) fn footprint(subject: &Subject<'_>, surface: usize) -> Option<AnalysisFigure> {
    let found = subject.numbers.footprints.as_ref()?;
    let (mut curves, mut notes) = (Vec::new(), Vec::new());
    let lens = &subject.results.lens;
    let rim = lens.parameter_at(subject.results.settings.zoom, surface, Quantity::SemiDiameter);
    if let Some(radius) = lens.get(rim).filter(|_| surface < lens.surfaces.len()) {
        let corner = |i: usize| {
            let (sin, cos) = (TAU * i as f64 / CORNERS as f64).sin_cos();
            [radius * cos, radius * sin]
        };
        let points = (0..=CORNERS).map(corner).map(|[x, y]| (x, Some(y)));
        curves.push(ChartCurve::new("rim", 0, points).neutral().dashed());
    }
    for (i, prints) in found.value.iter().enumerate() {
        let name = subject.field(i);
        match prints.as_ref().map(|prints| prints.get(surface)) {
            Ok(Some(print)) => {
                let edge = print.outline.iter().chain(print.outline.first());
                curves.push(ChartCurve::new(name.clone(), i, edge.map(|[x, y]| (*x, Some(*y)))));
                let (reach, rays) = (note_number(print.reach), print.outline.len());
                notes.push(format!("{name}: reaches {reach} mm from the axis, {rays} rays"));
            }
            Ok(None) => {}
            Err(why) => notes.push(format!("{name}: {why}")),
        }
    }
    notes.push(ms_text(found.ms));
    let title = if surface < lens.surfaces.len() {
        format!("Beams on surface {}", SurfaceNumber::new(surface))
    } else {
        "Beams on the image plane".to_owned()
    };
    let chart = CurveChart::map(title, ["x, mm", "y, mm"], curves);
    Some(AnalysisFigure { rows: vec![vec![chart]], notes, ..AnalysisFigure::default() })
}

/// The contour lines of the RMS spot radius over the field.
pub(super) fn spot_map(subject: &Subject<'_>) -> Result<Option<AnalysisFigure>, String> {
    let Some(found) = subject.numbers.spot_map.as_ref() else { return Ok(None) };
    let map = found.value.as_ref().map_err(ToString::to_string)?;
    let side = grid_sides(map.grid.count, map.grid.half_width);
    let spot = |found: &Option<Result<Estimate, _>>| -> Option<Estimate> {
        found.as_ref()?.as_ref().ok().copied()
    };
    let values: Vec<Option<f64>> =
        map.grid.values.iter().map(|found| spot(found).map(|spot| 1e3 * spot.value)).collect();
    let row = |(y, values): (&f64, &[Option<f64>])| {
        let points = side.iter().copied().zip(values.iter().copied());
        ChartCurve::new(format!("field y {}", note_number(*y)), 0, points)
    };
    let rows = side.iter().zip(values.chunks(map.grid.count)).map(row).collect();
    let table = CurveChart::new("RMS spot radius", ["field x", "RMS radius, µm"], rows);
    let errors = map.grid.values.iter().filter_map(spot).map(|spot| spot.error / spot.value);
    let error = 100.0 * errors.fold(0.0, f64::max);
    let grid = ContourGrid { places: [side.clone(), side.clone()], values };
    let curves = contour_curves(&grid, "µm");
    let chart = CurveChart::map("RMS spot radius", ["field x", "field y"], curves);
    let note = format!("± {error:.1e} %, {} rays, {}", map.rays, ms_text(found.ms));
    Ok(Some(AnalysisFigure {
        rows: vec![vec![chart]],
        tables: vec![table],
        notes: vec![subject.field_axis().to_owned(), note],
        ..AnalysisFigure::default()
    }))
}

/// The irradiance of the ghosts of each field, the brightest first.
pub(super) fn ghosts(subject: &Subject<'_>) -> Result<Option<AnalysisFigure>, String> {
    let Some(found) = subject.numbers.ghosts.as_ref() else { return Ok(None) };
    let ghosts = found.value.as_ref().map_err(ToString::to_string)?;
    let (mut bars, mut tables) = (Vec::new(), Vec::new());
    let mut rays = 0;
    for (i, listed) in ghosts.fields.iter().enumerate() {
        let name = subject.field(i);
        rays += listed.iter().map(|ghost| ghost.patch.fates.total()).sum::<usize>();
        let lit = listed.iter().filter(|ghost| ghost.patch.irradiance > 0.0).enumerate();
        let points = lit.map(|(k, ghost)| ((k + 1) as f64, Some(ghost.patch.irradiance.log10())));
        bars.push(ChartCurve::new(name.clone(), i, points));
        tables.extend(ghost_tables(&name, i, listed));
    }
    let axes = ["ghost, the brightest first", "lg irradiance over that at the entrance"];
    let (coating, direct) = (&ghosts.coating, 100.0 * ghosts.ranking.direct);
    Ok(Some(AnalysisFigure {
        rows: vec![vec![CurveChart::new("Irradiance of ghosts", axes, bars)]],
        tables,
        notes: vec![
            format!("coating: {coating}; {direct:.2} % passes without reflection"),
            format!("{rays} rays, {}", ms_text(found.ms)),
        ],
        ..AnalysisFigure::default()
    }))
}

/// The numbers of the ghosts of a field, over both surfaces.
fn ghost_tables(name: &str, color: usize, listed: &[Ghost]) -> Vec<CurveChart> {
    let of = |number: &dyn Fn(&Ghost) -> Option<f64>| {
        let curve = |(k, ghost): (usize, &Ghost)| {
            let [first, second] =
                [ghost.paraxial.first, ghost.paraxial.second].map(SurfaceNumber::new);
            let point = [((k + 1) as f64, number(ghost))];
            ChartCurve::new(format!("surfaces {first} and {second}"), color, point)
        };
        listed.iter().enumerate().map(curve).collect()
    };
    let rank = "ghost, the brightest first";
    vec![
        CurveChart::new(
            name,
            [rank, "irradiance over that at the entrance"],
            of(&|ghost| Some(ghost.patch.irradiance)),
        ),
        CurveChart::new(name, [rank, "radius, mm"], of(&|ghost| Some(ghost.patch.radius))),
        CurveChart::new(
            name,
            [rank, "focus behind the image plane, mm"],
            of(&|ghost| ghost.paraxial.focus),
        ),
    ]
}
