//! The scene drawn on the processor, one pixel after the other: the specification of
//! `scene.wgsl`.
//!
//! A pixel is a box one pixel wide; how much of it a line covers is the overlap of two intervals,
//! across the line and along it. That is exact for upright lines, a ramp one pixel wide for
//! slanted ones, and right for lines thinner than a pixel. Colours are blended as they are
//! stored, multiplied by alpha, and rounded to eight bits after each shape, as a graphics card
//! does. Triangles have no ramp: their rims lie below outlines.

use std::ops::Range;

use glam::{Vec2, Vec4};

use super::{Camera, Rgba, RgbaImage, Scene, Segment, TriangleVertex};

/// Below this a line has no direction and is a dot.
const DOT: f32 = 1e-3; // px

/// Draws a scene into a picture of `size` pixels.
pub fn draw(scene: &Scene, camera: Camera, size: [u32; 2]) -> RgbaImage {
    let mut pixels = PixelBuffer::new(size, camera, scene.background);
    for corners in scene.vertices.chunks_exact(3) {
        pixels.triangle(corners);
    }
    for segment in &scene.segments {
        pixels.segment(segment);
    }
    pixels.image
}

struct PixelBuffer {
    image: RgbaImage,
    camera: Camera,
}

impl PixelBuffer {
    fn new(size: [u32; 2], camera: Camera, background: Rgba) -> Self {
        let pixels = size[0] as usize * size[1] as usize;
        let color = to_bytes(premultiplied(background));
        Self { image: RgbaImage { size, rgba: color.repeat(pixels) }, camera }
    }

    fn triangle(&mut self, corners: &[TriangleVertex]) {
        let points = [corners[0].position, corners[1].position, corners[2].position]
            .map(|at| self.to_px(at));
        let color = premultiplied(corners[0].color);
        let [a, b, c] = points;
        for row in self.rows(a.y.min(b.y).min(c.y), a.y.max(b.y).max(c.y)) {
            if let Some((from, to)) = triangle_span(points, row as f32 + 0.5) {
                for column in self.columns(from, to) {
                    self.blend(column, row, color);
                }
            }
        }
    }

    fn segment(&mut self, segment: &Segment) {
        let (a, b) = (self.to_px(segment.from), self.to_px(segment.to));
        let half = 0.5 * segment.width;
        let color = premultiplied(segment.color);
        for row in self.rows(a.y.min(b.y) - half - 1.0, a.y.max(b.y) + half + 1.0) {
            let y = row as f32 + 0.5;
            let (from, to) = segment_span(a, b, half, y);
            for column in self.columns(from, to) {
                let pixel = Vec2::new(column as f32 + 0.5, y);
                self.blend(column, row, color * segment_coverage(pixel, a, b, half));
            }
        }
    }

    fn to_px(&self, mm: Vec2) -> Vec2 {
        let (center, scale) = self.camera.to_f32();
        let [width, height] = self.image.size.map(|n| n as f32);
        let d = (mm - center) * scale;
        Vec2::new(0.5 * width + d.x, 0.5 * height - d.y)
    }

    fn rows(&self, from: f32, to: f32) -> Range<u32> {
        pixel_centers(from, to, self.image.size[1])
    }

    fn columns(&self, from: f32, to: f32) -> Range<u32> {
        pixel_centers(from, to, self.image.size[0])
    }

    fn blend(&mut self, column: u32, row: u32, source: Vec4) {
        if source.w <= 0.0 {
            return;
        }
        let start = 4 * (row as usize * self.image.size[0] as usize + column as usize);
        let pixel = &mut self.image.rgba[start..start + 4];
        let below = Vec4::new(pixel[0].into(), pixel[1].into(), pixel[2].into(), pixel[3].into());
        pixel.copy_from_slice(&to_bytes(source + below * ((1.0 - source.w) / 255.0)));
    }
}

/// The pixels whose centres lie from `from` up to, not at, `to`.
fn pixel_centers(from: f32, to: f32, count: u32) -> Range<u32> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let index = |x: f32| ((x - 0.5).ceil() as u32).min(count);
    index(from)..index(to)
}

/// The x at which the line at height `y` enters and leaves a triangle.
///
/// Each edge is taken from its lower end, so that two triangles that share an edge share it to
/// the last bit and no pixel is drawn twice.
fn triangle_span([a, b, c]: [Vec2; 3], y: f32) -> Option<(f32, f32)> {
    let crossing = |p: Vec2, q: Vec2| {
        let (low, high) = if p.y < q.y { (p, q) } else { (q, p) };
        let met = low.y <= y && y < high.y;
        met.then(|| low.x + (y - low.y) / (high.y - low.y) * (high.x - low.x))
    };
    let mut met = [crossing(a, b), crossing(b, c), crossing(c, a)].into_iter().flatten();
    let (first, second) = (met.next()?, met.next()?);
    Some((first.min(second), first.max(second)))
}

/// The stretch of the line at height `y` that a segment can cover.
fn segment_span(a: Vec2, b: Vec2, half: f32, y: f32) -> (f32, f32) {
    let reach = half + 0.5;
    let length = a.distance(b);
    if length < DOT {
        return (a.x - reach, a.x + reach);
    }
    let axis = (b - a) / length;
    let across = interval_where(axis.y, (a.y - y) * axis.x, -reach, reach);
    let along = interval_where(axis.x, (y - a.y) * axis.y, -0.5, length + 0.5);
    (a.x + across.0.max(along.0), a.x + across.1.min(along.1))
}

/// The x between which `slope * x + offset` lies between `low` and `high`.
fn interval_where(slope: f32, offset: f32, low: f32, high: f32) -> (f32, f32) {
    if slope.abs() < 1e-6 {
        let everywhere = low <= offset && offset <= high;
        return if everywhere { (f32::MIN, f32::MAX) } else { (f32::MAX, f32::MIN) };
    }
    let (p, q) = ((low - offset) / slope, (high - offset) / slope);
    (p.min(q), p.max(q))
}

/// The share of a pixel that a segment covers, 0 to 1.
fn segment_coverage(pixel: Vec2, a: Vec2, b: Vec2, half: f32) -> f32 {
    let length = a.distance(b);
    if length < DOT {
        return (half + 0.5 - pixel.distance(a)).clamp(0.0, 1.0);
    }
    let axis = (b - a) / length;
    let r = pixel - a;
    overlap(r.perp_dot(axis), -half, half) * overlap(r.dot(axis), 0.0, length)
}

/// The length of the unit interval around `x` that lies between `low` and `high`.
fn overlap(x: f32, low: f32, high: f32) -> f32 {
    ((x + 0.5).min(high) - (x - 0.5).max(low)).max(0.0)
}

fn premultiplied(color: Rgba) -> Vec4 {
    let [red, green, blue, alpha] = color.map(|byte| f32::from(byte) / 255.0);
    Vec4::new(red * alpha, green * alpha, blue * alpha, alpha)
}

fn to_bytes(color: Vec4) -> [u8; 4] {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    color.to_array().map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8)
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    const WHITE: Rgba = [255; 4];
    /// One pixel a millimetre, the origin in the middle.
    const PLAIN: Camera = Camera { center: DVec2::ZERO, scale: 1.0 };

    /// The sum of all alphas, in whole pixels.
    fn ink(picture: &RgbaImage) -> f64 {
        picture.rgba.chunks_exact(4).map(|pixel| f64::from(pixel[3]) / 255.0).sum()
    }

    #[test]
    fn a_line_covers_its_area_in_every_direction() {
        for degrees in 0..90 {
            let mut scene = Scene::default();
            let end = 20.0 * DVec2::from_angle(f64::from(degrees).to_radians());
            scene.line(-end, end, 2.0, WHITE);
            let area = ink(&draw(&scene, PLAIN, [64, 64]));
            assert!((area - 80.0).abs() < 3.0, "{area} at {degrees} degrees");
        }
    }

    #[test]
    fn a_line_thinner_than_a_pixel_is_fainter() {
        let mut scene = Scene::default();
        scene.line(DVec2::new(-10.0, 0.5), DVec2::new(10.0, 0.5), 0.25, WHITE);
        assert!((ink(&draw(&scene, PLAIN, [64, 64])) - 5.0).abs() < 0.1);
    }

    #[test]
    fn a_line_cut_in_two_looks_the_same() {
        let (a, b) = (DVec2::new(-10.0, 0.5), DVec2::new(10.0, 0.5));
        let mut whole = Scene::default();
        whole.line(a, b, 1.0, WHITE);
        let mut halves = Scene::default();
        halves.polyline(&[a, DVec2::new(3.0, 0.5), b], 1.0, WHITE);
        assert_eq!(draw(&whole, PLAIN, [64, 64]), draw(&halves, PLAIN, [64, 64]));
    }

    #[test]
    fn a_dot_is_round() {
        let mut scene = Scene::default();
        scene.dot(DVec2::ZERO, 20.0, WHITE);
        let area = ink(&draw(&scene, PLAIN, [64, 64]));
        assert!((area - 100.0 * std::f64::consts::PI).abs() < 2.0, "{area}");
    }

    #[test]
    fn triangles_that_share_an_edge_do_not_overlap() {
        let mut scene = Scene::default();
        let half_red = [255, 0, 0, 128];
        let corners = [(-10.3, -7.1), (12.9, -9.2), (-11.7, 8.8), (10.1, 11.4)];
        let [a, b, c, d] = corners.map(|(x, y)| DVec2::new(x, y));
        scene.strip(&[a, c], &[b, d], half_red);
        let picture = draw(&scene, PLAIN, [64, 64]);
        let alphas: Vec<u8> = picture.rgba.chunks_exact(4).map(|pixel| pixel[3]).collect();
        assert!(alphas.iter().all(|&alpha| alpha == 0 || alpha == 128));
    }

    #[test]
    fn shapes_far_outside_are_cut_at_the_rim() {
        let mut scene = Scene::on([0, 0, 0, 255]);
        scene.line(DVec2::new(-1e6, -1e6), DVec2::new(1e6, 1e6), 2.0, WHITE);
        scene.strip(
            &[DVec2::new(-1e6, 5.0), DVec2::new(-1e6, 9.0)],
            &[DVec2::new(1e6, 5.0), DVec2::new(1e6, 9.0)],
            WHITE,
        );
        let picture = draw(&scene, PLAIN, [16, 16]);
        assert!(picture.rgba.chunks_exact(4).all(|pixel| pixel[3] == 255));
    }
}
