//! The part of the image plane that a picture shows, divided into pixels.
//!
//! Pixels are counted as in files: columns from the left, rows from the top, of the picture as a viewer
//! sees it. A camera lens turns the scene upside down on the sensor, so that the picture is the sensor
//! seen turned by half a turn.

use super::PictureError;
use crate::lens::Object;
use crate::pupil::RayModel;

/// The largest number of pixels of a picture.
const MAX_PIXELS: usize = 1 << 26;

/// A rectangle of square pixels in the image plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageFrame {
    /// The number of columns and of rows.
    pub pixels: [usize; 2],
    /// The side of a pixel, in mm.
    pub pitch: f64,
    /// The middle of the rectangle, x and y in mm.
    pub center: [f64; 2],
    /// True if the image is upside down on the sensor, as behind a camera lens.
    pub inverted: bool,
}

impl ImageFrame {
    /// The frame about the axis with a diagonal in mm, turned so that the scene is upright.
    ///
    /// # Errors
    /// No pixels, too many, or a diagonal that is not positive.
    pub fn new(model: &RayModel, pixels: [usize; 2], diagonal: f64) -> Result<Self, PictureError> {
        let [width, height] = pixels;
        let all = width.saturating_mul(height);
        if all == 0 || all > MAX_PIXELS {
            let expected = "from 1 to 67108864";
            return Err(PictureError::Size {
                what: "the number of pixels",
                found: all as f64,
                expected,
            });
        }
        if !(diagonal > 0.0 && diagonal < 1e6) {
            let expected = "more than 0 mm, and less than 1e6";
            return Err(PictureError::Size { what: "the diagonal", found: diagonal, expected });
        }
        let pitch = diagonal / (width as f64).hypot(height as f64);
        let inverted = image_scale(model)? < 0.0;
        Ok(Self { pixels, pitch, center: [0.0; 2], inverted })
    }

    /// The point of the image plane at a place of a pixel, which counts from 0 to 1 to the right and
    /// downwards; x and y in mm.
    pub fn point(&self, [column, row]: [usize; 2], [right, down]: [f64; 2]) -> [f64; 2] {
        let facing = if self.inverted { -1.0 } else { 1.0 };
        let from_middle = |i: usize, part: f64, count: usize| i as f64 + part - 0.5 * count as f64;
        let [columns, rows] = self.pixels;
        [
            self.center[0] + facing * self.pitch * from_middle(column, right, columns),
            self.center[1] - facing * self.pitch * from_middle(row, down, rows),
        ]
    }

    /// The place of a point of the image plane, x and y in mm, as shares of the picture's width and height
    /// from its upper left corner; the inverse of [`ImageFrame::point`].
    pub fn place(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let facing = if self.inverted { -1.0 } else { 1.0 };
        let [width, height] = self.size();
        [0.5 + facing * (x - self.center[0]) / width, 0.5 - facing * (y - self.center[1]) / height]
    }

    /// The point of the image plane, x and y in mm, at shares of the picture's width and height from its upper
    /// left corner; the inverse of [`ImageFrame::place`].
    pub fn at_share(&self, [right, down]: [f64; 2]) -> [f64; 2] {
        let [columns, rows] = self.pixels;
        self.point([0, 0], [right * columns as f64, down * rows as f64])
    }

    /// The largest distance of a point of the frame from the axis, in mm.
    pub fn reach(&self) -> f64 {
        let side = |k: usize| self.center[k].abs() + 0.5 * self.pitch * self.pixels[k] as f64;
        side(0).hypot(side(1))
    }

    /// Width and height, in mm.
    pub fn size(&self) -> [f64; 2] {
        self.pixels.map(|count| count as f64 * self.pitch)
    }

    /// The same frame with pixels `factor` times as large, and fewer of them.
    #[must_use]
    pub fn coarser(&self, factor: usize) -> Self {
        let pixels = self.pixels.map(|count| count.div_ceil(factor.max(1)));
        let diagonal = self.size()[0].hypot(self.size()[1]);
        let pitch = diagonal / (pixels[0] as f64).hypot(pixels[1] as f64);
        Self { pixels, pitch, ..*self }
    }
}

/// The first-order size of the image over that of the object: the magnification, or, of an object at
/// infinity, minus the focal length in mm, over the tangent of its direction.
pub(super) fn image_scale(model: &RayModel) -> Result<f64, PictureError> {
    let first = &model.first_order;
    let scale = match model.beam.object {
        Object::Infinity => first.efl.map(|efl| -efl),
        Object::Finite(_) => first.magnification,
    };
    scale.filter(|scale| *scale != 0.0 && scale.is_finite()).ok_or(PictureError::Afocal)
}

/// The tangent of the direction in which the entrance pupil sees the scene that is imaged at a height
/// in mm, by first-order optics.
pub(super) fn tangent(model: &RayModel, height: f64) -> Result<f64, PictureError> {
    let size = (height / image_scale(model)?).abs();
    Ok(match model.beam.object {
        Object::Infinity => size,
        Object::Finite(distance) => size / (distance + entrance_pupil(model)).abs(),
    })
}

fn entrance_pupil(model: &RayModel) -> f64 {
    model.first_order.entrance_pupil.position.unwrap_or(0.0)
}

/// The half width and half height of a scene that fills a frame by first-order optics: in mm at a
/// distance in mm in front of the first vertex, as tangents of its directions at infinity.
///
/// # Errors
/// A lens without focal length.
pub fn filling_size(
    model: &RayModel,
    frame: &ImageFrame,
    distance: Option<f64>,
) -> Result<[f64; 2], PictureError> {
    let reach = distance.map_or(1.0, |distance| (distance + entrance_pupil(model)).abs());
    let [width, height] = frame.size();
    Ok([reach * tangent(model, 0.5 * width)?, reach * tangent(model, 0.5 * height)?])
}

/// The diagonal of the image of the fields of a lens in mm: twice the largest distance of a chief ray
/// from the axis.
///
/// # Errors
/// No field has a chief ray off the axis.
pub fn field_diagonal(model: &RayModel) -> Result<f64, PictureError> {
    let height = |field| {
        let launch = model.launch(field, model.primary).ok()?;
        let point = launch.unclipped_landing([0.0; 2])?.ray.point.value();
        Some(point.x.hypot(point.y))
    };
    let heights = model.fields.iter().filter_map(|field| height(*field));
    let widest = heights.fold(0.0, f64::max);
    if widest > 0.0 && widest.is_finite() {
        return Ok(2.0 * widest);
    }
    let expected = "a field off the axis, or a diagonal that is given";
    Err(PictureError::Size { what: "the image of the widest field", found: widest, expected })
}
