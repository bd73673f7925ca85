//! Figure 3.8: a moving target, through the darkest and through the brightest lens of a front,
//! exposed to equal brightness of the image. The bright lens is less sharp, but its shorter
//! exposure makes the moving target sharper.
//!
//! The brightness of a point of the image of an extended scene is its radiance times the projected solid
//! angle of the light there. Both images have the same overall brightness, its mean over the circle of the
//! fields, so that exposures are in the inverse ratio of these means. Pictures of moving bars on the axis by
//! rays from every pixel check the solid angle there, and the contrasts. Contrast is that of the spot on the
//! axis, `|∫ exp(2πi ν x) dw| / ∫ dw`, times that of the motion `s` of the image during the exposure,
//! `|sin(π ν s) / (π ν s)|`.

use super::camera::{CameraFrame, darkest_and_brightest, draw_pictures, take};
use super::{
    Claim, DataTable, Effort, Experiment, ExperimentError, ExperimentOutcome, ExperimentResult,
    NamedPlot, ProgressFn, report_progress,
};
use crate::analysis::{Estimate, distortion, irradiance};
use crate::lens::{FieldPoint, Lens};
use crate::math::quadrature::gauss_legendre;
use crate::optimize::pareto::ParetoPoint;
use crate::picture::{
    ExactSettings, Pattern, Picture, Scene, SceneLayer, field_diagonal, filling_size,
};
use crate::plot::{Axis, Canvas, Chart, Color, Legend, PALETTE, Stroke};
use crate::pupil::{Accuracy, RayModel, Region};
use std::f64::consts::PI;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "3.8",
    title: "A moving target at equal brightness",
    claim: "The brightest lens of a front needs a fraction of the time of the darkest one, and shows \
            sharper what moves",
    omits: "the colours of the simulated images",
    seconds: 15.0,
    run,
};

/// The order of quadrature.
const ORDER: usize = 6;
/// The range of frequencies plotted, in cycles/mm.
const FREQUENCIES: [f64; 2] = [0.5, 40.0];
const STEPS: usize = 80;
/// The motion of the image during the exposure of the dark lens, in mm.
const WAY: f64 = 0.2;
/// The frequency at which both are compared, in cycles/mm.
const COMPARED: f64 = 4.0;
/// The periods, the columns and the rows of a picture of moving bars.
const PERIODS: f64 = 2.0;
const COLUMNS: usize = 48;
const ROWS: usize = 16;
/// The sampling error of pictures, and the difference from a prediction that is allowed.
const SAMPLING: f64 = 0.01;
const EQUAL: f64 = 0.02;
/// The diagonal of the pictures of the target, in mm.
const TARGET: f64 = 4.0;
const ACCURACY: Accuracy = Accuracy { tolerance: 1e-6, max_rays: 100_000 };
/// The minimum ratio of the exposure times.
const TIMES: f64 = 2.0;

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let designs = darkest_and_brightest(effort, 0.7, progress)?;
    let mut rays = 0;
    let [dark, bright] =
        [MovingShot::of(&designs[0], &mut rays)?, MovingShot::of(&designs[1], &mut rays)?];
    let exposure_ratio = bright.brightness.value / dark.brightness.value;
    let pair = ExposurePair { dark, bright, exposure_ratio };
    report_progress(progress, 0.7, "pictures of moving bars")?;
    let mut claims = pair.claims();
    claims.extend(pair.picture_claims(&mut rays)?);
    report_progress(progress, 0.8, "pictures of the moving target")?;
    let target = pair.draw_target(effort.select(140, 24), &mut rays)?;
    Ok(ExperimentOutcome {
        claims,
        tables: vec![pair.lenses(), pair.table()],
        pictures: vec![
            NamedPlot { name: "contrast", canvas: pair.draw() },
            NamedPlot { name: "target", canvas: target },
        ],
        lenses: vec![
            ("darkest".to_owned(), pair.dark.design.lens.clone()),
            ("brightest".to_owned(), pair.bright.design.lens.clone()),
        ],
        rays,
        reasons: Vec::new(),
    })
}

/// A lens with its brightness and its spot on the axis.
struct MovingShot {
    design: ParetoPoint,
    /// The height of the image over the tangent of its field angle near the axis, in mm: the focal length
    /// but for the defocus of the image plane.
    scale: f64,
    /// The projected solid angle of the light on the axis, and its mean over the image.
    on_axis: Estimate,
    brightness: Estimate,
    /// The x coordinates in mm and the weights of the rays of the field on the axis.
    spot: Vec<[f64; 2]>,
}

impl MovingShot {
    fn of(design: &ParetoPoint, rays: &mut usize) -> ExperimentResult<Self> {
        let spot = spot(&design.lens, rays)?;
        let model = RayModel::from_lens(&design.lens, 0)?;
        let (on_axis, brightness) = (solid_angle(&model, 0.0)?, mean_solid_angle(&model)?);
        *rays += design.rays + on_axis.rays + brightness.rays;
        Ok(Self { scale: image_scale(&model)?, on_axis, brightness, spot, design: design.clone() })
    }

    /// A picture during an exposure of this many seconds of a layer that the image of moves by [`WAY`] to the
    /// right in a second.
    fn picture(
        &self,
        frame: &CameraFrame,
        seconds: f64,
        pattern: impl Fn(f64) -> Pattern,
        rays: &mut usize,
    ) -> ExperimentResult<Picture> {
        let settings = ExactSettings { tolerance: SAMPLING, seconds, ..ExactSettings::default() };
        let shot = take(&self.design.lens, frame, &settings, |model, frame| {
            let half_size = match pattern(self.scale) {
                Pattern::Bars => filling_size(model, frame, None)?,
                _ => [f64::INFINITY; 2],
            };
            let velocity = [WAY / self.scale, 0.0];
            let pattern = pattern(self.scale);
            let layer =
                SceneLayer { distance: None, center: [0.0; 2], half_size, velocity, pattern };
            Scene::new(vec![layer], [1.0; 3], 1.0)
        })?;
        *rays += shot.picture.rays;
        Ok(shot.picture)
    }

    /// The contrast of moving bars in a picture of them, and its standard error; and the mean light.
    fn pictured(&self, seconds: f64, rays: &mut usize) -> ExperimentResult<[f64; 3]> {
        let width = PERIODS / COMPARED;
        let pitch = width / COLUMNS as f64;
        let diagonal = Some(pitch * (COLUMNS as f64).hypot(ROWS as f64));
        let frame = CameraFrame { pixels: [COLUMNS, ROWS], diagonal };
        let wave = |scale: f64| Pattern::Wave {
            contrast: 1.0,
            frequency: [COMPARED * scale, 0.0],
            phase: 0.0,
        };
        let picture = self.picture(&frame, seconds, wave, rays)?;
        let mut sums = [0.0; 4];
        for (i, (value, error)) in picture.values.iter().zip(&picture.errors).enumerate() {
            let phase = 2.0 * PI * PERIODS * ((i % COLUMNS) as f64 + 0.5) / COLUMNS as f64;
            let (sin, cos) = phase.sin_cos();
            let terms = [value[0], value[0] * cos, value[0] * sin, error[0] * error[0]];
            sums = [0, 1, 2, 3].map(|k| sums[k] + terms[k]);
        }
        let [light, re, im, squares] = sums;
        // A pixel averages over its width.
        let half = PI * COMPARED * pitch;
        let pixel = half.sin() / half;
        let contrast = 2.0 * re.hypot(im) / light / pixel;
        let error = (2.0 * squares).sqrt() / light;
        Ok([contrast, error, light / picture.values.len() as f64])
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

/// The projected solid angle of the light at a distance from the axis in mm.
fn solid_angle(model: &RayModel, height: f64) -> ExperimentResult<Estimate> {
    let found = irradiance(model, model.primary, [0.0, height], ACCURACY);
    found.map_err(|error| ExperimentError::Failed(error.to_string()))
}

/// The orders of the quadrature over the image, whose difference is its error.
const IMAGE_ORDERS: [usize; 2] = [4, 8];

/// The mean projected solid angle over the circle of the fields.
fn mean_solid_angle(model: &RayModel) -> ExperimentResult<Estimate> {
    let radius = 0.5 * field_diagonal(model)?;
    let (mut rays, mut error) = (0, 0.0);
    let mut mean = |order: usize| {
        // Nodes in the square of the height stand for rings of equal area.
        gauss_legendre(order, 0.0, 1.0).into_iter().try_fold(0.0, |sum, (place, weight)| {
            let found = solid_angle(model, radius * place.sqrt())?;
            rays += found.rays;
            error = found.error.max(error);
            Ok::<_, ExperimentError>(sum + weight * found.value)
        })
    };
    let [coarse, fine] = [mean(IMAGE_ORDERS[0])?, mean(IMAGE_ORDERS[1])?];
    Ok(Estimate::new(fine, (fine - coarse).abs() + error, rays))
}

/// The number of azimuths to which a radius of the spot on the axis is rotated.
const AZIMUTHS: usize = 32;

/// The height of the image over the tangent of its field angle near the axis, in mm.
fn image_scale(model: &RayModel) -> ExperimentResult<f64> {
    const DEGREES: f64 = 0.05;
    let field = FieldPoint { x: 0.0, y: DEGREES, weight: 1.0 };
    let chief = distortion(model, field, model.primary);
    let chief = chief.map_err(|error| ExperimentError::Failed(error.to_string()))?;
    Ok(chief.height / DEGREES.to_radians().tan())
}

/// Both lenses at equal brightness.
struct ExposurePair {
    dark: MovingShot,
    bright: MovingShot,
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
        let relative = |shot: &MovingShot| shot.brightness.error / shot.brightness.value;
        let error = self.exposure_ratio * (relative(&self.dark) + relative(&self.bright));
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

    /// The claims that pictures by rays from every pixel check.
    fn picture_claims(&self, rays: &mut usize) -> ExperimentResult<Vec<Claim>> {
        let [dark, dark_error, dark_light] = self.dark.pictured(1.0, rays)?;
        let seconds = self.exposure_ratio.recip();
        let [bright, bright_error, bright_light] = self.bright.pictured(seconds, rays)?;
        let [_, _, moving_dark, moving_bright] = self.contrasts(COMPARED);
        let predicted = moving_bright / moving_dark;
        let error = (dark_error / dark).hypot(bright_error / bright);
        let solid_angles = self.bright.on_axis.value / self.dark.on_axis.value;
        let light_error = (dark_error.hypot(bright_error)) / 2f64.sqrt();
        Ok(vec![
            Claim::at_most(
                "light of the pictures on the axis, bright over dark, over the ratio of the solid angles \
                 there, less 1",
                (bright_light / dark_light / solid_angles - 1.0).abs(),
                EQUAL,
            )
            .with_error(light_error),
            Claim::at_least("moving bars in the pictures: contrast bright over dark", bright / dark, 1.1)
                .with_error(error * bright / dark),
            Claim::at_most(
                "that ratio over the computed one, less 1",
                (bright / dark / predicted - 1.0).abs(),
                EQUAL,
            )
            .with_error(error),
        ])
    }

    /// The moving target through both lenses.
    fn draw_target(&self, columns: usize, rays: &mut usize) -> ExperimentResult<Canvas> {
        let frame = CameraFrame { pixels: [columns; 2], diagonal: Some(TARGET) };
        let mut levels = |shot: &MovingShot, seconds: f64| {
            let picture = shot.picture(&frame, seconds, |_| Pattern::Bars, rays)?;
            let white = picture.white;
            Ok::<_, ExperimentError>(
                picture.values.iter().map(|v| v[0] / white).collect::<Vec<_>>(),
            )
        };
        let bright = levels(&self.bright, self.exposure_ratio.recip())?;
        let dark = levels(&self.dark, 1.0)?;
        let pictures = [("brightest, short", bright), ("darkest, long", dark)];
        let title = "a target that moves to the right, at equal brightness";
        Ok(draw_pictures(title, &pictures, columns, (1.0 / 2.2, 0.0)).0)
    }

    fn lenses(&self) -> DataTable {
        let columns =
            ["lens", "spot_mm", "light_mm2", "solid_angle_on_axis", "mean_solid_angle", "exposure"];
        let mut table = DataTable::new("lenses", &columns);
        let exposures =
            [("darkest", &self.dark, self.exposure_ratio), ("brightest", &self.bright, 1.0)];
        for (name, shot, exposure) in exposures {
            let light = [shot.on_axis.value, shot.brightness.value];
            let numbers = [shot.design.spot, shot.design.light, light[0], light[1], exposure];
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
