//! Target images: drawn by formula, or read from a file.

use super::geometry::GOLDEN_ANGLE;
use super::task_file::TaskFile;
use crate::files::{FileError, GrayscaleImage};
use serde::{Deserialize, Serialize};

/// Sample points along a side of a pixel.
const SUBPIXELS: usize = 4;
/// The background: light cannot be removed completely from any place.
const BACKGROUND: f64 = 0.25;
/// The width of a soft edge, in units of half the side.
const EDGE_SOFTNESS: f64 = 0.03;
/// Sample points of the circle of confusion, and its radius in units of half the side per unit of
/// defocus.
const CONFUSION_POINTS: usize = 12;
const CONFUSION_RADIUS: f64 = 0.4;

/// A target image, which the light of a view should form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TargetImage {
    /// A smiling face.
    Face,
    /// A letter A in a frame.
    Letter,
    /// A ring.
    Ring,
    /// A scene as a camera sees it that is focused at this depth, evenly spaced in dioptres: a ring
    /// at depth 0, a cross at 0.5, a square at 1.
    Scene(f64),
    /// An image file: converted to grey and cropped to the largest central square. Its pixel values
    /// are taken as linear light.
    File(TaskFile<GrayscaleImage>),
}

impl TargetImage {
    /// The pixels in rows from the bottom, as many as columns, of mean 1.
    ///
    /// # Errors
    /// A file that has not been read, or an image without light in its central square.
    pub fn render(&self, pixels: usize) -> Result<Vec<f64>, FileError> {
        let mut all = match self {
            Self::File(file) => match file.content() {
                Some(image) => resample(image, pixels),
                None => return Err(self.unusable("its content", "a file that was not read")),
            },
            drawn => (0..pixels * pixels).map(|n| drawn.pixel(n, pixels)).collect(),
        };
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        if !(mean > 0.0) {
            return Err(self.unusable("its middle", "no light"));
        }
        all.iter_mut().for_each(|value| *value /= mean);
        Ok(all)
    }

    fn unusable(&self, place: &str, found: &str) -> FileError {
        let file = match self {
            Self::File(file) => file.name(),
            _ => "drawing".to_owned(),
        };
        let (place, found, expected) =
            (place.to_owned(), found.to_owned(), "some light".to_owned());
        FileError::Malformed { file, place, found, expected }
    }

    /// A pixel of an image by formula, averaged over its area.
    fn pixel(&self, n: usize, pixels: usize) -> f64 {
        let fine = (pixels * SUBPIXELS) as f64;
        let at = |pixel: usize, k: usize| 2.0 * ((pixel * SUBPIXELS + k) as f64 + 0.5) / fine - 1.0;
        let lit = |k: usize| {
            self.light(at(n % pixels, k % SUBPIXELS), at(n / pixels, k / SUBPIXELS), k as f64)
        };
        (0..SUBPIXELS * SUBPIXELS).map(lit).sum::<f64>() / (SUBPIXELS * SUBPIXELS) as f64
    }

    /// The light at a point of the square from -1 to 1: soft edges on a background. The circles of
    /// confusion of the points of a pixel are rotated against each other.
    fn light(&self, x: f64, y: f64, turn: f64) -> f64 {
        let drawn = match self {
            Self::Face => face(x, y),
            Self::Letter => letter(x, y),
            Self::Ring => soft_edge((x.hypot(y) - 0.6).abs() - 0.08),
            Self::Scene(focus) => scene([x, y], *focus, turn),
            Self::File(_) => 0.0,
        };
        BACKGROUND + (1.0 - BACKGROUND) * drawn
    }
}

/// 1 inside, at a negative distance, and 0 outside.
fn soft_edge(distance: f64) -> f64 {
    1.0 / (1.0 + (distance / EDGE_SOFTNESS).exp())
}

fn face(x: f64, y: f64) -> f64 {
    let ring = soft_edge((x.hypot(y) - 0.62).abs() - 0.08);
    let eye = |side: f64| soft_edge((x - side * 0.24).hypot(y - 0.2) - 0.11);
    let mouth = soft_edge((x.hypot(y + 0.02) - 0.36).abs() - 0.06) * soft_edge(y + 0.16);
    ring.max(eye(-1.0)).max(eye(1.0)).max(mouth)
}

fn letter(x: f64, y: f64) -> f64 {
    let frame = soft_edge((x.abs().max(y.abs()) - 0.68).abs() - 0.07);
    let leg = |side: f64| soft_edge((x - side * 0.5 * (0.45 - y) * 0.55).abs() - 0.075);
    let legs = leg(-1.0).max(leg(1.0)) * soft_edge(y.abs() - 0.45);
    let bar = soft_edge((y + 0.08).abs() - 0.06) * soft_edge(x.abs() - 0.2);
    frame.max(legs).max(bar)
}

/// Three objects at three depths, each blurred in proportion to its defocus.
fn scene(place: [f64; 2], focus: f64, turn: f64) -> f64 {
    let ring = |x: f64, y: f64| soft_edge(((x + 0.36).hypot(y - 0.3) - 0.22).abs() - 0.06);
    let cross = |x: f64, y: f64| {
        let (x, y) = ((x - 0.38).abs(), (y - 0.3).abs());
        soft_edge(x.min(y) - 0.06) * soft_edge(x.max(y) - 0.26)
    };
    let square = |x: f64, y: f64| soft_edge((x.abs().max((y + 0.36).abs()) - 0.2).abs() - 0.06);
    let front = blur(place, focus, turn, ring);
    let middle = blur(place, focus - 0.5, turn, cross);
    front.max(middle).max(blur(place, focus - 1.0, turn, square))
}

/// The mean over a circle of confusion.
fn blur([x, y]: [f64; 2], off: f64, turn: f64, light: impl Fn(f64, f64) -> f64) -> f64 {
    let radius = CONFUSION_RADIUS * off.abs();
    if radius < EDGE_SOFTNESS / 4.0 {
        return light(x, y);
    }
    let lit = |k: usize| {
        let r = radius * ((k as f64 + 0.5) / CONFUSION_POINTS as f64).sqrt();
        let (sin, cos) = (GOLDEN_ANGLE * k as f64 + turn).sin_cos();
        light(x + r * cos, y + r * sin)
    };
    (0..CONFUSION_POINTS).map(lit).sum::<f64>() / CONFUSION_POINTS as f64
}

/// The central square of an image resampled to `pixels` a side, each the mean over its area, rows
/// from the bottom.
fn resample(photo: &GrayscaleImage, pixels: usize) -> Vec<f64> {
    let side = photo.width.min(photo.height);
    let (left, top) = ((photo.width - side) / 2, (photo.height - side) / 2);
    let parts: Vec<Vec<(usize, f64)>> =
        (0..pixels).map(|i| pixel_overlap(i, pixels, side)).collect();
    let at = |x: usize, y: usize| f64::from(photo.light[(top + y) * photo.width + left + x]);
    let mean = |n: usize| {
        let (columns, rows) = (&parts[n % pixels], &parts[pixels - 1 - n / pixels]);
        let row = |y: usize| columns.iter().map(|(x, share)| share * at(*x, y)).sum::<f64>();
        rows.iter().map(|(y, share)| share * row(*y)).sum()
    };
    (0..pixels * pixels).map(mean).collect()
}

/// The pixels of `side` that a target pixel covers along an axis, with the share of each; the
/// shares sum to 1.
fn pixel_overlap(pixel: usize, pixels: usize, side: usize) -> Vec<(usize, f64)> {
    let scale = side as f64 / pixels as f64;
    let (from, to) = (pixel as f64 * scale, (pixel + 1) as f64 * scale);
    let last = (to.ceil() as usize).min(side);
    let share = |k: usize| (to.min((k + 1) as f64) - from.max(k as f64)) / scale;
    (from as usize..last).map(|k| (k, share(k))).filter(|(_, share)| *share > 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_photo_keeps_its_light_at_any_size() {
        let light: Vec<f32> = (0..7 * 5).map(|i| ((i * 37) % 11) as f32).collect();
        let photo = GrayscaleImage { width: 7, height: 5, light };
        let square = |x: usize, y: usize| f64::from(photo.light[y * 7 + 1 + x]);
        let mean = (0..25).map(|n| square(n % 5, n / 5)).sum::<f64>() / 25.0;
        for pixels in [1, 3, 4, 5, 8, 64] {
            let found = resample(&photo, pixels);
            let sum = found.iter().sum::<f64>() / found.len() as f64;
            assert!((sum - mean).abs() < 1e-9 * mean, "{pixels}: {sum} {mean}");
        }
        let same = resample(&photo, 5);
        assert!((0..25).all(|n| (same[n] - square(n % 5, 4 - n / 5)).abs() < 1e-12));
    }

    #[test]
    fn a_scene_is_sharp_where_it_is_in_focus() {
        // In the middle of the strokes of the ring, the cross and the square.
        let strokes = [[-0.14, 0.3], [0.38, 0.45], [0.0, -0.16]];
        for (i, place) in strokes.into_iter().enumerate() {
            let by_depth = [0.0, 0.5, 1.0].map(|depth| scene(place, depth, 0.0));
            assert!(by_depth[i] > 0.75, "{by_depth:?}");
            assert!((0..3).all(|k| k == i || by_depth[k] < by_depth[i] - 0.1), "{by_depth:?}");
        }
    }

    /// A ring is its own mirror image in both directions and across the diagonal, pixel by pixel, and it
    /// is bright where its circle is.
    #[test]
    fn a_ring_by_formula_is_round() {
        let side = 24;
        let ring: Vec<f64> = (0..side * side).map(|n| TargetImage::Ring.pixel(n, side)).collect();
        let at = |column: usize, row: usize| ring[row * side + column];
        for row in 0..side {
            for column in 0..side {
                let here = at(column, row);
                for other in
                    [at(row, column), at(side - 1 - column, row), at(column, side - 1 - row)]
                {
                    assert!((here - other).abs() < 1e-12, "{column} {row}: {here} {other}");
                }
            }
        }
        // The circle has a radius of 0.6 of the half side.
        let crossing = (side as f64 * 0.5 * (1.0 - 0.6)) as usize;
        assert!(at(crossing, side / 2) > 0.8, "{}", at(crossing, side / 2));
        assert!(at(side / 2, side / 2) < 0.3 && at(0, 0) < 0.3);
    }
}
