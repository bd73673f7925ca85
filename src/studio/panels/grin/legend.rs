//! The legend of a slice: a colour bar with numbers, and the rays of each view.

use egui::{Align2, Color32, Mesh, Rect, RichText, Role, Sense, Shape, TextStyle, Ui};
use egui::{WidgetInfo, pos2};

use super::text;
use crate::session::Slice;
use crate::studio::colormap;
use crate::studio::draw::Rgba;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};
use crate::studio::panels::widgets::swatch;

/// The room for the legend of the colours, and the width of its strip.
pub(super) const WIDTH: f32 = 76.0;
const STRIP: f32 = 14.0;
/// Even numbers at the strip, and its pieces.
const MARKS: usize = 5;
const PIECES: usize = 64;

/// Contours, and the background of labels: visible on every colour of a slice.
pub(super) const CONTOUR: Rgba = [0, 0, 0, 120];
pub(super) const LABEL_BACKGROUND: Color32 = Color32::from_black_alpha(150);

/// Rays of views in their order, on dark and on light, distinguishable for the colour-blind.
const BRIGHT_RAYS: [Rgba; 6] = [
    [255, 255, 255, 255],
    [255, 170, 60, 255],
    [120, 215, 255, 255],
    [255, 140, 200, 255],
    [170, 255, 150, 255],
    [255, 235, 130, 255],
];
const DARK_RAYS: [Rgba; 6] = [
    [20, 20, 20, 255],
    [190, 60, 0, 255],
    [0, 70, 190, 255],
    [150, 20, 110, 255],
    [0, 95, 60, 255],
    [110, 85, 0, 255],
];

/// The colour of the rays of a view.
pub(super) const fn ray_color(view: usize, dark: bool) -> Rgba {
    if dark { BRIGHT_RAYS[view % BRIGHT_RAYS.len()] } else { DARK_RAYS[view % DARK_RAYS.len()] }
}

/// The rim of a ray, by which it is seen on every colour of a slice.
pub(super) const fn ray_outline(dark: bool) -> Rgba {
    if dark { [0, 0, 0, 150] } else { [255, 255, 255, 170] }
}

/// The colour of a value of a slice.
pub(super) fn value_color(slice: &Slice, value: f64, dark: bool) -> [u8; 3] {
    let [low, high] = slice.range;
    if slice.settings.quantity.is_difference() {
        return colormap::diverging(if high > 0.0 { value / high } else { 0.0 }, dark);
    }
    colormap::sequential(if high > low { (value - low) / (high - low) } else { 0.5 })
}

/// The strip of colours with its numbers.
pub(super) fn color_bar(ui: &mut Ui, rect: Rect, slice: &Slice) {
    let response = ui.allocate_rect(rect, Sense::hover());
    let text = text::color_scale_text(slice);
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &text));
    response.on_hover_text(&text);
    let [low, high] = slice.range;
    let dark = ui.visuals().dark_mode;
    let top = rect.top() + 10.0;
    let strip = Rect::from_min_max(
        pos2(rect.left() + 6.0, top),
        pos2(rect.left() + 6.0 + STRIP, (rect.bottom() - 10.0).max(top + 1.0)),
    );
    let place = |share: f32| strip.bottom() - share * strip.height();
    let value = |share: f32| low + f64::from(share) * (high - low);
    let mut mesh = Mesh::default();
    for i in 0..PIECES {
        let [below, above] = [i, i + 1].map(|i| i as f32 / PIECES as f32);
        let [r, g, b] = value_color(slice, value(0.5 * (below + above)), dark);
        let piece =
            Rect::from_min_max(pos2(strip.left(), place(above)), pos2(strip.right(), place(below)));
        mesh.add_colored_rect(piece, Color32::from_rgb(r, g, b));
    }
    let painter = ui.painter();
    painter.add(Shape::mesh(mesh));
    let font = TextStyle::Small.resolve(ui.style());
    let marks = if high > low { MARKS } else { 1 };
    let step = (high - low) / (MARKS - 1) as f64;
    let digits = number::digits_between(low.abs().max(high.abs()), step, 4);
    for i in 0..marks {
        let share = if marks > 1 { i as f32 / (marks - 1) as f32 } else { 0.5 };
        let at = pos2(strip.right() + 4.0, place(share));
        let text = number::format_digits(value(share), digits);
        painter.text(at, Align2::LEFT_CENTER, text, font.clone(), ui.visuals().text_color());
    }
}

/// The views whose rays are drawn, how far they are off the slice, and those that do not count.
pub(super) fn ray_legend(ui: &mut Ui, slice: &Slice) {
    let visuals = ui.visuals();
    let (weak, error) = (visuals.weak_text_color(), visuals.error_fg_color);
    let (dark, lost) = (visuals.dark_mode, color32(Palette::for_visuals(visuals).lost_ray));
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        ui.label(RichText::new(text::slice_text(slice)).small().color(weak));
        let task = slice.document.task.as_ref();
        for bundle in slice.paths.iter().filter(|bundle| !bundle.paths.is_empty()) {
            let name = task.and_then(|task| task.views.get(bundle.view)).map(|view| &view.name);
            ui.add_space(4.0);
            swatch(ui, color32(ray_color(bundle.view, dark)));
            let text = text::rays_text(name.map_or("", String::as_str), bundle);
            ui.label(RichText::new(text).small()).on_hover_text(text::distance_text(bundle));
            if let Some(text) = text::excluded_text(bundle) {
                swatch(ui, lost);
                ui.label(RichText::new(text).small().color(lost)).on_hover_text(
                    "Excluded rays are drawn to their end, which is marked by a dot",
                );
            }
        }
        if let Some(why) = &slice.paths_error {
            ui.colored_label(error, why);
        }
    });
}
