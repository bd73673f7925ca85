//! Images from PNG and JPEG files: their brightness, or the light of their colours.

use super::{FileError, MAX_DATA_BYTES, read_file};
use image::{DynamicImage, ImageReader, Limits};
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

/// A colour image.
#[derive(Debug, Clone, PartialEq)]
pub struct ColorImage {
    /// Number of pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Linear red, green and blue from 0 to 1, each times the cover, and the cover (1 where it is
    /// opaque), row by row from the upper left corner.
    pub light: Vec<[f32; 4]>,
}

/// Reads an image and converts it to grayscale.
///
/// # Errors
/// A file that cannot be read or is not an image, a side of more than 16384 pixels, or an image that
/// is black everywhere.
pub fn read_grayscale(path: &Path) -> Result<GrayscaleImage, FileError> {
    let grey = read_image(path)?.into_luma_alpha16();
    let share = |level: u16| f32::from(level) / f32::from(u16::MAX);
    let light: Vec<f32> = grey.pixels().map(|p| share(p.0[0]) * share(p.0[1])).collect();
    if !light.iter().any(|light| *light > 0.0) {
        let expected = "an image that is not black everywhere".to_owned();
        return Err(malformed(path, "a black image".to_owned(), expected));
    }
    Ok(GrayscaleImage { width: grey.width() as usize, height: grey.height() as usize, light })
}

/// Reads an image with the light of its colours, which are taken as sRGB.
///
/// # Errors
/// A file that cannot be read or is not an image, or a side of more than 16384 pixels.
pub fn read_color(path: &Path) -> Result<ColorImage, FileError> {
    let image = read_image(path)?.into_rgba16();
    let share = |level: u16| f32::from(level) / f32::from(u16::MAX);
    let pixel = |[red, green, blue, cover]: [u16; 4]| {
        let cover = share(cover);
        let [red, green, blue] = [red, green, blue].map(|v| cover * linear_light(share(v)));
        [red, green, blue, cover]
    };
    let light = image.pixels().map(|p| pixel(p.0)).collect();
    Ok(ColorImage { width: image.width() as usize, height: image.height() as usize, light })
}

/// The light of an sRGB value, both 0 to 1 (IEC 61966-2-1).
fn linear_light(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

fn malformed(path: &Path, found: String, expected: String) -> FileError {
    let (file, place) = (path.display().to_string(), "image".to_owned());
    FileError::Malformed { file, place, found, expected }
}

/// Reads and decodes an image of at most 16384 pixels along a side.
fn read_image(path: &Path) -> Result<DynamicImage, FileError> {
    let bytes = read_file(path, MAX_DATA_BYTES)?;
    let not_an_image = |says: String| malformed(path, says, EXPECTED.to_owned());
    if bytes.is_empty() {
        return Err(not_an_image("an empty file".to_owned()));
    }
    let reader = || ImageReader::new(Cursor::new(&bytes)).with_guessed_format();
    let size = reader().map_err(|error| not_an_image(error.to_string()))?.into_dimensions();
    let (width, height) = size.map_err(|error| not_an_image(error.to_string()))?;
    if width > MAX_SIDE || height > MAX_SIDE {
        let expected = format!("at most {MAX_SIDE} pixels along a side");
        return Err(malformed(path, format!("{width} x {height} pixels"), expected));
    }
    let mut reader = reader().map_err(|error| not_an_image(error.to_string()))?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    reader.decode().map_err(|error| not_an_image(error.to_string()))
}
