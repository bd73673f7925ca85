//! `picture`: what a camera with a lens sees of a scene.

mod device;
mod effects;
mod render;
mod report;
mod scene;
mod sensor;

pub(super) use device::DeviceChoice;

use super::analyze::parse_coating;
use super::error::CliError;
use super::failures::Failures;
use super::input::{LensFile, LoadedLens, Tolerance};
use super::output::{Output, print_note};
use super::output_paths::OutputPaths;
use super::progress::stop_flag;
use crate::analysis::Coating;
use crate::files::write_atomic;
use crate::measure::time_ms;
use crate::picture::{
    BitDepth, ColorBand, ErrorMap, FocusGroup, ImageFrame, IncludedEffects, OmittedEffect, Picture,
    PictureError, ToneCurve, encode_colors, encode_png, omitted_beside,
};
use crate::pupil::RayModel;
use render::RenderedPicture;
use report::{ErrorMapReport, PictureReport, not_reached};
use sensor::SensorArgs;
use serde::Serialize;
use std::env;
use std::path::PathBuf;
use std::process;

/// A picture of a scene through the lens, by rays traced backwards, with its error
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/picture.txt"))]
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of the command line")]
pub(super) struct PictureArgs {
    #[command(flatten)]
    lens: LensFile,

    /// The scene: white, target, star, edge, checkerboard, lights, still-life, a PNG or JPEG file, or a JSON
    /// file of planes
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

    /// The width in mm of a scene that is one plane at a finite distance; absent: it fills the frame
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    size: Option<f64>,

    /// Focuses at this distance in front of the first surface in mm, by moving the image plane
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    focus: Option<f64>,

    /// Focuses at --focus by moving these surfaces, counted from 1, with the image plane at rest
    #[arg(long, value_name = "FIRST..LAST", value_parser = parse_group, requires = "focus")]
    focus_group: Option<FocusGroup>,

    /// The coating of all surfaces between air and glass: none (bare glass), single-layer, v, a reflected
    /// share as `0.3%`, or layers from the air as index:nm, `1.38:125.9+2.05:19.4`; with it losses count, of
    /// glasses that absorb light too, and ghosts where they matter.
    /// Absent: nothing is lost
    #[arg(long, value_name = "COATING", value_parser = parse_coating)]
    coating: Option<Coating>,

    /// Prints every effect with its number, its limit and the time that leaving it out saves, measured
    #[arg(long)]
    effects: bool,

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

/// The numbers of columns and rows.
pub(super) fn parse_pixels(text: &str) -> Result<[usize; 2], String> {
    let count = |part: &str| part.trim().parse::<usize>().ok().filter(|n| (1..=16_384).contains(n));
    let pair = text.split_once('x').and_then(|(w, h)| Some([count(w)?, count(h)?]));
    pair.ok_or_else(|| "expected columns and rows from 1 to 16384, as in `480x320`".to_owned())
}

/// The surfaces of a focus group.
fn parse_group(text: &str) -> Result<FocusGroup, String> {
    let index = |part: &str| part.trim().parse::<usize>().ok()?.checked_sub(1);
    let pair = text.split_once("..").and_then(|(a, b)| Some((index(a)?, index(b)?)));
    let group = pair.filter(|(first, last)| first <= last);
    let group = group.map(|(first, last)| FocusGroup { first, last });
    group.ok_or_else(|| "expected the first and the last surface, as in `7..10`".to_owned())
}

/// A tone curve.
fn parse_tone_curve(text: &str) -> Result<ToneCurve, String> {
    let gamma = || text.parse::<f64>().ok().and_then(ToneCurve::power);
    let curve = if text == "srgb" { Some(ToneCurve::Srgb) } else { gamma() };
    curve.ok_or_else(|| "expected srgb, or a number from 0.1 to 10".to_owned())
}

impl PictureArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let lens = [("the lens", self.lens.path())];
        let scene = self.scene_path().map(|file| ("the scene", file));
        let sensor_file = self.exposed.file().map(|file| ("the sensor", file));
        let mut paths = OutputPaths::reading(lens.into_iter().chain(scene).chain(sensor_file));
        paths.file("--out", Some(&self.out), &["png"])?;
        paths.file("--error-map", self.error_map.as_deref(), &["png"])?;
        self.check_numbers()?;
        let source = self.scene_source()?;
        let sensor = self.exposed.sensor()?;
        if !self.exact {
            self.device.install()?;
        }
        let opened = self.lens.open()?;
        opened.check_zoom(self.zoom)?;
        self.check_group(&opened)?;
        let (picture, ms) = time_ms(|| self.render(&opened, &source, &stop_flag()));
        let (rendered, shot) = picture?;
        let picture = rendered.picture.clone();
        let exposed = sensor.map(|sensor| self.expose(sensor, &source, &picture));
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

    /// Refuses lengths and counts that no picture has.
    fn check_numbers(&self) -> Result<(), CliError> {
        let lengths = [
            ("--diagonal", self.diagonal, 1e6, ", at most 1e6"),
            ("--distance", self.distance, 1e12, ", at most 1e12"),
            ("--size", self.size, f64::MAX, ""),
            ("--focus", self.focus, 1e12, ", at most 1e12"),
        ];
        for (name, value, most, limit) in lengths {
            if let Some(found) = value.filter(|value| !(*value > 0.0 && *value <= most)) {
                let text = format!("{name}: found {found}; expected mm, more than 0{limit}");
                return Err(CliError::Input(text));
            }
        }
        if self.max_samples == 0 {
            return Err(CliError::Input("--max-samples: found 0; expected 1 or more".to_owned()));
        }
        Ok(())
    }

    /// Refuses a focus group that the lens does not have.
    fn check_group(&self, opened: &LoadedLens) -> Result<(), CliError> {
        let surfaces = opened.lens.surfaces.len();
        match self.focus_group.filter(|group| group.last >= surfaces) {
            Some(FocusGroup { first, last }) => Err(CliError::Input(format!(
                "--focus-group: found {}..{}; expected surfaces from 1 to {surfaces}",
                first + 1,
                last + 1
            ))),
            None => Ok(()),
        }
    }

    /// The error of a picture, which begins with the option at fault, else with the file of the lens.
    fn refuse(&self, opened: &LoadedLens, error: &PictureError) -> CliError {
        let asked = |distance: f64| self.focus == Some(distance);
        let blamed = match error {
            PictureError::NotImaged { distance } if asked(*distance) => "--focus",
            PictureError::NotFocused { distance } if asked(*distance) => "--focus",
            _ => &opened.file,
        };
        CliError::Input(format!("{blamed}: {error}"))
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
        let reached = picture.reached && split.error() <= self.error.0;
        let reason = || not_reached(split.shares(), self.error.0, picture.complete);
        PictureReport {
            scene: self.scene.clone(),
            pixels: picture.frame.pixels,
            size: picture.frame.size(),
            focus: shot.focus,
            focus_group: shot.group,
            distance: shot.distance,
            way,
            device: device.clone(),
            error: split.error(),
            error_of_error: sampling.error,
            errors: split.shares().to_vec(),
            tolerance: self.error.0,
            reached,
            not_reached: (!reached).then(reason),
            complete: picture.complete,
            white: picture.white,
            mean: picture.mean(),
            rays: picture.rays,
            rays_per_pixel: picture.rays as f64 / pixels,
            fates: picture.fates,
            left_out: self.left_out(rendered, shot, included),
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
            gates: rendered.gates.clone(),
            sensor: None,
            quick_milliseconds: sampling.milliseconds,
            milliseconds,
            out: Some(self.out.display().to_string()),
        }
    }

    /// The effects that are not in the picture.
    fn left_out(
        &self,
        rendered: &RenderedPicture,
        shot: &CameraShot,
        included: IncludedEffects<'_>,
    ) -> Vec<OmittedEffect> {
        let frame = &rendered.picture.frame;
        let mut left_out = omitted_beside(&shot.model, frame, self.error.0, included);
        if self.coating.is_some() && included.ghosts.is_none() {
            let ghosts = left_out.iter_mut().find(|omitted| omitted.effect == "ghosts");
            ghosts.into_iter().for_each(|ghosts| ghosts.reason = NO_GHOSTS);
        }
        if let Some(colors) = rendered.colors.filter(|colors| colors.count <= 1) {
            let (effect, reason) = if colors.count == 0 {
                (
                    "colour errors",
                    "of some tiles with a wavelength for each colour instead of one for all",
                )
            } else {
                let effect = "change of wavelength within a colour";
                (effect, "of some tiles with three wavelengths instead of one")
            };
            left_out.push(OmittedEffect { effect, change: Some(colors.change), reason });
        }
        if rendered.is_sharp {
            let used = rendered.split.shares().iter().find(|share| share.effect == "blur");
            left_out.push(OmittedEffect {
                effect: "blur",
                change: used.map(|share| share.used),
                reason: "of some tiles with rays from all of the pupil instead of one",
            });
        }
        let off =
            rendered.gates.iter().flatten().filter(|gate| !gate.on && gate.effect == "motion");
        left_out.extend(off.map(|gate| OmittedEffect {
            effect: gate.effect,
            change: None,
            reason: gate.reason,
        }));
        left_out
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

/// The reason for which a picture with a coating has no ghosts, which are the last that is added to it.
const NO_GHOSTS: &str = "not computed, since the picture was stopped";

/// A lens focused for a picture, with its sensor.
struct CameraShot {
    model: RayModel,
    bands: Vec<ColorBand>,
    frame: ImageFrame,
    /// The distance of the focus in mm; `None` at infinity.
    focus: Option<f64>,
    /// The distance of the scene in mm; `None` at infinity.
    distance: Option<f64>,
    /// The way of the focus group, if one moves.
    group: Option<GroupMotion>,
}

/// The way of a focus group.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct GroupMotion {
    /// Towards the image in mm.
    shift: f64,
    /// The change of the field of view.
    breathing: f64,
}
