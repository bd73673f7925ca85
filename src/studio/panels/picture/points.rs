//! The images of points of light, enlarged at their places over the picture.

use egui::epaint::TextureId;
use egui::{Color32, ColorImage, Painter, Pos2, Rect, Rgba, Stroke, StrokeKind, Vec2, vec2};

use super::magnifier::Magnifier;
use crate::picture::{ImageFrame, PlacedPoints};
use crate::studio::number;

/// The side of a square over the distance of places.
const SHARE: f64 = 0.86;
/// The picture behind the squares, darker than it is.
pub(super) const BEHIND: Color32 = Color32::from_gray(80);

/// All images in one, each of the same size, row by row.
pub(super) fn atlas(points: &PlacedPoints) -> ColorImage {
    let ([columns, rows], cells) = (points.places, points.cells);
    let size = [columns * cells, rows * cells];
    let pixel = |n: usize| {
        let [x, y] = [n % size[0], n / size[0]];
        let image = points.images[y / cells * columns + x / cells].as_ref();
        image.map_or(Color32::BLACK, |image| {
            let [r, g, b] = image.values[y % cells * cells + x % cells].map(|v| v as f32);
            Rgba::from_rgb(r, g, b).into()
        })
    };
    ColorImage::new(size, (0..size[0] * size[1]).map(pixel).collect())
}

/// Paints the images of a frame into the area that shows a part of it.
pub(super) fn paint(
    (painter, area, stroke): (&Painter, Rect, Stroke),
    magnifier: Magnifier,
    (points, frame): (&PlacedPoints, &ImageFrame),
    texture: TextureId,
) {
    let part = magnifier.part();
    let [columns, rows] = points.places;
    let [width, height] = frame.size().map(|v| v as f32);
    let side = side(points, frame) as f32;
    let size = vec2(side / width * area.width(), side / height * area.height());
    let cells = points.cells as f32;
    // Half a cell less on all sides keeps neighbours out.
    let inset = vec2(0.5 / (cells * columns as f32), 0.5 / (cells * rows as f32));
    for i in 0..columns * rows {
        let [column, row] = [i % columns, i / columns].map(|v| v as f32);
        let of = |at: Vec2| at / vec2(columns as f32, rows as f32);
        let share = Pos2::ZERO + of(vec2(column + 0.5, row + 0.5));
        let center = area.min + (share - part.min) / part.size() * area.size();
        let square = Rect::from_center_size(center, size);
        let uv = Rect::from_min_max(
            Pos2::ZERO + of(vec2(column, row)) + inset,
            Pos2::ZERO + of(vec2(column + 1.0, row + 1.0)) - inset,
        );
        painter.image(texture, square, uv, Color32::WHITE);
        painter.rect_stroke(square, 0.0, stroke, StrokeKind::Inside);
    }
}

/// The side of a square in mm of the frame, as large as the picture shows it.
fn side(points: &PlacedPoints, frame: &ImageFrame) -> f64 {
    let apart = [0, 1].map(|k| frame.size()[k] / points.places[k] as f64);
    SHARE * apart[0].min(apart[1])
}

/// The enlargement over the picture, the scale, the distance, the error, and the size of the images.
pub(super) fn words(points: &PlacedPoints, frame: &ImageFrame, magnification: f32) -> String {
    let times = side(points, frame) / points.side / f64::from(magnification);
    let [times, width, pixels, error] =
        [times, 1e3 * points.side, points.side / frame.pitch, 100.0 * points.error]
            .map(|v| number::format_digits(v, 3));
    let at = points.distance.map_or("infinity".to_owned(), |mm| format!("{mm:.0} mm"));
    format!(
        "Points at {at}, enlarged {times} times: squares of {width} µm ({pixels} px), each normalized to its own \
         peak; sampling error {error} % of the peak (rms), {} rays{}",
        points.rays,
        sizes(points).unwrap_or_default()
    )
}

/// The sizes of the images, and the least share of their light that is shown; `None` where all is dark.
fn sizes(points: &PlacedPoints) -> Option<String> {
    let images = || points.images.iter().flatten();
    let radii = || images().map(|image| 1e3 * image.half_light);
    let sharp = radii().reduce(f64::min)?;
    let blurred = radii().reduce(f64::max)?;
    let inside = images().map(|image| 100.0 * image.inside).reduce(f64::min)?;
    let [sharp, blurred, inside] = [sharp, blurred, inside].map(|v| number::format_digits(v, 3));
    Some(format!(
        "; half of the light within {sharp} to {blurred} µm of the centroid, at least {inside} % of it in the square"
    ))
}
