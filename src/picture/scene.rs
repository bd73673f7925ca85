//! A scene: painted planes at depths in front of the lens, and a background behind them.
//!
//! A plane is at a distance from the first vertex, or at infinity, where it is a plane of tangents of
//! directions. What is painted on it radiates evenly in all directions. A ray meets the planes from the
//! nearest to the farthest, each of which covers a share of what is behind it.

use super::PictureError;
use super::exact::luminance;
use super::pattern::{PaintedPoint, Pattern};
use crate::math::Vec3;
use crate::trace::Ray;

/// A radiance in red, green and blue.
pub type Radiance = [f64; 3];

/// A painted plane.
#[derive(Debug, Clone)]
pub struct SceneLayer {
    /// The distance in front of the first vertex in mm; `None` at infinity.
    pub distance: Option<f64>,
    /// The middle of the painted rectangle, to the right and upwards as the lens sees it: in mm, or as
    /// tangents of directions at infinity.
    pub center: [f64; 2],
    /// Half of its width and of its height, in the same unit; infinite without an end.
    pub half_size: [f64; 2],
    /// The velocity to the right and upwards in the same unit per second.
    pub velocity: [f64; 2],
    /// The painting.
    pub pattern: Pattern,
}

/// A scene.
#[derive(Debug, Clone)]
pub struct Scene {
    /// The planes, from the nearest to the farthest.
    layers: Vec<SceneLayer>,
    /// The radiance in every direction without a plane.
    background: Radiance,
    /// The radiance that a picture shows as white.
    pub white: f64,
}

impl Scene {
    /// A scene of planes in front of a background. Of two planes at the same distance the first one is in
    /// front.
    ///
    /// # Errors
    /// A plane that is not in front of the lens, without size, or with a number that is not finite.
    pub fn new(
        mut layers: Vec<SceneLayer>,
        background: Radiance,
        white: f64,
    ) -> Result<Self, PictureError> {
        layers.iter().try_for_each(SceneLayer::check)?;
        if !(white > 0.0 && white.is_finite()) {
            let expected = "a positive number";
            return Err(PictureError::Size {
                what: "the white of the scene",
                found: white,
                expected,
            });
        }
        let depth = |layer: &SceneLayer| layer.distance.unwrap_or(f64::INFINITY);
        layers.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
        Ok(Self { layers, background, white })
    }

    /// A wave of contrast 0.5 by its two frequencies and its phase: in cycles/mm on a plane at a distance in mm, or by
    /// the tangents of the direction of light.
    ///
    /// # Errors
    /// A plane that is not in front of the lens.
    pub fn wave([fx, fy, phase]: [f64; 3], distance: Option<f64>) -> Result<Self, PictureError> {
        // Light comes from the opposite side of where it goes.
        let frequency = if distance.is_some() { [fx, fy] } else { [-fx, -fy] };
        let pattern = Pattern::Wave { contrast: 0.5, frequency, phase };
        let half_size = [f64::INFINITY; 2];
        let layer =
            SceneLayer { distance, center: [0.0; 2], half_size, velocity: [0.0; 2], pattern };
        Self::new(vec![layer], [0.0; 3], 1.0)
    }

    /// The same scene, whose only plane has this width in mm, and its height in proportion.
    ///
    /// # Errors
    /// Not one plane at a finite distance, or a width that is not positive.
    pub fn with_width(mut self, width: f64) -> Result<Self, PictureError> {
        let what = "the width of the scene";
        let refuse = |expected| Err(PictureError::Size { what, found: width, expected });
        if !(width > 0.0 && width.is_finite()) {
            return refuse("a positive number of mm");
        }
        let [layer] = &mut self.layers[..] else {
            return refuse("a scene of one plane, or none for this scene");
        };
        if layer.distance.is_none() {
            return refuse("a scene at a finite distance, as by --distance, or none at infinity");
        }
        let factor = 0.5 * width / layer.half_size[0];
        layer.half_size = layer.half_size.map(|half| half * factor);
        Ok(self)
    }

    /// The same scene, all of whose planes move to the right and upwards, in mm per second or, at infinity, in
    /// tangents of directions per second.
    ///
    /// # Errors
    /// A velocity that is not finite.
    pub fn moving(mut self, velocity: [f64; 2]) -> Result<Self, PictureError> {
        if velocity != [0.0; 2] {
            self.layers.iter_mut().for_each(|layer| layer.velocity = velocity);
            self.layers.iter().try_for_each(SceneLayer::check)?;
        }
        Ok(self)
    }

    /// The same radiance in every direction.
    pub fn uniform(radiance: f64) -> Self {
        Self {
            layers: Vec::new(),
            background: [radiance; 3],
            white: radiance.max(f64::MIN_POSITIVE),
        }
    }

    /// True if the same light comes from every direction: no blur changes its image but at the edge of the light.
    pub fn is_uniform(&self) -> bool {
        self.layers.is_empty()
    }

    /// The radiance of the background in a colour of three, or its luminance as the only one.
    pub(super) fn seen_background(&self, color: usize, colors: usize) -> f64 {
        if colors == 3 { self.background[color] } else { luminance(self.background) }
    }

    /// The radiance in every direction without a plane.
    pub(super) fn background(&self) -> Radiance {
        self.background
    }

    /// The planes, from the nearest to the farthest.
    pub fn layers(&self) -> &[SceneLayer] {
        &self.layers
    }

    /// True if there are planes, all at the distance of the first.
    pub(super) fn is_at_one_distance(&self) -> bool {
        self.layers
            .first()
            .is_some_and(|first| self.layers.iter().all(|layer| layer.distance == first.distance))
    }

    /// True if something moves.
    pub fn is_moving(&self) -> bool {
        self.layers.iter().any(|layer| layer.velocity != [0.0; 2])
    }

    /// The radiance along a ray that leads away from the lens, in the frame of its first vertex, at a
    /// time in seconds.
    pub fn radiance(&self, ray: &Ray<f64>, seconds: f64) -> Radiance {
        let (mut sum, mut open) = ([0.0; 3], 1.0);
        for layer in &self.layers {
            let Some(point) = layer.meet(ray, seconds) else { continue };
            let paint = layer.pattern.paint(point);
            let share = open * paint.cover;
            sum = [0, 1, 2].map(|c| sum[c] + share * paint.radiance[c]);
            open -= share;
            if open <= 0.0 {
                return sum;
            }
        }
        [0, 1, 2].map(|c| sum[c] + open * self.background[c])
    }
}

/// Refuses the distance of a plane that is not in front of the lens.
pub(super) fn check_distance(distance: Option<f64>) -> Result<(), PictureError> {
    match distance {
        Some(found) if !(found > 0.0 && found <= 1e12) => {
            let expected = "a positive number of mm in front of the first vertex, or infinity";
            Err(PictureError::Size { what: "the distance of a plane", found, expected })
        }
        _ => Ok(()),
    }
}

impl SceneLayer {
    fn check(&self) -> Result<(), PictureError> {
        let refuse = |what, found, expected| Err(PictureError::Size { what, found, expected });
        check_distance(self.distance)?;
        if let Some(size) = self.half_size.into_iter().find(|size| !(*size > 0.0)) {
            return refuse("the size of a plane", size, "a positive number");
        }
        let placed = self.center.into_iter().chain(self.velocity);
        match placed.into_iter().find(|v| !v.is_finite()) {
            Some(found) => refuse("the place or velocity of a plane", found, "a finite number"),
            None => Ok(()),
        }
    }

    /// The point of the painting that a ray meets; `None` beside it.
    fn meet(&self, ray: &Ray<f64>, seconds: f64) -> Option<PaintedPoint> {
        let Vec3 { x: l, y: m, z: n } = ray.direction;
        if !(n < 0.0) {
            return None;
        }
        let place = match self.distance {
            None => [-l / n, -m / n],
            Some(distance) => {
                let along = (-distance - ray.point.z) / n;
                if !(along > 0.0) {
                    return None;
                }
                [ray.point.x + along * l, ray.point.y + along * m]
            }
        };
        let moved = |k: usize| place[k] - self.center[k] - seconds * self.velocity[k];
        let place = [moved(0), moved(1)];
        let inside = place[0].abs() <= self.half_size[0] && place[1].abs() <= self.half_size[1];
        inside.then_some(PaintedPoint { place, half_size: self.half_size })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(distance: Option<f64>, level: f64, cover: f64) -> SceneLayer {
        SceneLayer {
            distance,
            center: [0.0; 2],
            half_size: [100.0; 2],
            velocity: [0.0; 2],
            pattern: Pattern::Uniform { radiance: [level; 3], cover },
        }
    }

    fn outwards(x: f64) -> Ray<f64> {
        let direction = Vec3::new(0.0, 0.0, -1.0);
        Ray { point: Vec3::new(x, 0.0, 3.0), direction }
    }

    #[test]
    fn near_planes_cover_far_ones() {
        let layers = vec![plane(None, 8.0, 1.0), plane(Some(500.0), 2.0, 0.25)];
        let scene = Scene::new(layers, [1.0; 3], 1.0).unwrap();
        assert_eq!(scene.radiance(&outwards(0.0), 0.0), [0.25 * 2.0 + 0.75 * 8.0; 3]);
        // Beside the near plane; the far one is met by direction.
        assert_eq!(scene.radiance(&outwards(101.0), 0.0), [8.0; 3]);
        let backwards = Ray { direction: Vec3::new(0.0, 0.0, 1.0), ..outwards(0.0) };
        assert_eq!(scene.radiance(&backwards, 0.0), [1.0; 3]);
    }

    #[test]
    fn of_two_planes_at_the_same_depth_the_first_is_in_front_and_one_that_moves_leaves() {
        let moving = SceneLayer { velocity: [150.0, 0.0], ..plane(Some(500.0), 5.0, 1.0) };
        let scene = Scene::new(vec![moving, plane(Some(500.0), 2.0, 1.0)], [0.0; 3], 1.0).unwrap();
        assert!(scene.is_moving());
        assert_eq!(scene.radiance(&outwards(0.0), 0.0), [5.0; 3]);
        assert_eq!(scene.radiance(&outwards(0.0), 1.0), [2.0; 3]);
    }

    #[test]
    fn planes_that_are_not_in_front_of_the_lens_are_refused() {
        for distance in [0.0, -5.0, f64::NAN, f64::INFINITY] {
            let refused = Scene::new(vec![plane(Some(distance), 1.0, 1.0)], [0.0; 3], 1.0);
            assert!(refused.unwrap_err().to_string().contains("the distance of a plane"));
        }
        let empty = SceneLayer { half_size: [0.0, 1.0], ..plane(None, 1.0, 1.0) };
        assert!(Scene::new(vec![empty], [0.0; 3], 1.0).is_err());
        assert!(Scene::new(Vec::new(), [0.0; 3], 0.0).is_err());
        // A plane without light is a plane.
        assert!(Scene::new(vec![plane(None, 0.0, 1.0)], [0.0; 3], 1.0).is_ok());
    }
}
