//! The scene of the picture that the window shows: one made by code, or a picture from a file, which is
//! read once and shared from then on.

use crate::files::{FileError, read_color};
use crate::picture::{BuiltInScene, ImageFrame, PictureError, Raster, Scene};
use crate::pupil::RayModel;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A picture from a file as a scene.
#[derive(Debug, Clone)]
pub struct SceneFile {
    path: PathBuf,
    raster: Arc<Raster>,
}

/// The same reading of the same file.
impl PartialEq for SceneFile {
    fn eq(&self, other: &Self) -> bool {
        self.path == other.path && Arc::ptr_eq(&self.raster, &other.raster)
    }
}

impl SceneFile {
    /// Reads a PNG or JPEG file.
    ///
    /// # Errors
    /// A file that cannot be read or is not an image.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let raster = Arc::new(Raster::new(read_color(path)?));
        Ok(Self { path: path.to_owned(), raster })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The name of the file.
    pub fn name(&self) -> String {
        self.path.file_name().unwrap_or(self.path.as_os_str()).to_string_lossy().into_owned()
    }
}

/// A scene of the window.
#[derive(Debug, Clone, PartialEq)]
pub enum PictureScene {
    /// One that needs no file.
    BuiltIn(BuiltInScene),
    /// A picture from a file.
    File(SceneFile),
}

impl PictureScene {
    /// The name of the scene, or of its file.
    pub fn name(&self) -> String {
        match self {
            Self::BuiltIn(scene) => scene.name().to_owned(),
            Self::File(file) => file.name(),
        }
    }

    /// The scene that needs no file; `None` for a picture from one.
    pub const fn built_in(&self) -> Option<BuiltInScene> {
        match self {
            Self::BuiltIn(scene) => Some(*scene),
            Self::File(_) => None,
        }
    }

    /// True for a scene with depth, which needs a distance.
    pub(super) fn has_depth(&self) -> bool {
        matches!(self, Self::BuiltIn(scene) if scene.has_depth())
    }

    /// The scene at a distance in mm, or at infinity, of the size that fits a frame.
    ///
    /// # Errors
    /// A lens without focal length, or a distance that is not in front of it.
    pub(super) fn build(
        &self,
        model: &RayModel,
        frame: &ImageFrame,
        distance: Option<f64>,
    ) -> Result<Scene, PictureError> {
        match self {
            Self::BuiltIn(scene) => scene.build(model, frame, distance),
            Self::File(file) => Scene::of_raster(Arc::clone(&file.raster), model, frame, distance),
        }
    }
}
