//! Sheets of technical drawings: format, frame, title field, and the scales of ISO 5455.

use crate::plot::{Pen, TextAlign, VectorDrawing};

/// The distance of the frame from the edge of the sheet, in mm.
const MARGIN: f64 = 10.0;
/// The width and height of the title field, in mm.
const TITLE_FIELD: [f64; 2] = [130.0, 20.0];
/// The room between the frame and what is drawn, in mm.
const ROOM: f64 = 10.0;

/// A sheet of A4 or A3 in landscape format.
#[derive(Debug, Clone)]
pub(super) struct DrawingSheet {
    pub(super) drawing: VectorDrawing,
}

impl DrawingSheet {
    /// A sheet of A4.
    pub(super) fn a4() -> Self {
        Self { drawing: VectorDrawing::new([297.0, 210.0]) }
    }

    /// The sheet for a thing of this width and height: A3 if A4 would make it very small.
    pub(super) fn fitting(length: [f64; 2]) -> Self {
        let small = Self::a4();
        if standard_scale(length, small.room()) < 0.5 {
            return Self { drawing: VectorDrawing::new([420.0, 297.0]) };
        }
        small
    }

    /// Width and height of the room for a drawing, in mm.
    pub(super) fn room(&self) -> [f64; 2] {
        let [w, h] = self.drawing.size;
        [w - 2.0 * (MARGIN + ROOM), h - 2.0 * (MARGIN + ROOM) - TITLE_FIELD[1]]
    }

    /// The middle of that room.
    pub(super) fn middle(&self) -> [f64; 2] {
        let [w, h] = self.drawing.size;
        [0.5 * w, 0.5 * (h - TITLE_FIELD[1])]
    }

    /// The lower end of the frame and its right one, in mm.
    pub(super) fn frame_end(&self) -> [f64; 2] {
        self.drawing.size.map(|length| length - MARGIN)
    }

    /// Draws the frame and the title field.
    pub(super) fn finish(mut self, name: &str, title: &str, factor: f64) -> VectorDrawing {
        let [right, bottom] = self.frame_end();
        let sheet = &mut self.drawing;
        sheet.rectangle([MARGIN; 2], [right, bottom], Pen::FRAME.with_width(0.5));
        let [left, top] = [right - TITLE_FIELD[0], bottom - TITLE_FIELD[1]];
        sheet.rectangle([left, top], [right, bottom], Pen::FRAME);
        let column = right - 32.0;
        sheet.line(&[[column, top], [column, bottom]], Pen::FRAME);
        // Another program may have another, wider typeface for an SVG file.
        let room = 0.8 * (column - left - 6.0);
        let shorter = |text: &str, size: f64| shortened(text, size, room);
        sheet.text([left + 3.0, top + 7.0], shorter(name, 3.8), 3.8, TextAlign::Left);
        sheet.text([left + 3.0, top + 14.0], shorter(title, 3.2), 3.2, TextAlign::Left);
        let scale = format!("Scale {}", scale_text(factor));
        sheet.text([column + 3.0, top + 7.0], scale, 3.2, TextAlign::Left);
        sheet.text([column + 3.0, top + 14.0], "Lengths in mm", 3.2, TextAlign::Left);
        self.drawing
    }
}

/// The text, cut so that it is no wider than this in mm.
fn shortened(text: &str, size: f64, width: f64) -> String {
    if crate::plot::text_width(text, size) <= width {
        return text.to_owned();
    }
    let mut short = String::new();
    for letter in text.chars() {
        short.push(letter);
        if crate::plot::text_width(&short, size) > width - size {
            break;
        }
    }
    short + "..."
}

/// The largest scale of ISO 5455 at which a thing fits into some room: a power of ten times 1, 2 or 5.
pub(super) fn standard_scale(length: [f64; 2], room: [f64; 2]) -> f64 {
    let share = |i: usize| room[i] / length[i].max(1e-6);
    let most = share(0).min(share(1)).clamp(1e-9, 1e9);
    let power = 10f64.powf(most.log10().floor());
    let steps = [5.0, 2.0, 1.0].map(|step| step * power);
    steps.into_iter().find(|factor| *factor <= most * (1.0 + 1e-12)).unwrap_or(power)
}

/// A scale as it is written: `2:1`, `1:5`.
pub fn scale_text(factor: f64) -> String {
    if factor >= 1.0 {
        format!("{}:1", factor.round())
    } else {
        format!("1:{}", (1.0 / factor).round())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_are_those_of_the_standard_and_fit() {
        for (length, expected) in
            [(100.0, "2:1"), (201.0, "1:2"), (200.0, "1:1"), (39.0, "5:1"), (9000.0, "1:50")]
        {
            let factor = standard_scale([length, 1.0], [200.0, 100.0]);
            assert_eq!(scale_text(factor), expected, "{length}");
            assert!(factor * length <= 200.0);
        }
    }

    #[test]
    fn the_words_of_a_title_are_in_their_field_and_on_lines_of_their_own() {
        let sheet = DrawingSheet::a4().finish("A lens", "Layout", 2.0);
        let texts: Vec<[f64; 2]> = sheet
            .marks
            .iter()
            .filter_map(|mark| match mark {
                crate::plot::Mark::Text { at, .. } => Some(*at),
                _ => None,
            })
            .collect();
        let [right, bottom] = [297.0 - MARGIN, 210.0 - MARGIN];
        assert_eq!(texts.len(), 4);
        for [x, y] in &texts {
            assert!(*x > right - TITLE_FIELD[0] && *x < right - 20.0, "{x}");
            assert!(*y > bottom - TITLE_FIELD[1] + 3.0 && *y < bottom - 1.0, "{y}");
        }
        let apart =
            |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).abs() > 30.0 || (a[1] - b[1]).abs() > 4.0;
        for i in 0..4 {
            assert!((0..i).all(|j| apart(texts[i], texts[j])), "{texts:?}");
        }
    }
}
