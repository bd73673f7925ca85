//! The sensor that a picture falls on: a preset, a file, or its numbers one by one.

use super::PictureArgs;
use super::report::SensorReport;
use super::scene::SceneSource;
use crate::cli::error::CliError;
use crate::files::json::read_json;
use crate::files::{MAX_LENS_BYTES, read_file};
use crate::picture::{
    BuiltInScene, Exposure, MID_GREY, Picture, PictureError, SensorModel, SensorPreset,
    photon_count,
};
use serde::Deserialize;
use std::path::Path;

/// The sensor that a picture falls on.
#[derive(Debug, clap::Args)]
pub(super) struct SensorArgs {
    /// Shows the numbers of a sensor with its noise: canon-7d, phone or industrial, or a JSON file with its numbers
    #[arg(long, value_name = "NAME")]
    sensor: Option<String>,

    /// The side of a pixel in um, in place of --diagonal
    #[arg(long, value_name = "UM", conflicts_with = "diagonal", allow_negative_numbers = true)]
    pitch: Option<f64>,

    /// Electrons per photon of the sensor, in place of its own number
    #[arg(long, value_name = "SHARE", requires = "sensor", allow_negative_numbers = true)]
    quantum_efficiency: Option<f64>,

    /// The largest number of electrons of a pixel
    #[arg(long, value_name = "E", requires = "sensor", allow_negative_numbers = true)]
    full_well: Option<f64>,

    /// Dark electrons per second
    #[arg(long, value_name = "E/S", requires = "sensor", allow_negative_numbers = true)]
    dark_current: Option<f64>,

    /// The standard deviation of the read noise in electrons
    #[arg(long, value_name = "E", requires = "sensor", allow_negative_numbers = true)]
    read_noise: Option<f64>,

    /// Digital numbers per electron
    #[arg(long, value_name = "DN/E", requires = "sensor", allow_negative_numbers = true)]
    gain: Option<f64>,

    /// The digital number without light
    #[arg(long, value_name = "DN", requires = "sensor", allow_negative_numbers = true)]
    black_level: Option<f64>,

    /// The bits of a digital number of the sensor, 1 to 16
    #[arg(long, value_name = "BITS", requires = "sensor")]
    sensor_bits: Option<u32>,

    /// Gives the pixels of the sensor one colour filter each (Bayer) and interpolates the others
    #[arg(long, requires = "sensor")]
    bayer: bool,

    /// The exposure time in seconds, during which planes move; absent: until white fills 80 % of the range of the
    /// sensor, with planes at rest
    #[arg(long, value_name = "S")]
    pub(super) seconds: Option<f64>,

    /// The luminance of white in the scene in cd/m2; absent: that of a scene file, 1 for still-life, else 100
    #[arg(long, value_name = "CD")]
    luminance: Option<f64>,
}

/// A sensor with the source of its numbers.
pub(super) struct NamedSensor {
    name: String,
    source: String,
    pub(super) model: SensorModel,
}

/// A sensor as its file has it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SensorFile {
    #[serde(default)]
    name: Option<String>,
    #[serde(default)]
    source: Option<String>,
    quantum_efficiency: f64,
    full_well: f64,
    dark_current: f64,
    read_noise: f64,
    gain: f64,
    black_level: f64,
    bits: u32,
}

impl SensorFile {
    fn read(path: &Path) -> Result<NamedSensor, CliError> {
        let file = path.display().to_string();
        let bytes = read_file(path, MAX_LENS_BYTES)?;
        let read: Self = read_json(&String::from_utf8_lossy(&bytes), &file)?;
        let model = SensorModel {
            quantum_efficiency: read.quantum_efficiency,
            full_well: read.full_well,
            dark_current: read.dark_current,
            read_noise: read.read_noise,
            gain: read.gain,
            black_level: read.black_level,
            bits: read.bits,
        };
        model.check().map_err(|error| CliError::Input(format!("{file}: {error}")))?;
        let source = read.source.unwrap_or_else(|| format!("numbers of {file}"));
        Ok(NamedSensor { name: read.name.unwrap_or(file), source, model })
    }
}

impl SensorArgs {
    /// The file of the sensor; `None` for a preset.
    pub(super) fn file(&self) -> Option<&Path> {
        let path = Path::new(self.sensor.as_ref()?);
        let is_json = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"));
        is_json.then_some(path)
    }

    /// The side of a pixel in mm, if it is given.
    pub(super) fn pitch_mm(&self) -> Option<f64> {
        self.pitch.map(|um| 1e-3 * um)
    }

    /// The sensor, and a check of the numbers that belong to it.
    pub(super) fn sensor(&self) -> Result<Option<NamedSensor>, CliError> {
        let is_positive = |v: &f64| *v > 0.0 && v.is_finite();
        if let Some(wrong) = self.luminance.filter(|v| !is_positive(v)) {
            let text = format!("--luminance: found {wrong}; expected a positive number of cd/m2");
            return Err(CliError::Input(text));
        }
        if let Some(wrong) = self.pitch.filter(|v| !is_positive(v)) {
            let text = format!("--pitch: found {wrong}; expected a positive number of um");
            return Err(CliError::Input(text));
        }
        if let Some(wrong) = self.seconds.filter(|v| !(*v >= 0.0 && v.is_finite())) {
            return Err(CliError::Input(format!("--seconds: found {wrong}; expected 0 or more")));
        }
        let Some(name) = &self.sensor else { return Ok(None) };
        let mut sensor = match (self.file(), SensorPreset::find(name)) {
            (_, Some(SensorPreset { name, source, model })) => NamedSensor {
                name: (*name).to_owned(),
                source: (*source).to_owned(),
                model: *model,
            },
            (Some(file), None) => SensorFile::read(file)?,
            (None, None) => {
                let names = SensorPreset::ALL.map(|preset| preset.name).join(", ");
                let text = format!(
                    "--sensor: no sensor `{name}`; expected one of {names}, or a JSON file"
                );
                return Err(CliError::Input(text));
            }
        };
        self.change(&mut sensor)?;
        Ok(Some(sensor))
    }

    /// Puts the numbers that are given one by one in place of those of a sensor.
    fn change(&self, sensor: &mut NamedSensor) -> Result<(), CliError> {
        let model = &mut sensor.model;
        let before = *model;
        let put = |number: &mut f64, given: Option<f64>| *number = given.unwrap_or(*number);
        put(&mut model.quantum_efficiency, self.quantum_efficiency);
        put(&mut model.full_well, self.full_well);
        put(&mut model.dark_current, self.dark_current);
        put(&mut model.read_noise, self.read_noise);
        put(&mut model.gain, self.gain);
        put(&mut model.black_level, self.black_level);
        model.bits = self.sensor_bits.unwrap_or(model.bits);
        model.check().map_err(|error| wrong_number(&error))?;
        if before != *model {
            sensor.source = format!("{}; changed by options", sensor.source);
        }
        Ok(())
    }
}

impl PictureArgs {
    /// The luminance of radiance 1 of a scene in cd/m2.
    pub(super) fn luminance(&self, source: &SceneSource) -> f64 {
        let of_scene = match source {
            SceneSource::BuiltIn(BuiltInScene::StillLife) => 1.0,
            SceneSource::File(file) => file.white,
            SceneSource::BuiltIn(_) | SceneSource::Picture(_) => 100.0,
        };
        self.exposed.luminance.unwrap_or(of_scene)
    }

    /// The picture as a sensor sees it.
    pub(super) fn expose(
        &self,
        NamedSensor { name, source, model: sensor }: NamedSensor,
        scene: &SceneSource,
        picture: &Picture,
    ) -> (Picture, SensorReport) {
        let luminance = self.luminance(scene);
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
            name,
            source,
            model: sensor,
            bayer: self.exposed.bayer,
            luminance,
            seconds,
            pixel_um: 1e3 * picture.frame.pitch,
            white_photons: photons(1.0),
            signal_to_noise: [1.0, MID_GREY, 0.01].map(|level| {
                let photons = photons(level);
                let is_full = sensor.is_saturated(photons, dark);
                (!is_full).then(|| sensor.signal_to_noise(photons, dark))
            }),
            saturated: image.saturated,
        };
        (image.develop(picture), report)
    }
}

/// The error of a number of a sensor, which begins with its option.
fn wrong_number(error: &PictureError) -> CliError {
    let PictureError::Size { what, found, expected } = error else {
        return CliError::Input(format!("--sensor: {error}"));
    };
    let option = match *what {
        "the number of bits" => "sensor-bits".to_owned(),
        name => name.trim_start_matches("the ").replace(' ', "-"),
    };
    CliError::Input(format!("--{option}: found {found}; expected {expected}"))
}
