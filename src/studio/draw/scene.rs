//! The scene of a drawing: triangles below, lines above, each in the order given.

use glam::{DVec2, Vec2};

use super::BoundingBox;

/// Red, green, blue and alpha: sRGB, colour not multiplied by alpha.
pub type Rgba = [u8; 4];

/// One corner of a filled triangle.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct TriangleVertex {
    /// Its position, mm.
    pub position: Vec2,
    /// Its colour; the three corners of a triangle share one.
    pub color: Rgba,
}

/// A straight line with flat ends, or, where both ends are the same point, a round dot.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Segment {
    /// The start, mm.
    pub from: Vec2,
    /// The end, mm.
    pub to: Vec2,
    /// Width of the line or diameter of the dot, px.
    pub width: f32,
    /// Its colour.
    pub color: Rgba,
}

/// Everything in one picture. Points that are not finite are left out as they are added.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// The background colour.
    pub background: Rgba,
    /// Filled triangles, three corners each.
    pub vertices: Vec<TriangleVertex>,
    /// Lines and dots, later ones over earlier ones.
    pub segments: Vec<Segment>,
}

impl Scene {
    /// A scene with nothing in it yet.
    pub fn on(background: Rgba) -> Self {
        Self { background, ..Self::default() }
    }

    /// One line from end to end.
    pub fn line(&mut self, from: DVec2, to: DVec2, width: f32, color: Rgba) {
        let (from, to) = (from.as_vec2(), to.as_vec2());
        if from.is_finite() && to.is_finite() {
            self.segments.push(Segment { from, to, width, color });
        }
    }

    /// Lines from point to point; points in line with their neighbours need no joint.
    pub fn polyline(&mut self, points: &[DVec2], width: f32, color: Rgba) {
        let Some(&(mut start)) = points.first() else { return };
        for (i, &end) in points.iter().enumerate().skip(1) {
            let continues = points.get(i + 1).is_some_and(|&next| is_straight(start, end, next));
            if !continues && start != end {
                self.line(start, end, width, color);
                start = end;
            }
        }
    }

    /// Lines from point to point and back to the first.
    pub fn outline(&mut self, points: &[DVec2], width: f32, color: Rgba) {
        self.polyline(points, width, color);
        if let (Some(&last), Some(&first)) = (points.last(), points.first()) {
            self.polyline(&[last, first], width, color);
        }
    }

    /// A round dot.
    pub fn dot(&mut self, at: DVec2, diameter: f32, color: Rgba) {
        self.line(at, at, diameter, color);
    }

    /// The area between two curves with the same number of points: a lens between its surfaces.
    pub fn strip(&mut self, left: &[DVec2], right: &[DVec2], color: Rgba) {
        for (l, r) in left.windows(2).zip(right.windows(2)) {
            self.triangle([l[0], r[0], l[1]], color);
            self.triangle([l[1], r[0], r[1]], color);
        }
    }

    fn triangle(&mut self, corners: [DVec2; 3], color: Rgba) {
        let corners = corners.map(|at| TriangleVertex { position: at.as_vec2(), color });
        if corners.iter().all(|corner| corner.position.is_finite()) {
            self.vertices.extend(corners);
        }
    }

    /// The bounding box of everything; `None` for an empty scene.
    pub fn bounds(&self) -> Option<BoundingBox> {
        let corners = self.vertices.iter().map(|corner| corner.position);
        let ends = self.segments.iter().flat_map(|segment| [segment.from, segment.to]);
        BoundingBox::around(corners.chain(ends).map(Vec2::as_dvec2))
    }
}

/// True if the way from `a` to `c` passes straight through `b`.
fn is_straight(a: DVec2, b: DVec2, c: DVec2) -> bool {
    let (first, second) = (b - a, c - b);
    let size = first.length() * second.length();
    first.perp_dot(second).abs() <= 1e-12 * size && first.dot(second) >= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const BLUE: Rgba = [0, 0, 255, 255];

    #[test]
    fn points_that_are_not_finite_are_left_out() {
        let mut scene = Scene::default();
        scene.line(DVec2::ZERO, DVec2::new(f64::NAN, 1.0), 1.0, BLUE);
        scene.line(DVec2::ZERO, DVec2::new(1e300, 1.0), 1.0, BLUE);
        scene.strip(&[DVec2::ZERO, DVec2::Y], &[DVec2::X, DVec2::INFINITY], BLUE);
        assert_eq!(scene.segments.len(), 0);
        assert_eq!(scene.vertices.len(), 3, "the finite half of the strip stays");
    }

    #[test]
    fn an_outline_closes_itself() {
        let mut scene = Scene::default();
        scene.outline(&[DVec2::ZERO, DVec2::X, DVec2::ONE], 1.0, BLUE);
        assert_eq!(scene.segments.len(), 3);
        assert_eq!(scene.segments[2].to, scene.segments[0].from);
    }

    #[test]
    fn points_in_line_need_no_joint() {
        let mut scene = Scene::default();
        let points = [(0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (3.0, 0.0), (3.0, 1.0), (3.0, 0.0)];
        scene.polyline(&points.map(|(x, y)| DVec2::new(x, y)), 1.0, BLUE);
        let ends: Vec<_> = scene.segments.iter().map(|s| (s.from, s.to)).collect();
        let [a, b, c] = [Vec2::ZERO, Vec2::new(3.0, 0.0), Vec2::new(3.0, 1.0)];
        assert_eq!(ends, [(a, b), (b, c), (c, b)]);
    }

    #[test]
    fn an_empty_scene_has_no_bounds() {
        assert_eq!(Scene::default().bounds(), None);
    }
}
