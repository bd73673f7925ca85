//! `picture`: what a camera with a lens sees of a scene.

mod device;
mod render;
mod report;

pub(super) use device::DeviceChoice;

use super::analyze::parse_coating;
use super::error::CliError;
use super::failures::Failures;
use super::input::{LensFile, LoadedLens, Tolerance};
use super::output::{Output, print_note};
use super::output_paths::OutputPaths;
use super::progress::stop_flag;
use crate::analysis::Coating;
use crate::files::{read_color, write_atomic};
use crate::lens::{Lens, Object};
use crate::measure::time_ms;
use crate::picture::{
    BitDepth, BuiltInScene, ColorBand, Coloring, ErrorMap, Exposure, ImageFrame, IncludedEffects,
    MID_GREY, Picture, PictureError, Raster, Scene, SensorPreset, ToneCurve, encode_colors,
    encode_png, field_diagonal, focused, omitted_beside, photon_count, picture_model,
};
use crate::pupil::RayModel;
use render::RenderedPicture;
use report::{ErrorMapReport, PictureReport, SensorReport};
use std::env;
use std::path::{Path, PathBuf};
use std::process;

/// A picture of a scene through the lens, by rays traced backwards, with its error
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/picture.txt"))]
pub(super) struct PictureArgs {
    #[command(flatten)]
    lens: LensFile,

    /// The scene: white, target, star, edge, checkerboard, lights, still-life, or a PNG or JPEG file
    #[arg(long, value_name = "SCENE")]
    scene: String,

    /// Writes the picture into this file, PNG
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Follows rays from every pixel, even if the quick way would do
    #[arg(long)]
    exact: bool,

    /// The quick way, by the map from image to scene, even if its error is larger than asked for
    #[arg(long, conflicts_with = "exact")]
    quick: bool,

    /// The device of the quick way: auto (a graphics card where there is one), gpu or cpu
    #[arg(long, value_name = "DEVICE", default_value = "auto", conflicts_with = "exact")]
    device: DeviceChoice,

    /// The error: root mean square over the pixels, as a share of mid grey, or of the pixel where that
    /// is brighter
    #[arg(long, default_value = "1%", value_name = "TOLERANCE")]
    error: Tolerance,

    /// The number of columns and rows
    #[arg(long, default_value = "480x320", value_name = "WxH", value_parser = parse_pixels)]
    pixels: [usize; 2],

    /// The diagonal of the sensor in mm; absent: that of the image of the lens's fields
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    diagonal: Option<f64>,

    /// The distance of the scene in front of the first surface in mm; absent: that of the focus
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    distance: Option<f64>,

    /// Focuses at this distance in front of the first surface in mm, by moving the image plane
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    focus: Option<f64>,

    /// The coating of all surfaces between air and glass: none (bare glass), single-layer, v, or a reflected
    /// share as `0.3%`; with it losses count, of glasses that absorb light too, and ghosts where they matter.
    /// Absent: nothing is lost
    #[arg(long, value_name = "COATING", value_parser = parse_coating)]
    coating: Option<Coating>,

    /// Writes a map of the error into this file too, PNG: black without error, white at the largest
    #[arg(long, value_name = "FILE")]
    error_map: Option<PathBuf>,

    /// Grey, at the wavelengths of the lens with their weights
    #[arg(long)]
    gray: bool,

    /// Bits of a colour of a pixel in the file: 8 or 16
    #[arg(long, default_value = "8", value_name = "BITS", value_parser = ["8", "16"])]
    bits: String,

    /// The largest number of rays of a colour of a pixel
    #[arg(long, default_value_t = 4096, value_name = "N")]
    max_samples: usize,

    /// The seed of the rays
    #[arg(long, default_value_t = 0, value_name = "SEED")]
    seed: u32,

    #[command(flatten)]
    exposed: SensorArgs,

    /// The tone curve: srgb, or the G of light to the power 1/G, 1 for numbers that are linear in light
    #[arg(long, default_value = "srgb", value_name = "CURVE", value_parser = parse_tone_curve)]
    gamma: ToneCurve,

    /// The zoom position, counted from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    zoom: usize,
}

/// The sensor that a picture falls on.
#[derive(Debug, clap::Args)]
struct SensorArgs {
    /// Shows the numbers of a sensor with its noise: canon-7d, phone or industrial
    #[arg(long, value_name = "NAME")]
    sensor: Option<String>,

    /// Gives the pixels of the sensor one colour filter each (Bayer) and interpolates the others
    #[arg(long, requires = "sensor")]
    bayer: bool,

    /// The exposure time in seconds; absent: until white fills 80 % of the range of the sensor
    #[arg(long, value_name = "S", requires = "sensor")]
    seconds: Option<f64>,

    /// The luminance of white in the scene in cd/m2; absent: 100, and 1 for still-life
    #[arg(long, value_name = "CD")]
    luminance: Option<f64>,
}

/// The numbers of columns and rows.
pub(super) fn parse_pixels(text: &str) -> Result<[usize; 2], String> {
    let count = |part: &str| part.trim().parse::<usize>().ok().filter(|n| (1..=16_384).contains(n));
    let pair = text.split_once('x').and_then(|(w, h)| Some([count(w)?, count(h)?]));
    pair.ok_or_else(|| "expected columns and rows from 1 to 16384, as in `480x320`".to_owned())
}

/// A tone curve.
fn parse_tone_curve(text: &str) -> Result<ToneCurve, String> {
    let gamma = || text.parse::<f64>().ok().and_then(ToneCurve::power);
    let curve = if text == "srgb" { Some(ToneCurve::Srgb) } else { gamma() };
    curve.ok_or_else(|| "expected srgb, or a number from 0.1 to 10".to_owned())
}

/// The distance in mm at which a scene with depth is placed and focused if none is given.
const NEAR: f64 = 1000.0;

impl PictureArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let lens = [("the lens", self.lens.path())];
        let scene = self.scene_file().map(|file| ("the scene", file));
        let mut paths = OutputPaths::reading(lens.into_iter().chain(scene));
        paths.file("--out", Some(&self.out), &["png"])?;
        paths.file("--error-map", self.error_map.as_deref(), &["png"])?;
        let sensor = self.sensor_preset()?;
        if !self.exact {
            self.device.install()?;
        }
        let opened = self.lens.open()?;
        opened.check_zoom(self.zoom)?;
        let (picture, ms) = time_ms(|| self.render(&opened, &stop_flag()));
        let (rendered, shot) = picture?;
        let picture = rendered.picture.clone();
        let exposed = sensor.map(|preset| self.expose(preset, &picture));
        let mut report = self.report(&rendered, &shot, ms);
        let shown = exposed.map_or(picture, |(image, exposed)| {
            report.sensor = Some(exposed);
            image
        });
        let mut failures = Failures::default();
        report.out = failures.note(self.save(&shown, &report));
        failures.note(self.save_error_map(rendered.error_map.as_ref()));
        failures.note(output.print(&report));
        failures.into_result()
    }

    fn built_in(&self) -> Option<BuiltInScene> {
        BuiltInScene::ALL.iter().find(|(_, name)| *name == self.scene).map(|(scene, _)| *scene)
    }

    /// The file of the scene; `None` for a built-in one.
    fn scene_file(&self) -> Option<&Path> {
        self.built_in().is_none().then_some(Path::new(&self.scene))
    }

    /// The lens as it is focused, and the distance of the focus; `None` at infinity.
    fn focused_lens(&self, opened: &LoadedLens) -> Result<(Lens, Option<f64>), PictureError> {
        let needs_depth = self.built_in().is_some_and(BuiltInScene::has_depth);
        let near = match opened.lens.object {
            Object::Infinity => needs_depth.then_some(NEAR),
            Object::Finite(_) => None,
        };
        match (self.focus.or(near), opened.lens.object) {
            (Some(distance), _) => {
                let lens = focused(&opened.lens, self.zoom, distance)?;
                Ok((lens, Some(distance)))
            }
            (None, Object::Finite(distance)) => Ok((opened.lens.clone(), Some(distance))),
            (None, Object::Infinity) => Ok((opened.lens.clone(), None)),
        }
    }

    /// Writes the map of the error if that is asked for.
    fn save_error_map(&self, map: Option<&ErrorMap>) -> Result<(), CliError> {
        let (Some(path), Some(map)) = (&self.error_map, map) else { return Ok(()) };
        let white = map.largest();
        let scale = format!("black 0, white {white:.4e} of mid grey, rms of tiles");
        let texts = [("Software", "Aplanat".to_owned()), ("Scale", scale)];
        let bytes = encode_colors(map.pixels(), &map.heat(white), &texts)
            .map_err(|error| CliError::Failed(format!("{}: {error}", path.display())))?;
        Ok(write_atomic(path, &bytes)?)
    }

    fn shot(&self, opened: &LoadedLens) -> Result<CameraShot, PictureError> {
        let coloring = if self.gray { Coloring::Gray } else { Coloring::Rgb(3) };
        let (lens, focus) = self.focused_lens(opened)?;
        let unfocused = RayModel::from_lens(&opened.lens, self.zoom)?;
        let diagonal = self.diagonal.map_or_else(|| field_diagonal(&unfocused), Ok)?;
        let (model, bands) = picture_model(&lens, self.zoom, coloring)?;
        let frame = ImageFrame::new(&model, self.pixels, diagonal)?;
        Ok(CameraShot { model, bands, frame, focus, distance: self.distance.or(focus) })
    }

    /// The scene; the outer error is that of its file.
    fn scene(&self, shot: &CameraShot) -> Result<Result<Scene, PictureError>, CliError> {
        let CameraShot { model, frame, distance, .. } = shot;
        if let Some(scene) = self.built_in() {
            return Ok(scene.build(model, frame, *distance));
        }
        let path = Path::new(&self.scene);
        if !path.exists() {
            let names = BuiltInScene::ALL.map(|(_, name)| name).join(", ");
            let text = format!(
                "--scene: no scene or file `{}`; expected {names}, or a PNG or JPEG file",
                self.scene
            );
            return Err(CliError::Input(text));
        }
        let raster = Raster::new(read_color(path)?);
        Ok(Scene::of_raster(raster, model, frame, *distance))
    }

    /// The sensor, and a check of the numbers that belong to it.
    fn sensor_preset(&self) -> Result<Option<&'static SensorPreset>, CliError> {
        let is_positive = |v: &f64| *v > 0.0 && v.is_finite();
        if let Some(wrong) = self.exposed.luminance.filter(|v| !is_positive(v)) {
            let text = format!("--luminance: found {wrong}; expected a positive number of cd/m2");
            return Err(CliError::Input(text));
        }
        if let Some(wrong) = self.exposed.seconds.filter(|v| !(*v >= 0.0 && v.is_finite())) {
            return Err(CliError::Input(format!("--seconds: found {wrong}; expected 0 or more")));
        }
        let Some(name) = &self.exposed.sensor else { return Ok(None) };
        let Some(preset) = SensorPreset::find(name) else {
            let names = SensorPreset::ALL.map(|preset| preset.name).join(", ");
            let text = format!("--sensor: no sensor `{name}`; expected one of {names}");
            return Err(CliError::Input(text));
        };
        Ok(Some(preset))
    }

    /// The picture as a sensor sees it.
    fn expose(&self, preset: &'static SensorPreset, picture: &Picture) -> (Picture, SensorReport) {
        let of_scene = if self.built_in() == Some(BuiltInScene::StillLife) { 1.0 } else { 100.0 };
        let luminance = self.exposed.luminance.unwrap_or(of_scene);
        let sensor = &preset.model;
        let seconds =
            self.exposed.seconds.unwrap_or_else(|| sensor.normal_exposure(picture, luminance));
        let exposure = Exposure { luminance, seconds, seed: u64::from(self.seed) };
        let mut image = sensor.expose(picture, &exposure);
        if self.exposed.bayer {
            image = image.through_filters(picture.frame.pixels[0]);
        }
        let photons = |level: f64| {
            photon_count(level * luminance * picture.white, picture.frame.pitch, seconds)
        };
        let dark = sensor.dark_current * seconds;
        let report = SensorReport {
            name: preset.name,
            source: preset.source,
            model: *sensor,
            bayer: self.exposed.bayer,
            luminance,
            seconds,
            white_photons: photons(1.0),
            signal_to_noise: [1.0, MID_GREY, 0.01]
                .map(|v| sensor.signal_to_noise(photons(v), dark)),
            saturated: image.saturated,
        };
        (image.develop(picture), report)
    }

    fn report(
        &self,
        rendered: &RenderedPicture,
        shot: &CameraShot,
        milliseconds: f64,
    ) -> PictureReport {
        let RenderedPicture { picture, sampling, split, way, device, error_map, .. } = rendered;
        let found = rendered.ghosts.as_ref().map(|(report, _)| report);
        let pixels = (picture.frame.pixels[0] * picture.frame.pixels[1]) as f64;
        let included = IncludedEffects {
            diffraction: rendered.diffraction.as_ref(),
            losses: rendered.losses.as_ref(),
            ghosts: found,
        };
        PictureReport {
            scene: self.scene.clone(),
            pixels: picture.frame.pixels,
            size: picture.frame.size(),
            focus: shot.focus,
            distance: shot.distance,
            way,
            device: device.clone(),
            error: split.error(),
            error_of_error: sampling.error,
            errors: split.shares().to_vec(),
            tolerance: self.error.0,
            reached: picture.reached && split.error() <= self.error.0,
            complete: picture.complete,
            white: picture.white,
            mean: picture.mean(),
            rays: picture.rays,
            rays_per_pixel: picture.rays as f64 / pixels,
            fates: picture.fates,
            left_out: omitted_beside(&shot.model, &picture.frame, self.error.0, included),
            diffraction: rendered.diffraction.clone(),
            losses: rendered.losses.clone(),
            ghosts: found.cloned(),
            ghosts_milliseconds: rendered.ghosts.as_ref().map(|(_, ms)| *ms),
            error_map: error_map.as_ref().map(|map| ErrorMapReport {
                tiles: map.tiles(),
                error: map.rms().value,
                error_of_error: map.rms().error,
                largest: map.largest(),
            }),
            sensor: None,
            quick_milliseconds: sampling.milliseconds,
            milliseconds,
            out: Some(self.out.display().to_string()),
        }
    }

    fn save(&self, picture: &Picture, report: &PictureReport) -> Result<String, CliError> {
        let depth = if self.bits == "16" { BitDepth::Sixteen } else { BitDepth::Eight };
        let data = serde_json::to_string(report).unwrap_or_default();
        let texts = [("Software", "Aplanat".to_owned()), ("Aplanat picture", data)];
        let bytes = encode_png(picture, depth, self.gamma, &texts)
            .map_err(|error| CliError::Failed(format!("{}: {error}", self.out.display())))?;
        write_atomic(&self.out, &bytes).inspect_err(|_| self.keep_elsewhere(&bytes))?;
        Ok(self.out.display().to_string())
    }

    /// Saves a picture that cannot be written where it should be in the folder of temporary files, since
    /// it cannot be printed.
    fn keep_elsewhere(&self, bytes: &[u8]) {
        let name = self.out.file_name().unwrap_or_default().to_string_lossy();
        let elsewhere = env::temp_dir().join(format!("aplanat-{}-{name}", process::id()));
        if write_atomic(&elsewhere, bytes).is_ok() {
            print_note(format!("note: the picture is kept as {}", elsewhere.display()));
        }
    }
}

/// A lens focused for a picture, with its sensor.
struct CameraShot {
    model: RayModel,
    bands: Vec<ColorBand>,
    frame: ImageFrame,
    /// The distance of the focus in mm; `None` at infinity.
    focus: Option<f64>,
    /// The distance of the scene in mm; `None` at infinity.
    distance: Option<f64>,
}
