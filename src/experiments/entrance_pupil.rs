//! Figure 3.4: the entrance pupil of a double Gauss lens at several fields, and the surfaces that
//! limit it.
//!
//! The edge of every pupil is tracked and split at its corners into arcs, each with the limit that
//! causes it; the boundary integral of (3.16) runs along them. Two checks do not use the edges: a
//! bitmap of rays launched from a grid in the first vertex plane, whose transmitted cells must add
//! up to the same area, and rays launched close to the edge on both sides, which must reach the
//! image or end at the surface of the arc.

use super::{
    Claim, DataTable, Effort, Experiment, ExperimentError, ExperimentOutcome, ExperimentResult,
    NamedPlot, ProgressFn, TableCell, lens, report_progress,
};
use crate::lens::FieldPoint;
use crate::math::Vec3;
use crate::plot::{Axis, BLACK, Canvas, Chart, Color, GREY, PALETTE, Stroke, TextAlign};
use crate::pupil::{Accuracy, ConvergedValues, PupilLimit, PupilOutline, RayModel, Region};
use crate::trace::{Fate, ImagePoints, Ray, Rays, TraceSink};
use std::f64::consts::PI;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "3.4",
    title: "The entrance pupil of a double Gauss lens by its limits",
    claim: "Off the axis the pupil is no disc: more and more limits form its edge, with corners",
    omits: "nothing of the figure",
    seconds: 2.0,
    run,
};

const LENS: &str = "double_gauss_nikkor_s_50";
/// The largest field angle, in degrees.
const EDGE: f64 = 24.0;
/// The number of points of an outline.
const POINTS: usize = 256;
/// The relative accuracy of its area.
const ACCURACY: Accuracy = Accuracy { tolerance: 1e-7, max_rays: 100_000 };
/// The relative distance from the edge at which rays are launched to check their fates.
const BESIDE: f64 = 1e-6;
/// The size of the bitmap relative to the pupil.
const MARGIN: f64 = 1.08;
/// The offset of its cells from the axes of symmetry of the pupil, in cells: without it the errors
/// of mirrored cells would be equal.
const ASKEW: [f64; 2] = [0.31, 0.17];
/// The largest deviation of the area of a bitmap, in standard errors.
const SIGMAS: f64 = 4.0;

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let (fields, cells): (usize, usize) = effort.select((13, 400), (5, 150));
    let model = RayModel::from_lens(&lens(LENS)?, 0)?;
    let mut pupils = Vec::new();
    for i in 0..fields {
        let angle = EDGE * i as f64 / (fields - 1) as f64;
        report_progress(progress, i as f64 / fields as f64, &format!("pupil at {angle} degrees"))?;
        pupils.push(MappedPupil::at(&model, angle, cells)?);
    }
    Ok(ExperimentOutcome {
        claims: claims(&pupils),
        tables: vec![areas(&pupils), shares(&model, &pupils), edges(&model, &pupils)],
        lenses: Vec::new(),
        pictures: vec![
            NamedPlot { name: "pupils", canvas: maps(&model, &pupils) },
            NamedPlot { name: "shares", canvas: curves(&model, &pupils) },
        ],
        rays: pupils.iter().map(|pupil| pupil.rays).sum(),
        reasons: Vec::new(),
    })
}

/// The pupil of a field.
struct MappedPupil {
    /// The field angle in degrees.
    angle: f64,
    outline: PupilOutline,
    area: ConvergedValues<3>,
    bitmap: Bitmap,
    /// The number of rays beside the edge whose fate contradicts the outline.
    wrong: usize,
    rays: usize,
}

impl MappedPupil {
    fn at(model: &RayModel, angle: f64, cells: usize) -> ExperimentResult<Self> {
        let field = FieldPoint { x: 0.0, y: angle, weight: 1.0 };
        let launch = model.launch(field, model.primary)?;
        let region = Region::new(launch);
        let dark = || ExperimentError::Failed(format!("the pupil at {angle} degrees has no edge"));
        let outline = region.outline(POINTS).ok_or_else(dark)?;
        let area = region.extent(ACCURACY).ok_or_else(dark)?;
        let bitmap = Bitmap::of(model, angle, &outline, cells);
        let (wrong, beside) = wrong_fates(model, angle, &outline);
        let rays = area.rays + outline.rays + beside + cells * cells;
        Ok(Self { angle, outline, area, bitmap, wrong, rays })
    }

    fn area(&self) -> f64 {
        self.area.values[0]
    }

    fn corners(&self) -> usize {
        self.outline.corners().count()
    }

    fn perimeter(&self) -> f64 {
        self.outline.sides.iter().map(|side| side.length).sum()
    }

    /// `4π A / P²`: 1 for a disc and for nothing else.
    fn roundness(&self) -> f64 {
        4.0 * PI * self.area() / self.perimeter().powi(2)
    }

    /// The standard error of the area of the bitmap: the transmitted fraction of a cell on the edge
    /// is uniform between 0 and 1, and the edge crosses `4/π` cells per cell length.
    fn grid_error(&self) -> f64 {
        let cell = self.bitmap.cell;
        let crossed = 4.0 / PI * self.perimeter() / cell;
        cell * cell * (crossed / 12.0).sqrt()
    }

    /// The deviation of the area of the bitmap, in standard errors.
    fn deviation(&self) -> f64 {
        (self.bitmap.area() - self.area()).abs() / self.grid_error()
    }
}

/// The ray of a field that crosses the first vertex plane at a point.
fn ray(angle: f64, [x, y]: [f64; 2]) -> Ray<f64> {
    let (sin, cos) = angle.to_radians().sin_cos();
    Ray { point: Vec3::new(x, y, 0.0), direction: Vec3::new(0.0, sin, cos) }
}

/// The fates of the rays through some points.
fn fates(model: &RayModel, angle: f64, points: impl Iterator<Item = [f64; 2]>) -> Vec<Fate> {
    let rays: Rays<f64> = points.map(|p| ray(angle, p)).collect();
    let mut landed = ImagePoints::default();
    model.channels[model.primary].tracer.trace_batch(&rays, &mut landed);
    (0..rays.len()).map(|i| landed.fate(i)).collect()
}

/// The fates of the rays at the points of a square grid.
struct Bitmap {
    /// The side of a cell in mm.
    cell: f64,
    cells: usize,
    corner: [f64; 2],
    fates: Vec<Fate>,
}

impl Bitmap {
    fn of(model: &RayModel, angle: f64, outline: &PupilOutline, cells: usize) -> Self {
        let points = || outline.sides.iter().flat_map(|side| &side.points);
        let ends = [0, 1].map(|k| {
            let values = || points().map(|p| p[k]);
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
        });
        let width = MARGIN * ends.iter().map(|(low, high)| high - low).fold(0.0, f64::max);
        let cell = width / cells as f64;
        let middle = ends.map(|(low, high)| 0.5 * (low + high - width + cell));
        let corner = [0, 1].map(|k| middle[k] + ASKEW[k] * cell);
        let at = |i: usize| {
            [corner[0] + (i % cells) as f64 * cell, corner[1] + (i / cells) as f64 * cell]
        };
        let fates = fates(model, angle, (0..cells * cells).map(at));
        Self { cell, cells, corner, fates }
    }

    fn area(&self) -> f64 {
        let lit = self.fates.iter().filter(|fate| fate.is_imaged()).count();
        lit as f64 * self.cell * self.cell
    }
}

/// The number of rays just inside the edge that do not reach the image and of rays just outside
/// that do not end at the surface of its arc, away from corners; and the number of all rays.
fn wrong_fates(model: &RayModel, angle: f64, outline: &PupilOutline) -> (usize, usize) {
    let [x, y] = outline.center;
    let mut wrong = 0;
    let mut rays = 0;
    for side in &outline.sides {
        let Some((_, rest)) = side.points.split_first() else { continue };
        let Some((_, points)) = rest.split_last() else { continue };
        let beside = |factor: f64| {
            let moved = points
                .iter()
                .map(move |p| [x + (1.0 + factor) * (p[0] - x), y + (1.0 + factor) * (p[1] - y)]);
            fates(model, angle, moved)
        };
        let lost = beside(-BESIDE).iter().filter(|fate| !fate.is_imaged()).count();
        let surface = side.limit.surface();
        let other = beside(BESIDE).iter().filter(|fate| fate.surface() != surface).count();
        wrong += lost + other;
        rays += 2 * points.len();
    }
    (wrong, rays)
}

fn claims(pupils: &[MappedPupil]) -> Vec<Claim> {
    let (first, last) = (&pupils[0], &pupils[pupils.len() - 1]);
    let fewer = pupils.windows(2).filter(|pair| pair[1].corners() < pair[0].corners()).count();
    let off = pupils.iter().map(MappedPupil::deviation).fold(0.0, f64::max);
    let wrong: usize = pupils.iter().map(|pupil| pupil.wrong).sum();
    let share = last.area() / first.area();
    let error = share * (last.area.errors[0] / last.area() + first.area.errors[0] / first.area());
    vec![
        Claim::exactly("corners of the pupil on the axis", first.corners() as f64, 0.0),
        Claim::at_most(
            "on the axis: 1 - 4 pi area / perimeter^2, zero for a disc",
            (1.0 - first.roundness()).abs(),
            1e-6,
        ),
        Claim::at_least("corners at the last field", last.corners() as f64, 4.0),
        Claim::at_most("fields with fewer corners than the one before", fewer as f64, 0.0),
        Claim::at_most(
            "roundness 4 pi area / perimeter^2 at the last field",
            last.roundness(),
            0.95,
        ),
        Claim::at_most("area at the last field over that on the axis", share, 0.9)
            .with_error(error),
        Claim::at_most("area against a bitmap of rays: worst, in standard errors", off, SIGMAS),
        Claim::at_most("rays beside the edge whose fate contradicts its arc", wrong as f64, 0.0),
    ]
}

fn areas(pupils: &[MappedPupil]) -> DataTable {
    let columns = [
        "field_deg",
        "corners",
        "area_mm2",
        "area_error_mm2",
        "bitmap_area_mm2",
        "bitmap_error_mm2",
        "perimeter_mm",
        "roundness",
    ];
    let mut table = DataTable::new("areas", &columns);
    for pupil in pupils {
        table.push_row([
            pupil.angle.into(),
            pupil.corners().into(),
            pupil.area().into(),
            pupil.area.errors[0].into(),
            pupil.bitmap.area().into(),
            pupil.grid_error().into(),
            pupil.perimeter().into(),
            pupil.roundness().into(),
        ]);
    }
    table
}

fn shares(model: &RayModel, pupils: &[MappedPupil]) -> DataTable {
    let mut table = DataTable::new("shares", &["field_deg", "limit", "surface", "share_of_edge"]);
    for pupil in pupils {
        for (limit, share) in pupil.outline.limits_by_share() {
            let surface = limit.surface().map_or(TableCell::Number(f64::NAN), TableCell::from);
            let name = model.limit_name(limit);
            table.push_row([pupil.angle.into(), name.into(), surface, share.into()]);
        }
    }
    table
}

fn edges(model: &RayModel, pupils: &[MappedPupil]) -> DataTable {
    let mut table = DataTable::new("edges", &["field_deg", "side", "limit", "x_mm", "y_mm"]);
    for pupil in pupils {
        for (i, side) in pupil.outline.sides.iter().enumerate() {
            for [x, y] in &side.points {
                let name = model.limit_name(side.limit);
                let angle = pupil.angle.into();
                table.push_row([angle, i.into(), name.into(), (*x).into(), (*y).into()]);
            }
        }
    }
    table
}

/// All limits in the order in which they appear with growing field, with their colours.
fn colors(pupils: &[MappedPupil]) -> Vec<(PupilLimit, Color)> {
    let mut found: Vec<PupilLimit> = Vec::new();
    for (limit, _) in pupils.iter().flat_map(|pupil| pupil.outline.limits_by_share()) {
        if !found.contains(&limit) {
            found.push(limit);
        }
    }
    found.into_iter().zip(PALETTE.into_iter().cycle()).collect()
}

fn color_of(colors: &[(PupilLimit, Color)], limit: PupilLimit) -> Color {
    colors.iter().find(|known| known.0 == limit).map_or(GREY, |known| known.1)
}

/// The colour of a fate in a bitmap: white for light, that of its surface's limit, else grey.
fn fate_color(colors: &[(PupilLimit, Color)], fate: Fate) -> Color {
    let of = |surface: usize| colors.iter().find(|known| known.0.surface() == Some(surface));
    match fate.surface() {
        None => [0xff; 3],
        Some(surface) => of(surface).map_or(GREY, |known| known.1.map(|c| c / 2 + 0x7f)),
    }
}

/// The number of fields drawn, and the side of a map in pixels.
const DRAWN: usize = 5;
const PANEL: f64 = 400.0;

/// Outlines above, bitmaps below.
fn maps(model: &RayModel, pupils: &[MappedPupil]) -> Canvas {
    let mut canvas = Canvas::new([120 + DRAWN as u32 * 500, 1240]);
    let colors = colors(pupils);
    legend(&mut canvas, model, &colors, [90.0, 20.0]);
    let step = (pupils.len() - 1) as f64 / (DRAWN - 1) as f64;
    for i in 0..DRAWN {
        let pupil = &pupils[(step * i as f64).round() as usize];
        let left = 100.0 + 500.0 * i as f64;
        let Bitmap { cell, cells, corner, fates } = &pupil.bitmap;
        let ends = corner.map(|low| [low, low + cell * (cells - 1) as f64]);
        let [x, y] =
            [("x, mm", ends[0]), ("y, mm", ends[1])].map(|(n, ends)| Axis::linear(n, ends));
        let chart =
            Chart::new([left, 150.0], [left + PANEL, 150.0 + PANEL], x, y).with_equal_scales();
        let title = format!("{} deg: {} corners", pupil.angle, pupil.corners());
        chart.draw(&mut canvas, &title);
        for side in &pupil.outline.sides {
            let color = color_of(&colors, side.limit);
            canvas.curve(&chart.to_pixels(&side.points), color, Stroke::Solid);
        }
        canvas.markers(&chart.to_pixels(&pupil.outline.corners().collect::<Vec<_>>()), BLACK);
        // Rows go downwards in a picture and upwards in the pupil.
        let rows = fates.chunks_exact(*cells).rev();
        let raster: Vec<Color> = rows.flatten().map(|fate| fate_color(&colors, *fate)).collect();
        let size = ((PANEL / *cells as f64) as usize).max(1);
        canvas.raster([left, 700.0], *cells, size, &raster);
        let text = format!("bitmap {:.3} mm^2, edge {:.3} mm^2", pupil.bitmap.area(), pupil.area());
        canvas.text([left + 0.5 * PANEL, 1150.0], &text, BLACK, TextAlign::Middle);
    }
    canvas
}

/// Area and fractions of the edge against the field.
fn curves(model: &RayModel, pupils: &[MappedPupil]) -> Canvas {
    let mut canvas = Canvas::new([1500, 800]);
    let colors = colors(pupils);
    legend(&mut canvas, model, &colors, [120.0, 20.0]);
    let x = || Axis::linear("field, deg", pupils.iter().map(|pupil| pupil.angle));
    let area = Axis::linear("mm^2", pupils.iter().map(MappedPupil::area).chain([0.0]));
    let share = Axis::linear("share", [0.0, 1.0]);
    let left = Chart::new([120.0, 190.0], [700.0, 690.0], x(), area);
    let right = Chart::new([860.0, 190.0], [1440.0, 690.0], x(), share);
    left.draw(&mut canvas, "area of the pupil");
    right.draw(&mut canvas, "fraction of the edge by limit");
    let places = pupils.iter().map(|pupil| left.to_pixel([pupil.angle, pupil.area()]));
    let places: Vec<_> = places.collect();
    canvas.marked_curve(&places, BLACK, Stroke::Solid);
    for (limit, color) in &colors {
        let share =
            |pupil: &MappedPupil| right.to_pixel([pupil.angle, pupil.outline.share(*limit)]);
        let places: Vec<_> = pupils.iter().map(share).collect();
        canvas.marked_curve(&places, *color, Stroke::Solid);
    }
    canvas
}

fn legend(canvas: &mut Canvas, model: &RayModel, colors: &[(PupilLimit, Color)], [x, y]: [f64; 2]) {
    for (i, (limit, color)) in colors.iter().enumerate() {
        let place = [x + 340.0 * (i % 4) as f64, y + 30.0 * (i / 4) as f64];
        canvas.curve(
            &[[place[0], place[1] + 7.0], [place[0] + 40.0, place[1] + 7.0]],
            *color,
            Stroke::Solid,
        );
        canvas.text([place[0] + 52.0, place[1]], &model.limit_name(*limit), BLACK, TextAlign::Left);
    }
}
