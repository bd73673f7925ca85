//! A sensor: from light on pixels to numbers, with its noise, after the linear model of EMVA 1288.
//!
//! Photons become electrons with the quantum efficiency; dark electrons join them; their number is
//! Poisson distributed and cut at the full well. Read noise is added, the gain makes digital numbers of it,
//! the black level is added, and the sum is rounded and clamped. Noise comes before any tone curve. Random
//! numbers depend on the place of a pixel, its colour and the seed alone, so that a picture does not depend
//! on the number of threads, and the noise of the rendering is never taken for that of photons.
//!
//! Each colour of a pixel is a sensor of its own, of which a mosaic of filters
//! ([`SensorImage::through_filters`]) leaves one; it counts its light as light of 555 nm. All pixels are
//! alike (no PRNU, no DSNU).

use super::scene::Radiance;
use super::{Picture, PictureError};
use rand::SeedableRng;
use rand_distr::{Distribution, Poisson, StandardNormal};
use rand_xoshiro::SplitMix64;
use serde::{Deserialize, Serialize};

/// A sensor at one setting of its gain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorModel {
    /// Electrons per photon, 0 to 1.
    pub quantum_efficiency: f64,
    /// The largest number of electrons of a pixel.
    pub full_well: f64,
    /// Dark electrons per second.
    pub dark_current: f64,
    /// The standard deviation of the read noise, in electrons.
    pub read_noise: f64,
    /// Digital numbers per electron.
    pub gain: f64,
    /// The digital number without light.
    pub black_level: f64,
    /// The bits of a digital number, 1 to 16.
    pub bits: u32,
}

/// A sensor by name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorPreset {
    /// The name on the command line.
    pub name: &'static str,
    /// The source of the numbers.
    pub source: &'static str,
    /// The sensor.
    pub model: SensorModel,
}

impl SensorPreset {
    /// Every preset.
    pub const ALL: [Self; 3] = [
        Self {
            name: "canon-7d",
            source: "Canon EOS 7D at unity gain, about ISO 984: 4.3 um and 14 bits are its data; full \
                     well, quantum efficiency and read noise are typical figures of it",
            model: SensorModel {
                quantum_efficiency: 0.45,
                full_well: 24_600.0,
                dark_current: 0.2,
                read_noise: 3.0,
                gain: 1.0,
                black_level: 2048.0,
                bits: 14,
            },
        },
        Self {
            name: "phone",
            source: "typical figures of a phone camera with pixels of 1.4 um, of no product",
            model: SensorModel {
                quantum_efficiency: 0.62,
                full_well: 3800.0,
                dark_current: 1.5,
                read_noise: 2.1,
                gain: 0.25,
                black_level: 16.0,
                bits: 10,
            },
        },
        Self {
            name: "industrial",
            source: "typical figures of a global shutter sensor with pixels of 3.45 um, of no product",
            model: SensorModel {
                quantum_efficiency: 0.6,
                full_well: 10_500.0,
                dark_current: 2.0,
                read_noise: 2.3,
                gain: 0.38,
                black_level: 60.0,
                bits: 12,
            },
        },
    ];

    /// The preset of this name.
    pub fn find(name: &str) -> Option<&'static Self> {
        Self::ALL.iter().find(|preset| preset.name == name)
    }
}

/// Photons of 555 nm per joule: `λ/(h c)` with the constants of the SI.
const PHOTONS_PER_JOULE: f64 = 0.555e-6 / (6.626_070_15e-34 * 299_792_458.0);
/// Lumens per watt at 555 nm.
const LUMENS_PER_WATT: f64 = 683.0;
/// The share of the range of the sensor that a white card fills in a normal exposure.
const NORMAL_EXPOSURE: f64 = 0.8;

/// The number of photons of 555 nm that an illuminance in lux brings to a pixel, given by its side in mm,
/// in a time in seconds.
pub fn photon_count(lux: f64, pitch: f64, seconds: f64) -> f64 {
    lux / LUMENS_PER_WATT * (1e-3 * pitch).powi(2) * seconds * PHOTONS_PER_JOULE
}

/// The light that a picture is exposed to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// The luminance of radiance 1 of the scene, in cd/m².
    pub luminance: f64,
    /// The time, in seconds.
    pub seconds: f64,
    /// The seed of the noise.
    pub seed: u64,
}

/// A picture in digital numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorImage {
    /// The digital numbers of the pixels in red, green and blue, row by row from the upper left corner.
    pub numbers: Vec<[u16; 3]>,
    /// The digital number of white without noise, less the black level.
    pub white: f64,
    /// The black level.
    pub black: f64,
    /// The share of numbers that are as large as the full well or the bits allow.
    pub saturated: f64,
}

impl SensorModel {
    /// Refuses numbers without meaning.
    ///
    /// # Errors
    /// The first number outside its range.
    pub fn check(&self) -> Result<(), PictureError> {
        let positive = |v: f64| v > 0.0 && v.is_finite();
        let not_negative = |v: f64| v >= 0.0 && v.is_finite();
        let checks = [
            (
                "the quantum efficiency",
                self.quantum_efficiency,
                self.quantum_efficiency > 0.0 && self.quantum_efficiency <= 1.0,
                "more than 0, at most 1",
            ),
            ("the full well", self.full_well, positive(self.full_well), "a positive number"),
            ("the dark current", self.dark_current, not_negative(self.dark_current), "0 or more"),
            ("the read noise", self.read_noise, not_negative(self.read_noise), "0 or more"),
            ("the gain", self.gain, positive(self.gain), "a positive number"),
            ("the black level", self.black_level, not_negative(self.black_level), "0 or more"),
            (
                "the number of bits",
                f64::from(self.bits),
                (1..=16).contains(&self.bits),
                "from 1 to 16",
            ),
        ];
        match checks.into_iter().find(|(_, _, holds, _)| !holds) {
            Some((what, found, _, expected)) => Err(PictureError::Size { what, found, expected }),
            None => Ok(()),
        }
    }

    /// The largest digital number.
    pub fn largest(&self) -> f64 {
        f64::from((1_u32 << self.bits) - 1)
    }

    /// The digital number of a pixel for a mean number of photons and of dark electrons, drawn from a
    /// generator.
    pub fn number(&self, photons: f64, dark: f64, random: &mut SplitMix64) -> u16 {
        self.read(photons, dark, random).0
    }

    /// The same, with true if the pixel is full or its number the largest.
    fn read(&self, photons: f64, dark: f64, random: &mut SplitMix64) -> (u16, bool) {
        let mean = self.quantum_efficiency * photons.max(0.0) + dark;
        // The law does not exist for no electrons, nor for so many that their noise is nothing.
        let electrons = Poisson::new(mean).map_or(mean, |law| law.sample(random));
        let noise: f64 = StandardNormal.sample(random);
        let read = electrons.min(self.full_well) + self.read_noise * noise;
        let number = (self.gain * read + self.black_level + 0.5).floor();
        let is_full = electrons >= self.full_well || number >= self.largest();
        (number.clamp(0.0, self.largest()) as u16, is_full)
    }

    /// The signal-to-noise ratio for a mean number of photons and of dark electrons by the linear model:
    /// without full well and clamping.
    pub fn signal_to_noise(&self, photons: f64, dark: f64) -> f64 {
        let signal = self.quantum_efficiency * photons;
        let rounding = 1.0 / (12.0 * self.gain * self.gain);
        signal / (self.read_noise.powi(2) + signal + dark + rounding).sqrt()
    }

    /// True if so many photons and dark electrons, on the mean, fill a pixel or are its largest number: noise does
    /// not show there.
    pub fn is_saturated(&self, photons: f64, dark: f64) -> bool {
        self.quantum_efficiency * photons + dark >= self.range()
    }

    /// The electrons that fill a pixel or make its largest number.
    fn range(&self) -> f64 {
        self.full_well.min((self.largest() - self.black_level) / self.gain)
    }

    /// The time in seconds after which white fills the range of the sensor up to a margin.
    pub fn normal_exposure(&self, picture: &Picture, luminance: f64) -> f64 {
        let range = self.range();
        let per_second = photon_count(luminance * picture.white, picture.frame.pitch, 1.0);
        NORMAL_EXPOSURE * range.max(0.0) / (self.quantum_efficiency * per_second)
    }

    /// The numbers of a picture.
    pub fn expose(&self, picture: &Picture, exposure: &Exposure) -> SensorImage {
        let photons = |value: f64| {
            photon_count(exposure.luminance * value, picture.frame.pitch, exposure.seconds)
        };
        let dark = self.dark_current * exposure.seconds;
        let pixel = |(i, value): (usize, &Radiance)| {
            let color = |c: usize| {
                let mut random = generator(exposure.seed, 3 * i + c);
                self.read(photons(value[c]), dark, &mut random)
            };
            [color(0), color(1), color(2)]
        };
        let read: Vec<[(u16, bool); 3]> = picture.values.iter().enumerate().map(pixel).collect();
        let saturated = read.iter().flatten().filter(|(_, is_full)| *is_full).count();
        let numbers: Vec<[u16; 3]> =
            read.iter().map(|pixel| pixel.map(|(number, _)| number)).collect();
        SensorImage {
            white: self.gain * self.quantum_efficiency * photons(picture.white),
            black: self.black_level,
            saturated: saturated as f64 / (3 * numbers.len().max(1)) as f64,
            numbers,
        }
    }
}

impl SensorImage {
    /// The light that the numbers stand for, white being that of a picture: what a file shows of them.
    pub fn develop(&self, picture: &Picture) -> Picture {
        // Without exposure numbers stand for no light.
        let scale = if self.white > 0.0 { picture.white / self.white } else { 0.0 };
        let light = |number: u16| (f64::from(number) - self.black) * scale;
        let values = self.numbers.iter().map(|pixel| pixel.map(light)).collect();
        Picture { values, ..picture.clone() }
    }
}

/// The generator of a number of a picture: the golden ratio steps through the seeds.
fn generator(seed: u64, number: usize) -> SplitMix64 {
    let step = (number as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    // A generator hashes its counter, so that those of neighbours share no numbers nearby.
    let mut hash = seed ^ step;
    hash = (hash ^ (hash >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    hash = (hash ^ (hash >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    SplitMix64::seed_from_u64(hash ^ (hash >> 31))
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDEAL: SensorModel = SensorModel {
        quantum_efficiency: 1.0,
        full_well: 1e5,
        dark_current: 0.0,
        read_noise: 0.0,
        gain: 1.0,
        black_level: 10.0,
        bits: 16,
    };

    #[test]
    fn extreme_levels_have_their_numbers() {
        let mut random = generator(1, 0);
        assert_eq!(IDEAL.number(0.0, 0.0, &mut random), 10);
        assert_eq!(IDEAL.number(1e9, 0.0, &mut random), 65535);
        assert_eq!(IDEAL.number(f64::INFINITY, 0.0, &mut random), 65535);
        let rare = (0..1000).filter(|_| IDEAL.number(1e-3, 0.0, &mut random) > 10).count();
        assert!(rare < 8, "{rare}");
        // A full well below the black level, and a gain at which all is one level.
        let shallow = SensorModel { full_well: 3.0, ..IDEAL };
        assert_eq!(shallow.number(1e6, 0.0, &mut random), 13);
        let coarse = SensorModel { gain: 1e-6, ..IDEAL };
        assert_eq!(coarse.number(1e4, 0.0, &mut random), 10);
    }

    #[test]
    fn wrong_sensors_are_refused() {
        assert!(SensorPreset::ALL.iter().all(|preset| preset.model.check().is_ok()));
        for wrong in [
            SensorModel { quantum_efficiency: 1.1, ..IDEAL },
            SensorModel { gain: 0.0, ..IDEAL },
            SensorModel { bits: 17, ..IDEAL },
            SensorModel { read_noise: f64::NAN, ..IDEAL },
        ] {
            assert!(wrong.check().is_err(), "{wrong:?}");
        }
    }
}
