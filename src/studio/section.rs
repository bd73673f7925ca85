//! The drawing of a lens section: glass with joined edges, the stop as ticks, mirrors where they
//! reflect, what apertures block, axis.

use glam::DVec2;

use super::draw::{BoundingBox, Rgba, Scene};
use super::palette::{Palette, to_byte};
use crate::lens::{LensSection, System};
use crate::math::Vec3;

/// The straight pieces of a drawn surface: the sag of a hemisphere of 200 px is then off by a
/// fiftieth of a pixel.
const PIECES: u32 = 96;

/// The section of a system, ready to be drawn.
#[derive(Clone, Debug)]
pub struct SectionDrawing<'a> {
    section: LensSection<'a>,
}

impl<'a> SectionDrawing<'a> {
    /// The section of a system. `ray_heights` holds the largest height of the rays at each surface,
    /// in mm.
    pub fn new(system: &'a System<f64>, ray_heights: &[f64]) -> Self {
        Self { section: LensSection::new(system, ray_heights) }
    }

    /// The bounding box of the whole lens: all surfaces and the image plane.
    pub fn bounds(&self) -> Option<BoundingBox> {
        let heights = self.section.heights().iter().enumerate();
        let heights = heights.map(|(i, h)| (i, if i == self.section.image() { 0.0 } else { *h }));
        let corner = |(i, h): (usize, f64)| [h, -h].map(|h| self.section.plane_point(i, h).into());
        BoundingBox::around(heights.flat_map(corner))
    }

    /// Draws glass, to lie below the rays; that behind the surfaces of `added_glass` is tinted.
    pub fn draw_glass(&self, scene: &mut Scene, palette: &Palette, added_glass: &[usize]) {
        for (front, index) in self.section.elements() {
            let [left, right] = self.section.element(front, PIECES).map(points);
            let is_added = added_glass.contains(&front);
            let mut color = if is_added { palette.added_glass } else { palette.glass };
            color[3] = glass_alpha(color[3], index);
            scene.strip(&left, &right, color);
        }
    }

    /// Draws the outlines above the rays: rims, mirrors, stop and axis.
    pub fn draw_outlines(&self, scene: &mut Scene, palette: &Palette) {
        self.draw_axis(scene, palette);
        self.draw_elements(scene, 1.5, palette.outline);
        let system = self.section.system();
        for (i, surface) in system.surfaces.iter().enumerate() {
            let refracts = system.index_before(i) != surface.index;
            let (width, color) =
                if surface.mirror { (1.0, palette.faint) } else { (3.0, palette.strong) };
            for part in self.section.blocked_parts(i, PIECES) {
                scene.polyline(&points(part), width, color);
            }
            if surface.mirror {
                for part in self.section.open_parts(i, PIECES) {
                    scene.polyline(&points(part), 2.5, palette.mirror);
                }
                continue;
            }
            if i != self.section.image() && !refracts && system.stop != Some(i) {
                scene.polyline(&self.surface(i), 1.0, palette.faint);
            }
        }
        self.draw_stop(scene, palette);
    }

    /// The point of the image plane at a height above its axis.
    pub fn image_point(&self, height: f64) -> DVec2 {
        self.section.plane_point(self.section.image(), height).into()
    }

    /// The height of a point above the axis of the image plane, in mm.
    pub fn image_height(&self, point: Vec3<f64>) -> f64 {
        self.section.height_above(self.section.image(), point)
    }

    /// The largest height of the lens above the axis, in mm.
    pub fn max_height(&self) -> f64 {
        self.section.max_height()
    }

    /// Draws the outlines of the elements alone, in one colour: a lens to compare with.
    pub fn draw_reference(&self, scene: &mut Scene, color: Rgba) {
        self.draw_elements(scene, 1.0, color);
    }

    /// The surface that passes nearest to a point, no farther than `within` mm along the axis.
    pub fn surface_near(&self, point: DVec2, within: f64) -> Option<usize> {
        self.section.surface_near(point.into(), within)
    }

    /// A surface from its lower rim to its upper one.
    pub fn surface(&self, surface: usize) -> Vec<DVec2> {
        points(self.section.surface(surface, PIECES))
    }

    fn draw_elements(&self, scene: &mut Scene, width: f32, color: Rgba) {
        for (front, _) in self.section.elements() {
            let [mut rim, back] = self.section.element(front, PIECES).map(points);
            rim.extend(back.into_iter().rev());
            scene.outline(&rim, width, color);
        }
    }

    fn draw_axis(&self, scene: &mut Scene, palette: &Palette) {
        if self.section.system().has_broken_axis() {
            return scene.polyline(&points(self.section.axis()), 1.0, palette.faint);
        }
        let vertices = || self.section.vertices().iter().copied();
        let (first, last) = (
            vertices().fold(f64::INFINITY, f64::min),
            vertices().fold(f64::NEG_INFINITY, f64::max),
        );
        let beyond = 0.05 * (last - first);
        let ends = [first - beyond, last + beyond].map(|z| DVec2::new(z, 0.0));
        scene.line(ends[0], ends[1], 1.0, palette.faint);
    }

    fn draw_stop(&self, scene: &mut Scene, palette: &Palette) {
        let heights = self.section.heights();
        let Some(stop) = self.section.system().stop.filter(|&stop| stop < heights.len()) else {
            return;
        };
        let highest = heights.iter().copied().fold(0.0, f64::max);
        let along = DVec2::from(self.section.plane_point(stop, 1.0))
            - DVec2::from(self.section.plane_point(stop, 0.0));
        for side in [-1.0, 1.0] {
            let rim = DVec2::from(self.section.point(stop, side * heights[stop]));
            scene.line(rim, rim + along * (side * 0.25 * highest), 3.0, palette.strong);
        }
    }
}

fn points(curve: Vec<[f64; 2]>) -> Vec<DVec2> {
    curve.into_iter().map(DVec2::from).collect()
}

/// The opacity of a glass: index 1.45 is half as opaque as 1.9.
fn glass_alpha(usual: u8, index: f64) -> u8 {
    let share = ((index - 1.0) / 0.65).clamp(0.4, 2.0);
    to_byte(f64::from(usual) * share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{ApertureShape, SurfaceAperture, blank};

    #[test]
    fn only_glass_is_filled() {
        let system = blank().resolve(0, 0.5875618).unwrap();
        let mut scene = Scene::default();
        SectionDrawing::new(&system, &[]).draw_glass(&mut scene, &Palette::DARK, &[]);
        let behind = scene.vertices.iter().map(|corner| corner.position.x).fold(0.0, f32::max);
        assert!(behind <= 5.01, "nothing is filled behind the plate");
    }

    /// A spider whose arms lie along y covers the whole section of the mirror that it is written at.
    #[test]
    fn a_mirror_is_drawn_where_it_is_blocked() {
        let mut system = blank().resolve(0, 0.5875618).unwrap();
        let spider = ApertureShape::Spider { arms: 4, width: 1.0 };
        system.surfaces[1].mirror = true;
        let drawn = |system: &System<f64>| {
            let mut scene = Scene::default();
            SectionDrawing::new(system, &[]).draw_outlines(&mut scene, &Palette::DARK);
            scene.vertices.len()
        };
        let open = drawn(&system);
        system.surfaces[1].apertures = vec![SurfaceAperture::obscuration(spider)];
        let section = LensSection::new(&system, &[]);
        assert_eq!((section.open_parts(1, 8).len(), section.blocked_parts(1, 8).len()), (0, 1));
        assert!(drawn(&system) >= open, "{} {open}", drawn(&system));
    }

    #[test]
    fn a_lens_without_surfaces_draws_nothing() {
        let system = System { index_before: 1.0, surfaces: Vec::new(), stop: Some(3) };
        let section = SectionDrawing::new(&system, &[]);
        let mut scene = Scene::default();
        section.draw_glass(&mut scene, &Palette::DARK, &[]);
        section.draw_outlines(&mut scene, &Palette::DARK);
        assert_eq!((scene.bounds(), section.bounds()), (None, None));
    }
}
