//! Lines, markers, letters and rasters on a white image.

use super::color::{BLACK, Color, GREY, gray_level};
use super::font::glyph;
use image::{ImageError, ImageFormat, Rgb, RgbImage};
use png::{ColorType, Encoder, EncodingError};
use std::io::Cursor;

/// The size of a dot of a letter, in pixels.
const DOT: i32 = 2;
/// The advance from one letter to the next, in dots.
const ADVANCE: i32 = 6;
/// The length of a dash, and the period of dashes, in pixels.
const DASH: f64 = 8.0;
const DASH_PERIOD: f64 = 14.0;

/// The horizontal alignment of a text to its position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TextAlign {
    /// The text starts there.
    Left,
    /// The text is centred there.
    Middle,
    /// The text ends there.
    Right,
}

/// The stroke of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stroke {
    /// A continuous line.
    Solid,
    /// A dashed line.
    Dashed,
}

/// An RGB image; positions are in pixels from its upper left corner.
#[derive(Debug, Clone, PartialEq)]
pub struct Canvas(RgbImage);

/// A plot with its name.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedPlot {
    /// The name, as a part of a file name.
    pub name: &'static str,
    /// The image.
    pub canvas: Canvas,
}

impl Canvas {
    /// A white image of this width and height.
    pub fn new([width, height]: [u32; 2]) -> Self {
        Self(RgbImage::from_pixel(width, height, Rgb([0xff; 3])))
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.0.width(), self.0.height()]
    }

    /// The pixels row by row from the upper left corner, three bytes each: red, green, blue.
    pub fn pixels(&self) -> &[u8] {
        self.0.as_raw()
    }

    fn put_pixel(&mut self, x: i32, y: i32, color: Color) {
        let place = u32::try_from(x).ok().zip(u32::try_from(y).ok());
        let inside = place.filter(|(x, y)| *x < self.0.width() && *y < self.0.height());
        if let Some((x, y)) = inside {
            self.0.put_pixel(x, y, Rgb(color));
        }
    }

    /// Draws a filled square around a position, `half` pixels to each side.
    pub fn square(&mut self, [x, y]: [f64; 2], half: i32, color: Color) {
        let (x, y) = (x.round() as i32, y.round() as i32);
        for dy in -half..=half {
            (-half..=half).for_each(|dx| self.put_pixel(x + dx, y + dy, color));
        }
    }

    /// Draws a line one pixel wide.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], color: Color) {
        let place = |t: f64| [0, 1].map(|i| from[i] + t * (to[i] - from[i]));
        let steps = length(from, to).ceil().max(1.0);
        (0..=steps as i32).for_each(|i| self.square(place(f64::from(i) / steps), 0, color));
    }

    /// Draws a polyline three pixels wide.
    pub fn curve(&mut self, points: &[[f64; 2]], color: Color, stroke: Stroke) {
        let mut arc = 0.0;
        for pair in points.windows(2) {
            let (from, to) = (pair[0], pair[1]);
            let length = length(from, to);
            let steps = length.ceil().max(1.0);
            for i in 0..=steps as i32 {
                let t = f64::from(i) / steps;
                let drawn = stroke == Stroke::Solid || (arc + t * length) % DASH_PERIOD < DASH;
                if drawn {
                    self.square([0, 1].map(|k| from[k] + t * (to[k] - from[k])), 1, color);
                }
            }
            arc += length;
        }
    }

    /// Draws a marker at every point.
    pub fn markers(&mut self, points: &[[f64; 2]], color: Color) {
        points.iter().for_each(|point| self.square(*point, 3, color));
    }

    /// Draws a polyline with a marker at every point.
    pub fn marked_curve(&mut self, points: &[[f64; 2]], color: Color, stroke: Stroke) {
        self.curve(points, color, stroke);
        self.markers(points, color);
    }

    /// Draws a raster of square cells, `cell` pixels to a side, row by row from its upper left
    /// corner.
    pub fn raster(&mut self, [x, y]: [f64; 2], columns: usize, cell: usize, colors: &[Color]) {
        let (x, y) = (x.round() as i32, y.round() as i32);
        for (i, color) in colors.iter().enumerate() {
            let corner = [i % columns, i / columns].map(|k| (k * cell) as i32);
            for pixel in 0..cell * cell {
                let [dx, dy] = [pixel % cell, pixel / cell].map(|k| k as i32);
                self.put_pixel(x + corner[0] + dx, y + corner[1] + dy, *color);
            }
        }
    }

    /// Draws a line of text; the position is at its top.
    pub fn text(&mut self, [x, y]: [f64; 2], text: &str, color: Color, align: TextAlign) {
        let text = &plain_letters(text);
        let width = DOT * ADVANCE * text.chars().count() as i32;
        let start = x.round() as i32
            - match align {
                TextAlign::Left => 0,
                TextAlign::Middle => width / 2,
                TextAlign::Right => width,
            };
        for (i, letter) in text.chars().enumerate() {
            self.draw_glyph([start + DOT * ADVANCE * i as i32, y.round() as i32], letter, color);
        }
    }

    /// The number of letters of a text that is not wider than this, in pixels.
    pub fn letters(width: usize) -> usize {
        width / (DOT * ADVANCE) as usize
    }

    /// The number of letters of a text as it is drawn.
    pub fn letters_of(text: &str) -> usize {
        plain_letters(text).chars().count()
    }

    fn draw_glyph(&mut self, [x, y]: [i32; 2], letter: char, color: Color) {
        for (column, bits) in glyph(letter).into_iter().enumerate() {
            for row in (0..8).filter(|row| bits >> row & 1 == 1) {
                let corner = [x + DOT * column as i32, y + DOT * row];
                for i in 0..DOT * DOT {
                    self.put_pixel(corner[0] + i % DOT, corner[1] + i / DOT, color);
                }
            }
        }
    }

    /// The image as a PNG file.
    pub fn png(&self) -> Result<Vec<u8>, ImageError> {
        let mut bytes = Cursor::new(Vec::new());
        self.0.write_to(&mut bytes, ImageFormat::Png)?;
        Ok(bytes.into_inner())
    }

    /// The same with texts by their keywords.
    ///
    /// # Errors
    /// A text that PNG does not hold.
    pub fn described_png(&self, texts: &[(&str, String)]) -> Result<Vec<u8>, EncodingError> {
        let mut bytes = Vec::new();
        let mut encoder = Encoder::new(&mut bytes, self.0.width(), self.0.height());
        encoder.set_color(ColorType::Rgb);
        for (keyword, text) in texts {
            encoder.add_itxt_chunk((*keyword).to_owned(), text.clone())?;
        }
        let mut writer = encoder.write_header()?;
        writer.write_image_data(self.pixels())?;
        writer.finish()?;
        Ok(bytes)
    }
}

fn length(from: [f64; 2], to: [f64; 2]) -> f64 {
    (to[0] - from[0]).hypot(to[1] - from[1])
}

/// A text in the letters that have dots: units and signs in words.
fn plain_letters(text: &str) -> String {
    let plain = [
        ("°", " deg"),
        ("µ", "u"),
        ("λ", "lambda"),
        ("ε", "e"),
        ("θ", "theta"),
        ("±", "+-"),
        ("²", "2"),
        ("\u{2212}", "-"),
    ];
    plain.into_iter().fold(text.to_owned(), |text, (from, to)| text.replace(from, to))
}

/// The approximate side of an image, in pixels.
const IMAGE_SIDE: usize = 384;
const IMAGE_MARGIN: f64 = 40.0;
const IMAGE_TOP: f64 = 110.0;

/// Brightness as grey levels, from black at 0 to white at `peak`, rows from the top; `values` has
/// its rows of `columns` from the bottom.
pub fn gray_levels(values: &[f64], columns: usize, peak: f64) -> Vec<Color> {
    let rows = values.chunks(columns.max(1)).rev();
    rows.flatten().map(|value| gray_level(value / peak)).collect()
}

/// Draws square images of `pixels` to a side in a row, each under its name.
pub fn draw_image_row(title: &str, pixels: usize, images: &[(String, Vec<Color>)]) -> Canvas {
    let cell = (IMAGE_SIDE / pixels.max(1)).max(1);
    let side = (cell * pixels) as f64;
    let width = IMAGE_MARGIN + images.len() as f64 * (side + IMAGE_MARGIN);
    let mut canvas =
        Canvas::new([width.max(640.0) as u32, (IMAGE_TOP + side + IMAGE_MARGIN) as u32]);
    canvas.text([IMAGE_MARGIN, 30.0], title, BLACK, TextAlign::Left);
    for (i, (name, colors)) in images.iter().enumerate() {
        let left = IMAGE_MARGIN + i as f64 * (side + IMAGE_MARGIN);
        canvas.text([left + 0.5 * side, IMAGE_TOP - 36.0], name, GREY, TextAlign::Middle);
        canvas.raster([left, IMAGE_TOP], pixels, cell, colors);
    }
    canvas
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_raster_fills_its_cells_row_by_row() {
        let mut canvas = Canvas::new([12, 14]);
        let colors: [Color; 6] = [[1; 3], [2; 3], [3; 3], [4; 3], [5; 3], [6; 3]];
        canvas.raster([2.0, 3.0], 3, 3, &colors);
        for (i, pixel) in canvas.pixels().chunks(3).enumerate() {
            let (x, y) = (i % 12, i / 12);
            let inside = (2..11).contains(&x) && (3..9).contains(&y);
            let cell = if inside { ((x - 2) / 3 + 3 * ((y - 3) / 3)) as u8 + 1 } else { 0xff };
            assert_eq!(pixel, [cell; 3], "{x} {y}");
        }
    }

    #[test]
    fn images_stand_beside_each_other_under_their_names() {
        let colors = |level: u8| vec![[level; 3]; 4];
        let images = [("a".to_owned(), colors(10)), ("b".to_owned(), colors(20))];
        let canvas = draw_image_row("title", 2, &images);
        let count =
            |level: u8| canvas.pixels().chunks(3).filter(|pixel| **pixel == [level; 3]).count();
        let side = (IMAGE_SIDE / 2).max(1) * 2;
        assert_eq!([count(10), count(20)], [side * side; 2]);
        // A margin before, between and behind.
        let width = 2 * side + 3 * IMAGE_MARGIN as usize;
        assert_eq!(canvas.size()[0] as usize, width);
    }

    #[test]
    fn a_dashed_curve_is_interrupted_at_equal_lengths_around_corners() {
        // 200 pixels to the right and 200 down, in steps of one pixel of length.
        let drawn = |stroke: Stroke| -> Vec<bool> {
            let mut canvas = Canvas::new([240, 240]);
            let points = [[10.0, 10.0], [210.0, 10.0], [210.0, 210.0]];
            canvas.curve(&points, [0; 3], stroke);
            let dark = |x: usize, y: usize| canvas.pixels()[3 * (240 * y + x)] == 0;
            (0..200).map(|i| dark(10 + i, 10)).chain((0..200).map(|i| dark(210, 10 + i))).collect()
        };
        assert!(drawn(Stroke::Solid).iter().all(|dark| *dark));
        let dashed = drawn(Stroke::Dashed);
        let starts: Vec<usize> =
            (1..dashed.len()).filter(|i| dashed[*i] && !dashed[i - 1]).collect();
        assert!(starts.len() as f64 > 0.9 * 400.0 / DASH_PERIOD - 2.0, "{starts:?}");
        for pair in starts.windows(2) {
            // To the corner, whose square hides a pixel or two.
            let period = (pair[1] - pair[0]) as f64;
            assert!((period - DASH_PERIOD).abs() <= 2.0, "{starts:?}");
        }
        let dark = dashed.iter().filter(|dark| **dark).count() as f64 / 400.0;
        assert!(dark > 0.3 && dark < 0.9, "{dark}");
    }
}
