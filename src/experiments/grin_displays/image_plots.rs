//! Plots of images beside their targets.

use crate::grin_design::ViewImage;
use crate::plot::{BLACK, Canvas, Color, GREY, TextAlign, gray_level};

/// The approximate side of an image on the canvas, in pixels.
const SIDE: usize = 384;
const MARGIN: f64 = 40.0;
const TOP: f64 = 110.0;

/// Plots the target image at the left and the image by traced rays at the right, both with white
/// for the brightest pixel of the target.
pub fn plot_view(name: &str, image: &ViewImage, quality: f64) -> Canvas {
    let correlation = image.correlation();
    let subtitle = format!("{quality:.1} dB, correlation {correlation:.3}");
    let panels = [("wanted", &image.target), ("made", &image.formed)];
    let peak = image.target.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let panels =
        panels.map(|(title, light)| (title.to_owned(), gray_levels(light, image.pixels, peak)));
    draw_row(&format!("{name}: {subtitle}"), image.pixels, &panels)
}

/// Light as grey levels, rows from the top.
pub(super) fn gray_levels(light: &[f64], pixels: usize, peak: f64) -> Vec<Color> {
    let rows = light.chunks(pixels.max(1)).rev();
    rows.flatten().map(|value| gray_level(value / peak)).collect()
}

/// Draws square images side by side, each under its title.
pub(super) fn draw_row(title: &str, pixels: usize, panels: &[(String, Vec<Color>)]) -> Canvas {
    let cell = (SIDE / pixels.max(1)).max(1);
    let side = (cell * pixels) as f64;
    let width = MARGIN + panels.len() as f64 * (side + MARGIN);
    let mut canvas = Canvas::new([width.max(640.0) as u32, (TOP + side + MARGIN) as u32]);
    canvas.text([MARGIN, 30.0], title, BLACK, TextAlign::Left);
    for (i, (title, colors)) in panels.iter().enumerate() {
        let left = MARGIN + i as f64 * (side + MARGIN);
        canvas.text([left + 0.5 * side, TOP - 36.0], title, GREY, TextAlign::Middle);
        canvas.raster([left, TOP], pixels, cell, colors);
    }
    canvas
}
