//! The round trip of an export: a fixed set of rays through the paraxial entrance pupil, for every field
//! point and zoom position, is traced through the lens and through the file read back.

use super::FileError;
use super::probe_rays::ProbeLaunch;
use crate::lens::{Lens, LensError, SurfaceNumber, Wavelength};
use crate::trace::{Fate, Ray, Tracer};
use serde::Serialize;
use std::fmt;

/// Largest accepted distance between the two ends of a ray, in mm.
const TOLERANCE: f64 = 1e-9;

/// The result of a round trip that was passed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct RoundTripCheck {
    /// The number of rays that were traced through both lenses.
    pub rays: usize,
    /// The number of rays that reached the image.
    pub imaged: usize,
    /// The largest distance between the two ends of a ray, in mm.
    pub worst_mm: f64,
}

impl fmt::Display for RoundTripCheck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rays, imaged, worst_mm } = self;
        write!(
            f,
            "read back and traced: {rays} rays, {imaged} imaged, at most {worst_mm:.1e} mm apart"
        )
    }
}

/// Traces the same rays through a lens and through the lens read back; `file` is its name in the error.
pub(super) fn check_round_trip(
    lens: &Lens,
    back: &Lens,
    file: &str,
) -> Result<RoundTripCheck, FileError> {
    let unusable = |source| FileError::Lens { file: file.to_owned(), source };
    let mut proof = RoundTripCheck::default();
    // A single configuration is not a zoom lens in a foreign file.
    let positions = lens.zoom_positions();
    if back.zoom_positions() != positions {
        let what = format!("{} zoom positions instead of {positions}", back.zoom_positions());
        return Err(FileError::RoundTripFailed { file: file.to_owned(), what });
    }
    if !has_wavelengths_of(back, lens) {
        let what = "other wavelengths".to_owned();
        return Err(FileError::RoundTripFailed { file: file.to_owned(), what });
    }
    for zoom in 0..positions {
        let waves = &lens.wavelengths;
        let written = tracers(lens, zoom, waves).map_err(unusable)?;
        let read = tracers(back, zoom, waves).map_err(unusable)?;
        let launch = ProbeLaunch::new(lens, zoom).map_err(unusable)?;
        for (number, field) in lens.fields_at(zoom).values.iter().enumerate() {
            for (i, ray) in launch.rays(*field).enumerate() {
                let wave = i % written.len();
                compare(&written[wave], &read[wave], ray, &mut proof).map_err(|what| {
                    let what = format!("zoom {zoom}, field {number}, ray {i}: {what}");
                    FileError::RoundTripFailed { file: file.to_owned(), what }
                })?;
            }
        }
    }
    Ok(proof)
}

/// True if two lenses have the same wavelengths in any order, within the rounding of another unit.
fn has_wavelengths_of(back: &Lens, lens: &Lens) -> bool {
    let sorted = |lens: &Lens| {
        let mut waves: Vec<f64> = lens.wavelengths.iter().map(|wave| wave.um).collect();
        waves.sort_by(f64::total_cmp);
        waves
    };
    let (read, written) = (sorted(back), sorted(lens));
    let same = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-14 * b.abs();
    read.len() == written.len() && read.iter().zip(&written).all(same)
}

/// The tracers of a lens at a zoom position, one for each of some wavelengths. Formats may have another
/// order of them.
fn tracers(lens: &Lens, zoom: usize, waves: &[Wavelength]) -> Result<Vec<Tracer<f64>>, LensError> {
    let at = |um| Ok(Tracer::new(&lens.resolve(zoom, um)?)?);
    waves.iter().map(|wave| at(wave.um)).collect()
}

fn compare(
    written: &Tracer<f64>,
    read: &Tracer<f64>,
    ray: Ray<f64>,
    proof: &mut RoundTripCheck,
) -> Result<(), String> {
    let (a, b) = (written.trace(ray), read.trace(ray));
    proof.rays += 1;
    if a.fate != b.fate {
        return Err(format!("{} instead of {}", fate_text(b.fate), fate_text(a.fate)));
    }
    if a.fate != Fate::Imaged {
        return Ok(());
    }
    proof.imaged += 1;
    let apart = a.ray.point - b.ray.point;
    let apart = apart.dot(apart).sqrt().max((a.opl - b.opl).abs());
    proof.worst_mm = proof.worst_mm.max(apart);
    if apart <= TOLERANCE { Ok(()) } else { Err(format!("ends {apart} mm apart")) }
}

/// A fate with its surface: `missed at surface 1`.
fn fate_text(fate: Fate) -> String {
    let place = fate.surface().map(|index| format!(" at surface {}", SurfaceNumber::new(index)));
    format!("{}{}", fate.name(), place.unwrap_or_default())
}
