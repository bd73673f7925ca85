//! The spots of lenses that are made, as a histogram and as a curve of the yield.
//!
//! Bars and the band are those of lenses whose rays were traced; lines are those of the quadratic form. The
//! band is the interval after Wilson in which the share of good lenses lies with 95 % confidence.

use egui::{RichText, Role, Stroke, Ui, WidgetInfo};
use egui_plot::{Bar, BarChart, FilledArea, Line, LineStyle, PlotPoints, VLine};

use crate::session::AsBuiltLens;
use crate::studio::palette::{Palette, color32};
use crate::studio::panels::widgets::fixed_plot;
use crate::tolerance::{SpotHistogram, yield_band};

/// The height of a chart, in points.
const PLOT: f32 = 110.0;
/// The opacity of a band, and of bars.
const FAINT: f32 = 0.3;
const BARS: f32 = 0.45;

/// The names of the treatments of the focus.
pub(super) const FOCUS: [&str; 2] = ["fixed focus", "refocused"];

/// The histogram at a treatment of the focus, which is chosen above it.
pub(super) fn histogram(ui: &mut Ui, made: &AsBuiltLens, which: &mut usize) {
    ui.horizontal_wrapped(|ui| {
        let text = "shares of lenses against RMS over the fields, µm; line: quadratic form";
        ui.label(RichText::new(text).small().weak());
        for (i, name) in FOCUS.iter().enumerate() {
            ui.selectable_value(which, i, RichText::new(*name).small());
        }
    });
    let Some(found) = SpotHistogram::new(&made.analysis, *which) else {
        ui.weak("All lenses have the same spot");
        return;
    };
    let color = color32(Palette::for_visuals(ui.visuals()).field(*which));
    let shown = fixed_plot(ui, "histogram as built", PLOT).include_y(0.0).show(ui, |plot| {
        let bar = |(i, share): (usize, &f64)| {
            let bar = Bar::new(1e3 * found.middle(i), *share).width(0.95e3 * found.step);
            bar.fill(color.gamma_multiply(BARS)).stroke(Stroke::NONE)
        };
        let bars: Vec<Bar> = found.real.iter().enumerate().map(bar).collect();
        if !bars.is_empty() {
            plot.bar_chart(BarChart::new("lenses", bars));
        }
        let line = found.form.iter().enumerate().map(|(i, share)| [1e3 * found.middle(i), *share]);
        let line = Line::new("quadratic form", line.collect::<PlotPoints<'_>>());
        plot.line(line.color(color).width(1.6));
    });
    let samples = made.analysis.samples;
    let label = format!("Histogram of the RMS of {samples} lenses, {}", FOCUS[*which]);
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &label));
}

/// The share of lenses against the RMS that they do not exceed: the yield at each limit.
pub(super) fn yield_curve(ui: &mut Ui, made: &AsBuiltLens, limit: Option<f64>) {
    let palette = Palette::for_visuals(ui.visuals());
    let text = "yield against the largest RMS of a good lens, µm; fixed focus dashed; band: 95 % \
                confidence of the real lenses";
    ui.label(RichText::new(text).small().weak());
    let weak = ui.visuals().weak_text_color();
    let plot = fixed_plot(ui, "as built", PLOT).include_y(0.0).include_y(1.0);
    let shown = plot.show(ui, |plot| {
        for (i, spot) in made.analysis.spots.iter().enumerate() {
            let color = color32(palette.field(i));
            let band = yield_band(&made.analysis, i);
            if !band.is_empty() {
                let xs: Vec<f64> = band.iter().map(|(rms, _)| 1e3 * rms).collect();
                let [low, high] = [0, 1].map(|end| -> Vec<f64> {
                    band.iter().map(|(_, interval)| interval[end]).collect()
                });
                let area = FilledArea::new("95 % confidence", &xs, &low, &high);
                plot.add(area.fill_color(color.gamma_multiply(FAINT)));
            }
            let points = spot.distribution.iter().map(|q| [1e3 * q.corrected, q.share]);
            let style = if i == 0 { LineStyle::dashed_loose() } else { LineStyle::Solid };
            let line = Line::new(FOCUS[i], points.collect::<PlotPoints<'_>>());
            plot.line(line.color(color).width(1.6).style(style));
            let designed = VLine::new("as designed", 1e3 * spot.nominal_rms);
            plot.vline(designed.color(color).style(LineStyle::dotted_dense()));
        }
        if let Some(limit) = limit {
            plot.vline(VLine::new("good up to", 1e3 * limit).color(weak));
        }
    });
    let label = "Share of lenses against their RMS over the fields";
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, label));
}
