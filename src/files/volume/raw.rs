//! A volume as raw little-endian numbers with a JSON header beside them.
//!
//! The value at a node is `offset + scale * number`, with the defaults 0 and 1. For example, densities
//! stored as bytes become an index by `"scale": -1.176e-6, "offset": 1.0003`.

use super::{MAX_NODES, Volume, checked_volume, decode, raw_path};
use crate::files::error::ParseError;
use crate::files::{FileError, json, read_file, write_atomic};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The number of values up to which a message counts those that are too many.
const COUNTED_NODES: u64 = 1000;

/// The header: grid, number format and scale.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawHeader {
    /// The version of the format: 1.
    aplanat_volume: u32,
    /// The number of nodes along x, y and z.
    counts: [usize; 3],
    /// The position of the first node, in mm.
    low: [f64; 3],
    /// The distance of neighbours along x, y and z, in mm.
    spacing: [f64; 3],
    /// The format of a number.
    numbers: SampleFormat,
    /// The value for the number 0.
    #[serde(default, skip_serializing_if = "is_zero")]
    offset: f64,
    /// The difference of the values for the numbers 1 and 0.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    scale: f64,
    /// The file of the numbers, relative to the header.
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

/// The format of a number, little-endian.
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
            Self::U16 => decode(bytes, |b| f64::from(u16::from_le_bytes(b))),
            Self::F32 => decode(bytes, |b| f64::from(f32::from_le_bytes(b))),
            Self::F64 => decode(bytes, f64::from_le_bytes),
        }
    }
}

impl RawHeader {
    /// The number of bytes of the numbers, at most that of the largest volume, and at least those
    /// that a message counts.
    fn data_bytes(&self) -> u64 {
        let nodes = self.counts.iter().try_fold(1_u64, |all, n| all.checked_mul(*n as u64));
        nodes.unwrap_or(u64::MAX).clamp(COUNTED_NODES, MAX_NODES) * self.numbers.bytes() as u64
    }
}

/// The file of the numbers that a header names; `None` if it is not a header.
pub(super) fn data_path(path: &Path, header: &[u8]) -> Option<PathBuf> {
    let header: RawHeader = serde_json::from_slice(header).ok()?;
    Some(path.with_file_name(header.data))
}

pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Volume, FileError> {
    let file = path.display().to_string();
    let header: RawHeader = json::read_json(&String::from_utf8_lossy(bytes), &file)?;
    if header.aplanat_volume != 1 {
        let found = format!("version {}", header.aplanat_volume);
        let place = "aplanat_volume".to_owned();
        return Err(ParseError { place, found, expected: "1".to_owned() }.in_file(&file));
    }
    let bytes = read_file(&path.with_file_name(&header.data), header.data_bytes())?;
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

/// Writes a header and the numbers beside it; returns both paths.
pub(super) fn write(path: &Path, volume: &Volume) -> Result<Vec<PathBuf>, FileError> {
    let data = raw_path(path);
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
