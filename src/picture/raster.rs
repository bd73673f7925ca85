//! Pictures from files as paint: linear light, interpolated between the middles of pixels.

use super::pattern::Paint;
use crate::files::ColorImage;

/// A picture from a file.
#[derive(Debug, Clone)]
pub struct Raster {
    image: ColorImage,
}

impl Raster {
    /// The paint of an image, white being the radiance 1.
    pub fn new(image: ColorImage) -> Self {
        Self { image }
    }

    /// Width over height.
    pub fn aspect(&self) -> f64 {
        self.image.width as f64 / self.image.height as f64
    }

    /// True if no pixel lets through what is behind it.
    pub(super) fn covers_all(&self) -> bool {
        self.image.light.iter().all(|[.., cover]| *cover == 1.0)
    }

    /// The paint at a place, 0 to 1 to the right and downwards.
    pub(super) fn paint(&self, [right, down]: [f64; 2]) -> Paint {
        let [width, height] = [self.image.width, self.image.height];
        let split = |at: f64, count: usize| {
            let at = (at * count as f64 - 0.5).clamp(0.0, (count - 1) as f64);
            let low = (at as usize).min(count.saturating_sub(2));
            (low, (low + 1).min(count - 1), at - low as f64)
        };
        let ((left, next, across), (upper, lower, along)) =
            (split(right, width), split(down, height));
        let mut sum = [0.0; 4];
        for (row, part) in [(upper, 1.0 - along), (lower, along)] {
            for (column, share) in [(left, 1.0 - across), (next, across)] {
                let pixel = self.image.light[row * width + column];
                sum = [0, 1, 2, 3].map(|c| sum[c] + part * share * f64::from(pixel[c]));
            }
        }
        let [red, green, blue, cover] = sum;
        // Light is stored times the cover.
        let radiance = [red, green, blue].map(|v| if cover > 0.0 { v / cover } else { 0.0 });
        Paint { radiance, cover }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_is_interpolated_between_pixels_and_ends_at_the_border() {
        let light = vec![[0.0, 0.0, 0.0, 1.0], [1.0, 0.5, 0.0, 1.0]];
        let raster = Raster::new(ColorImage { width: 2, height: 1, light });
        assert_eq!(raster.paint([0.5, 0.3]).radiance, [0.5, 0.25, 0.0]);
        assert_eq!(raster.paint([0.0, 0.5]).radiance, [0.0; 3]);
        assert_eq!(raster.paint([1.0, 0.5]).radiance, [1.0, 0.5, 0.0]);
        assert_eq!(raster.aspect(), 2.0);
    }
}
