//! A picture: the irradiance of its pixels, each with an error.

use super::ImageFrame;
use super::exact::{MID_GREY, relative_rms};
use super::scene::Radiance;
use crate::trace::Fates;

/// A picture as light, before any sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// The pixels' places in the image.
    pub frame: ImageFrame,
    /// The irradiance of the pixels in red, green and blue, in the scene's radiance times steradians,
    /// row by row from the upper left corner.
    pub values: Vec<Radiance>,
    /// The standard errors of the values by sampling.
    pub errors: Vec<Radiance>,
    /// The irradiance of a white card on the axis.
    pub white: f64,
    /// The number of rays.
    pub rays: usize,
    /// The fates of the rays: those that are lost bring no light.
    pub fates: Fates,
    /// True if the error that was asked for is reached everywhere.
    pub reached: bool,
    /// False if the work was ended early.
    pub complete: bool,
    /// The largest reach of directions of light that were checked over that of the directions that are
    /// sampled; see [`LitDirections::overshoot`](super::LitDirections::overshoot).
    pub overshoot: f64,
}

impl Picture {
    /// The root mean square error by sampling, as a share of mid grey, or of the pixel where that is
    /// brighter.
    pub fn rms_error(&self) -> f64 {
        relative_rms(&self.values, &self.errors, MID_GREY * self.white)
    }

    /// The mean over all pixels and colours.
    pub fn mean(&self) -> f64 {
        let sum: f64 = self.values.iter().flatten().sum();
        sum / (3 * self.values.len().max(1)) as f64
    }

    /// The mean over a pixel's colours.
    pub fn gray(&self, [column, row]: [usize; 2]) -> f64 {
        let pixel = self.values[row * self.frame.pixels[0] + column];
        pixel.iter().sum::<f64>() / 3.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_is_over_pixels_and_colours() {
        let frame = ImageFrame { pixels: [2, 1], pitch: 1e-3, center: [0.0; 2], inverted: true };
        let picture = Picture {
            frame,
            values: vec![[1.0, 2.0, 3.0], [4.0, 5.0, 12.0]],
            errors: vec![[0.0; 3]; 2],
            white: 1.0,
            rays: 0,
            fates: Fates::default(),
            reached: true,
            complete: true,
            overshoot: 0.0,
        };
        assert_eq!(picture.mean(), 27.0 / 6.0);
        assert_eq!([picture.gray([0, 0]), picture.gray([1, 0])], [2.0, 7.0]);
        assert_eq!(picture.rms_error(), 0.0);
    }
}
