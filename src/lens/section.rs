//! The section of a lens in the y-z plane, as points that anything can draw.
//!
//! An element extends to the larger of its two semi-diameters; the smaller surface continues flat,
//! as lenses are ground. Decentred and tilted surfaces are drawn by their points with x = 0 in their own
//! frame, projected along x. A surface without a semi-diameter extends to its outermost rays, or else as
//! far as the largest surface.

use super::{HeightInterval, Pose, System};
use crate::math::Vec3;

/// The section of a system. Points are `[z, y]` in mm from the first vertex.
#[derive(Clone, Debug)]
pub struct LensSection<'a> {
    system: &'a System<f64>,
    vertices: Vec<f64>,
    /// The frame of every surface in that of the first vertex.
    places: Vec<Pose<f64>>,
    heights: Vec<f64>,
}

impl<'a> LensSection<'a> {
    /// The section of a system. `ray_heights` holds the largest height of the rays at each surface,
    /// in mm; it may be empty.
    pub fn new(system: &'a System<f64>, ray_heights: &[f64]) -> Self {
        let heights = heights(system, ray_heights);
        let frames = system.frames();
        let vertices = frames.iter().map(|frame| frame.shift.z).collect();
        let own = |(frame, pose): (Pose<f64>, Option<Pose<f64>>)| {
            pose.map_or(frame, |pose| frame.then(&pose))
        };
        let poses = system.surfaces.iter().map(|surface| surface.pose);
        let places = frames.into_iter().zip(poses).map(own).collect();
        Self { system, vertices, places, heights }
    }

    /// The system.
    pub const fn system(&self) -> &'a System<f64> {
        self.system
    }

    /// The z of every vertex on the axis, the image plane last.
    pub fn vertices(&self) -> &[f64] {
        &self.vertices
    }

    /// The place of a surface in the frame of the first vertex.
    pub fn place(&self, surface: usize) -> Pose<f64> {
        self.places[surface]
    }

    /// The height to which every surface extends, in mm.
    pub fn heights(&self) -> &[f64] {
        &self.heights
    }

    /// The z of the image plane, in mm.
    pub fn image_position(&self) -> f64 {
        self.vertices.last().copied().unwrap_or(0.0)
    }

    /// The largest height of the lens above the axis, without the image plane, in mm.
    pub fn max_height(&self) -> f64 {
        self.heights.iter().take(self.image()).copied().fold(0.0, f64::max)
    }

    /// The index of the image plane.
    pub const fn image(&self) -> usize {
        self.vertices.len().saturating_sub(1)
    }

    /// The elements: the index of the front surface, and the refractive index.
    pub fn elements(&self) -> impl Iterator<Item = (usize, f64)> {
        let filled = self.system.surfaces.iter().take(self.image()).enumerate();
        filled.filter(|(_, s)| !s.mirror && s.index != 1.0).map(|(i, s)| (i, s.index))
    }

    /// The front and the back of the element behind a surface, from below to above, each in this
    /// number of straight pieces.
    pub fn element(&self, front: usize, pieces: u32) -> [Vec<[f64; 2]>; 2] {
        let height = self.heights[front].max(self.heights[front + 1]);
        [front, front + 1].map(|surface| self.curve(surface, height, pieces))
    }

    /// A surface from its lower rim to its upper one, in this number of straight pieces.
    pub fn surface(&self, surface: usize, pieces: u32) -> Vec<[f64; 2]> {
        self.curve(surface, self.heights[surface], pieces)
    }

    /// The parts of a surface at which its obstruction or an aperture blocks light, each in this number of
    /// straight pieces.
    pub fn blocked_parts(&self, surface: usize, pieces: u32) -> Vec<Vec<[f64; 2]>> {
        let blocked = self.blocked_heights(surface);
        blocked.into_iter().map(|heights| self.part(surface, heights, pieces)).collect()
    }

    /// The parts of a surface inside its rim that are left by its obstruction and its apertures.
    pub fn open_parts(&self, surface: usize, pieces: u32) -> Vec<Vec<[f64; 2]>> {
        let (height, blocked) = (self.heights[surface], self.blocked_heights(surface));
        let starts = std::iter::once(-height).chain(blocked.iter().map(|own| own[1]));
        let ends = blocked.iter().map(|own| own[0]).chain(std::iter::once(height));
        let parts = starts.zip(ends).filter(|(start, end)| start < end || blocked.is_empty());
        parts.map(|(start, end)| self.part(surface, [start, end], pieces)).collect()
    }

    fn blocked_heights(&self, surface: usize) -> Vec<HeightInterval> {
        self.system.surfaces[surface].blocked_heights(self.heights[surface])
    }

    /// The point of a surface at a height, flat beyond its own semi-diameter.
    pub fn point(&self, surface: usize, height: f64) -> [f64; 2] {
        let ground = height.abs().min(self.heights[surface]);
        let sag = self.system.surfaces[surface].clamped_sag(ground.copysign(height));
        projected(self.places[surface].point_out(Vec3::new(0.0, height, sag)))
    }

    /// The point of the vertex plane of a surface at a height.
    pub fn plane_point(&self, surface: usize, height: f64) -> [f64; 2] {
        projected(self.places[surface].point_out(Vec3::new(0.0, height, 0.0)))
    }

    /// The height of a point above the vertex of a surface, in the frame of the surface.
    pub fn height_above(&self, surface: usize, point: Vec3<f64>) -> f64 {
        self.places[surface].point_in(point).y
    }

    /// The axis from the first vertex to the last, broken where the lens breaks it.
    pub fn axis(&self) -> Vec<[f64; 2]> {
        self.system.frames().into_iter().map(|frame| projected(frame.shift)).collect()
    }

    /// The surface that passes nearest to a point, no farther than `within` mm along the axis.
    pub fn surface_near(&self, [z, y]: [f64; 2], within: f64) -> Option<usize> {
        let own = |i: &usize| self.places[*i].point_in(Vec3::new(0.0, y, z));
        let sag = |i: usize, y: f64| {
            let ground = y.abs().min(self.heights[i]);
            self.system.surfaces[i].clamped_sag(ground.copysign(y))
        };
        let distance = |i: &usize| (sag(*i, own(i).y) - own(i).z).abs();
        let reaches = |i: &usize| own(i).y.abs() <= self.heights[*i] + within;
        (0..self.heights.len())
            .filter(reaches)
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .filter(|i| distance(i) <= within)
    }

    fn curve(&self, surface: usize, height: f64, pieces: u32) -> Vec<[f64; 2]> {
        self.part(surface, [-height, height], pieces)
    }

    /// A surface between two heights.
    fn part(&self, surface: usize, [low, high]: HeightInterval, pieces: u32) -> Vec<[f64; 2]> {
        let share = |i: u32| f64::from(i) / f64::from(pieces);
        (0..=pieces).map(|i| self.point(surface, low + (high - low) * share(i))).collect()
    }
}

fn projected(point: Vec3<f64>) -> [f64; 2] {
    [point.z, point.y]
}

fn heights(system: &System<f64>, ray_heights: &[f64]) -> Vec<f64> {
    let written = |i: usize| Some(system.surfaces[i].semi_diameter).filter(|h| h.is_finite());
    let rays = |i: usize| ray_heights.get(i).copied().filter(|h| *h > 0.0 && h.is_finite());
    let known: Vec<Option<f64>> =
        (0..system.surfaces.len()).map(|i| written(i).or_else(|| rays(i))).collect();
    let highest = known.iter().flatten().copied().fold(0.0, f64::max);
    let otherwise = if highest > 0.0 { highest } else { 1.0 };
    known.into_iter().map(|height| height.unwrap_or(otherwise)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Shape, Surface};

    fn surface(curvature: f64, thickness: f64, index: f64, semi_diameter: f64) -> Surface<f64> {
        let shape = Shape::Sphere { curvature };
        Surface { shape, semi_diameter, ..Surface::plane(thickness, index) }
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
        let [_, back] = section.element(0, 96);
        let rim = back.last().copied().unwrap_or_default();
        assert_eq!(rim[1], 10.0);
        assert!((rim[0] - (5.0 - 0.02 * 64.0 / (1.0 + (1.0_f64 - 0.0256).sqrt()))).abs() < 1e-12);
    }

    #[test]
    fn behind_a_fold_mirror_the_axis_goes_up() {
        let mut system = singlet();
        let turned = |degrees: f64| Pose::new([0.0; 2], [degrees.to_radians(), 0.0]);
        (system.surfaces[1].mirror, system.surfaces[1].thickness) = (true, -95.0);
        (system.surfaces[1].pose, system.surfaces[1].axis) =
            (Some(turned(45.0)), Some(turned(90.0)));
        let section = LensSection::new(&system, &[]);
        let [z, y] = section.point(2, 0.0);
        // The new axis is −y, and light travels against it.
        assert!((z - 5.0).abs() < 1e-12 && (y - 95.0).abs() < 1e-12, "{z} {y}");
        let [z, y] = section.point(2, 3.0);
        assert!((z - 8.0).abs() < 1e-12 && (y - 95.0).abs() < 1e-12, "{z} {y}");
        assert_eq!(section.surface_near([6.0, 95.2], 0.5), Some(2));
    }

    #[test]
    fn a_hole_leaves_two_parts_of_a_mirror() {
        let mut system = singlet();
        (system.surfaces[1].mirror, system.surfaces[1].obstruction) = (true, 2.0);
        let section = LensSection::new(&system, &[]);
        let [lower, upper] = &section.open_parts(1, 8)[..] else { panic!("two parts") };
        let ends = [lower[0][1], lower[8][1], upper[0][1], upper[8][1]];
        assert_eq!(ends, [-8.0, -2.0, 2.0, 8.0]);
        assert_eq!(section.blocked_parts(1, 8)[0], section.part(1, [-2.0, 2.0], 8));
        assert_eq!(section.open_parts(0, 8), [section.surface(0, 8)]);
        assert!(section.blocked_parts(0, 8).is_empty());
    }

    #[test]
    fn a_surface_without_semi_diameter_reaches_as_far_as_its_rays() {
        let system = singlet();
        assert_eq!(LensSection::new(&system, &[9.0, 9.0, 3.0]).heights, [10.0, 8.0, 3.0]);
        assert_eq!(LensSection::new(&system, &[]).heights, [10.0, 8.0, 10.0]);
    }
}
