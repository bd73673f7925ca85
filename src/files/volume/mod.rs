//! Volumes: samples of a refractive index on a regular grid.
//!
//! Two formats, recognized by their content: `NumPy`'s `.npz`, and raw numbers with a JSON header. In
//! both x runs fastest. Python writes the first with
//! `np.savez("lens.npz", index=a, low=[-1, -1, -1], spacing=[0.1, 0.1, 0.1])` with `a.shape == (nz,
//! ny, nx)`, lengths in mm.

mod npy;
mod npz;
mod raw;

use super::error::ParseError;
use super::{FileError, MAX_LENS_BYTES, read_file};
use crate::grin::field::RegularGrid;
use crate::math::Vec3;
use std::path::{Path, PathBuf};

/// The maximum number of nodes of a volume.
const MAX_NODES: u64 = 1 << 28;
/// The maximum size of a file of a volume, in bytes: all nodes with 8 bytes each, and the rest.
pub const MAX_VOLUME_BYTES: u64 = 8 * MAX_NODES + 1_000_000;

/// Samples on a regular grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Volume {
    /// The grid, in mm.
    pub grid: RegularGrid<f64>,
    /// One value for each node, in the order of the grid.
    pub values: Vec<f64>,
}

/// Reads a volume.
///
/// # Errors
/// A file that cannot be read, is malformed, or holds more numbers than its header says; see
/// [`FileError`].
pub fn read_volume(path: &Path) -> Result<Volume, FileError> {
    let file = path.display().to_string();
    let bytes = read_file(path, MAX_VOLUME_BYTES)?;
    if bytes.starts_with(b"PK") {
        return npz::read(&bytes).map_err(|malformed| malformed.in_file(&file));
    }
    let first = bytes.iter().find(|byte| !byte.is_ascii_whitespace());
    if first != Some(&b'{') {
        let (place, found) = ("its beginning".to_owned(), describe_start(&bytes));
        let expected = "NumPy's .npz, an archive that begins with `PK`, or the header of a volume, \
            JSON that begins with `{`";
        return Err(ParseError { place, found, expected: expected.to_owned() }.in_file(&file));
    }
    raw::read(path, &bytes)
}

/// The files that a volume is read from: the file itself, and the numbers that its header names.
pub fn volume_files(path: &Path) -> Vec<PathBuf> {
    let header = read_file(path, MAX_LENS_BYTES).ok();
    let data = header.and_then(|header| raw::data_path(path, &header));
    std::iter::once(path.to_owned()).chain(data).collect()
}

/// The beginning of a file that is not a volume, for a message.
fn describe_start(bytes: &[u8]) -> String {
    let start = &bytes[..bytes.len().min(16)];
    match std::str::from_utf8(start) {
        _ if bytes.is_empty() => "an empty file".to_owned(),
        _ if bytes.starts_with(b"\x93NUMPY") => "a single array of NumPy, .npy".to_owned(),
        Ok(text) if !text.contains(|c: char| c.is_control() && !c.is_whitespace()) => {
            format!("the text `{}`", text.split_whitespace().collect::<Vec<_>>().join(" "))
        }
        _ => format!("the bytes {start:02x?}"),
    }
}

/// Writes a volume and returns the paths of the written files: `NumPy`'s format for the extension
/// `.npz`, else a JSON header with the numbers in a `.raw` file beside it.
///
/// # Errors
/// A file that cannot be written; the targets are unchanged, except that the numbers of a `.raw` file
/// are replaced before its header.
pub fn write_volume(path: &Path, volume: &Volume) -> Result<Vec<PathBuf>, FileError> {
    if !is_npz(path) {
        return raw::write(path, volume);
    }
    npz::write(path, volume)?;
    Ok(vec![path.to_owned()])
}

/// True for a path in `NumPy`'s format.
pub fn is_npz(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npz"))
}

/// The file of the numbers that is written beside a JSON header.
pub fn raw_path(header: &Path) -> PathBuf {
    header.with_extension("raw")
}

/// Checks that there is one finite value for each node; `place` is their place in a message.
fn checked_volume(
    counts: [usize; 3],
    low: [f64; 3],
    spacing: [f64; 3],
    values: Vec<f64>,
    place: &str,
) -> Result<Volume, ParseError> {
    let vector = |[x, y, z]: [f64; 3]| Vec3::new(x, y, z);
    let wrong = |found: String| {
        let expected = "one finite value for each node".to_owned();
        Err(ParseError { place: place.to_owned(), found, expected })
    };
    match RegularGrid::new(counts, vector(low), vector(spacing)) {
        Ok(grid) if counts.contains(&0) || grid.node_count() != values.len() => {
            wrong(format!("{} values for {counts:?} nodes", values.len()))
        }
        Ok(grid) => match values.iter().position(|value| !value.is_finite()) {
            Some(n) => {
                let [nx, ny, _] = counts;
                let node = [n % nx, n / nx % ny, n / nx / ny];
                wrong(format!("{} at node {node:?}", values[n]))
            }
            None => Ok(Volume { grid, values }),
        },
        Err(error) => Err(ParseError {
            place: place.to_owned(),
            found: error.to_string(),
            expected: "a positive spacing".to_owned(),
        }),
    }
}

/// Decodes numbers of `N` bytes each; an incomplete one at the end is ignored.
fn decode<const N: usize>(bytes: &[u8], number: impl Fn([u8; N]) -> f64) -> Vec<f64> {
    bytes.as_chunks::<N>().0.iter().map(|bytes| number(*bytes)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_that_is_no_number_is_named_by_its_node() {
        let at = |n: usize| {
            let mut values = vec![1.5; 24];
            values[n] = f64::NAN;
            checked_volume([2, 3, 4], [0.0; 3], [1.0; 3], values, "values").unwrap_err().found
        };
        // x runs fastest, z slowest.
        for (n, node) in [(1, "[1, 0, 0]"), (2, "[0, 1, 0]"), (6, "[0, 0, 1]"), (23, "[1, 2, 3]")] {
            assert!(at(n).ends_with(node), "{n}: {}", at(n));
        }
    }

    #[test]
    fn a_file_that_is_no_volume_is_described_as_text_or_bytes() {
        assert_eq!(describe_start(b"hello\n  you"), "the text `hello you`");
        assert_eq!(describe_start(b"a\x01b"), "the bytes [61, 01, 62]");
        assert_eq!(describe_start(b""), "an empty file");
    }
}
