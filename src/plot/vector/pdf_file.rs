//! Drawings as the pages of a PDF file, with the letters that they use.

use super::letters::TYPEFACE;
use super::{Mark, Pen, SheetArc, VectorDrawing, dashes, text_width};
use crate::plot::{Color, TextAlign};
use krilla::color::rgb;
use krilla::geom::{Path, PathBuilder, Point, Transform};
use krilla::metadata::Metadata;
use krilla::page::PageSettings;
use krilla::paint::{Fill, Stroke, StrokeDash};
use krilla::surface::Surface;
use krilla::text::{Font, TextDirection};
use std::f64::consts::FRAC_PI_4;

/// Points of a PDF file in a millimetre.
const POINTS: f32 = 72.0 / 25.4;

/// The reason why there is no PDF file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PdfError {
    /// A page without a size.
    #[error("a page of {0}; expected a width and a height of more than 0 mm")]
    Size(String),
    /// The letters or the pages could not be written.
    #[error("the PDF file could not be made: {0}")]
    Writer(String),
}

/// A PDF file with a title and a page of every drawing. The same drawings give the same bytes.
///
/// # Errors
/// A page without a size, or letters that cannot be embedded.
pub fn pdf_bytes(title: &str, pages: &[VectorDrawing]) -> Result<Vec<u8>, PdfError> {
    let font = Font::new(TYPEFACE.into(), 0);
    let font = font.ok_or_else(|| PdfError::Writer("the typeface cannot be read".to_owned()))?;
    let mut document = krilla::Document::new();
    let metadata = Metadata::new().title(title.to_owned()).creator("Aplanat".to_owned());
    document.set_metadata(metadata.language("en".to_owned()));
    for drawing in pages {
        let [w, h] = drawing.size.map(|length| length as f32 * POINTS);
        let settings = PageSettings::from_wh(w, h)
            .ok_or_else(|| PdfError::Size(format!("{:?} mm", drawing.size)))?;
        let mut page = document.start_page_with(settings);
        let mut surface = page.surface();
        surface.push_transform(&Transform::from_scale(POINTS, POINTS));
        drawing.marks.iter().for_each(|mark| draw(&mut surface, mark, &font));
        surface.pop();
        surface.finish();
        page.finish();
    }
    document.finish().map_err(|error| PdfError::Writer(error.to_string()))
}

fn draw(surface: &mut Surface<'_>, mark: &Mark, font: &Font) {
    match mark {
        Mark::Line { points, pen } => draw_line(surface, polyline(points, false).as_ref(), pen),
        Mark::Arc { arc, pen } => draw_line(surface, curve(&arc_pieces(arc)).as_ref(), pen),
        Mark::Area { points, color } => {
            surface.set_stroke(None);
            surface.set_fill(Some(fill(*color)));
            if let Some(path) = polyline(points, true) {
                surface.draw_path(&path);
            }
        }
        Mark::Text { at, text, size, color, align, upwards, .. } => {
            let width = text_width(text, *size);
            let start = match align {
                TextAlign::Left => 0.0,
                TextAlign::Middle => -0.5 * width,
                TextAlign::Right => -width,
            };
            let turn = if *upwards { -90.0 } else { 0.0 };
            surface.set_stroke(None);
            surface.set_fill(Some(fill(*color)));
            surface.push_transform(&Transform::from_translate(at[0] as f32, at[1] as f32));
            surface.push_transform(&Transform::from_rotate(turn));
            let place = Point::from_xy(start as f32, 0.0);
            let direction = TextDirection::LeftToRight;
            surface.draw_text(place, font.clone(), *size as f32, text, false, direction);
            surface.pop();
            surface.pop();
        }
    }
}

fn draw_line(surface: &mut Surface<'_>, path: Option<&Path>, pen: &Pen) {
    let Some(path) = path else { return };
    let dash = dashes(pen.pattern);
    let dash = (!dash.is_empty()).then(|| StrokeDash { array: dash.to_vec(), offset: 0.0 });
    surface.set_fill(None);
    surface.set_stroke(Some(Stroke {
        paint: color(pen.color).into(),
        width: pen.width as f32,
        dash,
        ..Stroke::default()
    }));
    surface.draw_path(path);
}

fn color([r, g, b]: Color) -> rgb::Color {
    rgb::Color::new(r, g, b)
}

fn fill(of: Color) -> Fill {
    Fill { paint: color(of).into(), ..Fill::default() }
}

fn polyline(points: &[[f64; 2]], closed: bool) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for (i, [x, y]) in points.iter().enumerate() {
        let (x, y) = (*x as f32, *y as f32);
        if i == 0 { builder.move_to(x, y) } else { builder.line_to(x, y) }
    }
    if closed {
        builder.close();
    }
    builder.finish()
}

/// An arc by the points of cubic pieces of at most 45 degrees, each within 4e-6 of the radius.
fn arc_pieces(arc: &SheetArc) -> Vec<[[f64; 2]; 4]> {
    let [from, to] = arc.angles;
    let pieces = ((to - from) / FRAC_PI_4).ceil().max(1.0);
    let step = (to - from) / pieces;
    let reach = 4.0 / 3.0 * (0.25 * step).tan() * arc.radius;
    let tangent = |angle: f64| [-angle.sin() * reach, angle.cos() * reach];
    let piece = |i: usize| {
        let angles = [from + i as f64 * step, from + (i + 1) as f64 * step];
        let [a, b] = angles.map(|angle| arc.point(angle));
        let [u, v] = angles.map(tangent);
        [a, [a[0] + u[0], a[1] + u[1]], [b[0] - v[0], b[1] - v[1]], b]
    };
    (0..pieces as usize).map(piece).collect()
}

fn curve(pieces: &[[[f64; 2]; 4]]) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for (i, piece) in pieces.iter().enumerate() {
        let [[x0, y0], [x1, y1], [x2, y2], [x, y]] = piece.map(|p| p.map(|v| v as f32));
        if i == 0 {
            builder.move_to(x0, y0);
        }
        builder.cubic_to(x1, y1, x2, y2, x, y);
    }
    builder.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arcs_are_round_and_go_from_end_to_end() {
        for angles in [[0.2, 0.9], [-1.0, 3.0], [0.0, 6.2]] {
            let arc = SheetArc { center: [3.0, -2.0], radius: 50.0, angles };
            let pieces = arc_pieces(&arc);
            let apart = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
            assert!(apart(pieces[0][0], arc.point(angles[0])) < 1e-12);
            assert!(apart(pieces[pieces.len() - 1][3], arc.point(angles[1])) < 1e-12);
            assert!(pieces.windows(2).all(|pair| apart(pair[0][3], pair[1][0]) < 1e-12));
            for piece in &pieces {
                for t in [0.1, 0.3, 0.5, 0.8] {
                    // The weights of a cubic curve by Bernstein.
                    let s: f64 = 1.0 - t;
                    let weights = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
                    let at = [0, 1].map(|k| (0..4).map(|i| weights[i] * piece[i][k]).sum::<f64>());
                    let off = apart(at, arc.center) / arc.radius - 1.0;
                    assert!(off.abs() < 5e-6, "{angles:?} {t}: {off:e}");
                }
            }
        }
    }

    /// A sheet of A4 measures 297 mm, which are 841.89 points of 1/72 inch.
    #[test]
    fn a_page_has_the_size_of_its_sheet_and_every_point_of_its_lines() {
        let page = |middle: [f64; 2]| {
            let mut drawing = VectorDrawing::new([297.0, 210.0]);
            drawing.line(&[[10.0, 10.0], middle, [50.0, 60.0], [90.0, 20.0]], Pen::THIN);
            pdf_bytes("a", &[drawing]).unwrap()
        };
        let file = page([20.0, 30.0]);
        let text = String::from_utf8_lossy(&file);
        let (_, media) = text.split_once("/MediaBox").unwrap();
        let (_, media) = media.split_once('[').unwrap();
        let (media, _) = media.split_once(']').unwrap();
        let sides: Vec<f64> = media.split_whitespace().map(|v| v.parse().unwrap()).collect();
        let exact = [0.0, 0.0, 297.0 / 25.4 * 72.0, 210.0 / 25.4 * 72.0];
        assert!(sides.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-2), "{sides:?}");
        assert_eq!(file, page([20.0, 30.0]));
        assert!(file != page([25.0, 30.0]), "a point of the line is not in the file");
    }
}
