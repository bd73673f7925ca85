//! Light and sensors: photons, black bodies, noise, smear and defocus.

use super::check;
use crate::cli::error::CliError;
use crate::cli::output::{Output, ShortNumber};
use crate::picture::{
    SensorModel, black_body_photons, photons_of_wavelength, smear_contrast, thin_lens_blur,
};
use serde::Serialize;
use std::fmt::{self, Display};

/// Photons that an illuminance brings to a pixel
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/calc.txt"))]
pub(super) struct PhotonArgs {
    /// The illuminance in lux
    #[arg(long, value_name = "LUX")]
    lux: f64,

    /// The side of the pixel in um
    #[arg(long, value_name = "UM")]
    pixel: f64,

    /// The time in seconds
    #[arg(long, value_name = "S")]
    seconds: f64,

    /// The wavelength in um, with 683 lm/W as at 555 nm
    #[arg(long, value_name = "UM", default_value_t = 0.555)]
    um: f64,
}

/// Photon radiance of a black body between two wavelengths
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/calc.txt"))]
pub(super) struct BlackBodyArgs {
    /// The temperature in kelvin
    #[arg(long, value_name = "K")]
    kelvin: f64,

    /// The shortest wavelength in nm
    #[arg(long, value_name = "NM")]
    from: f64,

    /// The longest wavelength in nm
    #[arg(long, value_name = "NM")]
    to: f64,
}

/// Mean and variance of the numbers of a sensor, exact and by the linear model
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/calc.txt"))]
pub(super) struct NoiseArgs {
    /// Mean number of photons
    #[arg(long, value_name = "N")]
    photons: f64,

    /// Mean number of dark electrons
    #[arg(long, value_name = "N", default_value_t = 0.0)]
    dark: f64,

    /// Electrons per photon
    #[arg(long, value_name = "ETA", default_value_t = 0.5)]
    quantum_efficiency: f64,

    /// Largest number of electrons
    #[arg(long, value_name = "N", default_value_t = 20_000.0)]
    full_well: f64,

    /// Standard deviation of the read noise in electrons
    #[arg(long, value_name = "N", default_value_t = 3.0)]
    read_noise: f64,

    /// Digital numbers per electron
    #[arg(long, value_name = "K", default_value_t = 1.0)]
    gain: f64,

    /// Digital number without light
    #[arg(long, value_name = "DN", default_value_t = 2048.0)]
    black_level: f64,

    /// Bits of a number
    #[arg(long, value_name = "BITS", default_value_t = 14)]
    bits: u32,
}

/// Contrast that the motion of an image leaves
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/calc.txt"))]
pub(super) struct SmearArgs {
    /// The way of the image during the exposure in mm
    #[arg(long, value_name = "MM")]
    way: f64,

    /// The frequency along it in cycles/mm
    #[arg(long, value_name = "NU")]
    frequency: f64,
}

/// Disc of a point out of focus, behind a thin lens
#[derive(Debug, clap::Args)]
#[command(after_long_help = include_str!("../help/calc.txt"))]
pub(super) struct BlurArgs {
    /// The focal length in mm
    #[arg(long, value_name = "MM")]
    focal_length: f64,

    /// The f-number
    #[arg(long, value_name = "F")]
    f_number: f64,

    /// The distance in focus in mm
    #[arg(long, value_name = "MM")]
    focus: f64,

    /// The distance of the point in mm
    #[arg(long, value_name = "MM")]
    object: f64,
}

/// A name, its value and its unit.
#[derive(Serialize)]
#[serde(transparent)]
struct Numbers(serde_json::Map<String, serde_json::Value>);

impl Numbers {
    fn print<const N: usize>(output: &Output, list: [(&str, f64); N]) -> Result<(), CliError> {
        let pair = |(name, value): (&str, f64)| (name.to_owned(), serde_json::json!(value));
        output.print(&Self(list.into_iter().map(pair).collect()))
    }
}

impl Display for Numbers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, value) in &self.0 {
            let value = value.as_f64().unwrap_or(f64::NAN);
            writeln!(f, "{:<28} {}", name.replace('_', " "), ShortNumber(value))?;
        }
        Ok(())
    }
}

fn positive(name: &'static str, v: f64) -> (&'static str, f64, bool, &'static str) {
    (name, v, v > 0.0 && v.is_finite(), "a positive number")
}

fn not_negative(name: &'static str, v: f64) -> (&'static str, f64, bool, &'static str) {
    (name, v, v >= 0.0 && v.is_finite(), "0 or more")
}

impl PhotonArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        check(&[
            not_negative("--lux", self.lux),
            positive("--pixel", self.pixel),
            not_negative("--seconds", self.seconds),
            positive("--um", self.um),
        ])?;
        let photons = photons_of_wavelength(self.lux, 1e-3 * self.pixel, self.seconds, self.um);
        Numbers::print(output, [("photons", photons)])
    }
}

impl BlackBodyArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let range = [
            positive("--kelvin", self.kelvin),
            positive("--from", self.from),
            ("--to", self.to, self.to > self.from && self.to.is_finite(), "more than --from"),
        ];
        check(&range)?;
        let radiance = black_body_photons(self.kelvin, [1e-3 * self.from, 1e-3 * self.to]);
        Numbers::print(output, [("photons_per_s_m2_sr", radiance)])
    }
}

impl NoiseArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        check(&[not_negative("--photons", self.photons), not_negative("--dark", self.dark)])?;
        let sensor = SensorModel {
            quantum_efficiency: self.quantum_efficiency,
            full_well: self.full_well,
            dark_current: self.dark,
            read_noise: self.read_noise,
            gain: self.gain,
            black_level: self.black_level,
            bits: self.bits,
        };
        sensor.check().map_err(|error| CliError::Input(error.to_string()))?;
        let [mean, variance] = sensor.exact_moments(self.photons, self.dark);
        let [ideal_mean, ideal_variance] = sensor.linear_moments(self.photons, self.dark);
        let numbers = [
            ("mean", mean),
            ("variance", variance),
            ("ideal_mean", ideal_mean),
            ("ideal_variance", ideal_variance),
            ("ideal_snr", sensor.signal_to_noise(self.photons, self.dark)),
        ];
        Numbers::print(output, numbers)
    }
}

impl SmearArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        check(&[not_negative("--way", self.way), not_negative("--frequency", self.frequency)])?;
        let factor = smear_contrast(self.way, self.frequency);
        Numbers::print(output, [("factor", factor)])
    }
}

impl BlurArgs {
    pub(super) fn run(&self, output: &Output) -> Result<(), CliError> {
        let beyond = |v: f64| v > self.focal_length && v.is_finite();
        check(&[
            positive("--focal-length", self.focal_length),
            positive("--f-number", self.f_number),
            ("--focus", self.focus, beyond(self.focus), "more than the focal length"),
            ("--object", self.object, beyond(self.object), "more than the focal length"),
        ])?;
        let [sharp, diameter] =
            thin_lens_blur(self.focal_length, self.f_number, self.focus, self.object);
        Numbers::print(output, [("image_distance", sharp), ("blur_diameter", diameter)])
    }
}
