//! A scene from a JSON file: planes at distances, each with a picture or a built-in pattern.
//!
//! ```json
//! {"white": 200, "background": 10, "planes": [
//!   {"pattern": "star", "distance": 800, "size": [120, 80], "center": [10, 0], "alpha": 0.5},
//!   {"picture": "wall.png", "distance": 2000, "luminance": 100, "velocity": [50, 0]}]}
//! ```
//! Distances are from the first surface in mm, `null` at infinity, where sizes, places and velocities are
//! tangents of directions instead of mm. Luminances are in cd/m2.

use super::built_in::fitted_size;
use super::pattern::Pattern;
use super::scene::{Scene, SceneLayer};
use super::{BuiltInScene, ImageFrame, PictureError, Raster};
use crate::files::json::read_json;
use crate::files::{ColorImage, FileError, MAX_DATA_BYTES, read_color, read_file};
use crate::pupil::RayModel;
use serde::{Deserialize, Deserializer};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A scene as its file has it.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// The luminance in cd/m² that a picture shows as white.
    #[serde(default = "usual_white")]
    pub white: f64,
    /// The luminance in cd/m² in every direction without a plane.
    #[serde(default)]
    pub background: f64,
    /// The planes, in any order; of two at the same distance the first one is in front.
    pub planes: Vec<PlaneEntry>,
}

/// A plane of a scene as its file has it.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaneEntry {
    /// The distance in front of the first surface in mm; absent: that of the focus.
    #[serde(default, deserialize_with = "distance_entry")]
    pub distance: PlaneDistance,
    /// A picture file, beside the file of the scene.
    pub picture: Option<PathBuf>,
    /// The name of a built-in scene with one plane.
    pub pattern: Option<String>,
    /// Width and height; absent: what fills the frame.
    pub size: Option<[f64; 2]>,
    /// The middle, to the right and upwards.
    #[serde(default)]
    pub center: [f64; 2],
    /// The velocity to the right and upwards, per second.
    #[serde(default)]
    pub velocity: [f64; 2],
    /// The luminance of its white in cd/m²; absent: the white of the scene.
    pub luminance: Option<f64>,
    /// The share of what is behind that it covers, besides the cover of its picture.
    #[serde(default = "one")]
    pub alpha: f64,
}

/// The distance of a plane of a file.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum PlaneDistance {
    /// That of the focus.
    #[default]
    Focus,
    /// At infinity.
    Infinity,
    /// In mm in front of the first surface.
    At(f64),
}

/// A distance in JSON: a number, or null at infinity.
fn distance_entry<'de, D: Deserializer<'de>>(deserializer: D) -> Result<PlaneDistance, D::Error> {
    let found = Option::<f64>::deserialize(deserializer)?;
    Ok(found.map_or(PlaneDistance::Infinity, PlaneDistance::At))
}

fn usual_white() -> f64 {
    100.0
}

fn one() -> f64 {
    1.0
}

/// The error of a scene file.
#[derive(Debug, thiserror::Error)]
pub enum SceneFileError {
    /// A file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A number or a name has no meaning.
    #[error("{file}: {place}: found {found}; expected {expected}")]
    Entry {
        /// The file of the scene.
        file: String,
        /// The entry.
        place: String,
        /// The wrong value.
        found: String,
        /// The accepted values.
        expected: String,
    },
    /// The scene cannot be seen through the lens.
    #[error(transparent)]
    Picture(#[from] PictureError),
}

impl SceneFile {
    /// Reads a file.
    ///
    /// # Errors
    /// A file that cannot be read, or is no such scene.
    pub fn read(path: &Path) -> Result<Self, SceneFileError> {
        let file = path.display().to_string();
        let bytes = read_file(path, MAX_DATA_BYTES)?;
        let text = String::from_utf8_lossy(&bytes);
        let scene: Self = read_json(&text, &file)?;
        scene.check(&file)?;
        Ok(scene)
    }

    fn check(&self, file: &str) -> Result<(), SceneFileError> {
        let refuse = |place: String, found: String, expected: &str| {
            let (file, expected) = (file.to_owned(), expected.to_owned());
            Err(SceneFileError::Entry { file, place, found, expected })
        };
        let not_negative = |v: f64| v >= 0.0 && v.is_finite();
        if !(self.white > 0.0 && self.white.is_finite()) {
            return refuse(
                "white".to_owned(),
                self.white.to_string(),
                "a positive number of cd/m2",
            );
        }
        if !not_negative(self.background) {
            let found = self.background.to_string();
            return refuse("background".to_owned(), found, "0 cd/m2 or more");
        }
        for (i, plane) in self.planes.iter().enumerate() {
            let at = |name: &str| format!("planes[{i}].{name}");
            if !(0.0..=1.0).contains(&plane.alpha) {
                return refuse(at("alpha"), plane.alpha.to_string(), "from 0 to 1");
            }
            if let Some(wrong) = plane.luminance.filter(|v| !not_negative(*v)) {
                return refuse(at("luminance"), wrong.to_string(), "0 cd/m2 or more");
            }
            match (&plane.picture, &plane.pattern) {
                (Some(_), None) => {}
                (None, Some(name)) if BuiltInScene::pattern_of(name).is_some() => {}
                (None, Some(name)) => {
                    let names = BuiltInScene::ALL.map(|(_, name)| name);
                    let names: Vec<_> = names
                        .into_iter()
                        .filter(|name| BuiltInScene::pattern_of(name).is_some())
                        .collect();
                    return refuse(at("pattern"), format!("`{name}`"), &names.join(", "));
                }
                (both, _) => {
                    let found = if both.is_some() { "both" } else { "neither" };
                    return refuse(format!("planes[{i}]"), found.to_owned(), "picture or pattern");
                }
            }
        }
        Ok(())
    }

    /// True if something moves.
    pub fn is_moving(&self) -> bool {
        self.planes.iter().any(|plane| plane.velocity != [0.0; 2])
    }

    /// The scene for a lens and a frame, focused at a distance in mm or at infinity; pictures are looked for in
    /// a folder.
    ///
    /// # Errors
    /// A picture that cannot be read, or a plane that is not in front of the lens.
    pub fn build(
        &self,
        model: &RayModel,
        frame: &ImageFrame,
        (focus, folder): (Option<f64>, &Path),
    ) -> Result<Scene, SceneFileError> {
        let layer = |plane: &PlaneEntry| plane.layer(self.white, model, frame, (focus, folder));
        let layers = self.planes.iter().map(layer).collect::<Result<Vec<_>, _>>()?;
        Ok(Scene::new(layers, [self.background / self.white; 3], 1.0)?)
    }
}

impl PlaneEntry {
    fn layer(
        &self,
        white: f64,
        model: &RayModel,
        frame: &ImageFrame,
        (focus, folder): (Option<f64>, &Path),
    ) -> Result<SceneLayer, SceneFileError> {
        let distance = match self.distance {
            PlaneDistance::Focus => focus,
            PlaneDistance::Infinity => None,
            PlaneDistance::At(distance) => Some(distance),
        };
        let picture: Option<ColorImage> =
            self.picture.as_ref().map(|path| read_color(&folder.join(path))).transpose()?;
        let aspect = picture.as_ref().map(|image| image.width as f64 / image.height as f64);
        let half_size = match self.size {
            Some(size) => size.map(|side| 0.5 * side),
            None => fitted_size(model, frame, distance, aspect)?,
        };
        let pattern = if let Some(image) = picture {
            Pattern::Raster(Arc::new(Raster::new(image)))
        } else {
            let named = self.pattern.as_deref().and_then(BuiltInScene::pattern_of);
            named.unwrap_or(Pattern::Uniform { radiance: [1.0; 3], cover: 1.0 })
        };
        let level = self.luminance.unwrap_or(white) / white;
        let pattern = if level == 1.0 && self.alpha == 1.0 {
            pattern
        } else {
            Pattern::Veiled { pattern: Arc::new(pattern), level, cover: self.alpha }
        };
        let (center, velocity) = (self.center, self.velocity);
        Ok(SceneLayer { distance, center, half_size, velocity, pattern })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &str) -> String {
        let scene: Result<SceneFile, _> = serde_json::from_str(text);
        scene.map_or_else(
            |error| error.to_string(),
            |scene| scene.check("s.json").unwrap_err().to_string(),
        )
    }

    #[test]
    fn wrong_scenes_are_refused_by_name() {
        for (text, words) in [
            (r#"{"planes": [{"pattern": "moon"}]}"#, "planes[0].pattern: found `moon`"),
            (r#"{"planes": [{}]}"#, "planes[0]: found neither"),
            (r#"{"planes": [{"pattern": "star", "picture": "a.png"}]}"#, "found both"),
            (r#"{"planes": [{"pattern": "star", "alpha": 2}]}"#, "planes[0].alpha: found 2"),
            (r#"{"planes": [{"pattern": "star", "luminance": -1}]}"#, "luminance: found -1"),
            (r#"{"white": 0, "planes": []}"#, "white: found 0"),
            (r#"{"background": -3, "planes": []}"#, "background: found -3"),
            (r#"{"planes": [{"pattern": "star", "colour": 2}]}"#, "colour"),
        ] {
            let found = refused(text);
            assert!(found.contains(words), "{text}: {found}");
        }
        let text = r#"{"planes": [{"pattern": "star"}, {"pattern": "edge", "distance": null}]}"#;
        let scene: SceneFile = serde_json::from_str(text).unwrap();
        let distances: Vec<_> = scene.planes.iter().map(|plane| plane.distance).collect();
        assert_eq!(distances, [PlaneDistance::Focus, PlaneDistance::Infinity]);
        assert_eq!((scene.white, scene.is_moving()), (100.0, false));
    }
}
