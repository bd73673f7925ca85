//! The scene of a picture, and the lens focused on it.

use super::{CameraShot, GroupMotion, PictureArgs};
use crate::cli::error::CliError;
use crate::cli::input::LoadedLens;
use crate::files::{ColorImage, FileError, read_color};
use crate::lens::{Lens, Object};
use crate::picture::{
    BuiltInScene, Coloring, GroupFocus, ImageFrame, PictureError, Raster, Scene, SceneFile,
    SceneFileError, field_diagonal, focused, picture_model,
};
use crate::pupil::RayModel;
use std::path::Path;
use std::sync::Arc;

/// The distance in mm at which a scene with depth is placed and focused if none is given.
const NEAR: f64 = 1000.0;

/// A scene before it is placed in front of a lens.
pub(super) enum SceneSource {
    BuiltIn(BuiltInScene),
    Picture(Arc<Raster>),
    File(SceneFile),
}

impl PictureArgs {
    fn built_in(&self) -> Option<BuiltInScene> {
        BuiltInScene::ALL.iter().find(|(_, name)| *name == self.scene).map(|(scene, _)| *scene)
    }

    /// The file of the scene; `None` for a built-in one.
    pub(super) fn scene_path(&self) -> Option<&Path> {
        self.built_in().is_none().then_some(Path::new(&self.scene))
    }

    /// The scene with its file.
    pub(super) fn scene_source(&self) -> Result<SceneSource, CliError> {
        if let Some(scene) = self.built_in() {
            return Ok(SceneSource::BuiltIn(scene));
        }
        let path = Path::new(&self.scene);
        if !path.exists() {
            let names = BuiltInScene::ALL.map(|(_, name)| name).join(", ");
            let text = format!(
                "--scene: no scene or file `{}`; expected {names}, a PNG or JPEG file, or a JSON file of planes",
                self.scene
            );
            return Err(CliError::Input(text));
        }
        let is_json = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"));
        if !is_json {
            let image: ColorImage = read_color(path)?;
            return Ok(SceneSource::Picture(Arc::new(Raster::new(image))));
        }
        SceneFile::read(path).map(SceneSource::File).map_err(scene_error)
    }

    /// The lens as it is focused, the distance of the focus, `None` at infinity, and the way of a group.
    fn focused_lens(
        &self,
        opened: &LoadedLens,
        source: &SceneSource,
    ) -> Result<(Lens, Option<f64>, Option<GroupMotion>), PictureError> {
        let needs_depth = matches!(source, SceneSource::BuiltIn(scene) if scene.has_depth());
        let near = match opened.lens.object {
            Object::Infinity => needs_depth.then_some(NEAR),
            Object::Finite(_) => None,
        };
        match (self.focus.or(near), opened.lens.object) {
            (Some(distance), _) => match self.focus_group {
                Some(group) => {
                    let GroupFocus { lens, shift, distance, breathing } =
                        group.focus(&opened.lens, self.zoom, distance)?;
                    Ok((lens, Some(distance), Some(GroupMotion { shift, breathing })))
                }
                None => Ok((focused(&opened.lens, self.zoom, distance)?, Some(distance), None)),
            },
            (None, Object::Finite(distance)) => Ok((opened.lens.clone(), Some(distance), None)),
            (None, Object::Infinity) => Ok((opened.lens.clone(), None, None)),
        }
    }

    /// The lens with its sensor, and so many wavelengths for a colour, or one for all colours if that is 0.
    pub(super) fn shot(
        &self,
        opened: &LoadedLens,
        source: &SceneSource,
        wavelengths: usize,
    ) -> Result<CameraShot, PictureError> {
        let coloring = match wavelengths {
            _ if self.gray => Coloring::Gray,
            0 => Coloring::Primary,
            count => Coloring::Rgb(count),
        };
        let (lens, focus, group) = self.focused_lens(opened, source)?;
        let unfocused = RayModel::from_lens(&opened.lens, self.zoom)?;
        let diagonal = match (self.exposed.pitch_mm(), self.diagonal) {
            (Some(pitch), _) => pitch * (self.pixels[0] as f64).hypot(self.pixels[1] as f64),
            (None, Some(diagonal)) => diagonal,
            (None, None) => field_diagonal(&unfocused)?,
        };
        let (model, bands) = picture_model(&lens, self.zoom, coloring)?;
        let frame = ImageFrame::new(&model, self.pixels, diagonal)?;
        Ok(CameraShot { model, bands, frame, focus, distance: self.distance.or(focus), group })
    }

    /// The scene in front of a lens.
    pub(super) fn scene(
        &self,
        source: &SceneSource,
        shot: &CameraShot,
    ) -> Result<Scene, SceneFileError> {
        let CameraShot { model, frame, distance, .. } = shot;
        let scene = match source {
            SceneSource::BuiltIn(scene) => scene.build(model, frame, *distance)?,
            SceneSource::Picture(raster) => {
                Scene::of_raster(Arc::clone(raster), model, frame, *distance)?
            }
            SceneSource::File(file) => {
                let folder = Path::new(&self.scene).parent().unwrap_or(Path::new("."));
                file.build(model, frame, (*distance, folder))?
            }
        };
        Ok(scene)
    }

    /// The scene as wide as it is asked for.
    pub(super) fn sized(&self, scene: Scene) -> Result<Scene, CliError> {
        let Some(width) = self.size else { return Ok(scene) };
        scene.with_width(width).map_err(|error| CliError::Input(format!("--size: {error}")))
    }
}

/// The error of a scene file as one of the command line.
pub(super) fn scene_error(error: SceneFileError) -> CliError {
    match error {
        SceneFileError::File(error @ FileError::Malformed { .. }) => {
            CliError::Input(format!("{error}; expected an image, or a scene of planes in JSON"))
        }
        SceneFileError::File(error) => error.into(),
        other => CliError::Input(other.to_string()),
    }
}
