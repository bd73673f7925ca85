//! Scenes made by code: test targets that fill the frame, and a still life lit by a candle.

use super::frame::filling_size;
use super::pattern::Pattern;
use super::scene::{Radiance, Scene, SceneLayer, check_distance};
use super::{ImageFrame, PictureError, Raster};
use crate::pupil::RayModel;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A scene that needs no file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BuiltInScene {
    /// A white card in every direction.
    White,
    /// Groups of bars (after USAF 1951).
    Target,
    /// A Siemens star.
    #[default]
    Star,
    /// A slanted edge of the contrast 4:1 (ISO 12233).
    Edge,
    /// Black and white squares.
    Checkerboard,
    /// Small lights on black, in rows and columns.
    Lights,
    /// A candle before a wall, with two balls at other distances.
    StillLife,
}

/// The number of lights along the height, and their radiance over that of white: a sharp image of one, some
/// 1.5 pixels of a coarse picture wide, is far brighter than white, and one that is spread over a hundred
/// times that area can still be seen.
const LIGHTS: f64 = 8.0;
const LIGHT: f64 = 100.0;

impl BuiltInScene {
    /// Every scene with its name.
    pub const ALL: [(Self, &'static str); 7] = [
        (Self::White, "white"),
        (Self::Target, "target"),
        (Self::Star, "star"),
        (Self::Edge, "edge"),
        (Self::Checkerboard, "checkerboard"),
        (Self::Lights, "lights"),
        (Self::StillLife, "still-life"),
    ];

    /// The name of the scene.
    pub fn name(self) -> &'static str {
        let entry = Self::ALL.iter().find(|(scene, _)| *scene == self);
        entry.map_or("", |(_, name)| name)
    }

    /// True for a scene with depth, which needs a distance.
    pub fn has_depth(self) -> bool {
        self == Self::StillLife
    }

    /// The painting of a scene with one plane; a white card is a plane of that colour.
    fn pattern(self) -> Option<Pattern> {
        Some(match self {
            Self::White => Pattern::Uniform { radiance: [1.0; 3], cover: 1.0 },
            Self::Target => Pattern::Bars,
            Self::Star => Pattern::Star(36.0),
            Self::Edge => Pattern::SlantedEdge,
            Self::Checkerboard => Pattern::Checkerboard(10.0),
            Self::Lights => Pattern::Lights { count: LIGHTS, radiance: LIGHT },
            Self::StillLife => return None,
        })
    }

    /// The painting of the scene of this name if it has one plane.
    pub(super) fn pattern_of(name: &str) -> Option<Pattern> {
        let entry = Self::ALL.iter().find(|(_, own)| *own == name);
        entry.and_then(|(scene, _)| scene.pattern())
    }

    /// The scene at a distance in mm, or at infinity, of the size that fills a frame.
    ///
    /// # Errors
    /// A lens without focal length, or a distance that is not in front of it.
    pub fn build(
        self,
        model: &RayModel,
        frame: &ImageFrame,
        distance: Option<f64>,
    ) -> Result<Scene, PictureError> {
        check_distance(distance)?;
        let half_size = filling_size(model, frame, distance)?;
        let pattern = match self.pattern() {
            Some(_) if self == Self::White => return Ok(Scene::uniform(1.0)),
            Some(pattern) => pattern,
            None => return still_life(half_size, distance),
        };
        let layer =
            SceneLayer { distance, center: [0.0; 2], half_size, velocity: [0.0; 2], pattern };
        Scene::new(vec![layer], [0.0; 3], 1.0)
    }
}

impl Scene {
    /// A picture at a distance in mm, or at infinity: as large as fits into a frame, before black.
    ///
    /// # Errors
    /// A lens without focal length, or a distance that is not in front of it.
    pub fn of_raster(
        raster: impl Into<Arc<Raster>>,
        model: &RayModel,
        frame: &ImageFrame,
        distance: Option<f64>,
    ) -> Result<Self, PictureError> {
        let raster = raster.into();
        let layer = SceneLayer {
            distance,
            center: [0.0; 2],
            half_size: fitted_size(model, frame, distance, Some(raster.aspect()))?,
            velocity: [0.0; 2],
            pattern: Pattern::Raster(raster),
        };
        Self::new(vec![layer], [0.0; 3], 1.0)
    }
}

/// The half width and half height of the largest plane of an aspect that fits into a frame; of the frame itself
/// without one.
pub(super) fn fitted_size(
    model: &RayModel,
    frame: &ImageFrame,
    distance: Option<f64>,
    aspect: Option<f64>,
) -> Result<[f64; 2], PictureError> {
    let [width, height] = filling_size(model, frame, distance)?;
    let Some(aspect) = aspect else { return Ok([width, height]) };
    let half_height = height.min(width / aspect);
    Ok([aspect * half_height, half_height])
}

/// The colour of a candle's light with the luminance 1.
const CANDLE: Radiance = [1.65, 0.87, 0.28];
/// The luminance of the flame, of the wall behind it and of white in the picture, in cd/m².
const FLAME: f64 = 1e4;
const WALL: f64 = 0.3;
const WHITE: f64 = 1.0;

/// A candle at a distance, an orange in front of it and an apple behind it, each left and right, and a
/// wall at one and a half of the distance that the candle lights. Sizes are shares of the frame.
fn still_life([width, height]: [f64; 2], distance: Option<f64>) -> Result<Scene, PictureError> {
    let lit = |level: f64, [red, green, blue]: Radiance| {
        [level * red * CANDLE[0], level * green * CANDLE[1], level * blue * CANDLE[2]]
    };
    let scale = |depth: f64| if distance.is_some() { depth } else { 1.0 };
    let layer =
        |depth: f64, [x, y]: [f64; 2], [across, along]: [f64; 2], pattern: Pattern| SceneLayer {
            distance: distance.map(|distance| depth * distance),
            center: [scale(depth) * x * width, scale(depth) * y * height],
            half_size: [scale(depth) * across * height, scale(depth) * along * height],
            velocity: [0.0; 2],
            pattern,
        };
    let orange = Pattern::Ball { radiance: lit(1.2, [1.0, 0.5, 0.1]), lit_from: [1.2, 0.8] };
    let apple = Pattern::Ball { radiance: lit(0.8, [0.3, 0.8, 0.2]), lit_from: [-1.2, 0.6] };
    let wax = Pattern::Uniform { radiance: lit(3.0, [1.0, 1.0, 0.9]), cover: 1.0 };
    let table = Pattern::Uniform { radiance: lit(0.15, [0.6, 0.4, 0.25]), cover: 1.0 };
    let wall = Pattern::LitWall {
        radiance: lit(WALL, [0.9, 0.85, 0.8]),
        light: [0.0, 0.2 * height],
        distance: 0.9 * height,
    };
    let endless = |layer: SceneLayer| SceneLayer { half_size: [1e9; 2], ..layer };
    let layers = vec![
        layer(0.9, [-0.5, -0.55], [0.3, 0.3], orange),
        layer(1.0, [0.0, 0.22], [0.045, 0.14], Pattern::Flame(lit(FLAME, [1.0; 3]))),
        layer(1.0, [0.0, -0.4], [0.07, 0.47], wax),
        layer(1.2, [0.55, -0.5], [0.35, 0.33], apple),
        layer(1.35, [0.0, -1.4], [9.0, 0.65], table),
        endless(layer(1.5, [0.0, 0.0], [1.0, 1.0], wall)),
    ];
    Scene::new(layers, [0.0; 3], WHITE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fruit_is_lit_by_the_candle_between() {
        for distance in [None, Some(2000.0)] {
            let scene = still_life([300.0, 200.0], distance).unwrap();
            let center_of = |is: fn(&Pattern) -> bool| {
                scene.layers().iter().filter(move |layer| is(&layer.pattern)).map(|l| l.center)
            };
            let candle = center_of(|p| matches!(p, Pattern::Flame(_))).next().unwrap();
            assert_eq!(candle[0], 0.0);
            let mut sides = Vec::new();
            for layer in scene.layers() {
                if let Pattern::Ball { lit_from: [across, along], .. } = layer.pattern {
                    let [x, y] = [0, 1].map(|k| candle[k] - layer.center[k]);
                    assert!(across * x > 0.0 && along * y > 0.0, "{:?}", layer.center);
                    assert!(x.abs() < 0.5 * 300.0 * 1.5 && x != 0.0, "within the frame");
                    sides.push(x.signum());
                }
            }
            assert_eq!(sides.iter().sum::<f64>(), 0.0, "one on either side");
            assert_eq!(sides.len(), 2);
        }
    }
}
