//! A chart on paper: the axes of [`Chart`](crate::plot::Chart), in millimetres.

use super::{Pen, VectorDrawing};
use crate::plot::{Axis, TextAlign};

/// The size of the labels, in mm.
const LABEL: f64 = 2.4;
/// The length of a tick, in mm.
const TICK: f64 = 1.2;

/// A rectangle of a sheet with two axes.
#[derive(Debug, Clone, PartialEq)]
pub struct PaperChart {
    /// The upper left corner, in mm.
    corner: [f64; 2],
    /// Width and height, in mm.
    size: [f64; 2],
    axes: [Axis; 2],
}

impl PaperChart {
    /// A chart with its upper left corner and its size in mm; the labels are outside.
    pub fn new(corner: [f64; 2], size: [f64; 2], axes: [Axis; 2]) -> Self {
        Self { corner, size, axes }
    }

    /// The position of two quantities on the sheet.
    pub fn to_sheet(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [left, top] = self.corner;
        let [width, height] = self.size;
        [left + width * self.axes[0].fraction(x), top + height * (1.0 - self.axes[1].fraction(y))]
    }

    /// Draws the grid, the labels, the names of the axes and a title above.
    pub fn draw(&self, sheet: &mut VectorDrawing, title: &str) {
        let ([left, top], [width, height]) = (self.corner, self.size);
        let (right, bottom) = (left + width, top + height);
        for (share, label) in self.axes[0].ticks() {
            let x = left + width * share;
            sheet.line(&[[x, top], [x, bottom + TICK]], Pen::GRID);
            sheet.text([x, bottom + TICK + LABEL], label, LABEL, TextAlign::Middle);
        }
        for (share, label) in self.axes[1].ticks() {
            let y = bottom - height * share;
            sheet.line(&[[left - TICK, y], [right, y]], Pen::GRID);
            sheet.text([left - TICK - 0.8, y + 0.35 * LABEL], label, LABEL, TextAlign::Right);
        }
        sheet.rectangle(self.corner, [right, bottom], Pen::FRAME.with_width(0.18));
        let middle = 0.5 * (left + right);
        let name = self.axes[0].name();
        sheet.text([middle, bottom + TICK + 2.6 * LABEL], name, LABEL, TextAlign::Middle);
        sheet.text([left, top - 1.2], self.axes[1].name(), LABEL, TextAlign::Left);
        sheet.text([middle, top - 1.2], title, 1.15 * LABEL, TextAlign::Middle);
    }
}
