//! The memory that the window has of the Picture panel from one start to the next: the scene and how it is taken.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::picture::BuiltInScene;
use crate::session::{AnalysisSettings, Command, PanelSetting, PictureOptions, SceneFile};

/// The scene of the picture and its options.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct StoredPicture {
    scene: BuiltInScene,
    /// The picture from a file that takes the place of that scene.
    file: Option<PathBuf>,
    options: PictureOptions,
}

impl StoredPicture {
    /// That of some settings.
    pub(super) fn of(settings: &AnalysisSettings) -> Self {
        let file = settings.scene_file.as_ref().map(|file| file.path().to_owned());
        Self { scene: settings.scene, file, options: settings.picture_options.clone() }
    }

    /// The commands that restore it. A file that cannot be read any more leaves the scene that needs none.
    pub(super) fn commands(self) -> Vec<Command> {
        let mut settings = vec![
            PanelSetting::Scene(self.scene),
            PanelSetting::PictureOptions(Box::new(self.options)),
        ];
        if let Some(path) = self.file {
            match SceneFile::read(&path) {
                Ok(file) => settings.push(PanelSetting::SceneFile(file)),
                Err(why) => log::warn!("the scene of the picture: {why}"),
            }
        }
        settings.into_iter().map(Command::Show).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::Canvas;
    use crate::session::Session;

    /// A picture that was dropped on the window is the scene after the next start, as long as its file is there.
    #[test]
    fn the_scene_and_its_options_outlive_the_window() {
        let path = std::env::temp_dir().join(format!("aplanat-scene-{}.png", std::process::id()));
        std::fs::write(&path, Canvas::new([8, 4]).png().unwrap()).unwrap();
        let options = PictureOptions { seconds: Some(0.5), exact: true, ..Default::default() };
        let scene_file = Some(SceneFile::read(&path).unwrap());
        let settings = AnalysisSettings {
            scene: BuiltInScene::White,
            scene_file,
            picture_options: options.clone(),
            ..AnalysisSettings::default()
        };
        let stored = serde_json::to_string(&StoredPicture::of(&settings)).unwrap();
        let restore = || {
            let stored: StoredPicture = serde_json::from_str(&stored).unwrap();
            let mut session = Session::new(crate::lens::blank(), || {}).unwrap();
            for command in stored.commands() {
                session.apply(command);
            }
            session.view().settings
        };
        let found = restore();
        assert_eq!(found.scene_file.map(|file| file.path().to_owned()), Some(path.clone()));
        assert_eq!((found.scene, found.picture_options), (BuiltInScene::White, options));
        std::fs::remove_file(&path).unwrap();
        assert_eq!(restore().scene_file, None);
    }
}
