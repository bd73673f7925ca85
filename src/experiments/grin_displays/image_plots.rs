//! Plots of images beside their targets.

use crate::grin_design::ViewImage;
use crate::plot::{Canvas, draw_image_row, gray_levels};

/// Plots the target image at the left and the image by traced rays at the right, both with white
/// for the brightest pixel of the target.
pub fn plot_view(name: &str, image: &ViewImage, quality: f64) -> Canvas {
    let correlation = image.correlation();
    let subtitle = format!("{quality:.1} dB, correlation {correlation:.3}");
    let panels = [("target", &image.target), ("image", &image.formed)];
    let peak = image.target.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let panels =
        panels.map(|(title, light)| (title.to_owned(), gray_levels(light, image.pixels, peak)));
    draw_image_row(&format!("{name}: {subtitle}"), image.pixels, &panels)
}
