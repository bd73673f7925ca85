//! Pictures of any size from PNG and JPEG files, as shares of light from 0 to 1.

use super::FileError;
use image::{ImageReader, Limits};
use std::io::Cursor;
use std::path::Path;

/// Most pixels along a side, and the memory that reading one may take.
const MAX_SIDE: u32 = 16_384;
const MAX_BYTES: u64 = 1 << 30;
const EXPECTED: &str = "a picture, PNG or JPEG";

/// A picture in grey.
#[derive(Debug, Clone, PartialEq)]
pub struct GrayscaleImage {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// From the upper left corner, row by row: 0 is black or transparent, 1 is white.
    pub light: Vec<f32>,
}

/// Reads a picture; colours become grey.
///
/// # Errors
/// A file that cannot be read, that is no picture, a side of more than 16384 pixels, or a picture
/// without any light.
pub fn read_grayscale(path: &Path) -> Result<GrayscaleImage, FileError> {
    let file = path.display().to_string();
    let bytes = std::fs::read(path)
        .map_err(|source| FileError::Unreadable { file: file.clone(), source })?;
    let wrong = |found: String, expected: String| {
        let (file, place) = (file.clone(), "picture".to_owned());
        FileError::Malformed { file, place, found, expected }
    };
    if bytes.is_empty() {
        return Err(wrong("an empty file".into(), EXPECTED.into()));
    }
    let reader = || ImageReader::new(Cursor::new(&bytes)).with_guessed_format();
    let no_picture = |says: String| wrong(says, EXPECTED.into());
    let size = reader().map_err(|error| no_picture(error.to_string()))?.into_dimensions();
    let (width, height) = size.map_err(|error| no_picture(error.to_string()))?;
    if width > MAX_SIDE || height > MAX_SIDE {
        let expected = format!("at most {MAX_SIDE} pixels along a side");
        return Err(wrong(format!("{width} x {height} pixels"), expected));
    }
    let mut reader = reader().map_err(|error| no_picture(error.to_string()))?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    let grey = reader.decode().map_err(|error| no_picture(error.to_string()))?;
    let grey = grey.into_luma_alpha16();
    let share = |level: u16| f32::from(level) / f32::from(u16::MAX);
    let light: Vec<f32> = grey.pixels().map(|p| share(p.0[0]) * share(p.0[1])).collect();
    if !light.iter().any(|light| *light > 0.0) {
        return Err(wrong("a black picture".into(), "some light in it".into()));
    }
    Ok(GrayscaleImage { width: width as usize, height: height as usize, light })
}
