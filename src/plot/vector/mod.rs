//! Drawings of lines, arcs and letters on paper, once for every form: SVG, PDF and DXF.
//!
//! Positions are in millimetres from the upper left corner of the sheet, y downwards. A drawing to
//! scale also knows where the drawn thing is, so that a CAD program gets it in its own size.

mod axes;
mod dxf_file;
mod letters;
mod pdf_file;
mod svg_file;

pub use axes::PaperChart;
pub use dxf_file::{DxfError, dxf_bytes};
pub use letters::{text_width, wrapped};
pub use pdf_file::{PdfError, pdf_bytes};
pub(in crate::plot) use svg_file::escaped;
pub use svg_file::{described_svg, svg_text};

use super::canvas::TextAlign;
use super::color::{BLACK, Color, GREY};
use std::f64::consts::PI;

/// The pattern of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinePattern {
    /// Without gaps.
    Full,
    /// Dashes.
    Dashes,
    /// Long dashes and dots: axes.
    DashDot,
}

/// The kind of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pen {
    /// The width, in mm.
    pub width: f64,
    /// The colour.
    pub color: Color,
    /// The pattern.
    pub pattern: LinePattern,
    /// The layer in a CAD program; `None` for lines of the sheet, which are left out there.
    pub layer: Option<&'static str>,
}

impl Pen {
    /// Contours of parts.
    pub const OUTLINE: Self = Self::new(0.35, BLACK, LinePattern::Full, Some("OUTLINE"));
    /// Dimensions, hatches and leaders.
    pub const THIN: Self = Self::new(0.13, BLACK, LinePattern::Full, Some("DIMENSIONS"));
    /// Axes of symmetry.
    pub const AXIS: Self = Self::new(0.13, GREY, LinePattern::DashDot, Some("AXIS"));
    /// The frame of the sheet and its tables.
    pub const FRAME: Self = Self::new(0.25, BLACK, LinePattern::Full, None);
    /// Grids of charts.
    pub const GRID: Self = Self::new(0.1, [0xcc; 3], LinePattern::Full, None);

    const fn new(
        width: f64,
        color: Color,
        pattern: LinePattern,
        layer: Option<&'static str>,
    ) -> Self {
        Self { width, color, pattern, layer }
    }

    /// A ray or a curve of this colour.
    pub const fn colored(color: Color) -> Self {
        Self::new(0.15, color, LinePattern::Full, Some("RAYS"))
    }

    /// The same with another pattern.
    #[must_use]
    pub const fn with_pattern(self, pattern: LinePattern) -> Self {
        Self { pattern, ..self }
    }

    /// The same with another width in mm.
    #[must_use]
    pub const fn with_width(self, width: f64) -> Self {
        Self { width, ..self }
    }
}

/// The lengths in mm of dashes and gaps; empty for a full line.
const fn dashes(pattern: LinePattern) -> &'static [f32] {
    match pattern {
        LinePattern::Full => &[],
        LinePattern::Dashes => &[1.6, 0.9],
        LinePattern::DashDot => &[4.0, 1.0, 0.4, 1.0],
    }
}

/// Part of a circle, from the first angle to the larger second one, in radians from the x axis of the
/// sheet towards its y axis, which is downwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SheetArc {
    /// The centre.
    pub center: [f64; 2],
    /// The radius, in mm.
    pub radius: f64,
    /// The two angles.
    pub angles: [f64; 2],
}

impl SheetArc {
    /// The point at an angle.
    pub fn point(&self, angle: f64) -> [f64; 2] {
        let (sin, cos) = angle.sin_cos();
        [self.center[0] + self.radius * cos, self.center[1] + self.radius * sin]
    }

    /// The arc from a point to another by way of a third one; `None` if they are so nearly on a line
    /// that the drawing programs would lose the centre.
    pub fn through([from, middle, to]: [[f64; 2]; 3]) -> Option<Self> {
        let minus = |a: [f64; 2], b: [f64; 2]| [a[0] - b[0], a[1] - b[1]];
        let (a, b) = (minus(middle, from), minus(to, from));
        let cross = a[0] * b[1] - a[1] * b[0];
        let [a2, b2] = [a, b].map(|v| v[0] * v[0] + v[1] * v[1]);
        let offset =
            [(b[1] * a2 - a[1] * b2) / (2.0 * cross), (a[0] * b2 - b[0] * a2) / (2.0 * cross)];
        let radius = offset[0].hypot(offset[1]);
        if !(radius < LARGEST_RADIUS) {
            return None;
        }
        let center = [from[0] + offset[0], from[1] + offset[1]];
        let angle = |p: [f64; 2]| (p[1] - center[1]).atan2(p[0] - center[0]);
        // Towards growing angles if the three points turn that way.
        let (first, last) = if cross > 0.0 { (from, to) } else { (to, from) };
        let start = angle(first);
        let sweep = (angle(last) - start).rem_euclid(std::f64::consts::TAU);
        Some(Self { center, radius, angles: [start, start + sweep] })
    }
}

/// The radius in mm beyond which an arc is drawn as a polyline.
const LARGEST_RADIUS: f64 = 1e4;

/// One mark on a sheet.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// A polyline.
    Line {
        /// Its points.
        points: Vec<[f64; 2]>,
        /// Its pen.
        pen: Pen,
    },
    /// Part of a circle.
    Arc {
        /// Its place.
        arc: SheetArc,
        /// Its pen.
        pen: Pen,
    },
    /// A filled polygon without a contour.
    Area {
        /// Its corners.
        points: Vec<[f64; 2]>,
        /// Its colour.
        color: Color,
    },
    /// A line of text.
    Text {
        /// The position on its base line.
        at: [f64; 2],
        /// The letters.
        text: String,
        /// The size of the typeface, in mm.
        size: f64,
        /// The colour.
        color: Color,
        /// The part of the text that is at the position.
        align: TextAlign,
        /// True if it reads upwards.
        upwards: bool,
        /// True for a text of the sheet, which a CAD program does not get.
        of_sheet: bool,
    },
}

/// The scale of a drawing: the position of the origin of the drawn thing, and the sheet millimetres
/// of one of its millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SheetScale {
    /// The position of the origin on the sheet.
    pub origin: [f64; 2],
    /// Sheet millimetres a millimetre.
    pub factor: f64,
}

impl SheetScale {
    /// The position on the sheet of a point of the thing, whose second coordinate is upwards.
    pub fn to_sheet(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.origin[0] + self.factor * x, self.origin[1] - self.factor * y]
    }

    /// The point of the thing at a position on the sheet.
    pub fn to_model(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [(x - self.origin[0]) / self.factor, (self.origin[1] - y) / self.factor]
    }
}

/// A sheet with marks on it.
#[derive(Debug, Clone, PartialEq)]
pub struct VectorDrawing {
    /// Width and height, in mm.
    pub size: [f64; 2],
    /// The marks, the hindmost first.
    pub marks: Vec<Mark>,
    /// The scale of what is drawn, for a drawing that has one.
    pub scale: Option<SheetScale>,
}

impl VectorDrawing {
    /// An empty sheet of this width and height in mm.
    pub const fn new(size: [f64; 2]) -> Self {
        Self { size, marks: Vec::new(), scale: None }
    }

    /// Draws a polyline.
    pub fn line(&mut self, points: &[[f64; 2]], pen: Pen) {
        self.marks.push(Mark::Line { points: points.to_vec(), pen });
    }

    /// Draws part of a circle.
    pub fn arc(&mut self, arc: SheetArc, pen: Pen) {
        self.marks.push(Mark::Arc { arc, pen });
    }

    /// Draws a whole circle.
    pub fn circle(&mut self, center: [f64; 2], radius: f64, pen: Pen) {
        let half = |from: f64| SheetArc { center, radius, angles: [from, from + PI] };
        self.arc(half(0.0), pen);
        self.arc(half(PI), pen);
    }

    /// Fills a polygon.
    pub fn area(&mut self, points: &[[f64; 2]], color: Color) {
        self.marks.push(Mark::Area { points: points.to_vec(), color });
    }

    /// Draws the contour of a rectangle between two corners.
    pub fn rectangle(&mut self, [x0, y0]: [f64; 2], [x1, y1]: [f64; 2], pen: Pen) {
        self.line(&[[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]], pen);
    }

    /// Writes a text that belongs to the drawn thing.
    pub fn label(&mut self, at: [f64; 2], text: impl Into<String>, size: f64, align: TextAlign) {
        let (text, color) = (text.into(), BLACK);
        let mark = Mark::Text { at, text, size, color, align, upwards: false, of_sheet: false };
        self.marks.push(mark);
    }

    /// Writes a text of the sheet.
    pub fn text(&mut self, at: [f64; 2], text: impl Into<String>, size: f64, align: TextAlign) {
        let (text, color) = (text.into(), BLACK);
        let mark = Mark::Text { at, text, size, color, align, upwards: false, of_sheet: true };
        self.marks.push(mark);
    }

    /// Writes a text that reads upwards.
    pub fn label_upwards(&mut self, at: [f64; 2], text: impl Into<String>, size: f64) {
        let (text, color, align) = (text.into(), BLACK, TextAlign::Middle);
        let mark = Mark::Text { at, text, size, color, align, upwards: true, of_sheet: false };
        self.marks.push(mark);
    }

    /// Places all marks of another drawing with its upper left corner at a position, in `factor`
    /// times its size.
    pub fn place(&mut self, other: &Self, [x, y]: [f64; 2], factor: f64) {
        let moved = |p: [f64; 2]| [x + factor * p[0], y + factor * p[1]];
        let all = |points: &[[f64; 2]]| points.iter().map(|p| moved(*p)).collect();
        let marks = other.marks.iter().map(|mark| match mark {
            Mark::Line { points, pen } => Mark::Line { points: all(points), pen: *pen },
            Mark::Arc { arc, pen } => {
                let arc =
                    SheetArc { center: moved(arc.center), radius: factor * arc.radius, ..*arc };
                Mark::Arc { arc, pen: *pen }
            }
            Mark::Area { points, color } => Mark::Area { points: all(points), color: *color },
            Mark::Text { at, text, size, color, align, upwards, of_sheet } => Mark::Text {
                at: moved(*at),
                text: text.clone(),
                size: factor * size,
                color: *color,
                align: *align,
                upwards: *upwards,
                of_sheet: *of_sheet,
            },
        });
        self.marks.extend(marks);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arc_goes_through_its_three_points() {
        for points in [
            [[0.0, 5.0], [1.0, 0.0], [0.0, -5.0]],
            [[0.0, -5.0], [1.0, 0.0], [0.0, 5.0]],
            [[3.0, 1.0], [-2.0, 7.0], [8.0, 9.0]],
        ] {
            let arc = SheetArc::through(points).unwrap();
            assert!(arc.angles[1] > arc.angles[0]);
            let off = |p: [f64; 2]| (p[0] - arc.center[0]).hypot(p[1] - arc.center[1]) - arc.radius;
            assert!(points.iter().all(|p| off(*p).abs() < 1e-12), "{arc:?}");
            // The middle point lies between the ends.
            let angle =
                (points[1][1] - arc.center[1]).atan2(points[1][0] - arc.center[0]) - arc.angles[0];
            let sweep = arc.angles[1] - arc.angles[0];
            assert!(angle.rem_euclid(2.0 * PI) < sweep, "{arc:?}");
        }
        assert_eq!(SheetArc::through([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]), None);
    }
}
