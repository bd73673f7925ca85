//! Figure 3.3: the stop of a lens that is optimized for sharpness alone closes to a pinhole if the
//! gradient includes the motion of the pupil edge.
//!
//! Two singlets around a stop, `C = |p − o|²` with `o` the middle of the sensor, and the stop's
//! semi-diameter `R` the only variable. The image point of a ray does not depend on `R`, so that
//! the biased gradient (3.15) is zero and the stop does not change. The unbiased one (3.16) is
//! `dL/dR = 2π r r' C(rim)` with `r` the radius of the pupil: positive, and the stop closes.
//!
//! The image plane is behind the paraxial focus. In front of it a zone of rays would cross the axis
//! in the plane, where `C(rim) = 0` and the descent would stop.

use super::section::SectionPlot;
use super::{
    Claim, DataTable, Effort, Experiment, ExperimentError, ExperimentOutcome, ExperimentResult,
    NamedPlot, ProgressFn, report_progress,
};
use crate::lens::{
    Aperture, FieldKind, FieldPoint, Fields, Lens, Medium, Object, Row, blank,
    paraxial_image_distance,
};
use crate::plot::{Axis, BLACK, Canvas, Chart, Color, Legend, PALETTE, Stroke};
use crate::pupil::{QuadraticIntegrand, RayModel, Region};

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "3.3",
    title: "An aperture stop optimized for sharpness alone",
    claim: "The unbiased gradient closes the stop to a pinhole; the biased one leaves it unchanged",
    omits: "nothing of the figure",
    seconds: 1.0,
    run,
};

/// Curvature in 1/mm, thickness in mm, semi-diameter in mm, index behind the surface.
const SURFACES: [[f64; 4]; 5] = [
    [1.0 / 60.0, 5.0, 14.0, 1.5168],
    [-1.0 / 120.0, 6.0, 14.0, 1.0],
    [0.0, 4.0, START, 1.0],
    [1.0 / 90.0, 5.0, 13.0, 1.5168],
    [-1.0 / 70.0, 0.0, 13.0, 1.0],
];
const STOP: usize = 2;
/// The initial semi-diameter of the stop, in mm.
const START: f64 = 9.0;
/// The distance of the image plane behind the paraxial focus, in mm.
const BEHIND_FOCUS: f64 = 1.0;
const AXIS: FieldPoint = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };

/// The rate of Adam in mm, and its number of steps.
const RATE: f64 = 0.2;
const STEPS: usize = 4000;
const FEW_STEPS: usize = 2000;
/// The minimum semi-diameter of the stop, in mm.
const CLOSED: f64 = 0.01;
/// The order of quadrature: it gives eight digits, ample for a descent; the checks use a higher
/// one.
const ORDER: usize = 4;
const HIGH_ORDER: usize = 8;
/// The stop counts as a pinhole below this fraction of its initial semi-diameter.
const PINHOLE: f64 = 0.1;

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let steps = effort.select(STEPS, FEW_STEPS);
    let mut outcome = ExperimentOutcome::default();
    let start = StopObjective::at(START, HIGH_ORDER)?;
    let mut descents = Vec::new();
    for gradient in [GradientKind::Unbiased, GradientKind::Biased] {
        descents.push(StopDescent::run(gradient, steps, progress)?);
    }
    outcome.rays = start.rays + descents.iter().map(|descent| descent.rays).sum::<usize>();
    let [unbiased, biased] = [&descents[0], &descents[1]];
    outcome.claims = claims(&start, unbiased, biased, &mut outcome.rays)?;
    outcome.tables.push(table(unbiased, biased));
    outcome.pictures.push(NamedPlot { name: "radius", canvas: radii(unbiased, biased) });
    outcome.pictures.push(NamedPlot { name: "lens", canvas: lenses(unbiased, biased)? });
    Ok(outcome)
}

/// The derivative by the radius that the descent uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum GradientKind {
    Unbiased,
    Biased,
}

/// The two singlets with a stop of this semi-diameter.
fn lens(radius: f64) -> ExperimentResult<Lens> {
    let row = |(i, [curvature, thickness, semi_diameter, index]): (usize, &[f64; 4])| Row {
        curvature: *curvature,
        thickness: *thickness,
        medium: if *index == 1.0 { Medium::Air } else { Medium::Index(*index) },
        semi_diameter: Some(if i == STOP { radius } else { *semi_diameter }),
        stop: i == STOP,
        ..Row::default()
    };
    let mut lens = Lens {
        name: "Two singlets and a stop".to_owned(),
        aperture: Aperture::StopSemiDiameter(radius),
        fields: Fields { kind: FieldKind::Angle, values: vec![AXIS] },
        surfaces: SURFACES.iter().enumerate().map(row).collect(),
        ..blank()
    };
    let system = lens.resolve(0, lens.wavelengths[0].um)?;
    let gap = paraxial_image_distance(&system, Object::Infinity) + BEHIND_FOCUS;
    lens.surfaces[SURFACES.len() - 1].thickness = gap;
    Ok(lens)
}

fn model(radius: f64) -> ExperimentResult<RayModel> {
    Ok(RayModel::from_lens(&lens(radius)?, 0)?)
}

/// The objective at a radius of the stop.
struct StopObjective {
    /// `L = ∫ |p − o|² dw`, in mm⁴.
    blur: f64,
    /// The area of the pupil, in mm².
    area: f64,
    /// The derivatives of `L` by the radius, in mm³.
    unbiased: f64,
    biased: f64,
    rays: usize,
}

impl StopObjective {
    fn at(radius: f64, order: usize) -> ExperimentResult<Self> {
        let model = model(radius)?;
        let region = Region::new(model.launch(AXIS, 0)?);
        let nodes = region.trace_pupil(order);
        let cost = QuadraticIntegrand::spread([0.0; 2]);
        let failed =
            || ExperimentError::Failed(format!("the pupil of a stop of {radius} mm has no edge"));
        let unbiased = nodes.boundary_derivative(&cost).ok_or_else(failed)?;
        let biased = nodes.biased_derivative(&cost);
        let by_radius = |by: &crate::trace::SystemGradient<f64>| by.surfaces[STOP].semi_diameter;
        Ok(Self {
            blur: nodes.moments.spread,
            area: nodes.moments.area,
            unbiased: by_radius(&unbiased),
            biased: by_radius(&biased),
            rays: region.rays + nodes.rays_traced,
        })
    }

    /// The root mean square distance from the middle of the sensor, in mm.
    fn rms(&self) -> f64 {
        (self.blur / self.area).sqrt()
    }
}

/// The history of a descent: the radius and the objective at every step.
struct StopDescent {
    radii: Vec<f64>,
    blurs: Vec<f64>,
    rms: Vec<f64>,
    rays: usize,
}

impl StopDescent {
    /// Adam in one variable (Kingma and Ba, ICLR 2015, algorithm 1).
    fn run(
        gradient: GradientKind,
        steps: usize,
        progress: &mut ProgressFn<'_>,
    ) -> ExperimentResult<Self> {
        let (name, done) = match gradient {
            GradientKind::Unbiased => ("descent by the unbiased gradient", 0.0),
            GradientKind::Biased => ("descent by the biased gradient", 0.5),
        };
        let mut descent = Self { radii: Vec::new(), blurs: Vec::new(), rms: Vec::new(), rays: 0 };
        let (mut radius, mut mean, mut square) = (START, 0.0, 0.0);
        let [b1, b2]: [f64; 2] = [0.9, 0.999];
        for step in 0..=steps {
            report_progress(progress, done + 0.5 * step as f64 / steps as f64, name)?;
            let point = StopObjective::at(radius, ORDER)?;
            descent.record(radius, &point);
            let slope = match gradient {
                GradientKind::Unbiased => point.unbiased,
                GradientKind::Biased => point.biased,
            };
            let age = step as i32 + 1;
            mean = b1 * mean + (1.0 - b1) * slope;
            square = b2 * square + (1.0 - b2) * slope * slope;
            let size = (square / (1.0 - b2.powi(age))).sqrt();
            let along = if size > 0.0 { mean / (1.0 - b1.powi(age)) / size } else { 0.0 };
            radius = (radius - RATE * along).max(CLOSED);
        }
        Ok(descent)
    }

    fn record(&mut self, radius: f64, point: &StopObjective) {
        self.radii.push(radius);
        self.blurs.push(point.blur);
        self.rms.push(point.rms());
        self.rays += point.rays;
    }

    fn final_radius(&self) -> f64 {
        self.radii.last().copied().unwrap_or(START)
    }
}

fn claims(
    start: &StopObjective,
    unbiased: &StopDescent,
    biased: &StopDescent,
    rays: &mut usize,
) -> ExperimentResult<Vec<Claim>> {
    let step = 1e-4 * START;
    let [below, above] = [
        StopObjective::at(START - step, HIGH_ORDER)?,
        StopObjective::at(START + step, HIGH_ORDER)?,
    ];
    *rays += below.rays + above.rays;
    let difference = (above.blur - below.blur) / (2.0 * step);
    let grown = unbiased.radii.windows(2).filter(|pair| pair[1] > pair[0]).count();
    let moved = biased.radii.iter().filter(|radius| **radius != START).count();
    let last = |values: &[f64]| values.last().copied().unwrap_or(f64::NAN);
    Ok(vec![
        Claim::at_most(
            "unbiased: final radius of the stop over the initial one",
            unbiased.final_radius() / START,
            PINHOLE,
        ),
        Claim::at_most("unbiased: steps that open the stop", grown as f64, 0.0),
        Claim::at_most(
            "unbiased: final blur (rms) over the initial one",
            last(&unbiased.rms) / unbiased.rms[0],
            PINHOLE,
        ),
        Claim::exactly("biased: initial derivative by the radius", start.biased, 0.0)
            .in_unit("mm^3"),
        Claim::exactly("biased: steps that change the radius", moved as f64, 0.0),
        Claim::exactly("biased: final radius of the stop", biased.final_radius(), START)
            .in_unit("mm"),
        Claim::at_most(
            "initial unbiased derivative against central differences, relative error",
            (start.unbiased / difference - 1.0).abs(),
            1e-6,
        ),
    ])
}

fn table(unbiased: &StopDescent, biased: &StopDescent) -> DataTable {
    let columns = [
        "step",
        "unbiased_radius_mm",
        "unbiased_blur_mm4",
        "unbiased_rms_mm",
        "biased_radius_mm",
        "biased_blur_mm4",
        "biased_rms_mm",
    ];
    let mut table = DataTable::new("radius", &columns);
    for step in 0..unbiased.radii.len() {
        let of =
            |descent: &StopDescent| [descent.radii[step], descent.blurs[step], descent.rms[step]];
        let numbers = of(unbiased).into_iter().chain(of(biased));
        table.push_row(std::iter::once(step.into()).chain(numbers.map(Into::into)));
    }
    table
}

const UNBIASED: Color = PALETTE[0];
const BIASED: Color = PALETTE[1];

/// Radius and blur over the steps.
fn radii(unbiased: &StopDescent, biased: &StopDescent) -> Canvas {
    let mut canvas = Canvas::new([1500, 700]);
    let descents = [("unbiased", unbiased, UNBIASED), ("biased", biased, BIASED)];
    let x = Axis::linear("step", [0.0, unbiased.radii.len() as f64 - 1.0]);
    let radius =
        Axis::linear("mm", descents.iter().flat_map(|descent| descent.1.radii.iter().copied()));
    let rms = Axis::logarithmic(
        "mm",
        descents.iter().flat_map(|descent| descent.1.rms.iter().copied()),
        1e-9,
    );
    let charts = [
        Chart::new([120.0, 110.0], [700.0, 580.0], x.clone(), radius),
        Chart::new([860.0, 110.0], [1440.0, 580.0], x, rms),
    ];
    charts[0].draw(&mut canvas, "radius of the stop");
    charts[1].draw(&mut canvas, "blur, root mean square");
    let mut legend = Legend::new([120.0, 20.0]);
    for (name, descent, color) in descents {
        for (chart, values) in charts.iter().zip([&descent.radii, &descent.rms]) {
            let points =
                values.iter().enumerate().map(|(step, v)| chart.to_pixel([step as f64, *v]));
            canvas.curve(&points.collect::<Vec<_>>(), color, Stroke::Solid);
        }
        legend.curve(&mut canvas, name, color, Stroke::Solid);
    }
    canvas
}

/// The lens at the start and at both ends.
fn lenses(unbiased: &StopDescent, biased: &StopDescent) -> ExperimentResult<Canvas> {
    let mut canvas = Canvas::new([1800, 720]);
    let panels = [
        ("start", START, BLACK),
        ("biased gradient", biased.final_radius(), BIASED),
        ("unbiased gradient", unbiased.final_radius(), UNBIASED),
    ];
    for (i, (name, radius, color)) in panels.into_iter().enumerate() {
        let model = model(radius)?;
        let section = SectionPlot::new(&model.channels[0].system);
        let [z, y] = section.extent();
        let left = 90.0 + 600.0 * i as f64;
        let (x, y) = (Axis::linear("z, mm", z), Axis::linear("y, mm", y));
        let chart = Chart::new([left, 110.0], [left + 480.0, 600.0], x, y).with_equal_scales();
        chart.draw(&mut canvas, &format!("{name}: stop {radius:.3} mm"));
        let launch = model.launch(AXIS, 0)?;
        for ray in -4..=4 {
            section.draw_ray(&mut canvas, &chart, &launch, [0.0, 0.24 * f64::from(ray)], color);
        }
        section.draw(&mut canvas, &chart);
    }
    Ok(canvas)
}
