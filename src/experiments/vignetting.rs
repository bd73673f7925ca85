//! Figure 3.9: the brightness of the corner of a white target, with a lens optimized by unbiased
//! gradients, which include the light off the axis, and with one by biased gradients, which do not.
//!
//! Both searches begin with the same lens and a fixed stop, so that the difference is not just a
//! larger aperture. From the unbiased front the least sharp lens is chosen that is still at least as
//! sharp as the biased one: by its blur alone, so that the claims about its light can fail.

use super::camera::{CameraFrame, CameraPicture, draw_pictures, take};
use super::pareto_front::ANGLES;
use super::sharpness_vs_light::{
    FieldView, ProgressSpan, WeightSweep, field_views, mean_blur_and_light, run_sweep,
    with_field_angles,
};
use super::{
    Claim, DataTable, Effort, Experiment, ExperimentError, ExperimentOutcome, ExperimentResult,
    NamedPlot, ProgressFn, lens, report_progress,
};
use crate::analysis::{Illumination, illumination};
use crate::lens::{Lens, Parameter, Quantity, Variable};
use crate::optimize::pareto::ParetoPoint;
use crate::picture::{ExactSettings, Scene};
use crate::plot::{
    Axis, BLACK, Canvas, Chart, Color, Legend, PALETTE, Stroke, TextAlign, gray_level,
};
use crate::pupil::{Accuracy, RayModel};

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "3.9",
    title: "Vignetting with the same stop",
    claim: "At the same sharpness the corner is brighter with unbiased gradients than with biased \
            ones",
    omits: "the design of OpticStudio, for which a biased search stands",
    seconds: 15.0,
    run,
};

const LENS: &str = "double_gauss_rudolph_50";
/// The number of fields of the curves, from the axis to the corner.
const FIELDS: usize = 21;
const ACCURACY: Accuracy = Accuracy { tolerance: 1e-5, max_rays: 100_000 };

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let start = with_fixed_stop(with_field_angles(lens(LENS)?, &ANGLES));
    // Weights near the sharpness of the biased design are enough.
    let plan = WeightSweep::new(2.0, effort.select(14, 8), 1200);
    let part = ProgressSpan { from: 0.0, to: 0.2, name: "biased gradient" };
    let without = run_sweep(&start, &plan.biased(), part, progress)?;
    let part = ProgressSpan { from: 0.2, to: 0.8, name: "unbiased gradient" };
    let with = run_sweep(&start, &plan, part, progress)?;
    let mut rays = 0;
    let biased = IlluminatedLens::of(&without[without.len() - 1], &mut rays)?;
    let as_sharp = with[1..].iter().filter(|design| design.spot <= biased.blur());
    let unbiased = as_sharp.max_by(|a, b| a.spot.total_cmp(&b.spot)).ok_or_else(|| {
        ExperimentError::Failed("no unbiased design is as sharp as the biased one".to_owned())
    })?;
    let pair = [biased, IlluminatedLens::of(unbiased, &mut rays)?];
    report_progress(progress, 0.8, "pictures of the white target")?;
    let cards = CardPictures::of(&pair, effort, &mut rays)?;
    let mut claims = claims(&pair);
    claims.extend(cards.claims()?);
    Ok(ExperimentOutcome {
        claims,
        tables: vec![table(&pair)],
        pictures: vec![
            NamedPlot { name: "illumination", canvas: draw(&pair) },
            NamedPlot { name: "card", canvas: cards.draw() },
        ],
        lenses: vec![
            ("biased".to_owned(), pair[0].lens.clone()),
            ("unbiased".to_owned(), pair[1].lens.clone()),
        ],
        rays,
        reasons: Vec::new(),
    })
}

/// The lens with a fixed semi-diameter of its stop.
fn with_fixed_stop(mut lens: Lens) -> Lens {
    let stop = lens.stop().and_then(|stop| Some((stop, lens.surfaces[stop].semi_diameter?)));
    if let Some((surface, radius)) = stop {
        let parameter = Parameter::new(surface, Quantity::SemiDiameter);
        let (min, max) = (Some(radius), Some(radius));
        lens.variables.push(Variable { parameter, min, max });
    }
    lens
}

/// A lens with its illumination from the axis to the corner.
struct IlluminatedLens {
    lens: Lens,
    views: Vec<FieldView>,
    light: Vec<Illumination>,
}

impl IlluminatedLens {
    fn of(design: &ParetoPoint, rays: &mut usize) -> ExperimentResult<Self> {
        let views = field_views(&design.lens, rays)?;
        let last = ANGLES[ANGLES.len() - 1];
        let angles: Vec<f64> = (0..FIELDS).map(|i| last * i as f64 / (FIELDS - 1) as f64).collect();
        let model = RayModel::from_lens(&with_field_angles(design.lens.clone(), &angles), 0);
        let model = model?;
        let light = illumination(&model, model.primary, ACCURACY);
        *rays += light.iter().map(|field| field.irradiance.rays).sum::<usize>();
        Ok(Self { lens: design.lens.clone(), views, light })
    }

    /// Its RMS spot radius over all fields, in mm.
    fn blur(&self) -> f64 {
        mean_blur_and_light(&self.views)[0]
    }

    /// The irradiance at the image of a field over the radiance of the white target, and its error.
    fn irradiance(&self, field: usize) -> [f64; 2] {
        let Illumination { irradiance, .. } = self.light[field];
        [irradiance.value, irradiance.error]
    }

    fn corner(&self) -> [f64; 2] {
        self.irradiance(FIELDS - 1)
    }

    /// The relative illumination of the corner, and its error.
    fn relative(&self) -> [f64; 2] {
        ratio(self.corner(), self.irradiance(0))
    }
}

/// A ratio with its error.
fn ratio([a, da]: [f64; 2], [b, db]: [f64; 2]) -> [f64; 2] {
    [a / b, (da + a / b * db) / b]
}

fn claims([biased, unbiased]: &[IlluminatedLens; 2]) -> Vec<Claim> {
    let [corner, corner_error] = ratio(unbiased.corner(), biased.corner());
    let [axis, axis_error] = ratio(unbiased.irradiance(0), biased.irradiance(0));
    let [relative, relative_error] = unbiased.relative();
    let [gain, gain_error] = ratio([relative, relative_error], biased.relative());
    vec![
        Claim::at_least("illumination of the corner, unbiased over biased", corner, 1.1)
            .with_error(corner_error),
        Claim::at_least("illumination of the axis, unbiased over biased", axis, 0.9)
            .with_error(axis_error),
        Claim::at_least("corner over axis, unbiased over biased", gain, 1.0).with_error(gain_error),
    ]
}

fn table(pair: &[IlluminatedLens; 2]) -> DataTable {
    let columns = [
        "field_deg",
        "biased_irradiance",
        "biased_irradiance_error",
        "unbiased_irradiance",
        "unbiased_irradiance_error",
        "biased_relative",
        "unbiased_relative",
    ];
    let mut table = DataTable::new("illumination", &columns);
    for field in 0..FIELDS {
        let irradiances = pair.each_ref().map(|lit| lit.irradiance(field));
        let relative =
            pair.each_ref().map(|lit| ratio(lit.irradiance(field), lit.irradiance(0))[0]);
        let numbers = [pair[0].light[field].field.y].into_iter().chain(irradiances.concat());
        table.push_row(numbers.chain(relative).map(Into::into));
    }
    table
}

const KINDS: [(&str, Color); 2] =
    [("biased gradient", PALETTE[1]), ("unbiased gradient", PALETTE[0])];

/// Draws the curves over the field, and a white target from the axis to the corner through both
/// lenses.
fn draw(pair: &[IlluminatedLens; 2]) -> Canvas {
    let mut canvas = Canvas::new([1200, 1000]);
    let brightest = pair.iter().map(|lit| lit.irradiance(0)[0]).fold(0.0, f64::max);
    let x = Axis::linear("field, deg", ANGLES);
    let y = Axis::linear("illumination", [0.0, 1.0]);
    let chart = Chart::new([120.0, 190.0], [1140.0, 690.0], x, y);
    chart.draw(&mut canvas, "illumination relative to the brighter axis");
    let mut legend = Legend::new([130.0, 20.0]);
    for (i, ((name, color), lit)) in KINDS.into_iter().zip(pair).enumerate() {
        let share = |field: usize| lit.irradiance(field)[0] / brightest;
        let curve: Vec<[f64; 2]> = (0..FIELDS)
            .map(|field| chart.to_pixel([lit.light[field].field.y, share(field)]))
            .collect();
        canvas.marked_curve(&curve, color, Stroke::Solid);
        legend.curve(&mut canvas, name, color, Stroke::Solid);
        let strip: Vec<Color> = (0..FIELDS).map(|field| gray_level(share(field))).collect();
        let top = 790.0 + 100.0 * i as f64;
        canvas.raster([120.0, top], FIELDS, 48, &strip);
        canvas.text([120.0, top + 56.0], name, BLACK, TextAlign::Left);
    }
    canvas
}

/// The sampling error of the pictures, and the difference from a prediction that is allowed.
const SAMPLING: f64 = 0.01;
const CLOSE: f64 = 0.03;

/// Pictures of the white target, through the biased and through the unbiased lens.
struct CardPictures {
    shots: [CameraPicture; 2],
}

impl CardPictures {
    fn of(pair: &[IlluminatedLens; 2], effort: Effort, rays: &mut usize) -> ExperimentResult<Self> {
        let frame = CameraFrame { pixels: effort.select([144, 96], [30, 20]), diagonal: None };
        let settings = ExactSettings { tolerance: SAMPLING, ..ExactSettings::default() };
        let mut shoot = |lens: &IlluminatedLens| {
            let shot = take(&lens.lens, &frame, &settings, |_, _| Ok(Scene::uniform(1.0)))?;
            *rays += shot.picture.rays;
            Ok::<_, ExperimentError>(shot)
        };
        Ok(Self { shots: [shoot(&pair[0])?, shoot(&pair[1])?] })
    }

    /// The four pixels around the middle and those in the corners, which see the same in a centred lens.
    fn places(&self) -> [[[usize; 2]; 4]; 2] {
        let [columns, rows] = self.shots[0].picture.frame.pixels;
        let pixels = |columns: [usize; 2], rows: [usize; 2]| {
            [0, 1, 2, 3].map(|i: usize| [columns[i % 2], rows[i / 2]])
        };
        let middle = pixels([columns / 2 - 1, columns / 2], [rows / 2 - 1, rows / 2]);
        [middle, pixels([0, columns - 1], [0, rows - 1])]
    }

    /// The brightness of the corners over that of the middle in a picture, and its error. An error of one
    /// pixel, from the few replicates of its samples, is itself uncertain; that of four is less so.
    fn pictured(shot: &CameraPicture, [middle, corners]: [[[usize; 2]; 4]; 2]) -> [f64; 2] {
        let columns = shot.picture.frame.pixels[0];
        let mean = |places: [[usize; 2]; 4]| {
            let (mut sum, mut squares) = (0.0, 0.0);
            for [column, row] in places {
                let i = row * columns + column;
                sum += shot.picture.values[i][0];
                squares += shot.picture.errors[i][0].powi(2);
            }
            [0.25 * sum, 0.25 * f64::sqrt(squares)]
        };
        ratio(mean(corners), mean(middle))
    }

    fn claims(&self) -> ExperimentResult<Vec<Claim>> {
        let places = self.places();
        let mut claims = Vec::new();
        let mut relative = Vec::new();
        for (name, shot) in ["biased", "unbiased"].into_iter().zip(&self.shots) {
            let [found, error] = Self::pictured(shot, places);
            let [middle, corner] = places.map(|all| shot.solid_angle(shot.height(all[0])));
            let exact = corner?[0] / middle?[0];
            let says =
                format!("picture, {name}: corner over middle, over that of solid angles, less 1");
            claims.push(
                Claim::at_most(says, (found / exact - 1.0).abs(), CLOSE).with_error(error / found),
            );
            relative.push([found, error]);
        }
        let [gain, gain_error] = ratio(relative[1], relative[0]);
        let says = "pictures: corner over middle, unbiased over biased";
        claims.push(Claim::at_least(says, gain, 1.0).with_error(gain_error));
        Ok(claims)
    }

    /// Both pictures over their horizontal sections through the middle.
    fn draw(&self) -> Canvas {
        let [biased, unbiased] = &self.shots;
        let white = biased.picture.white.max(unbiased.picture.white);
        let levels = |shot: &CameraPicture| {
            shot.picture.values.iter().map(|v| v[0] / white).collect::<Vec<_>>()
        };
        let all = [levels(unbiased), levels(biased)];
        let columns = biased.picture.frame.pixels[0];
        let row = columns * (biased.picture.frame.pixels[1] / 2);
        let [first, second] = all.clone();
        let pictures = [("unbiased", first), ("biased", second)];
        let title = "a white target, and its brightness along the middle row";
        let (mut canvas, top) = draw_pictures(title, &pictures, columns, (1.0, 420.0));
        let width = biased.picture.frame.size()[0];
        let x = Axis::linear("mm", [-0.5 * width, 0.5 * width]);
        let chart =
            Chart::new([120.0, top + 60.0], [1000.0, top + 340.0], x, Axis::linear("", [0.0, 1.0]));
        chart.draw(&mut canvas, "brightness over the middle of the brighter");
        let mut legend = Legend::new([1020.0, top + 60.0]);
        for ((name, color), levels) in
            [("unbiased", PALETTE[0]), ("biased", PALETTE[1])].into_iter().zip(&all)
        {
            let pitch = biased.picture.frame.pitch;
            let point = |i: usize| [(i as f64 + 0.5) * pitch - 0.5 * width, levels[row + i]];
            let curve: Vec<_> = (0..columns).map(point).collect();
            canvas.curve(&chart.to_pixels(&curve), color, Stroke::Solid);
            legend.curve(&mut canvas, name, color, Stroke::Solid);
        }
        canvas
    }
}
