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
        Mark::Arc { arc, pen } => draw_line(surface, arc_path(arc).as_ref(), pen),
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

/// An arc by cubic pieces of at most 45 degrees, each within 4e-6 of the radius.
fn arc_path(arc: &SheetArc) -> Option<Path> {
    let [from, to] = arc.angles;
    let pieces = ((to - from) / FRAC_PI_4).ceil().max(1.0);
    let step = (to - from) / pieces;
    let reach = 4.0 / 3.0 * (0.25 * step).tan() * arc.radius;
    let tangent = |angle: f64| [-angle.sin() * reach, angle.cos() * reach];
    let mut builder = PathBuilder::new();
    let [x, y] = arc.point(from).map(|v| v as f32);
    builder.move_to(x, y);
    for i in 0..pieces as usize {
        let angles = [from + i as f64 * step, from + (i + 1) as f64 * step];
        let [a, b] = angles.map(|angle| arc.point(angle));
        let [u, v] = angles.map(tangent);
        let [x1, y1, x2, y2, x, y] =
            [a[0] + u[0], a[1] + u[1], b[0] - v[0], b[1] - v[1], b[0], b[1]].map(|v| v as f32);
        builder.cubic_to(x1, y1, x2, y2, x, y);
    }
    builder.finish()
}
