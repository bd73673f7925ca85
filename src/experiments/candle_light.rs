//! Figure 3.7: a still life lit by a candle, through the darkest and through the brightest lens of a front,
//! exposed for the same time, as a sensor sees it. The bright lens gives larger numbers and less noise, and a
//! little more blur.
//!
//! The mean number of a pixel follows the light, the radiance of the scene times the projected solid angle at
//! the pixel; its scatter is that of photons, of the dark current and of reading (EMVA 1288). A patch of mid
//! grey on the axis, so small that the solid angle is the same all over it, checks both: the mean and the
//! scatter of its numbers against solid angles found by quadrature.

use super::camera::{CameraFrame, CameraPicture, darkest_and_brightest, draw_pictures, take};
use super::{
    Claim, DataTable, Effort, Experiment, ExperimentError, ExperimentOutcome, ExperimentResult,
    NamedPlot, ProgressFn, report_progress,
};
use crate::lens::Lens;
use crate::optimize::pareto::ParetoPoint;
use crate::picture::{
    BuiltInScene, ExactSettings, Exposure, MID_GREY, Scene, SensorPreset, field_diagonal, focused,
    photon_count,
};
use crate::plot::{Axis, Canvas, Chart, Color, Legend, PALETTE, Stroke};
use crate::pupil::RayModel;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "3.7",
    title: "A still life by candle light",
    claim: "In the same time the brightest lens of a front gives larger numbers and a better ratio of \
            signal to noise than the darkest one",
    omits: "the colours of the simulated images, and their scene, for which a still life made by code \
            stands",
    seconds: 25.0,
    run,
};

/// The name of the sensor.
const SENSOR: &str = "canon-7d";
/// The side of its pixels, in mm.
const PIXEL: f64 = 4.3e-3;
/// The luminance of white by candle light, in cd/m².
const LUMINANCE: f64 = 1.0;
/// The distance of the still life, in mm.
const DISTANCE: f64 = 1000.0;
/// The electrons of white on the axis through the bright lens: little light.
const WHITE_ELECTRONS: f64 = 400.0;
/// The exponent of the tone curve, which lifts the shadows.
const TONE: f64 = 0.2;
const SAMPLING: f64 = 0.01;
/// The differences from a prediction that are allowed: of a mean, and of a scatter.
const EQUAL: f64 = 0.02;
const CLOSE: f64 = 0.06;
/// The bins of a histogram.
const BINS: usize = 32;
const SEED: u64 = 7;

fn run(effort: Effort, progress: &mut ProgressFn<'_>) -> ExperimentResult {
    let [dark, bright] = darkest_and_brightest(effort, 0.7, progress)?;
    report_progress(progress, 0.7, "pictures by candle light")?;
    let bright = CandleShot::of(&bright, effort)?;
    report_progress(progress, 0.85, "pictures by candle light")?;
    let dark = CandleShot::of(&dark, effort)?;
    let study = CandleStudy::of([dark, bright])?;
    Ok(ExperimentOutcome {
        claims: study.claims(),
        tables: vec![study.table(), study.histogram_table()],
        pictures: vec![NamedPlot { name: "candle", canvas: study.draw() }],
        lenses: vec![
            ("darkest".to_owned(), study.shots[0].design.lens.clone()),
            ("brightest".to_owned(), study.shots[1].design.lens.clone()),
        ],
        rays: study.shots.iter().map(CandleShot::rays).sum(),
        reasons: Vec::new(),
    })
}

/// A lens with its pictures without noise.
struct CandleShot {
    design: ParetoPoint,
    still_life: CameraPicture,
    patch: CameraPicture,
    /// The projected solid angle on the axis, and its error.
    solid_angle: [f64; 2],
}

impl CandleShot {
    fn of(design: &ParetoPoint, effort: Effort) -> ExperimentResult<Self> {
        let lens = focused(&design.lens, 0, DISTANCE)?;
        let diagonal = field_diagonal(&RayModel::from_lens(&design.lens, 0)?)?;
        let pixels = effort.select([96, 64], [24, 16]);
        let frame = CameraFrame { pixels, diagonal: Some(diagonal) };
        let settings = ExactSettings { tolerance: SAMPLING, ..ExactSettings::default() };
        let still_life = take(&lens, &frame, &settings, |model, frame| {
            BuiltInScene::StillLife.build(model, frame, Some(DISTANCE))
        })?;
        let patch = patch(&lens, effort.select(64, 48), &settings)?;
        let solid_angle = patch.solid_angle(0.0)?;
        Ok(Self { design: design.clone(), still_life, patch, solid_angle })
    }

    fn rays(&self) -> usize {
        self.design.rays + self.still_life.picture.rays + self.patch.picture.rays
    }
}

/// A picture of white on the axis by some rows of the sensor's pixels.
fn patch(lens: &Lens, rows: usize, settings: &ExactSettings) -> ExperimentResult<CameraPicture> {
    let diagonal = Some(PIXEL * (rows as f64).hypot(rows as f64));
    let frame = CameraFrame { pixels: [rows; 2], diagonal };
    take(lens, &frame, settings, |_, _| Ok(Scene::uniform(1.0)))
}

/// The numbers of mid grey: their mean above the black level, its ratio to their standard deviation, and the
/// ratio that the model of the sensor predicts.
#[derive(Clone, Copy)]
struct GreyPatch {
    mean: f64,
    signal_to_noise: f64,
    predicted: f64,
    count: f64,
}

impl GreyPatch {
    /// The relative standard error of the mean.
    fn mean_error(&self) -> f64 {
        (self.signal_to_noise * self.count.sqrt()).recip()
    }

    /// The relative standard error of the measured ratio of signal to noise.
    fn ratio_error(&self) -> f64 {
        self.mean_error().hypot((2.0 * self.count).sqrt().recip())
    }
}

/// Both lenses, the darkest first, exposed for the same time.
struct CandleStudy {
    shots: [CandleShot; 2],
    patches: [GreyPatch; 2],
    /// The pixels of the still life by the sensor over white through the bright lens.
    levels: [Vec<f64>; 2],
}

impl CandleStudy {
    fn of(shots: [CandleShot; 2]) -> ExperimentResult<Self> {
        let preset = SensorPreset::find(SENSOR)
            .ok_or_else(|| ExperimentError::Failed(format!("no sensor {SENSOR}")))?;
        let white = shots[1].solid_angle[0];
        let patches = shots.each_ref().map(|shot| grey_patch(preset, shot, white));
        let levels = shots.each_ref().map(|shot| still_life_levels(preset, shot, white));
        Ok(Self { shots, patches, levels })
    }

    fn claims(&self) -> Vec<Claim> {
        let [dark, bright] = &self.patches;
        let [dark_angle, bright_angle] = self.shots.each_ref().map(|shot| shot.solid_angle[0]);
        let [dark_error, bright_error] =
            self.shots.each_ref().map(|shot| shot.solid_angle[1] / shot.solid_angle[0]);
        let means = bright.mean / dark.mean;
        let means_error = dark.mean_error().hypot(bright.mean_error());
        let ratio = bright.signal_to_noise / dark.signal_to_noise;
        let ratio_error = ratio * dark.ratio_error().hypot(bright.ratio_error());
        let predicted = |name: &str, patch: &GreyPatch| {
            let says =
                format!("signal to noise of mid grey, {name}: measured over predicted, less 1");
            Claim::at_most(says, (patch.signal_to_noise / patch.predicted - 1.0).abs(), CLOSE)
                .with_error(patch.ratio_error())
        };
        vec![
            Claim::at_most(
                "numbers of mid grey: bright over dark, over the ratio of solid angles, less 1",
                (means / (bright_angle / dark_angle) - 1.0).abs(),
                EQUAL,
            )
            .with_error(means_error + dark_error + bright_error),
            predicted("darkest", dark),
            predicted("brightest", bright),
            Claim::at_least("signal to noise of mid grey: bright over dark", ratio, 1.1)
                .with_error(ratio_error),
            Claim::at_most(
                "spot of the darkest lens relative to the brightest",
                self.shots[0].design.spot / self.shots[1].design.spot,
                1.0,
            ),
        ]
    }

    fn table(&self) -> DataTable {
        let columns = [
            "lens",
            "spot_mm",
            "light_mm2",
            "solid_angle_on_axis",
            "grey_number",
            "signal_to_noise",
            "signal_to_noise_predicted",
        ];
        let mut table = DataTable::new("lenses", &columns);
        for ((name, shot), patch) in NAMES.iter().zip(&self.shots).zip(&self.patches) {
            let numbers = [shot.design.spot, shot.design.light, shot.solid_angle[0]];
            let noise = [patch.mean, patch.signal_to_noise, patch.predicted];
            let numbers = numbers.into_iter().chain(noise).map(Into::into);
            table.push_row(std::iter::once((*name).into()).chain(numbers));
        }
        table
    }

    /// The shares of pixels by level after the tone curve, for the dark and for the bright lens.
    fn histograms(&self) -> [Vec<f64>; 2] {
        self.levels.each_ref().map(|levels| {
            let mut shares = vec![0.0; BINS];
            for level in levels {
                let place = (BINS as f64 * toned(*level)) as usize;
                shares[place.min(BINS - 1)] += (levels.len() as f64).recip();
            }
            shares
        })
    }

    fn histogram_table(&self) -> DataTable {
        let mut table = DataTable::new("histogram", &["level", "darkest_share", "brightest_share"]);
        let [dark, bright] = self.histograms();
        for (i, (dark, bright)) in dark.iter().zip(&bright).enumerate() {
            table.push_row([bin_level(i), *dark, *bright].map(Into::into));
        }
        table
    }

    fn draw(&self) -> Canvas {
        let [dark, bright] = self.levels.clone();
        let columns = self.shots[0].still_life.picture.frame.pixels[0];
        let title = "a still life by candle light, exposed for the same time";
        let pictures = [("darkest", dark), ("brightest", bright)];
        let (mut canvas, top) = draw_pictures(title, &pictures, columns, (TONE, 420.0));
        let histograms = self.histograms();
        let highest = histograms.iter().flatten().copied().fold(0.0, f64::max);
        let x = Axis::linear("level after the tone curve", [0.0, 1.0]);
        let y = Axis::linear("share of pixels", [0.0, highest]);
        let chart = Chart::new([120.0, top + 60.0], [1000.0, top + 340.0], x, y);
        chart.draw(&mut canvas, "levels of the pixels");
        let mut legend = Legend::new([1020.0, top + 60.0]);
        for ((name, color), shares) in NAMES.into_iter().zip(COLORS).zip(&histograms) {
            let point = |(i, share): (usize, &f64)| [bin_level(i), *share];
            let curve: Vec<_> = shares.iter().enumerate().map(point).collect();
            canvas.curve(&chart.to_pixels(&curve), color, Stroke::Solid);
            legend.curve(&mut canvas, name, color, Stroke::Solid);
        }
        canvas
    }
}

const NAMES: [&str; 2] = ["darkest", "brightest"];
const COLORS: [Color; 2] = [PALETTE[1], PALETTE[0]];

/// The middle of a bin of the histograms.
fn bin_level(bin: usize) -> f64 {
    (bin as f64 + 0.5) / BINS as f64
}

/// A level after the tone curve, from 0 to 1.
fn toned(level: f64) -> f64 {
    level.clamp(0.0, 1.0).powf(TONE)
}

/// The exposure of a picture by which white through the bright lens, of a projected solid angle on the axis,
/// gives [`WHITE_ELECTRONS`]. Pixels of another size than the sensor's have another time for it.
fn exposure(preset: &SensorPreset, pitch: f64, white: f64, luminance: f64) -> Exposure {
    let per_second = photon_count(LUMINANCE * white, pitch, 1.0) * preset.model.quantum_efficiency;
    Exposure { luminance, seconds: WHITE_ELECTRONS / per_second, seed: SEED }
}

fn grey_patch(preset: &SensorPreset, shot: &CandleShot, white: f64) -> GreyPatch {
    let picture = &shot.patch.picture;
    let pitch = picture.frame.pitch;
    let exposure = exposure(preset, pitch, white, MID_GREY * LUMINANCE);
    let image = preset.model.expose(picture, &exposure);
    let numbers = image.numbers.iter().map(|pixel| f64::from(pixel[0]) - image.black);
    let count = image.numbers.len() as f64;
    let mean = numbers.clone().sum::<f64>() / count;
    let square = numbers.map(|number| (number - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let photons = photon_count(exposure.luminance * shot.solid_angle[0], pitch, exposure.seconds);
    let dark = preset.model.dark_current * exposure.seconds;
    GreyPatch {
        mean,
        signal_to_noise: mean / square.sqrt(),
        predicted: preset.model.signal_to_noise(photons, dark),
        count,
    }
}

/// The pixels of the still life by the sensor, over white through the bright lens.
fn still_life_levels(preset: &SensorPreset, shot: &CandleShot, white: f64) -> Vec<f64> {
    let picture = &shot.still_life.picture;
    let exposure = exposure(preset, picture.frame.pitch, white, LUMINANCE);
    let image = preset.model.expose(picture, &exposure);
    let electrons = preset.model.gain * WHITE_ELECTRONS;
    image.numbers.iter().map(|pixel| (f64::from(pixel[0]) - image.black) / electrons).collect()
}
