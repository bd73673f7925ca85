//! The slice itself: colours below, contours and rays above; the pointer reads it.

use std::sync::Arc;

use egui::{
    Align2, Color32, ColorImage, CursorIcon, Rect, Stroke, TextStyle, TextureHandle,
    TextureOptions, Ui, UiBuilder, pos2,
};
use glam::DVec2;

use super::{legend, text};
use crate::grin_design::RayPath;
use crate::math::Vec3;
use crate::session::{SessionView, Slice};
use crate::studio::cached::{ByAddress, Cached};
use crate::studio::draw::{BoundingBox, RenderBackend, Rgba, Scene, SceneResponse, SceneView};
use crate::studio::number;
use crate::studio::palette::{Palette, color32};

/// The smallest distance of two contour labels, in points.
const LABEL_SPACING: egui::Vec2 = egui::vec2(44.0, 16.0);
/// The margin around the whole slice and its rays, as a share of their size.
const MARGIN: f64 = 0.01;

/// The drawing of a slice.
#[derive(Debug)]
pub(super) struct SlicePicture {
    backend: RenderBackend,
    scene_view: SceneView,
    drawing: Cached<(ByAddress<Result<Slice, String>>, bool), SliceDrawing>,
}

/// The scene and the colours of a slice.
struct SliceDrawing {
    scene: Arc<Scene>,
    full_view: BoundingBox,
    colors: TextureHandle,
}

impl std::fmt::Debug for SliceDrawing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Drawing").field("whole", &self.full_view).finish_non_exhaustive()
    }
}

impl SlicePicture {
    pub(super) const fn new(backend: RenderBackend) -> Self {
        Self { backend, scene_view: SceneView::new("slice"), drawing: Cached::new() }
    }

    /// Shows the whole slice again.
    pub(super) const fn fit(&mut self) {
        self.scene_view.fit();
    }

    /// Shows a slice in all the room that is left; a click pins a place.
    pub(super) fn ui(
        &mut self,
        ui: &mut Ui,
        view: &SessionView,
        slice: &Slice,
        pinned: &mut Option<Vec3<f64>>,
    ) {
        let Some(source) = &view.grin.slice else { return };
        let dark = ui.visuals().dark_mode;
        let drawing = self.drawing.get((source.into(), dark), |_| SliceDrawing::new(ui, slice));
        legend::ray_legend(ui, slice);
        let all = ui.available_rect_before_wrap();
        let split = (all.right() - legend::WIDTH).max(all.left() + 1.0);
        let area = Rect::from_min_max(all.min, pos2(split, all.bottom()));
        ui.scope_builder(UiBuilder::new().max_rect(area), |ui| {
            let label = text::slice_name(slice);
            let drawn = (&drawing.scene, drawing.full_view);
            let below = |ui: &Ui, shown: &SceneResponse| drawing.paint_colors(ui, shown, slice);
            let shown = self.scene_view.show_over(ui, self.backend, drawn, &label, below);
            contour_labels(ui, &shown, slice);
            probe(ui, &shown, slice, pinned);
        });
        legend::color_bar(ui, Rect::from_min_max(pos2(split, all.top()), all.max), slice);
    }
}

impl SliceDrawing {
    fn new(ui: &Ui, slice: &Slice) -> Self {
        let dark = ui.visuals().dark_mode;
        let scene = scene(slice, &Palette::for_visuals(ui.visuals()), dark);
        let colors = ui.ctx().load_texture("slice", image(slice, dark), TextureOptions::LINEAR);
        let whole = full_view(slice);
        Self { scene: Arc::new(scene), full_view: whole, colors }
    }

    /// The colours of the cells, under the scene.
    fn paint_colors(&self, ui: &Ui, shown: &SceneResponse, slice: &Slice) {
        let painter = ui.painter_at(shown.response.rect);
        let ground = color32(Palette::for_visuals(ui.visuals()).background);
        painter.rect_filled(shown.response.rect, 0.0, ground);
        let [low, high] = slice.frame.map(|corner| shown.to_screen(DVec2::from(corner)));
        let all = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        let place = Rect::from_two_pos(low, high);
        painter.image(self.colors.id(), place, all, Color32::WHITE);
    }
}

/// The cells as pixels, rows from the top; air is clear.
fn image(slice: &Slice, dark: bool) -> ColorImage {
    let [width, height] = slice.size;
    let pixel = |n: usize| {
        let value = slice.values[(height - 1 - n / width) * width + n % width];
        if !value.is_finite() {
            return Color32::TRANSPARENT;
        }
        let [r, g, b] = legend::value_color(slice, value, dark);
        Color32::from_rgb(r, g, b)
    };
    ColorImage::new(slice.size, (0..width * height).map(pixel).collect())
}

/// The extent that *Fit* shows: the slice, and its rays from before they enter to their screens.
fn full_view(slice: &Slice) -> BoundingBox {
    let rays = slice
        .paths
        .iter()
        .flat_map(|bundle| &bundle.paths)
        .filter(|path| path.excluded().is_none());
    let ends = rays.flat_map(|path| path.points.first().into_iter().chain(path.points.last()));
    let ends = ends.map(|end| DVec2::from(slice.settings.plane.project(*end)));
    let corners = slice.frame.map(DVec2::from);
    let BoundingBox { min, max } = BoundingBox::around(corners.into_iter().chain(ends))
        .unwrap_or(BoundingBox { min: corners[0], max: corners[1] });
    let margin = MARGIN * (max - min);
    BoundingBox { min: min - margin, max: max + margin }
}

/// Contours, the boundary of the space, and rays.
fn scene(slice: &Slice, palette: &Palette, dark: bool) -> Scene {
    let mut scene = Scene::on([0; 4]);
    let line = |scene: &mut Scene, pieces: &[[[f64; 2]; 2]], width: f32, color: Rgba| {
        pieces.iter().for_each(|[a, b]| scene.line((*a).into(), (*b).into(), width, color));
    };
    for contour in &slice.contours {
        line(&mut scene, &contour.pieces, 1.0, legend::CONTOUR);
    }
    line(&mut scene, &slice.rim, 1.5, palette.outline);
    let [[left, low], [right, high]] = slice.frame;
    let corners = [[left, low], [right, low], [right, high], [left, high]].map(DVec2::from);
    scene.outline(&corners, 1.0, palette.faint);
    for bundle in &slice.paths {
        let colours =
            [legend::ray_color(bundle.view, dark), palette.lost_ray, legend::ray_outline(dark)];
        bundle.paths.iter().for_each(|path| draw_ray_path(&mut scene, slice, path, colours));
    }
    scene
}

/// A ray with a rim, legible on every colour; an excluded one in red to the dot where it ends.
fn draw_ray_path(scene: &mut Scene, slice: &Slice, path: &RayPath, [ray, lost, rim]: [Rgba; 3]) {
    let seen = |point: &Vec3<f64>| DVec2::from(slice.settings.plane.project(*point));
    let points: Vec<DVec2> = path.points.iter().map(seen).collect();
    let counts = path.excluded().is_none();
    let color = if counts { ray } else { lost };
    scene.polyline(&points, 2.8, rim);
    scene.polyline(&points, 1.3, color);
    if let Some(end) = points.last() {
        scene.dot(*end, if counts { 3.5 } else { 6.0 }, color);
    }
}

/// Labels each contour with its level, if there is room.
fn contour_labels(ui: &Ui, shown: &SceneResponse, slice: &Slice) {
    let rect = shown.response.rect;
    let painter = ui.painter_at(rect);
    let font = TextStyle::Small.resolve(ui.style());
    let mut taken: Vec<egui::Pos2> = Vec::new();
    for contour in &slice.contours {
        let middle = |[a, b]: &[[f64; 2]; 2]| 0.5 * (DVec2::from(*a) + DVec2::from(*b));
        let places = contour.pieces.iter().map(|piece| shown.to_screen(middle(piece)));
        let inside = places.filter(|at| rect.shrink(12.0).contains(*at));
        let free = inside.filter(|at| {
            taken.iter().all(|other| {
                let apart = (*at - *other).abs();
                apart.x > LABEL_SPACING.x || apart.y > LABEL_SPACING.y
            })
        });
        // Along the diagonal up to the right, so that the labels of circles stand in a row.
        let ahead = |at: &egui::Pos2| at.x - at.y;
        if let Some(at) = free.max_by(|a, b| ahead(a).total_cmp(&ahead(b))) {
            let level = rounded_level(contour.level, slice.spacing);
            let digits = number::digits_between(level, slice.spacing, 5);
            let text = number::format_digits(level, digits);
            let galley = painter.layout_no_wrap(text, font.clone(), Color32::WHITE);
            let place = Align2::CENTER_CENTER.anchor_size(at, galley.size());
            painter.rect_filled(place.expand2(egui::vec2(2.0, 0.0)), 2.0, legend::LABEL_BACKGROUND);
            painter.galley(place.min, galley, Color32::WHITE);
            taken.push(at);
        }
    }
}

/// A multiple of a spacing without the rounding of the product.
fn rounded_level(level: f64, spacing: f64) -> f64 {
    if level.abs() < 1e-6 * spacing { 0.0 } else { level }
}

/// Reads the field under the pointer; a click pins the place.
fn probe(ui: &Ui, shown: &SceneResponse, slice: &Slice, pinned: &mut Option<Vec3<f64>>) {
    let painter = ui.painter_at(shown.response.rect);
    let strong = Stroke::new(1.5, Color32::WHITE);
    if let Some(point) = *pinned {
        let at = shown.to_screen(slice.settings.plane.project(point).into());
        painter.circle(at, 4.5, legend::LABEL_BACKGROUND, strong);
    }
    let Some((at, _)) = shown.pointer() else { return };
    let point = slice.settings.plane.point(at.into());
    if shown.response.clone().on_hover_cursor(CursorIcon::Crosshair).clicked() {
        *pinned = Some(point);
    }
    let text = text::probe_text(&slice.document, &slice.field, point);
    let font = TextStyle::Small.resolve(ui.style());
    let galley = painter.layout_no_wrap(text, font, Color32::WHITE);
    let corner = shown.response.rect.right_bottom() - egui::vec2(8.0, 8.0);
    let place = Align2::RIGHT_BOTTOM.anchor_size(corner, galley.size());
    painter.rect_filled(place.expand(4.0), 3.0, legend::LABEL_BACKGROUND);
    painter.galley(place.min, galley, Color32::WHITE);
}
