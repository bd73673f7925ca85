//! Square images side by side.

use super::canvas::{Canvas, TextAlign};
use super::color::{BLACK, Color, GREY, gray_level};

/// The approximate side of an image, in pixels.
const SIDE: usize = 384;
const MARGIN: f64 = 40.0;
const TOP: f64 = 110.0;

/// Brightness as grey levels, from black at 0 to white at `peak`, rows from the top; `values` has
/// its rows of `columns` from the bottom.
pub fn gray_levels(values: &[f64], columns: usize, peak: f64) -> Vec<Color> {
    let rows = values.chunks(columns.max(1)).rev();
    rows.flatten().map(|value| gray_level(value / peak)).collect()
}

/// Draws square images of `pixels` to a side in a row, each under its name.
pub fn draw_image_row(title: &str, pixels: usize, images: &[(String, Vec<Color>)]) -> Canvas {
    let cell = (SIDE / pixels.max(1)).max(1);
    let side = (cell * pixels) as f64;
    let width = MARGIN + images.len() as f64 * (side + MARGIN);
    let mut canvas = Canvas::new([width.max(640.0) as u32, (TOP + side + MARGIN) as u32]);
    canvas.text([MARGIN, 30.0], title, BLACK, TextAlign::Left);
    for (i, (name, colors)) in images.iter().enumerate() {
        let left = MARGIN + i as f64 * (side + MARGIN);
        canvas.text([left + 0.5 * side, TOP - 36.0], name, GREY, TextAlign::Middle);
        canvas.raster([left, TOP], pixels, cell, colors);
    }
    canvas
}
