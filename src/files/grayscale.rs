//! Grayscale images from PNG and JPEG files of any size.

use super::{FileError, MAX_DATA_BYTES, read_file};
use image::{ImageReader, Limits};
use std::io::Cursor;
use std::path::Path;

/// Limits of an image: pixels along a side, and bytes of memory while it is decoded.
const MAX_SIDE: u32 = 16_384;
const MAX_BYTES: u64 = 1 << 30;
const EXPECTED: &str = "an image, PNG or JPEG";

/// A grayscale image.
#[derive(Debug, Clone, PartialEq)]
pub struct GrayscaleImage {
    /// Number of pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Brightness from 0 (black or transparent) to 1 (white), row by row from the upper left corner.
    pub light: Vec<f32>,
}

/// Reads an image and converts it to grayscale.
///
/// # Errors
/// A file that cannot be read or is not an image, a side of more than 16384 pixels, or an image that
/// is black everywhere.
pub fn read_grayscale(path: &Path) -> Result<GrayscaleImage, FileError> {
    let file = path.display().to_string();
    let bytes = read_file(path, MAX_DATA_BYTES)?;
    let wrong = |found: String, expected: String| {
        let (file, place) = (file.clone(), "image".to_owned());
        FileError::Malformed { file, place, found, expected }
    };
    if bytes.is_empty() {
        return Err(wrong("an empty file".into(), EXPECTED.into()));
    }
    let reader = || ImageReader::new(Cursor::new(&bytes)).with_guessed_format();
    let not_an_image = |says: String| wrong(says, EXPECTED.into());
    let size = reader().map_err(|error| not_an_image(error.to_string()))?.into_dimensions();
    let (width, height) = size.map_err(|error| not_an_image(error.to_string()))?;
    if width > MAX_SIDE || height > MAX_SIDE {
        let expected = format!("at most {MAX_SIDE} pixels along a side");
        return Err(wrong(format!("{width} x {height} pixels"), expected));
    }
    let mut reader = reader().map_err(|error| not_an_image(error.to_string()))?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    let grey = reader.decode().map_err(|error| not_an_image(error.to_string()))?;
    let grey = grey.into_luma_alpha16();
    let share = |level: u16| f32::from(level) / f32::from(u16::MAX);
    let light: Vec<f32> = grey.pixels().map(|p| share(p.0[0]) * share(p.0[1])).collect();
    if !light.iter().any(|light| *light > 0.0) {
        return Err(wrong("a black image".into(), "an image that is not black everywhere".into()));
    }
    Ok(GrayscaleImage { width: width as usize, height: height as usize, light })
}
