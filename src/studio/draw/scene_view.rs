//! A scene that can be navigated: drag to move, wheel or plus and minus to zoom, double click, Home or
//! *Fit* to see it all, with a scale bar.

use std::sync::Arc;

use egui::{
    Align2, CornerRadius, Event, Key, MouseWheelUnit, Rect, Response, Sense, Stroke, StrokeKind,
    Ui, WidgetInfo,
};
use glam::DVec2;

use super::{BoundingBox, Camera, RenderBackend, Scene, SceneCanvas, round_length_below};

/// Free room around a fitted scene.
const MARGIN: f64 = 24.0; // points
/// The largest length of the scale bar: a share of the width, and a number of points.
const BAR: (f32, f32) = (0.25, 160.0); // share, points
/// The magnification for one notch of the wheel.
const NOTCH: f64 = 1.2;

/// A navigable scene in a panel; it keeps its camera.
#[derive(Debug)]
pub struct SceneView {
    canvas: SceneCanvas,
    /// The camera that the user has chosen; `None` while the whole scene is shown.
    user_camera: Option<Camera>,
    /// The camera of the last frame.
    last_camera: Option<Camera>,
    /// The camera that stays while something in the scene is moved.
    held_camera: Option<Camera>,
}

impl SceneView {
    /// A stage; no two of one window share a name.
    pub const fn new(name: &'static str) -> Self {
        Self {
            canvas: SceneCanvas::new(name),
            user_camera: None,
            last_camera: None,
            held_camera: None,
        }
    }

    /// Holds the camera where it is, or lets it follow the scene again.
    pub fn hold(&mut self, holds: bool) {
        self.held_camera = if holds { self.held_camera.or(self.last_camera) } else { None };
    }

    /// Shows the whole scene again.
    pub const fn fit(&mut self) {
        self.user_camera = None;
    }

    /// Shows a scene in all the room that is left. `whole` is the extent that *Fit* shows.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        backend: RenderBackend,
        scene: &Arc<Scene>,
        whole: BoundingBox,
        label: &str,
    ) -> SceneResponse {
        self.show_over(ui, backend, (scene, whole), label, |_, _| {})
    }

    /// Shows a scene over something else: `below` paints under the scene, which has no background
    /// of its own.
    pub fn show_over(
        &mut self,
        ui: &mut Ui,
        backend: RenderBackend,
        (scene, whole): (&Arc<Scene>, BoundingBox),
        label: &str,
        below: impl FnOnce(&Ui, &SceneResponse),
    ) -> SceneResponse {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        response.widget_info(|| WidgetInfo::labeled(egui::Role::Image, true, label));
        let per_point = f64::from(ui.ctx().pixels_per_point());
        let size = per_point * DVec2::new(rect.width().into(), rect.height().into());
        let fitted = Camera::fit(whole, size, MARGIN * per_point);
        let camera = match self.held_camera {
            Some(camera) => camera,
            None => self.navigate(ui, &response, fitted, size, per_point),
        };
        self.last_camera = Some(camera);
        let shown = SceneResponse { response, camera, per_point };
        below(ui, &shown);
        self.canvas.show(ui, rect, backend, scene, camera);
        // The camera counts real pixels, the bar points.
        scale_bar(ui, rect, camera.scale / per_point);
        if shown.response.has_focus() {
            let stroke = ui.visuals().selection.stroke;
            ui.painter().rect_stroke(rect, CornerRadius::ZERO, stroke, StrokeKind::Inside);
        }
        shown
    }

    fn navigate(
        &mut self,
        ui: &Ui,
        response: &Response,
        fitted: Camera,
        size: DVec2,
        per_point: f64,
    ) -> Camera {
        let has_keyboard = response.has_focus();
        if response.double_clicked() || has_keyboard && ui.input(|i| i.key_pressed(Key::Home)) {
            self.fit();
        }
        let mut camera = self.user_camera.unwrap_or(fitted);
        if response.dragged() {
            camera = camera.dragged(per_point * to_dvec(response.drag_delta()));
        }
        if let Some(pointer) = pointer_over(response) {
            let factor = zoom_factor(ui);
            if factor != 1.0 {
                let px = per_point * to_dvec(pointer - response.rect.min);
                camera = camera.zoomed(factor, px, size);
            }
        }
        let factor = if has_keyboard { zoom_by_keys(ui) } else { 1.0 };
        if factor != 1.0 {
            camera = camera.zoomed(factor, 0.5 * size, size);
        }
        if camera != self.user_camera.unwrap_or(fitted) {
            self.user_camera = Some(camera);
        }
        camera
    }
}

/// A scene as it is shown.
#[derive(Debug)]
pub struct SceneResponse {
    /// The area of the scene in the window.
    pub response: Response,
    camera: Camera,
    per_point: f64,
}

impl SceneResponse {
    fn size(&self) -> DVec2 {
        self.per_point * to_dvec(self.response.rect.size())
    }

    /// The point of the plane under the pointer, and how long a point of the screen is there.
    pub fn pointer(&self) -> Option<(DVec2, f64)> {
        let at = pointer_over(&self.response)?;
        let px = self.per_point * to_dvec(at - self.response.rect.min);
        Some((self.camera.to_mm(px, self.size()), self.per_point / self.camera.scale))
    }

    /// The length of a point of the screen in the plane, in mm.
    pub fn mm_per_point(&self) -> f64 {
        self.per_point / self.camera.scale
    }

    /// The place on the screen of a point of the plane.
    pub fn to_screen(&self, mm: DVec2) -> egui::Pos2 {
        let px = self.camera.to_px(mm, self.size()) / self.per_point;
        #[expect(clippy::cast_possible_truncation, reason = "a place on the screen")]
        let offset = egui::vec2(px.x as f32, px.y as f32);
        self.response.rect.min + offset
    }
}

/// The pointer over a scene, also where something lies on the scene.
fn pointer_over(response: &Response) -> Option<egui::Pos2> {
    let pointer = response.ctx.input(|input| input.pointer.hover_pos());
    pointer.filter(|_| response.contains_pointer())
}

fn to_dvec(v: egui::Vec2) -> DVec2 {
    DVec2::new(v.x.into(), v.y.into())
}

/// By how much the keys plus and minus bring the scene nearer.
fn zoom_by_keys(ui: &Ui) -> f64 {
    ui.input(|input| {
        input.events.iter().fold(1.0, |factor, event| match event {
            Event::Text(text) if text == "+" => factor * NOTCH,
            Event::Text(text) if text == "-" => factor / NOTCH,
            _ => factor,
        })
    })
}

/// By how much the wheel or two fingers bring the scene nearer.
///
/// The events themselves are read: the smoothed ones would draw the scene ten times for a notch.
pub(in crate::studio) fn zoom_factor(ui: &Ui) -> f64 {
    ui.input(|input| {
        input.events.iter().fold(1.0, |factor, event| match event {
            Event::Zoom(nearer) => factor * f64::from(*nearer),
            Event::MouseWheel { unit, delta, .. } => {
                let notches = match unit {
                    MouseWheelUnit::Point => delta.y / 50.0,
                    MouseWheelUnit::Line => delta.y,
                    MouseWheelUnit::Page => 4.0 * delta.y,
                };
                factor * NOTCH.powf(notches.into())
            }
            _ => factor,
        })
    })
}

/// Draws a scale bar of a round length with its label. `scale` is in points per mm.
fn scale_bar(ui: &Ui, rect: Rect, scale: f64) {
    let available = (BAR.0 * rect.width()).min(BAR.1);
    let length = round_length_below(f64::from(available) / scale);
    #[expect(clippy::cast_possible_truncation, reason = "at most 160 points")]
    let width = (length * scale) as f32;
    let left = rect.left_bottom() + egui::vec2(10.0, -10.0);
    let color = ui.visuals().strong_text_color();
    let bar = Rect::from_min_size(left - egui::vec2(0.0, 3.0), egui::vec2(width, 3.0));
    ui.painter().rect(bar, CornerRadius::ZERO, color, Stroke::NONE, StrokeKind::Inside);
    let font = egui::TextStyle::Body.resolve(ui.style());
    let above = bar.left_top() - egui::vec2(0.0, 2.0);
    ui.painter().text(above, Align2::LEFT_BOTTOM, length_text(length), font, color);
}

/// A round length in the unit in which it is easiest to read.
pub fn length_text(mm: f64) -> String {
    if mm >= 1000.0 {
        format!("{} m", mm / 1000.0)
    } else if mm >= 1.0 {
        format!("{mm} mm")
    } else {
        // A round length below a millimetre is a whole or tenth number of micrometres.
        format!("{} µm", (mm * 1e5).round() / 100.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_in_readable_units() {
        let cases = [
            (0.00002, "0.02 µm"),
            (0.05, "50 µm"),
            (2.0, "2 mm"),
            (500.0, "500 mm"),
            (2000.0, "2 m"),
        ];
        for (mm, text) in cases {
            assert_eq!(length_text(mm), text);
        }
    }
}
