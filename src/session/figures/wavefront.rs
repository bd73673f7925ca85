//! The wavefront and its polynomials, and the image of a point by diffraction and by rays.

use super::{Subject, estimate_note, ms_text};
use crate::analysis::{
    AnalysisError, Estimate, SquareGrid, ZernikeOrder, aberration_name, grid_sides,
};
use crate::plot::{ChartCurve, ContourGrid, CurveChart, contour_curves};
use crate::report::{AnalysisFigure, note_number};
use crate::session::analysis::{ENERGY_SHARES, FieldWavefront};
use crate::session::clock::Timed;

/// The intensities below this share of the peak that a logarithmic chart leaves out.
const DARK: f64 = 1e-6;
/// The charts beside each other.
const COLUMNS: usize = 3;

/// The rows of a grid as curves, for a table.
fn grid_table(title: String, axes: [&'static str; 2], grid: &SquareGrid<f64>) -> CurveChart {
    let side = grid_sides(grid.count, grid.half_width);
    let row = |(y, values): (&f64, &[f64])| {
        let points = side.iter().zip(values).map(|(x, value)| (*x, Some(*value)));
        ChartCurve::new(format!("y {}", note_number(*y)), 0, points)
    };
    let curves = side.iter().zip(grid.values.chunks(grid.count)).map(row).collect();
    CurveChart::new(title, axes, curves)
}

/// The contour lines of the wavefront over the pupil.
pub(super) fn maps(subject: &Subject<'_>) -> Option<AnalysisFigure> {
    let found = subject.numbers.wavefronts.as_ref()?;
    let mut notes = vec![format!("waves of {}", subject.light(Some(found.value.um)))];
    let (mut charts, mut tables) = (Vec::new(), Vec::new());
    for (i, field) in found.value.fields.iter().enumerate() {
        let name = subject.field(i);
        let wave = match &field.value {
            Ok(wave) => wave,
            Err(why) => {
                notes.push(format!("{name}: {why}"));
                continue;
            }
        };
        let side = grid_sides(wave.map.count, wave.map.half_width);
        let grid =
            ContourGrid { places: [side.clone(), side.clone()], values: wave.map.values.clone() };
        let curves = contour_curves(&grid, "waves");
        charts.push(CurveChart::map(name.clone(), ["pupil x", "pupil y"], curves));
        let row = |(y, values): (&f64, &[Option<f64>])| {
            let points = side.iter().copied().zip(values.iter().copied());
            ChartCurve::new(format!("pupil y {}", note_number(*y)), 0, points)
        };
        let rows = side.iter().zip(wave.map.values.chunks(wave.map.count)).map(row).collect();
        tables.push(CurveChart::new(name.clone(), ["pupil x", "waves"], rows));
        let rms = estimate_note("RMS", &wave.wavefront.rms, " waves");
        notes.push(format!("{name}: {rms}, {}", ms_text(field.ms)));
    }
    let rows = charts.chunks(COLUMNS).map(<[CurveChart]>::to_vec).collect();
    Some(AnalysisFigure { rows, tables, notes, ..AnalysisFigure::default() })
}

/// The Zernike coefficients as bars over their numbers.
pub(super) fn coefficients(subject: &Subject<'_>) -> Option<AnalysisFigure> {
    let found = subject.numbers.wavefronts.as_ref()?;
    let light = subject.light(Some(found.value.um));
    let mut notes = vec![format!("Noll's order, waves of {light}")];
    let (mut bars, mut ends) = (Vec::new(), Vec::new());
    let count = found.value.fields.len().max(1) as f64;
    for (i, field) in found.value.fields.iter().enumerate() {
        let name = subject.field(i);
        let sum = field.value.as_ref().map_err(|why| *why);
        match sum.and_then(|wave| wave.zernike.as_ref().map_err(|why| *why)) {
            Ok(sum) => {
                let points: Vec<[f64; 2]> = sum
                    .coefficients
                    .iter()
                    .enumerate()
                    .skip(1)
                    .map(|(k, e)| [(k + 1) as f64, e.value])
                    .collect();
                let shift = 0.6 * (i as f64 / count - 0.5);
                let shifted: Vec<[f64; 2]> = points.iter().map(|[x, y]| [x + shift, *y]).collect();
                bars.push(ChartCurve::bars(name.clone(), i, &shifted, 0.0));
                ends.push(ChartCurve {
                    name: name.clone(),
                    color: i,
                    dashed: false,
                    pieces: vec![points],
                });
                notes.push(estimate_note(&format!("{name} RMS of the rest"), &sum.rest, " waves"));
            }
            Err(why) => notes.push(format!("{name}: {why}")),
        }
    }
    let fringe = fringe_table(subject);
    let most = ends.iter().flat_map(|curve| curve.pieces.iter().map(Vec::len)).max().unwrap_or(0);
    let names = ZernikeOrder::Noll.indices(most + 1).into_iter().enumerate().skip(1);
    notes.extend(names.map(|(k, index)| format!("{}: {}", k + 1, aberration_name(index))));
    let axes = ["number in Noll's order", "waves"];
    Some(AnalysisFigure {
        rows: vec![vec![CurveChart::new("Zernike coefficients", axes, bars)]],
        tables: vec![CurveChart::new("Zernike coefficients, Noll", axes, ends), fringe?],
        notes,
        ..AnalysisFigure::default()
    })
}

/// The coefficients in the fringe order, for a table.
fn fringe_table(subject: &Subject<'_>) -> Option<CurveChart> {
    let found = subject.numbers.wavefronts.as_ref()?;
    let curve = |(i, field): (usize, &Timed<Result<FieldWavefront, AnalysisError>>)| {
        let sum = field.value.as_ref().ok()?.fringe.as_ref().ok()?;
        let place = |(k, e): (usize, &Estimate)| ((k + 1) as f64, Some(e.value));
        let points = sum.coefficients.iter().enumerate().skip(1).map(place);
        Some(ChartCurve::new(subject.field(i), i, points))
    };
    let curves = found.value.fields.iter().enumerate().filter_map(curve).collect();
    let axes = ["number in the fringe order", "waves"];
    Some(CurveChart::new("Zernike coefficients, fringe", axes, curves))
}

/// The sections of an image of a point through its centre, linear and logarithmic.
fn sections(name: &str, grid: &SquareGrid<f64>, peak: f64) -> Vec<CurveChart> {
    let side = grid_sides(grid.count, grid.half_width);
    let middle = grid.count / 2;
    let along_x = |i: usize| grid.values[middle * grid.count + i];
    let along_y = |i: usize| grid.values[i * grid.count + middle];
    let chart = |title: &str, axis: &'static str, number: &dyn Fn(f64) -> Option<f64>| {
        let curve = |name: &str, color: usize, of: &dyn Fn(usize) -> f64| {
            let points = side.iter().enumerate().map(|(i, at)| (1e3 * at, number(of(i) / peak)));
            ChartCurve::new(name, color, points)
        };
        let curves = vec![curve("along x", 0, &along_x), curve("along y", 1, &along_y)];
        CurveChart::new(format!("{name} {title}"), ["distance, µm", axis], curves)
    };
    let logarithm = |share: f64| (share > DARK).then(|| share.log10());
    vec![
        chart("linear", "intensity", &|share| Some(share)),
        chart("logarithmic", "lg intensity", &logarithm),
    ]
}

/// The image of a point by diffraction.
pub(super) fn point_spread(subject: &Subject<'_>) -> Option<AnalysisFigure> {
    let found = subject.numbers.point_images.as_ref()?;
    let about =
        "intensity over the peak without aberrations, about the image point of the chief ray";
    let mut notes = vec![format!("{about}, {}", subject.light(found.value.um))];
    let (mut rows, mut tables) = (Vec::new(), Vec::new());
    for (i, field) in found.value.fields.iter().enumerate() {
        let name = subject.field(i);
        match &field.value {
            Ok(image) => {
                rows.push(sections(&name, &image.intensity, 1.0));
                tables.push(grid_table(name.clone(), ["x, mm", "intensity"], &image.intensity));
                notes.push(estimate_note(
                    &format!("{name} Strehl ratio at the chief ray"),
                    &image.strehl.at_chief,
                    "",
                ));
                let best = image.strehl.best_name();
                notes.push(estimate_note(
                    &format!("{name} {best} Strehl ratio"),
                    &image.strehl.best,
                    "",
                ));
                let (error, ms) = (image.error, ms_text(field.ms));
                notes.push(format!("{name}: ± {error:.0e}, {} rays, {ms}", image.rays));
            }
            Err(why) => notes.push(format!("{name}: {why}")),
        }
    }
    Some(AnalysisFigure { rows, tables, notes, ..AnalysisFigure::default() })
}

/// A curve of encircled energy that begins at the centre.
fn energy_curve(
    name: String,
    color: usize,
    circles: impl Iterator<Item = (f64, f64)>,
) -> ChartCurve {
    let circles = circles.map(|(radius, share)| (1e3 * radius, Some(share)));
    ChartCurve::new(name, color, std::iter::once((0.0, Some(0.0))).chain(circles))
}

/// Lines from the axis up to the curve at the radii of the circles that hold shares of the light.
fn share_marks(name: &str, color: usize, radii: &[Option<Estimate>]) -> Vec<ChartCurve> {
    let mark = |(share, radius): (&f64, &Option<Estimate>)| {
        let radius = 1e3 * radius.as_ref()?.value;
        let ends = [(radius, Some(0.0)), (radius, Some(*share))];
        let name = format!("{name} radius of {:.0} %", 100.0 * share);
        Some(ChartCurve::new(name, color, ends).dashed())
    };
    ENERGY_SHARES.iter().zip(radii).filter_map(mark).collect()
}

/// The radii of the circles that hold shares of the light.
fn share_notes(name: &str, radii: &[Option<Estimate>]) -> Vec<String> {
    let note = |(share, radius): (&f64, &Option<Estimate>)| {
        let what = format!("{name} radius of {:.0} % of the light", 100.0 * share);
        radius.as_ref().map_or_else(
            || format!("{what}: beyond the largest circle"),
            |radius| estimate_note(&what, radius, " mm"),
        )
    };
    ENERGY_SHARES.iter().zip(radii).map(note).collect()
}

/// The encircled energy by diffraction.
pub(super) fn energy(subject: &Subject<'_>) -> Option<AnalysisFigure> {
    let found = subject.numbers.point_images.as_ref()?;
    let about = "by diffraction, about the image point of the chief ray";
    let mut notes = vec![format!("{about}, {}", subject.light(found.value.um))];
    let mut curves = Vec::new();
    for (i, field) in found.value.fields.iter().enumerate() {
        let name = subject.field(i);
        match &field.value {
            Ok(image) => {
                let circles = image.energy.iter().map(|(radius, share)| (*radius, share.value));
                curves.push(energy_curve(name.clone(), i, circles));
                let radii = image.energy.iter().map(|(radius, _)| *radius);
                let perfect = radii.zip(image.perfect.iter().copied());
                let limit = format!("{name} without aberrations");
                curves.push(energy_curve(limit, i, perfect).dashed());
                curves.extend(share_marks(&name, i, &image.share_radii));
                notes.extend(share_notes(&name, &image.share_radii));
                let error = image.energy.iter().map(|(_, share)| share.error).fold(0.0, f64::max);
                notes.push(format!(
                    "{name}: ± {error:.0e}, {} rays, {}",
                    image.rays,
                    ms_text(field.ms)
                ));
            }
            Err(why) => notes.push(format!("{name}: {why}")),
        }
    }
    let chart = CurveChart::new("Encircled energy", ["radius, µm", "share of the light"], curves);
    Some(AnalysisFigure { rows: vec![vec![chart]], notes, ..AnalysisFigure::default() })
}

/// The image of a point by rays.
pub(super) fn ray_image(subject: &Subject<'_>) -> Option<AnalysisFigure> {
    let found = subject.numbers.ray_images.as_ref()?;
    let about =
        "density of rays over its peak, about the image point of the chief ray, all wavelengths";
    let mut notes = vec![about.to_owned()];
    let (mut rows, mut tables) = (Vec::new(), Vec::new());
    for (i, field) in found.value.fields.iter().enumerate() {
        let name = subject.field(i);
        match &field.value {
            Ok(found) => {
                let density = &found.image.density;
                let peak = density.values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
                rows.push(sections(&name, density, peak));
                tables.push(grid_table(
                    name.clone(),
                    ["x, mm", "share of the light, 1/mm2"],
                    density,
                ));
                let (error, rays) = (100.0 * found.image.error, found.image.rays);
                notes.push(format!(
                    "{name}: ± {error:.1} % of the peak, {rays} rays, {}",
                    ms_text(field.ms)
                ));
            }
            Err(why) => notes.push(format!("{name}: {why}")),
        }
    }
    Some(AnalysisFigure { rows, tables, notes, ..AnalysisFigure::default() })
}

/// The encircled energy by rays.
pub(super) fn ray_energy(subject: &Subject<'_>) -> Option<AnalysisFigure> {
    let found = subject.numbers.ray_images.as_ref()?;
    let mut notes =
        vec!["by rays, about the image point of the chief ray, all wavelengths".to_owned()];
    let mut curves = Vec::new();
    for (i, field) in found.value.fields.iter().enumerate() {
        let name = subject.field(i);
        match &field.value {
            Ok(found) => {
                let shares = found.image.energy.iter().map(|share| share.value);
                curves.push(energy_curve(name.clone(), i, found.radii.iter().copied().zip(shares)));
                let share_radii: Vec<_> =
                    found.image.share_radii.iter().copied().map(Some).collect();
                curves.extend(share_marks(&name, i, &share_radii));
                notes.extend(share_notes(&name, &share_radii));
                let error = found.image.energy.iter().map(|share| share.error).fold(0.0, f64::max);
                let rays = found.image.rays;
                notes.push(format!("{name}: ± {error:.0e}, {rays} rays, {}", ms_text(field.ms)));
            }
            Err(why) => notes.push(format!("{name}: {why}")),
        }
    }
    let chart = CurveChart::new("Encircled energy", ["radius, µm", "share of the light"], curves);
    Some(AnalysisFigure { rows: vec![vec![chart]], notes, ..AnalysisFigure::default() })
}
