//! Figure 3.8: a moving target, through the darkest and through the brightest lens of a front,
//! exposed to equal brightness of the image. The bright lens is less sharp, but its shorter
//! exposure makes the moving target sharper.
//!
//! The brightness of an extended scene grows with the area of the pupil over the square of the
//! focal length. Contrast is that of the spot on the axis, `|∫ exp(2πi ν x) dw| / ∫ dw`, times that
//! of the motion `s` of the image during the exposure, `|sin(π ν s) / (π ν s)|`.

use super::pareto_front::{ANGLES, plan};
use super::sharpness_vs_light::{ProgressSpan, focal_length, run_sweep, with_field_angles};
use super::{
    Claim, DataTable, Effort, Experiment, ExperimentError, ExperimentOutcome, ExperimentResult,
    NamedPlot, ProgressFn, lens,
};
use crate::lens::Lens;
use crate::optimize::pareto::ParetoPoint;
use crate::plot::{Axis, Canvas, Chart, Color, Legend, PALETTE, Stroke};
use crate::pupil::{RayModel, Region};
use std::f64::consts::PI;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "3.8",
    title: "A moving target at equal brightness",
    claim: "The brightest lens of a front needs a fraction of the time of the darkest one, and shows \
            sharper what moves",
    omits: "the simulated images of the moving target; contrasts are computed on the axis in \
            their place",
    seconds: 5.0,
    run,
};

const LENS: &str = "double_gauss_rudolph_50";
/// The order of quadrature.
const ORDER: usize = 6;
/// The range of frequencies plotted, in cycles/mm.
const FREQUENCIES: [f64; 2] = [0.5, 40.0];
const STEPS: usize = 80;
/// The motion of the image during the exposure of the dark lens, in mm.
const WAY: f64 = 0.2;
/// The frequency at which both are compared, in cycles/mm.
const COMPARED: f64 = 4.0;
/// The minimum ratio of the exposure times.
const TIMES: f64 = 2.0;

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let start = with_field_angles(lens(LENS)?, &ANGLES);
    let part = ProgressSpan { from: 0.0, to: 1.0, name: "front of sharpness and light" };
    let designs = run_sweep(&start, &plan(effort), part, progress)?;
    let [Some(bright), Some(dark)] = [designs.get(1), designs.last()] else {
        return Err(ExperimentError::Failed("no design was found".to_owned()));
    };
    let mut rays = 0;
    let [dark, bright] = [Exposure::of(dark, &mut rays)?, Exposure::of(bright, &mut rays)?];
    let times = bright.brightness / dark.brightness;
    let pair = ExposurePair { dark, bright, exposure_ratio: times };
    Ok(ExperimentOutcome {
        claims: pair.claims(),
        tables: vec![pair.lenses(), pair.table()],
        pictures: vec![NamedPlot { name: "contrast", canvas: pair.draw() }],
        lenses: vec![
            ("darkest".to_owned(), pair.dark.design.lens.clone()),
            ("brightest".to_owned(), pair.bright.design.lens.clone()),
        ],
        rays,
    })
}

/// A lens with its brightness and its spot on the axis.
struct Exposure {
    design: ParetoPoint,
    /// The light per image area, in arbitrary units, and its relative error.
    brightness: f64,
    error: f64,
    /// The x coordinates in mm and the weights of the rays of the field on the axis.
    spot: Vec<[f64; 2]>,
}

impl Exposure {
    fn of(design: &ParetoPoint, rays: &mut usize) -> ExperimentResult<Self> {
        let focal = focal_length(&design.lens)?;
        let spot = spot(&design.lens, rays)?;
        *rays += design.rays;
        Ok(Self {
            brightness: design.light / (focal * focal),
            error: design.light_error / design.light,
            spot,
            design: design.clone(),
        })
    }

    /// The contrast at a frequency in cycles/mm of a target whose image moves by `distance`,
    /// in mm.
    fn contrast(&self, frequency: f64, distance: f64) -> f64 {
        let (mut sum, mut light) = (0.0, 0.0);
        for [x, weight] in &self.spot {
            // The spot is symmetric.
            sum += weight * (2.0 * PI * frequency * x).cos();
            light += weight;
        }
        let phase = PI * frequency * distance;
        let motion_contrast = if phase == 0.0 { 1.0 } else { phase.sin() / phase };
        (sum / light * motion_contrast).abs()
    }
}

fn spot(lens: &Lens, rays: &mut usize) -> ExperimentResult<Vec<[f64; 2]>> {
    let model = RayModel::from_lens(lens, 0)?;
    let launch = model.launch(model.fields[0], model.primary)?;
    let region = Region::new(launch);
    // On the axis all azimuths are equivalent: the nodes of one are rotated through half a turn.
    let nodes = region.trace_pupil(ORDER);
    *rays += region.rays + nodes.rays_traced;
    let turn = |i: usize| {
        let radius = nodes.landed.sink.x[i].hypot(nodes.landed.sink.y[i]);
        (0..AZIMUTHS).map(move |k| radius * (PI * (k as f64 + 0.5) / AZIMUTHS as f64).cos())
    };
    let places = nodes.landed.arrivals().flat_map(|(i, weight)| turn(i).map(move |x| [x, weight]));
    Ok(places.collect())
}

/// The number of azimuths to which a radius of the spot on the axis is rotated.
const AZIMUTHS: usize = 32;

/// Both lenses at equal brightness.
struct ExposurePair {
    dark: Exposure,
    bright: Exposure,
    /// The exposure time of the dark lens relative to that of the bright one.
    exposure_ratio: f64,
}

impl ExposurePair {
    /// The contrast of the dark and of the bright lens, for a target at rest and then for a moving
    /// one.
    fn contrasts(&self, frequency: f64) -> [f64; 4] {
        [
            self.dark.contrast(frequency, 0.0),
            self.bright.contrast(frequency, 0.0),
            self.dark.contrast(frequency, WAY),
            self.bright.contrast(frequency, WAY / self.exposure_ratio),
        ]
    }

    fn claims(&self) -> Vec<Claim> {
        let [dark, bright, moving_dark, moving_bright] = self.contrasts(COMPARED);
        let error = self.exposure_ratio * (self.dark.error + self.bright.error);
        let sharper = self.dark.design.spot / self.bright.design.spot;
        vec![
            Claim::at_least(
                "exposure of the darkest lens relative to the brightest at equal brightness",
                self.exposure_ratio,
                TIMES,
            )
            .with_error(error),
            Claim::at_most("spot of the darkest lens relative to the brightest", sharper, 1.0),
            Claim::at_most(
                format!("at rest: contrast bright over dark, {COMPARED} cycles/mm"),
                bright / dark,
                1.0,
            ),
            Claim::at_least(
                format!("moving {WAY} mm in the longer exposure: contrast bright over dark"),
                moving_bright / moving_dark,
                1.1,
            ),
        ]
    }

    fn lenses(&self) -> DataTable {
        let columns = ["lens", "spot_mm", "light_mm2", "brightness", "exposure"];
        let mut table = DataTable::new("lenses", &columns);
        let exposures =
            [("darkest", &self.dark, self.exposure_ratio), ("brightest", &self.bright, 1.0)];
        for (name, shot, exposure) in exposures {
            let numbers = [shot.design.spot, shot.design.light, shot.brightness, exposure];
            table.push_row(std::iter::once(name.into()).chain(numbers.map(Into::into)));
        }
        table
    }

    fn table(&self) -> DataTable {
        let columns =
            ["line_pairs_per_mm", "dark_at_rest", "bright_at_rest", "dark_moving", "bright_moving"];
        let mut table = DataTable::new("contrast", &columns);
        for frequency in frequencies() {
            let numbers = self.contrasts(frequency);
            table.push_row(std::iter::once(frequency.into()).chain(numbers.map(Into::into)));
        }
        table
    }

    fn draw(&self) -> Canvas {
        let mut canvas = Canvas::new([1200, 800]);
        let x = Axis::linear("cycles/mm", FREQUENCIES.into_iter().chain([0.0]));
        let y = Axis::linear("contrast", [0.0, 1.0]);
        let chart = Chart::new([120.0, 190.0], [1140.0, 690.0], x, y);
        chart.draw(&mut canvas, &format!("the image moves {WAY} mm in the longer exposure"));
        let kinds: [(&str, Color, Stroke); 4] = [
            ("darkest, at rest", PALETTE[1], Stroke::Dashed),
            ("brightest, at rest", PALETTE[0], Stroke::Dashed),
            ("darkest, moving", PALETTE[1], Stroke::Solid),
            ("brightest, moving", PALETTE[0], Stroke::Solid),
        ];
        let mut legend = Legend::new([130.0, 20.0]);
        for (i, (name, color, stroke)) in kinds.into_iter().enumerate() {
            let curve = frequencies().map(|f| chart.to_pixel([f, self.contrasts(f)[i]]));
            canvas.curve(&curve.collect::<Vec<_>>(), color, stroke);
            legend.curve(&mut canvas, name, color, stroke);
        }
        canvas
    }
}

fn frequencies() -> impl Iterator<Item = f64> {
    let [low, high] = FREQUENCIES;
    (0..=STEPS).map(move |i| low + (high - low) * i as f64 / STEPS as f64)
}
