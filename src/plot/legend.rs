//! A legend: samples of curves and markers with their names, one below the other.

use super::canvas::{Canvas, Stroke, TextAlign};
use super::color::{BLACK, Color};

/// The distance between two entries, in pixels.
const LINE: f64 = 28.0;
/// The length of the sample of a curve, and the distance of a name from its sample, in pixels.
const SAMPLE: f64 = 50.0;
const GAP: f64 = 12.0;
/// Half the height of a letter, in pixels: samples are centred on their names.
const HALF_LETTER: f64 = 7.0;

/// A column of entries, drawn one by one from the top.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Legend {
    corner: [f64; 2],
}

impl Legend {
    /// An empty legend with its upper left corner at a position in pixels.
    pub fn new(corner: [f64; 2]) -> Self {
        Self { corner }
    }

    /// Draws the next entry: a curve and its name.
    pub fn curve(&mut self, canvas: &mut Canvas, name: &str, color: Color, stroke: Stroke) {
        let [x, y] = [self.corner[0], self.corner[1] + HALF_LETTER];
        canvas.curve(&[[x, y], [x + SAMPLE, y]], color, stroke);
        self.name(canvas, name, SAMPLE);
    }

    /// Draws the next entry: a marker and its name.
    pub fn marker(&mut self, canvas: &mut Canvas, name: &str, color: Color) {
        canvas.markers(&[[self.corner[0], self.corner[1] + HALF_LETTER]], color);
        self.name(canvas, name, 0.0);
    }

    fn name(&mut self, canvas: &mut Canvas, name: &str, sample: f64) {
        let [x, y] = self.corner;
        canvas.text([x + sample + GAP, y], name, BLACK, TextAlign::Left);
        self.corner[1] += LINE;
    }
}
