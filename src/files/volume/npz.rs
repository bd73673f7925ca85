//! A volume in `NumPy`'s `.npz`: an archive of the arrays `index`, `low` and `spacing`.

use super::npy::{self, NpyArray};
use super::{Volume, checked_volume};
use crate::files::FileError;
use crate::files::error::ParseError;
use crate::files::write_atomic;
use std::io::{Cursor, Write as _};
use std::path::Path;
use zip::result::{ZipError, ZipResult};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

pub(super) fn read(bytes: &[u8]) -> Result<Volume, ParseError> {
    let index = read_array(bytes, "index")?;
    let (low, spacing) = (read_triple(bytes, "low")?, read_triple(bytes, "spacing")?);
    let [nz, ny, nx] = index.shape[..] else {
        return Err(ParseError {
            place: "array index".to_owned(),
            found: format!("shape {:?}", index.shape),
            expected: "three axes: z, y, x".to_owned(),
        });
    };
    checked_volume([nx, ny, nz], low, spacing, index.values, "array index")
}

fn read_array(bytes: &[u8], name: &str) -> Result<NpyArray, ParseError> {
    let missing = |error: ZipError| ParseError {
        place: format!("array {name}"),
        found: error.to_string(),
        expected: "the arrays index, low and spacing".to_owned(),
    };
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(missing)?;
    let content = archive.by_name(&format!("{name}.npy")).map_err(missing)?;
    npy::read(name, content)
}

fn read_triple(bytes: &[u8], name: &str) -> Result<[f64; 3], ParseError> {
    let values = read_array(bytes, name)?.values;
    values.try_into().map_err(|values: Vec<f64>| ParseError {
        place: format!("array {name}"),
        found: format!("{} numbers", values.len()),
        expected: "three: x, y, z".to_owned(),
    })
}

pub(super) fn write(path: &Path, volume: &Volume) -> Result<(), FileError> {
    let bytes = archive(volume).map_err(|error| FileError::Unwritable {
        file: path.display().to_string(),
        source: error.into(),
    })?;
    write_atomic(path, &bytes)
}

fn archive(volume: &Volume) -> ZipResult<Vec<u8>> {
    let [nx, ny, nz] = volume.grid.counts();
    let (low, spacing) = (volume.grid.low(), volume.grid.spacing());
    let arrays = [
        ("index.npy", npy::write(&[nz, ny, nx], &volume.values)),
        ("low.npy", npy::write(&[3], &[low.x, low.y, low.z])),
        ("spacing.npy", npy::write(&[3], &[spacing.x, spacing.y, spacing.z])),
    ];
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
    for (name, bytes) in arrays {
        archive.start_file(name, options)?;
        archive.write_all(&bytes)?;
    }
    Ok(archive.finish()?.into_inner())
}
