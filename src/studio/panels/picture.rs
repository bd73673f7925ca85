//! A scene seen through the lens: coarse while the lens changes, finer when it is still.

use std::sync::Arc;

use egui::{ComboBox, RichText, TextureHandle, TextureOptions, Ui, Vec2, WidgetInfo};

use super::{Panel, displayed_results, show_missing_results};
use crate::picture::{BitDepth, BuiltInScene};
use crate::session::{Command, PanelSetting, ScenePicture, SessionView, Timed};
use crate::studio::actions::Actions;
use crate::studio::cached::{ByAddress, Cached};
use crate::studio::file_dialog::FileRequest;

type ShownPicture = Timed<Result<ScenePicture, String>>;

/// The panel.
#[derive(Default)]
pub struct PicturePanel {
    texture: Cached<ByAddress<ShownPicture>, TextureHandle>,
}

impl std::fmt::Debug for PicturePanel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PicturePanel").finish_non_exhaustive()
    }
}

impl Panel for PicturePanel {
    fn title(&self) -> &'static str {
        "Picture"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Some((_, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        ui.horizontal(|ui| {
            choose_scene(ui, view, actions);
            if let Some(shown) = &numbers.picture
                && shown.value.is_ok()
                && ui.button("Save …").on_hover_text("Saves the picture as PNG").clicked()
            {
                actions.push(FileRequest::SavePicture);
            }
        });
        let Some(shown) = &numbers.picture else {
            ui.weak("Computing …");
            return;
        };
        match &shown.value {
            Ok(picture) => {
                facts(ui, picture, shown.ms);
                self.show(ui, shown, picture);
            }
            Err(why) => {
                ui.label(RichText::new(why).color(ui.visuals().warn_fg_color));
            }
        }
    }
}

impl PicturePanel {
    fn show(&mut self, ui: &mut Ui, shown: &Arc<ShownPicture>, picture: &ScenePicture) {
        let [width, height] = picture.picture.frame.pixels;
        let texture = self.texture.get(ByAddress::from(shown), |_| {
            let bytes = picture.picture.srgb_bytes(BitDepth::Eight);
            let image = egui::ColorImage::from_rgb([width, height], &bytes);
            ui.ctx().load_texture("picture", image, TextureOptions::LINEAR)
        });
        let room = ui.available_size();
        let scale = (room.x / width as f32).min(room.y / height as f32).max(0.1);
        let size = Vec2::new(width as f32, height as f32) * scale;
        let response = ui.image((texture.id(), size));
        let label = format!("Picture of {} through the lens", picture.scene.name());
        response.widget_info(|| WidgetInfo::labeled(egui::Role::Image, true, &label));
    }
}

fn choose_scene(ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
    let chosen = view.settings.scene;
    ComboBox::from_id_salt("scene").selected_text(chosen.name()).show_ui(ui, |ui| {
        for (scene, name) in BuiltInScene::ALL {
            if ui.selectable_label(chosen == scene, name).clicked() {
                actions.push(Command::Show(PanelSetting::Scene(scene)));
            }
        }
    });
}

/// Pixels, error, focus and time.
fn facts(ui: &mut Ui, picture: &ScenePicture, ms: f64) {
    let [width, height] = picture.picture.frame.pixels;
    let focus = picture.focus.map_or("infinity".to_owned(), |mm| format!("{mm:.0} mm"));
    let error = picture
        .error
        .map_or("coarse".to_owned(), |error| format!("± {:.1} % of mid grey", 100.0 * error.value));
    let text = format!("{width} x {height}, {error}, focus at {focus}, {ms:.0} ms");
    let hover = "The error is measured against rays from every pixel, on some tiles. Diffraction, losses \
                 and ghosts are left out";
    ui.label(RichText::new(text).small().weak()).on_hover_text(hover);
}
