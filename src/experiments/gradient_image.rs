//! Figure 3.5: the image of a glyph through a lens, differentiated by the stop and by a curvature.
//!
//! Light is traced backwards, from a pixel of the sensor through the rear of the lens to a chart in
//! front of it. A pixel is `∫ c(p) dw` over the transmitted rays, `c` the brightness of the chart
//! at the end of a ray. Its derivatives by the boundary integral and by the warp field are compared
//! with central differences of the image and with the biased derivative, which is zero for the
//! stop: no transmitted ray ends elsewhere when the stop opens.
//!
//! The chart is a smooth function, so that pixels are integrals without noise, which can be
//! compared to many digits. Figure 3.5 of the thesis shows a trademark in its place.

use super::{
    Claim, DataTable, Effort, Experiment, ExperimentError, ExperimentOutcome, ExperimentResult,
    NamedPlot, ProgressFn, lens, report_progress,
};
use crate::lens::{Aperture, FieldKind, FieldPoint, Object, System};
use crate::math::Real;
use crate::paraxial::Beam;
use crate::plot::{BLACK, Canvas, Color, GREY, TextAlign, diverging, gray_level};
use crate::pupil::{
    Aiming, FixedLaunch, Integrand, PupilPattern, RayModel, Region, RegionKind, TracedPupil,
    WarpSampling,
};
use crate::trace::{SurfaceParameter, SystemGradient};
use rayon::prelude::*;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "3.5",
    title: "Gradient images by the stop and by a curvature",
    claim: "The unbiased derivative of an image matches finite differences; the biased one by the \
            stop is zero everywhere",
    omits: "the gradient images of DiffOptics, for which the biased derivative stands; a smooth \
            chart replaces the logo",
    seconds: 15.0,
    run,
};

const LENS: &str = "double_gauss_rudolph_50";
const UM: f64 = 0.5875618;
/// Half the side of the sensor, in mm.
const HALF: f64 = 6.0;
/// The distance of the chart in front of the lens, in mm.
const DISTANCE: f64 = 10_000.0;
/// The order of quadrature.
const ORDER: usize = 4;
/// The rays per pixel of the noisy image for comparison.
const SCATTERED: usize = 4096;
/// The samples of the warp field per pixel.
const SAMPLES: usize = 4096;
const FEW_SAMPLES: usize = 2048;
/// The largest relative error of the warp field, by the stop and by the curvature: it is a random
/// estimate.
const NOISE: [f64; 2] = [0.05, 0.1];
/// Steps of the differences: the radius of the stop in mm, the curvature in 1/mm.
const STEPS: [f64; 2] = [1e-5, 1e-6];
/// The largest relative difference between the boundary integrals and central differences.
const AGREEMENT: f64 = 1e-4;
/// The largest relative error of the biased derivative by the curvature: the front of the lens
/// hardly limits these pixels.
const NEARLY: f64 = 0.05;

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let side = effort.select(40, 10);
    let camera = SensorView::new(effort.select(SAMPLES, FEW_SAMPLES))?;
    let mut pixels = Vec::with_capacity(side * side);
    for row in 0..side {
        report_progress(progress, row as f64 / side as f64, "pixels")?;
        let line: ExperimentResult<Vec<Pixel>> = (0..side)
            .into_par_iter()
            .map(|column| camera.pixel(place(row, column, side)))
            .collect();
        pixels.extend(line?);
    }
    let images = GradientImages { side, pixels };
    Ok(ExperimentOutcome {
        claims: images.claims(),
        tables: vec![images.table()],
        lenses: Vec::new(),
        pictures: vec![NamedPlot { name: "images", canvas: images.draw() }],
        rays: images.pixels.iter().map(|pixel| pixel.rays).sum(),
        reasons: Vec::new(),
    })
}

/// The centre of a pixel in mm, the first row at the top. The image is upside down.
fn place(row: usize, column: usize, side: usize) -> [f64; 2] {
    let at = |i: usize| HALF * ((2.0 * i as f64 + 1.0) / side as f64 - 1.0);
    [-at(column), at(row)]
}

/// A capital A in soft strokes, bright on a darker ground.
#[derive(Debug, Clone, Copy)]
struct TestChart {
    /// The length on the chart that corresponds to half the side of the sensor, in mm.
    unit: f64,
}

/// The strokes from end to end, in units of half the side of the image.
const STROKES: [[[f64; 2]; 2]; 3] =
    [[[-0.55, -0.7], [0.0, 0.7]], [[0.55, -0.7], [0.0, 0.7]], [[-0.31, -0.1], [0.31, -0.1]]];
/// Half the width of a stroke, and the softness of its edge.
const WIDTH: f64 = 0.13;
const SOFT: f64 = 0.03;
/// Brightness of the ground and of a stroke.
const GROUND: f64 = 0.15;
const BRIGHT: f64 = 0.9;

impl TestChart {
    /// The coverage of a point by a stroke, 0 to 1, and its slope: a logistic function of the
    /// squared distance, smooth everywhere.
    fn stroke([from, to]: [[f64; 2]; 2], t: [f64; 2]) -> (f64, [f64; 2]) {
        let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
        let along = (t[0] - from[0]) * dx + (t[1] - from[1]) * dy;
        let share = (along / (dx * dx + dy * dy)).clamp(0.0, 1.0);
        let away = [t[0] - from[0] - share * dx, t[1] - from[1] - share * dy];
        let square = away[0] * away[0] + away[1] * away[1];
        let depth = (square - WIDTH * WIDTH) / (2.0 * WIDTH * SOFT);
        let ink = 1.0 / (1.0 + depth.exp());
        (ink, away.map(|v| -ink * (1.0 - ink) * v / (WIDTH * SOFT)))
    }

    /// The fraction of a point that no stroke covers, and its slope.
    fn uncovered(t: [f64; 2]) -> (f64, [f64; 2]) {
        STROKES.into_iter().fold((1.0, [0.0; 2]), |(bare, slope), ends| {
            let (ink, by) = Self::stroke(ends, t);
            (bare * (1.0 - ink), [0, 1].map(|k| slope[k] * (1.0 - ink) - bare * by[k]))
        })
    }
}

impl Integrand for TestChart {
    fn value<R: Real>(&self, p: [R; 2]) -> R {
        let (bare, _) = Self::uncovered(p.map(|v| v.value() / self.unit));
        R::from_f64(BRIGHT - (BRIGHT - GROUND) * bare)
    }

    fn slope<R: Real>(&self, p: [R; 2]) -> [R; 2] {
        let (_, slope) = Self::uncovered(p.map(|v| v.value() / self.unit));
        slope.map(|v| R::from_f64(-(BRIGHT - GROUND) * v / self.unit))
    }
}

/// The lens as seen from the sensor, and with slightly perturbed parameters.
struct SensorView {
    chart: TestChart,
    model: RayModel,
    /// Perturbed in the stop and in the curvature, each a step down and a step up.
    perturbed: [[RayModel; 2]; 2],
    /// The sampling of the warp field.
    warp: WarpSampling,
    stop: usize,
    /// The first surface of the lens, the last one of the reversed system.
    front: usize,
}

/// A pixel and its derivatives by the stop and by the curvature.
struct Pixel {
    value: f64,
    scattered: f64,
    boundary: [f64; 2],
    warp: [f64; 2],
    biased: [f64; 2],
    difference: [f64; 2],
    rays: usize,
}

impl SensorView {
    fn new(samples: usize) -> ExperimentResult<Self> {
        let lens = lens(LENS)?;
        let forwards = lens.resolve(0, UM)?;
        let rear = lens.surfaces.len() - 1;
        let object = Object::Finite(forwards.surfaces[rear].thickness);
        let focal = RayModel::from_lens(&lens, 0)?.first_order.efl;
        let focal =
            focal.ok_or_else(|| ExperimentError::Failed("the lens is afocal".to_owned()))?;
        let system = forwards.reversed(DISTANCE);
        let stop = system.stop.unwrap_or(0);
        let radius = system.surfaces[stop].semi_diameter;
        let model = |radius: f64, bend: f64| {
            let mut system = system.clone();
            // The reversed curvature has the other sign.
            *SurfaceParameter::Curvature.value_mut(&mut system, rear) -= bend;
            reversed_model(system, object, radius)
        };
        let [wider, bent] = STEPS;
        Ok(Self {
            chart: TestChart { unit: DISTANCE * HALF / focal },
            model: model(radius, 0.0)?,
            perturbed: [
                [model(radius - wider, 0.0)?, model(radius + wider, 0.0)?],
                [model(radius, -bent)?, model(radius, bent)?],
            ],
            warp: WarpSampling { count: samples, seed: 1 },
            stop,
            front: rear,
        })
    }

    fn pixel(&self, [x, y]: [f64; 2]) -> ExperimentResult<Pixel> {
        let field = FieldPoint { x, y, weight: 1.0 };
        let launch = self.model.launch(field, 0)?;
        let anchor = launch.to_fixed();
        let region = Region::new(launch);
        let lit = region.trace_pupil(ORDER);
        let failed =
            || ExperimentError::Failed(format!("the pupil of the pixel at {x}, {y} has no edge"));
        let boundary = lit.boundary_derivative(&self.chart).ok_or_else(failed)?;
        let warp = region.warp_derivative(&self.chart, self.warp).ok_or_else(failed)?;
        let biased = lit.biased_derivative(&self.chart);
        let nodes = region.pattern_nodes(PupilPattern::Sobol { count: SCATTERED, seed: 1 });
        let mut rays = region.rays + lit.rays_traced + warp.rays + nodes.points.len();
        let mut difference = [0.0; 2];
        for (i, models) in self.perturbed.iter().enumerate() {
            let ends = models.each_ref().map(|model| follow_pupil(&region.kind, anchor, model));
            rays += ends[0].rays_traced + ends[1].rays_traced;
            let [low, high] = ends.map(|lit| lit.integral(&self.chart));
            difference[i] = (high - low) / (2.0 * STEPS[i]);
        }
        let scattered = region.trace_nodes(&nodes).integral(&self.chart);
        Ok(Pixel {
            value: lit.integral(&self.chart),
            scattered,
            boundary: self.numbers(&boundary),
            warp: self.numbers(&warp.gradient),
            biased: self.numbers(&biased),
            difference,
            rays,
        })
    }

    /// The derivatives by the semi-diameter of the stop and by the curvature of the first surface.
    fn numbers(&self, by: &SystemGradient<f64>) -> [f64; 2] {
        [by.surfaces[self.stop].semi_diameter, -by.surfaces[self.front].curvature]
    }
}

/// The ray model of a reversed lens.
fn reversed_model(system: System<f64>, object: Object, radius: f64) -> ExperimentResult<RayModel> {
    let aperture = Aperture::StopSemiDiameter(radius);
    let edge = HALF * std::f64::consts::SQRT_2;
    let beam = Beam { object, aperture, field: FieldKind::ObjectHeight, edge };
    Ok(RayModel::from_systems(vec![(UM, 1.0, system)], 0, beam, Aiming::Paraxial)?)
}

/// The pupil of the same pixel tracked to a perturbed lens.
fn follow_pupil<'a>(
    before: &RegionKind,
    anchor: FixedLaunch,
    model: &'a RayModel,
) -> TracedPupil<'a> {
    Region::track(before, anchor.launch(model)).trace_pupil(ORDER)
}

/// Selects the two derivatives of a pixel by one method.
type PixelPair = fn(&Pixel) -> [f64; 2];

/// All pixels, row by row.
struct GradientImages {
    side: usize,
    pixels: Vec<Pixel>,
}

/// The norm of the difference of two images relative to the norm of the second.
fn relative(pixels: &[Pixel], of: impl Fn(&Pixel) -> f64, against: impl Fn(&Pixel) -> f64) -> f64 {
    let length = |number: &dyn Fn(&Pixel) -> f64| -> f64 {
        pixels.iter().map(|pixel| number(pixel).powi(2)).sum::<f64>().sqrt()
    };
    length(&|pixel| of(pixel) - against(pixel)) / length(&against)
}

/// The names of the two parameters.
const NAMES: [&str; 2] = ["semi-diameter of the stop", "curvature of the first surface"];

impl GradientImages {
    fn claims(&self) -> Vec<Claim> {
        let pixels = &self.pixels;
        let mut claims = vec![Claim::at_most(
            format!("image against {SCATTERED} scattered rays a pixel, relative L2"),
            relative(pixels, |pixel| pixel.scattered, |pixel| pixel.value),
            0.02,
        )];
        for (i, name) in NAMES.into_iter().enumerate() {
            claims.push(Claim::at_most(
                format!("by the {name}: boundary against differences, relative L2"),
                relative(pixels, |pixel| pixel.boundary[i], |pixel| pixel.difference[i]),
                AGREEMENT,
            ));
            claims.push(Claim::at_most(
                format!("by the {name}: warp field against differences, relative L2"),
                relative(pixels, |pixel| pixel.warp[i], |pixel| pixel.difference[i]),
                NOISE[i],
            ));
        }
        let largest = |of: &dyn Fn(&Pixel) -> f64| {
            pixels.iter().map(|pixel| of(pixel).abs()).fold(0.0, f64::max)
        };
        let [bright, dark] =
            [largest(&|pixel| pixel.difference[0]), largest(&|pixel| pixel.biased[0])];
        claims.push(
            Claim::at_least(
                format!("by the {}: differences, largest pixel", NAMES[0]),
                bright,
                1.0,
            )
            .in_unit("mm"),
        );
        claims.push(
            Claim::exactly(format!("by the {}: biased, largest pixel", NAMES[0]), dark, 0.0)
                .in_unit("mm"),
        );
        claims.push(Claim::exactly(
            format!("by the {}: biased against differences, relative L2", NAMES[0]),
            relative(pixels, |pixel| pixel.biased[0], |pixel| pixel.difference[0]),
            1.0,
        ));
        claims.push(Claim::at_most(
            format!("by the {}: biased against differences, relative L2", NAMES[1]),
            relative(pixels, |pixel| pixel.biased[1], |pixel| pixel.difference[1]),
            NEARLY,
        ));
        claims
    }

    fn table(&self) -> DataTable {
        let columns = [
            "row",
            "column",
            "image_mm2",
            "scattered_mm2",
            "by_stop_boundary_mm",
            "by_stop_warp_mm",
            "by_stop_difference_mm",
            "by_stop_biased_mm",
            "by_curvature_boundary_mm3",
            "by_curvature_warp_mm3",
            "by_curvature_difference_mm3",
            "by_curvature_biased_mm3",
        ];
        let mut table = DataTable::new("images", &columns);
        for (i, pixel) in self.pixels.iter().enumerate() {
            let place = [i / self.side, i % self.side];
            let derivatives = [0, 1]
                .map(|k| [pixel.boundary[k], pixel.warp[k], pixel.difference[k], pixel.biased[k]]);
            let numbers = [pixel.value, pixel.scattered].into_iter().chain(derivatives.concat());
            table.push_row(place.map(Into::into).into_iter().chain(numbers.map(Into::into)));
        }
        table
    }

    /// Draws the image, and for each parameter a row of its derivatives on a common scale.
    fn draw(&self) -> Canvas {
        let cell = (320 / self.side).max(1);
        let width = cell * self.side;
        let step = width as f64 + 60.0;
        let size = [5 * (width + 60) + 60, 2 * (width + 90) + 60];
        let mut canvas = Canvas::new(size.map(|v| v as u32));
        let mut panel = |column: usize, row: usize, title: &str, colors: Vec<Color>| {
            let corner = [60.0 + step * column as f64, 70.0 + (step + 30.0) * row as f64];
            canvas.raster(corner, self.side, cell, &colors);
            let end = corner.map(|v| v + width as f64);
            for [x, y] in [[end[0], corner[1]], [corner[0], end[1]]] {
                canvas.line(corner, [x, y], GREY);
                canvas.line([x, y], end, GREY);
            }
            let middle = corner[0] + 0.5 * width as f64;
            canvas.text([middle, corner[1] - 26.0], title, BLACK, TextAlign::Middle);
        };
        let brightest = self.pixels.iter().map(|pixel| pixel.value).fold(0.0, f64::max);
        let image = self.pixels.iter().map(|pixel| gray_level(pixel.value / brightest));
        panel(0, 0, "image", image.collect());
        for i in 0..2 {
            let largest = self.pixels.iter().map(|p| p.difference[i].abs()).fold(0.0, f64::max);
            let kinds: [(&str, PixelPair); 4] = [
                ("boundary", |pixel| pixel.boundary),
                ("warp field", |pixel| pixel.warp),
                ("differences", |pixel| pixel.difference),
                ("biased", |pixel| pixel.biased),
            ];
            for (column, (name, of)) in kinds.into_iter().enumerate() {
                let shown = self.pixels.iter().map(|pixel| diverging(of(pixel)[i] / largest));
                let title = ["by the stop", "by the first curvature"][i];
                panel(column + 1, i, &format!("{name}, {title}"), shown.collect());
            }
        }
        canvas
    }
}
