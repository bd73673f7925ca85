//! A volume as raw little-endian numbers with a JSON header beside them.
//!
//! The value at a node is `offset + scale * number`: a volume of densities in bytes, as many are
//! kept, becomes one of the index by `"scale": -1.176e-6, "offset": 1.0003`. Left out, they are 1 and
//! 0, and the numbers are the values themselves.

use super::{Volume, checked_volume};
use crate::files::FileError;
use crate::files::error::ParseError;
use crate::files::write_atomic;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What the numbers mean.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawHeader {
    /// The version of this format: 1.
    aplanat_volume: u32,
    /// Nodes along x, y and z.
    counts: [usize; 3],
    /// The first node, in mm.
    low: [f64; 3],
    /// Between neighbours along x, y and z, in mm.
    spacing: [f64; 3],
    /// How a number is written.
    numbers: SampleFormat,
    /// The value where the number is 0.
    #[serde(default, skip_serializing_if = "is_zero")]
    offset: f64,
    /// What the value grows by from a number to the next whole one.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    scale: f64,
    /// The file of the numbers, beside this one.
    data: PathBuf,
}

fn one() -> f64 {
    1.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// How a number is written, with its lowest byte first.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SampleFormat {
    /// `NumPy`'s `uint8`.
    U8,
    /// `NumPy`'s `<u2`.
    U16,
    /// `NumPy`'s `<f4`.
    F32,
    /// `NumPy`'s `<f8`.
    F64,
}

impl SampleFormat {
    fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    fn read(self, bytes: &[u8]) -> Vec<f64> {
        match self {
            Self::U8 => bytes.iter().map(|b| f64::from(*b)).collect(),
            Self::U16 => each(bytes, |b| f64::from(u16::from_le_bytes(b))),
            Self::F32 => each(bytes, |b| f64::from(f32::from_le_bytes(b))),
            Self::F64 => each(bytes, f64::from_le_bytes),
        }
    }
}

/// Numbers of so many bytes each.
fn each<const N: usize>(bytes: &[u8], number: impl Fn([u8; N]) -> f64) -> Vec<f64> {
    bytes.as_chunks::<N>().0.iter().map(|bytes| number(*bytes)).collect()
}

pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Volume, FileError> {
    let file = path.display().to_string();
    let header: RawHeader = serde_json::from_slice(bytes).map_err(|error| {
        let place = format!("line {}, column {}", error.line(), error.column());
        let expected = "a header of a volume, or NumPy's .npz".to_owned();
        ParseError { place, found: error.to_string(), expected }.in_file(&file)
    })?;
    if header.aplanat_volume != 1 {
        let found = format!("version {}", header.aplanat_volume);
        let place = "aplanat_volume".to_owned();
        return Err(ParseError { place, found, expected: "1".to_owned() }.in_file(&file));
    }
    let data = path.with_file_name(&header.data);
    let bytes = std::fs::read(&data)
        .map_err(|source| FileError::Unreadable { file: data.display().to_string(), source })?;
    let RawHeader { numbers, offset, scale, .. } = header;
    let place = header.data.display().to_string();
    if bytes.len() % numbers.bytes() != 0 {
        let found = format!("{} bytes", bytes.len());
        let expected = format!("a whole number of values of {} bytes", numbers.bytes());
        return Err(ParseError { place, found, expected }.in_file(&file));
    }
    let values = numbers.read(&bytes).into_iter().map(|number| offset + scale * number).collect();
    checked_volume(header.counts, header.low, header.spacing, values, &place)
        .map_err(|malformed| malformed.in_file(&file))
}

/// Writes a header and the numbers beside it: both files.
pub(super) fn write(path: &Path, volume: &Volume) -> Result<Vec<PathBuf>, FileError> {
    let data = path.with_extension("raw");
    let (low, spacing) = (volume.grid.low(), volume.grid.spacing());
    let header = RawHeader {
        aplanat_volume: 1,
        counts: volume.grid.counts(),
        low: [low.x, low.y, low.z],
        spacing: [spacing.x, spacing.y, spacing.z],
        numbers: SampleFormat::F64,
        offset: 0.0,
        scale: 1.0,
        data: data.file_name().map(PathBuf::from).unwrap_or_default(),
    };
    let text = serde_json::to_string_pretty(&header).map_err(|error| FileError::Unwritable {
        file: path.display().to_string(),
        source: error.into(),
    })?;
    let bytes: Vec<u8> = volume.values.iter().flat_map(|value| value.to_le_bytes()).collect();
    write_atomic(&data, &bytes)?;
    write_atomic(path, format!("{text}\n").as_bytes())?;
    Ok(vec![path.to_owned(), data])
}
