//! The histogram of a picture: how many of its pixels have which light.

use egui::{Color32, Rect, Sense, Shape, Stroke, Ui, WidgetInfo, pos2, vec2};

use crate::picture::Picture;

/// The number of bins, from black to white.
const BINS: usize = 96;
/// The height of the plot, in points.
const HEIGHT: f32 = 54.0;
/// The colours of red, green and blue.
const COLORS: [Color32; 3] = [
    Color32::from_rgb(225, 85, 75),
    Color32::from_rgb(70, 175, 90),
    Color32::from_rgb(80, 135, 230),
];

/// The share of pixels in every bin, of each colour; what is brighter than white is in the last one.
fn bins(picture: &Picture, white: f64) -> [[f32; BINS]; 3] {
    let mut bins = [[0.0; BINS]; 3];
    let share = 1.0 / picture.values.len().max(1) as f32;
    for pixel in &picture.values {
        for (bins, value) in bins.iter_mut().zip(pixel) {
            let place = (value / white).clamp(0.0, 1.0) * (BINS - 1) as f64;
            bins[place.round() as usize] += share;
        }
    }
    bins
}

/// Shows the histograms of one or two pictures, light from black to white, in roots of shares, so that few
/// pixels are seen too: the first in colours, the other in a thin line of its mean.
pub(super) fn histogram(ui: &mut Ui, pictures: &[&Picture], white: f64) {
    let size = vec2(ui.available_width(), HEIGHT);
    let (rect, response) = ui.allocate_exact_size(size, Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(egui::Role::Image, true, "Histogram"));
    response.on_hover_text(
        "Pixels against their light, from black to white; heights are roots of shares",
    );
    let all: Vec<_> = pictures.iter().map(|picture| bins(picture, white)).collect();
    let largest = all.iter().flatten().flatten().fold(0.0_f32, |a, b| a.max(*b));
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
    for (i, bins) in all.iter().enumerate().rev() {
        if i > 0 {
            let mean =
                std::array::from_fn(|bin| bins.iter().map(|color| color[bin]).sum::<f32>() / 3.0);
            let stroke = Stroke::new(1.0, ui.visuals().strong_text_color());
            painter.add(Shape::line(line(rect, &mean, largest), stroke));
            continue;
        }
        for (bins, color) in bins.iter().zip(COLORS) {
            painter.add(Shape::line(line(rect, bins, largest), Stroke::new(1.6, color)));
        }
    }
}

/// The points of a curve.
fn line(rect: Rect, bins: &[f32; BINS], largest: f32) -> Vec<egui::Pos2> {
    let point = |(i, share): (usize, &f32)| {
        let height = (share / largest.max(f32::MIN_POSITIVE)).sqrt();
        let x = rect.left() + rect.width() * (i as f32 + 0.5) / BINS as f32;
        pos2(x, rect.bottom() - 2.0 - height * (rect.height() - 4.0))
    };
    bins.iter().enumerate().map(point).collect()
}
