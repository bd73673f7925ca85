//! The RMS spot radius over the whole field.

use egui::{
    Color32, ColorImage, RichText, Role, TextureHandle, TextureOptions, Ui, WidgetInfo, vec2,
};
use egui_plot::{PlotImage, PlotPoint};

use super::figure_view::export_menu;
use super::widgets::fixed_plot;
use super::{Panel, displayed_results, plain_error, show_missing_results};
use crate::analysis::{AnalysisError, Estimate, SpotMap};
use crate::lens::FieldKind;
use crate::report::FigureKind;
use crate::session::{SessionView, Timed};
use crate::studio::actions::Actions;
use crate::studio::cached::{ByAddress, Cached};
use crate::studio::colormap;
use crate::studio::number;

/// The lowest plot, in points.
const LOWEST: f32 = 120.0;
/// The size of the scale of colours, in points.
const SCALE: [f32; 2] = [120.0, 10.0];

/// The map and its picture.
type MapResult = Timed<Result<SpotMap, AnalysisError>>;

/// The panel.
#[derive(Default)]
pub struct SpotMapPanel {
    texture: Cached<ByAddress<MapResult>, Option<TextureHandle>>,
}

impl std::fmt::Debug for SpotMapPanel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SpotMapPanel").finish_non_exhaustive()
    }
}

impl Panel for SpotMapPanel {
    fn title(&self) -> &'static str {
        "Spot over the field"
    }

    fn ui(&mut self, ui: &mut Ui, view: &SessionView, actions: &mut Actions) {
        let Some((results, numbers)) = displayed_results(view) else {
            return show_missing_results(ui, view);
        };
        let Some(found) = &numbers.spot_map else {
            ui.weak("Computing …");
            return;
        };
        let map = match &found.value {
            Ok(map) => map,
            Err(why) => {
                ui.weak(format!("Nothing to show: {why}"));
                return;
            }
        };
        let Some(range) = range(map) else {
            ui.weak("No field has light");
            return;
        };
        summary(ui, map, (range, found.ms), actions);
        let context = ui.ctx().clone();
        let texture = self.texture.get(ByAddress::from(found), |_| {
            Some(context.load_texture("spot map", raster(map, range), TextureOptions::NEAREST))
        });
        let kind = results.lens.fields_at(results.settings.zoom).kind;
        if let Some(texture) = texture {
            plot(ui, map, texture, kind);
        }
    }
}

/// The fields with light.
fn spots(map: &SpotMap) -> impl Iterator<Item = &Estimate> {
    map.grid.values.iter().flatten().filter_map(|found| found.as_ref().ok())
}

/// The least and the largest radius in mm; `None` without light.
fn range(map: &SpotMap) -> Option<[f64; 2]> {
    let radii = spots(map).map(|spot| spot.value);
    radii.fold(None, |range, radius| {
        let [least, most] = range.unwrap_or([radius; 2]);
        Some([radius.min(least), radius.max(most)])
    })
}

/// The scale of colours, the error, the rays and the time.
fn summary(ui: &mut Ui, map: &SpotMap, (range, ms): ([f64; 2], f64), actions: &mut Actions) {
    ui.horizontal_wrapped(|ui| {
        export_menu(ui, FigureKind::SpotMap, actions);
        let [least, most] = range.map(|radius| number::format_digits(1e3 * radius, 4));
        ui.label(least);
        let (rect, _) = ui.allocate_exact_size(vec2(SCALE[0], SCALE[1]), egui::Sense::hover());
        let steps = SCALE[0] as usize;
        for i in 0..steps {
            let share = i as f64 / (steps - 1) as f64;
            let left = rect.left_top() + vec2(i as f32, 0.0);
            let stripe = egui::Rect::from_min_size(left, vec2(1.5, SCALE[1]));
            ui.painter().rect_filled(stripe, 0.0, color(share));
        }
        ui.label(format!("{most} µm"));
        let error = spots(map).map(|spot| spot.error / spot.value).fold(0.0, f64::max);
        let error = plain_error(100.0 * error, " %");
        let text = format!("RMS radius, {error}, {} rays, {ms:.0} ms", map.rays);
        ui.label(RichText::new(text).small().weak());
    });
}

fn color(share: f64) -> Color32 {
    let [r, g, b] = colormap::sequential(share);
    Color32::from_rgb(r, g, b)
}

/// The pixels of the map, the highest row first.
fn raster(map: &SpotMap, [least, most]: [f64; 2]) -> ColorImage {
    let count = map.grid.count;
    let span = if most > least { most - least } else { 1.0 };
    let pixel = |n: usize| match &map.grid.values[(count - 1 - n / count) * count + n % count] {
        Some(Ok(spot)) => color((spot.value - least) / span),
        Some(Err(_)) => Color32::BLACK,
        None => Color32::TRANSPARENT,
    };
    ColorImage::new([count, count], (0..count * count).map(pixel).collect())
}

fn plot(ui: &mut Ui, map: &SpotMap, texture: &TextureHandle, kind: FieldKind) {
    let unit = match kind {
        FieldKind::Angle => "degrees",
        FieldKind::ObjectHeight => "mm in the object",
        FieldKind::ImageHeight => "mm in the image",
    };
    let height = (ui.available_height() - 4.0).max(LOWEST);
    let plot = fixed_plot(ui, "spot map", height).data_aspect(1.0);
    let [x, y] = ["x", "y"].map(|axis| format!("field {axis}, {unit}"));
    let plot = plot.x_axis_label(x).y_axis_label(y);
    // A pixel has its field in the middle.
    let width = 2.0 * map.grid.half_width * map.grid.count as f64 / (map.grid.count - 1) as f64;
    let size = vec2(width as f32, width as f32);
    let shown = plot.show(ui, |plot| {
        let image = PlotImage::new("spot map", texture.id(), PlotPoint::new(0.0, 0.0), size);
        plot.image(image);
        plot.pointer_coordinate()
    });
    let words = "RMS spot radius over the field";
    let response = shown.response;
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, words));
    if let Some((field, text)) = shown.inner.and_then(|at| under_pointer(map, at)) {
        response.on_hover_text(format!("{} {unit}: {text}", field_text(field)));
    }
}

fn field_text([x, y]: [f64; 2]) -> String {
    format!("{}, {}", number::format_digits(x, 4), number::format_digits(y, 4))
}

/// The field under the pointer with its spot.
fn under_pointer(map: &SpotMap, at: PlotPoint) -> Option<([f64; 2], String)> {
    let half = (map.grid.count / 2) as f64;
    let step = map.grid.half_width / half;
    let [column, row] = [at.x, at.y].map(|v| (v / step).round() + half);
    let is_inside = |i: f64| i >= 0.0 && i < map.grid.count as f64;
    if !(is_inside(column) && is_inside(row)) {
        return None;
    }
    let field = [column, row].map(|i| (i - half) * step);
    let text = match map.grid.values[row as usize * map.grid.count + column as usize].as_ref()? {
        Ok(spot) => format!("{} µm", number::with_error(1e3 * spot.value, 1e3 * spot.error)),
        Err(why) => why.to_string(),
    };
    Some((field, text))
}
