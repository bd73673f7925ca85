//! The section of a lens in the y-z plane: glass with joined edges, the stop as ticks, mirrors,
//! axis.
//!
//! An element extends to the larger of its two semi-diameters; the smaller surface continues flat,
//! as lenses are ground. A surface without a semi-diameter is drawn up to its outermost rays.

use glam::DVec2;

use super::draw::{BoundingBox, Rgba, Scene};
use super::palette::{Palette, to_byte};
use crate::lens::System;

/// How many straight pieces a surface is drawn with: the sag of a hemisphere of 200 px is then
/// off by a fiftieth of a pixel.
const PIECES: i32 = 96;

/// The section of a system, ready to be drawn.
#[derive(Clone, Debug)]
pub struct LensSection<'a> {
    system: &'a System<f64>,
    vertices: Vec<f64>,
    heights: Vec<f64>,
}

impl<'a> LensSection<'a> {
    /// The section of a system. `reached` holds the largest height of the rays at each surface, in
    /// mm.
    pub fn new(system: &'a System<f64>, reached: &[f64]) -> Self {
        Self { system, vertices: system.vertex_positions(), heights: heights(system, reached) }
    }

    /// The bounding box of the whole lens: all surfaces and the image plane.
    pub fn bounds(&self) -> Option<BoundingBox> {
        let heights = self.heights.iter().enumerate();
        let heights = heights.map(|(i, h)| if i == self.last() { 0.0 } else { *h });
        let corners = self.vertices.iter().zip(heights);
        BoundingBox::around(corners.flat_map(|(&z, h)| [DVec2::new(z, h), DVec2::new(z, -h)]))
    }

    /// Draws glass, to lie below the rays; that behind the surfaces of `added_glass` is tinted.
    pub fn draw_glass(&self, scene: &mut Scene, palette: &Palette, fresh: &[usize]) {
        for (left, medium) in self.elements() {
            let height = self.heights[left].max(self.heights[left + 1]);
            let mut color = if fresh.contains(&left) { palette.added_glass } else { palette.glass };
            color[3] = glass_alpha(color[3], medium);
            scene.strip(&self.curve(left, height), &self.curve(left + 1, height), color);
        }
    }

    /// Draws the outlines above the rays: rims, mirrors, stop and axis.
    pub fn draw_outlines(&self, scene: &mut Scene, palette: &Palette) {
        self.draw_axis(scene, palette);
        for (left, _) in self.elements() {
            scene.outline(&self.rim(left), 1.5, palette.outline);
        }
        for (i, surface) in self.system.surfaces.iter().enumerate() {
            let curve = || self.curve(i, self.heights[i]);
            if surface.mirror {
                scene.polyline(&curve(), 2.5, palette.mirror);
            } else if i != self.last() && !self.is_refracting(i) && self.system.stop != Some(i) {
                scene.polyline(&curve(), 1.0, palette.faint);
            }
        }
        self.draw_stop(scene, palette);
    }

    /// The z of the image plane, in mm.
    pub fn image(&self) -> f64 {
        self.vertices.last().copied().unwrap_or(0.0)
    }

    /// The largest height of the lens above the axis, in mm.
    pub fn highest(&self) -> f64 {
        self.heights.iter().take(self.last()).copied().fold(0.0, f64::max)
    }

    /// The number of the image plane.
    fn last(&self) -> usize {
        self.heights.len().saturating_sub(1)
    }

    /// Draws the rims alone, in one colour: a lens to compare with.
    pub fn draw_ghost(&self, scene: &mut Scene, color: Rgba) {
        for (left, _) in self.elements() {
            scene.outline(&self.rim(left), 1.0, color);
        }
    }

    /// The surface that passes nearest to a point, no farther than `within` mm along the axis.
    pub fn surface_near(&self, point: DVec2, within: f64) -> Option<usize> {
        let distance = |i: &usize| (self.at(*i, point.y).x - point.x).abs();
        let reaches = |i: &usize| point.y.abs() <= self.heights[*i] + within;
        (0..self.heights.len())
            .filter(reaches)
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .filter(|i| distance(i) <= within)
    }

    /// A surface from its lower rim to its upper one.
    pub fn outline_of(&self, i: usize) -> Vec<DVec2> {
        self.curve(i, self.heights[i])
    }

    fn rim(&self, left: usize) -> Vec<DVec2> {
        let height = self.heights[left].max(self.heights[left + 1]);
        let mut rim = self.curve(left, height);
        rim.extend(self.curve(left + 1, height).into_iter().rev());
        rim
    }

    fn draw_axis(&self, scene: &mut Scene, palette: &Palette) {
        let first = self.vertices.iter().copied().fold(f64::INFINITY, f64::min);
        let last = self.vertices.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let beyond = 0.05 * (last - first);
        let ends = [first - beyond, last + beyond].map(|z| DVec2::new(z, 0.0));
        scene.line(ends[0], ends[1], 1.0, palette.faint);
    }

    fn draw_stop(&self, scene: &mut Scene, palette: &Palette) {
        let Some(stop) = self.system.stop.filter(|&stop| stop < self.heights.len()) else {
            return;
        };
        let height = self.heights[stop];
        let highest = self.heights.iter().copied().fold(0.0, f64::max);
        let z = self.at(stop, height).x;
        for side in [-1.0, 1.0] {
            let rim = DVec2::new(z, side * height);
            scene.line(rim, rim + DVec2::new(0.0, side * 0.25 * highest), 3.0, palette.strong);
        }
    }

    /// The gaps filled with something other than air: the surface in front and the index.
    fn elements(&self) -> impl Iterator<Item = (usize, f64)> {
        let gaps = self.system.surfaces.len().saturating_sub(1);
        let filled = self.system.surfaces.iter().take(gaps).enumerate();
        filled.filter(|(_, s)| !s.mirror && s.index != 1.0).map(|(i, s)| (i, s.index))
    }

    fn is_refracting(&self, i: usize) -> bool {
        self.system.index_before(i) != self.system.surfaces[i].index
    }

    /// A surface from below to above, flat beyond its own semi-diameter.
    fn curve(&self, i: usize, height: f64) -> Vec<DVec2> {
        let step = |j: i32| f64::from(j) / f64::from(PIECES);
        (-PIECES..=PIECES).step_by(2).map(|j| self.at(i, height * step(j))).collect()
    }

    /// The point of a surface at a height, flat beyond its own semi-diameter.
    fn at(&self, i: usize, height: f64) -> DVec2 {
        let ground = height.abs().min(self.heights[i]);
        DVec2::new(self.vertices[i] + self.system.surfaces[i].shape.clamped_sag(ground), height)
    }
}

fn heights(system: &System<f64>, reached: &[f64]) -> Vec<f64> {
    let known = |i: usize| Some(system.surfaces[i].semi_diameter).filter(|h| h.is_finite());
    let reached = |i: usize| reached.get(i).copied().filter(|h| *h > 0.0 && h.is_finite());
    let own: Vec<Option<f64>> =
        (0..system.surfaces.len()).map(|i| known(i).or_else(|| reached(i))).collect();
    let highest = own.iter().flatten().copied().fold(0.0, f64::max);
    let usual = if highest > 0.0 { highest } else { 1.0 };
    own.into_iter().map(|height| height.unwrap_or(usual)).collect()
}

/// Denser glass is less transparent: 1.45 half as much as 1.9.
fn glass_alpha(usual: u8, index: f64) -> u8 {
    let share = ((index - 1.0) / 0.65).clamp(0.4, 2.0);
    to_byte(f64::from(usual) * share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Shape, Surface};

    fn surface(curvature: f64, thickness: f64, index: f64, semi_diameter: f64) -> Surface<f64> {
        let shape = Shape::Sphere { curvature };
        let obstruction = 0.0;
        Surface {
            shape,
            thickness,
            index,
            semi_diameter,
            obstruction,
            mirror: false,
            hyperhemisphere: false,
            grin: None,
        }
    }

    fn singlet() -> System<f64> {
        let mut surfaces = vec![
            surface(0.02, 5.0, 1.5, 10.0),
            surface(-0.02, 95.0, 1.0, 8.0),
            surface(0.0, 0.0, 1.0, f64::INFINITY),
        ];
        surfaces[2].shape = Shape::Plane;
        System { index_before: 1.0, surfaces, stop: Some(1) }
    }

    #[test]
    fn an_element_reaches_to_its_larger_semi_diameter() {
        let system = singlet();
        let section = LensSection::new(&system, &[]);
        let back = section.curve(1, 10.0);
        let rim = back.last().copied().unwrap_or_default();
        assert_eq!(rim.y, 10.0);
        assert!((rim.x - (5.0 - 0.02 * 64.0 / (1.0 + (1.0_f64 - 0.0256).sqrt()))).abs() < 1e-12);
    }

    #[test]
    fn a_surface_without_semi_diameter_reaches_as_far_as_its_rays() {
        let system = singlet();
        assert_eq!(LensSection::new(&system, &[9.0, 9.0, 3.0]).heights, [10.0, 8.0, 3.0]);
        assert_eq!(LensSection::new(&system, &[]).heights, [10.0, 8.0, 10.0]);
    }

    #[test]
    fn a_surface_that_ends_early_is_drawn_to_its_edge() {
        let ball = Shape::Sphere { curvature: 0.1 };
        assert!((ball.clamped_sag(30.0) - 10.0).abs() < 1e-4);
    }

    #[test]
    fn only_glass_is_filled() {
        let system = singlet();
        let mut scene = Scene::default();
        LensSection::new(&system, &[]).draw_glass(&mut scene, &Palette::DARK, &[]);
        let behind = scene.vertices.iter().map(|corner| corner.position.x).fold(0.0, f32::max);
        assert!(behind <= 5.01, "nothing is filled behind the singlet");
    }

    #[test]
    fn a_lens_without_surfaces_draws_nothing() {
        let system = System { index_before: 1.0, surfaces: Vec::new(), stop: Some(3) };
        let section = LensSection::new(&system, &[]);
        let mut scene = Scene::default();
        section.draw_glass(&mut scene, &Palette::DARK, &[]);
        section.draw_outlines(&mut scene, &Palette::DARK);
        assert_eq!((scene.bounds(), section.bounds()), (None, None));
    }
}
