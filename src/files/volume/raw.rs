//! A volume as raw little-endian numbers with a JSON header beside them.

use super::{Volume, volume};
use crate::files::FileError;
use crate::files::error::Malformed;
use crate::files::replace;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What the numbers mean.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    /// The version of this format: 1.
    aplanat_volume: u32,
    /// Nodes along x, y and z.
    counts: [usize; 3],
    /// The first node, in mm.
    low: [f64; 3],
    /// Between neighbours along x, y and z, in mm.
    spacing: [f64; 3],
    /// How a number is written.
    numbers: Numbers,
    /// The file of the numbers, beside this one.
    data: PathBuf,
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Numbers {
    F32,
    F64,
}

pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Volume, FileError> {
    let file = path.display().to_string();
    let header: Header = serde_json::from_slice(bytes).map_err(|error| {
        let place = format!("line {}, column {}", error.line(), error.column());
        let expected = "a header of a volume, or NumPy's .npz".to_owned();
        Malformed { place, found: error.to_string(), expected }.of(&file)
    })?;
    if header.aplanat_volume != 1 {
        let found = format!("version {}", header.aplanat_volume);
        let place = "aplanat_volume".to_owned();
        return Err(Malformed { place, found, expected: "1".to_owned() }.of(&file));
    }
    let data = path.with_file_name(&header.data);
    let bytes = std::fs::read(&data)
        .map_err(|source| FileError::Unreadable { file: data.display().to_string(), source })?;
    let values = match header.numbers {
        Numbers::F64 => bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect(),
        Numbers::F32 => {
            bytes.as_chunks().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect()
        }
    };
    let place = header.data.display().to_string();
    volume(header.counts, header.low, header.spacing, values, &place)
        .map_err(|malformed| malformed.of(&file))
}

pub(super) fn write(path: &Path, volume: &Volume) -> Result<(), FileError> {
    let data = path.with_extension("raw");
    let (low, spacing) = (volume.grid.low(), volume.grid.spacing());
    let header = Header {
        aplanat_volume: 1,
        counts: volume.grid.counts(),
        low: [low.x, low.y, low.z],
        spacing: [spacing.x, spacing.y, spacing.z],
        numbers: Numbers::F64,
        data: data.file_name().map(PathBuf::from).unwrap_or_default(),
    };
    let text = serde_json::to_string_pretty(&header).map_err(|error| FileError::Unwritable {
        file: path.display().to_string(),
        source: error.into(),
    })?;
    let bytes: Vec<u8> = volume.values.iter().flat_map(|value| value.to_le_bytes()).collect();
    replace(&data, &bytes)?;
    replace(path, format!("{text}\n").as_bytes())
}
