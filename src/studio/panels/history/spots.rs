//! The spots of two versions beside each other, all to one scale.

use egui::{
    Align2, Color32, Label, Painter, Rect, RichText, Role, Sense, TextStyle, Ui, WidgetInfo, pos2,
    vec2,
};

use crate::analysis::Spot;
use crate::session::{Analyses, AnalysisResults};
use crate::studio::number;
use crate::studio::palette::{Palette, color32};
use crate::studio::panels::field_name;
use crate::studio::panels::spot::half_width;

/// The side of a picture, in points.
const SIDE: f32 = 84.0;
/// The width of the names of the fields.
const NAMES: f32 = 58.0;
/// The height of the names of the versions.
const HEADING: f32 = 18.0;
/// The radius of a dot.
const DOT: f32 = 1.0;

/// A lens with its numbers.
type Shown<'a> = (&'a AnalysisResults, &'a Analyses);

/// Shows a row for every field: the present version, then the other one.
pub(super) fn beside_each_other(ui: &mut Ui, present: Shown<'_>, selected: Shown<'_>) {
    let half = half_width(present.1).max(half_width(selected.1));
    let rows = present.1.spots.value.len().max(selected.1.spots.value.len());
    ui.add_space(4.0);
    let width = 2000.0 * half;
    let width = number::format_digits(width, 3);
    ui.weak(format!("Spots with their RMS radius, each picture {width} µm wide"));
    ui.horizontal(|ui| {
        for (text, width) in [("", NAMES), ("present", SIDE), ("this one", SIDE)] {
            ui.add_sized([width, HEADING], Label::new(RichText::new(text).weak()));
        }
    });
    for field in 0..rows {
        ui.horizontal(|ui| {
            let fields = present.0.lens.fields_at(present.0.settings.zoom);
            let name = fields.values.get(field).map(|point| field_name(fields.kind, *point));
            let name = RichText::new(name.unwrap_or_default()).weak();
            ui.add_sized([NAMES, SIDE], Label::new(name));
            for (shown, which) in [(present, "present"), (selected, "selected")] {
                picture(ui, shown.1, (field, half), which);
            }
        });
    }
}

/// The spot of a field about its centroid.
fn picture(ui: &mut Ui, numbers: &Analyses, (field, half): (usize, f64), which: &str) {
    let (rect, response) = ui.allocate_exact_size(vec2(SIDE, SIDE), Sense::hover());
    let spot = numbers.spots.value.get(field).and_then(|spot| spot.as_ref().ok());
    let text = spot.map_or_else(
        || "no light".to_owned(),
        |spot| format!("RMS {} µm", number::format_digits(1e3 * spot.rms.value, 4)),
    );
    let label = format!("Spot of field {} of the {which} version: {text}", field + 1);
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &label));
    response.on_hover_text(text);
    let painter = ui.painter_at(rect);
    let palette = Palette::for_visuals(ui.visuals());
    painter.rect_filled(rect, 2.0, color32(palette.background));
    let faint = ui.visuals().widgets.noninteractive.bg_stroke;
    painter.hline(rect.x_range(), rect.center().y, faint);
    painter.vline(rect.center().x, rect.y_range(), faint);
    if let Some(spot) = spot {
        dots(&painter, rect, numbers, (field, spot), half, palette);
        let rms = format!("{} µm", number::format_digits(1e3 * spot.rms.value, 4));
        let (at, font) =
            (rect.left_bottom() + vec2(4.0, -2.0), TextStyle::Small.resolve(ui.style()));
        painter.text(at, Align2::LEFT_BOTTOM, rms, font, ui.visuals().text_color());
    }
}

/// Paints the dots, short waves over long ones.
fn dots(
    painter: &Painter,
    rect: Rect,
    numbers: &Analyses,
    (field, spot): (usize, &Spot),
    half: f64,
    palette: Palette,
) {
    let um = |wavelength: usize| numbers.ray_model.value.channels[wavelength].um;
    let mut scatters: Vec<_> =
        numbers.spot_points.value.iter().filter(|scatter| scatter.field == field).collect();
    scatters.sort_by(|a, b| um(b.wavelength).total_cmp(&um(a.wavelength)));
    let scale = 0.5 * f64::from(SIDE) / half;
    for scatter in scatters {
        let [r, g, b, _] = palette.wavelength(um(scatter.wavelength));
        for [x, y] in &scatter.points {
            let dx = (scale * (x - spot.centroid[0].value)) as f32;
            let dy = (scale * (y - spot.centroid[1].value)) as f32;
            let at = pos2(rect.center().x + dx, rect.center().y - dy);
            painter.circle_filled(at, DOT, Color32::from_rgb(r, g, b));
        }
    }
}
