//! The section of an element with its hatching and its dimensions.

use super::indications::ElementTolerances;
use crate::math::ShortNumber;
use crate::plot::{Pen, SheetScale, TextAlign, VectorDrawing};
use crate::report::body::LensBody;
use crate::report::layout_drawing::draw_curve;

/// The straight pieces of a surface that is no circle.
const PIECES: u32 = 240;
/// The distance of hatches, in mm on the sheet.
const HATCH: f64 = 4.0;
/// The length and half the width of an arrow head, in mm.
const ARROW: [f64; 2] = [2.4, 0.45];
/// The size of dimensions, in mm.
const SIZE: f64 = 3.4;

/// Draws the section at a scale whose origin is the first vertex.
pub(super) fn draw_section(
    sheet: &mut VectorDrawing,
    body: &LensBody,
    scale: SheetScale,
    tolerances: &ElementTolerances<'_>,
) {
    let rim = body.rim();
    let sides = [0, 1].map(|side| profile(body, side, rim, scale));
    let outline: Vec<[f64; 2]> = sides[0].iter().chain(sides[1].iter().rev()).copied().collect();
    hatch(sheet, &outline);
    for side in [0, 1] {
        let own = profile(body, side, body.heights[side], scale);
        draw_curve(sheet, &own, Pen::OUTLINE.with_width(0.5));
        draw_flat(sheet, body, side, scale);
    }
    for half in [rim, -rim] {
        let ends = [0, 1].map(|side| scale.to_sheet([body.z(side, rim), half]));
        sheet.line(&ends, Pen::OUTLINE.with_width(0.5));
    }
    let low = outline.iter().map(|p| p[0]).fold(f64::INFINITY, f64::min);
    let high = outline.iter().map(|p| p[0]).fold(f64::NEG_INFINITY, f64::max);
    let y = scale.origin[1];
    sheet.line(&[[low - 10.0, y], [high + 10.0, y]], Pen::AXIS);
    let bottom = scale.to_sheet([0.0, -rim])[1] + 9.0;
    let ends = [0, 1].map(|side| scale.to_sheet([body.z(side, 0.0), 0.0]));
    horizontal(sheet, ends, bottom, &tolerances.thickness());
    let top = scale.to_sheet([0.0, rim])[1] - 6.0;
    let ends = [0, 1].map(|side| scale.to_sheet([body.z(side, rim), rim]));
    horizontal(sheet, ends, top, &format!("({:.3})", body.edge_thickness()));
    diameter(sheet, body, scale, high + 18.0);
}

/// A surface from below to above, flat beyond its own height.
fn profile(body: &LensBody, side: usize, height: f64, scale: SheetScale) -> Vec<[f64; 2]> {
    let place = |i: u32| height * (2.0 * f64::from(i) / f64::from(PIECES) - 1.0);
    (0..=PIECES).map(place).map(|h| scale.to_sheet([body.z(side, h.abs()), h])).collect()
}

/// The flat parts of a surface that is smaller than the rim.
fn draw_flat(sheet: &mut VectorDrawing, body: &LensBody, side: usize, scale: SheetScale) {
    let (height, rim) = (body.heights[side], body.rim());
    if height < rim {
        for half in [1.0, -1.0] {
            let ends = [height, rim].map(|h| scale.to_sheet([body.z(side, h), half * h]));
            sheet.line(&ends, Pen::OUTLINE.with_width(0.5));
        }
    }
}

/// Hatches a polygon by lines at 45 degrees.
fn hatch(sheet: &mut VectorDrawing, outline: &[[f64; 2]]) {
    let sums = || outline.iter().map(|p| p[0] + p[1]);
    let (low, high) =
        (sums().fold(f64::INFINITY, f64::min), sums().fold(f64::NEG_INFINITY, f64::max));
    let step = HATCH * std::f64::consts::SQRT_2;
    let count = ((high - low) / step) as usize;
    for sum in (0..count).map(|i| low + (i as f64 + 0.5) * step) {
        let mut cuts: Vec<[f64; 2]> = Vec::new();
        for i in 0..outline.len() {
            let (a, b) = (outline[i], outline[(i + 1) % outline.len()]);
            let (from, to) = (a[0] + a[1] - sum, b[0] + b[1] - sum);
            if (from < 0.0) != (to < 0.0) {
                let t = from / (from - to);
                cuts.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]);
            }
        }
        cuts.sort_by(|a, b| a[0].total_cmp(&b[0]));
        cuts.chunks_exact(2).for_each(|pair| sheet.line(pair, Pen::THIN.with_width(0.1)));
    }
}

/// A dimension between two points along x, with its line at some height.
fn horizontal(sheet: &mut VectorDrawing, [a, b]: [[f64; 2]; 2], y: f64, text: &str) {
    for end in [a, b] {
        let beyond = y + 1.5 * (y - end[1]).signum();
        sheet.line(&[end, [end[0], beyond]], Pen::THIN);
    }
    let wide = b[0] - a[0] > 4.0 * ARROW[0];
    if wide {
        sheet.line(&[[a[0], y], [b[0], y]], Pen::THIN);
        arrow(sheet, [a[0], y], [-1.0, 0.0]);
        arrow(sheet, [b[0], y], [1.0, 0.0]);
    } else {
        sheet.line(&[[a[0] - 7.0, y], [b[0] + 7.0, y]], Pen::THIN);
        arrow(sheet, [a[0], y], [1.0, 0.0]);
        arrow(sheet, [b[0], y], [-1.0, 0.0]);
    }
    let middle = 0.5 * (a[0] + b[0]);
    if wide && b[0] - a[0] > crate::plot::text_width(text, SIZE) + 2.0 {
        sheet.label([middle, y - 1.0], text, SIZE, TextAlign::Middle);
    } else {
        sheet.label([b[0] + 8.0, y + 0.35 * SIZE], text, SIZE, TextAlign::Left);
    }
}

/// The dimension of the diameter at the right side.
fn diameter(sheet: &mut VectorDrawing, body: &LensBody, scale: SheetScale, x: f64) {
    let rim = body.rim();
    let [top, bottom] = [rim, -rim].map(|h| scale.to_sheet([body.z(1, rim), h]));
    for end in [top, bottom] {
        sheet.line(&[end, [x + 1.5, end[1]]], Pen::THIN);
    }
    sheet.line(&[[x, top[1]], [x, bottom[1]]], Pen::THIN);
    arrow(sheet, [x, top[1]], [0.0, -1.0]);
    arrow(sheet, [x, bottom[1]], [0.0, 1.0]);
    let text = format!("\u{d8} {}", ShortNumber(2.0 * rim));
    sheet.label_upwards([x - 1.0, 0.5 * (top[1] + bottom[1])], text, SIZE);
}

/// An arrow head whose tip is at a position, in a direction of the axes of the sheet.
fn arrow(sheet: &mut VectorDrawing, tip: [f64; 2], [dx, dy]: [f64; 2]) {
    let [length, half] = ARROW;
    let foot = [tip[0] - length * dx, tip[1] - length * dy];
    let [left, right] = [half, -half].map(|h| [foot[0] - h * dy, foot[1] + h * dx]);
    sheet.area(&[tip, left, right], [0; 3]);
    // A CAD program gets no areas.
    sheet.line(&[tip, left, right, tip], Pen::THIN.with_width(0.05));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::Mark;

    /// Lines at equal distances fill an area: their lengths times that distance are the area.
    #[test]
    fn hatching_covers_the_area_and_nothing_else() {
        let outline = [[10.0, 20.0], [52.0, 20.0], [52.0, 45.0], [10.0, 45.0]];
        let mut drawing = VectorDrawing::new([100.0, 100.0]);
        hatch(&mut drawing, &outline);
        let mut covered = 0.0;
        for mark in &drawing.marks {
            let Mark::Line { points, .. } = mark else { panic!("{mark:?}") };
            let (a, b) = (points[0], points[1]);
            let inside = |p: [f64; 2]| {
                (10.0 - 1e-9..=52.0 + 1e-9).contains(&p[0])
                    && (20.0 - 1e-9..=45.0 + 1e-9).contains(&p[1])
            };
            assert!(inside(a) && inside(b), "{a:?} {b:?}");
            assert!((a[0] - b[0] + a[1] - b[1]).abs() < 1e-9, "at 45 degrees: {a:?} {b:?}");
            covered += (a[0] - b[0]).hypot(a[1] - b[1]) * HATCH;
        }
        assert!((covered / (42.0 * 25.0) - 1.0).abs() < 0.02, "{covered}");
    }
}
