//! The merit against the steps.

use egui::{Role, Ui, WidgetInfo, vec2};
use egui_plot::{Line, Plot, PlotPoints};

use crate::session::{MeritSample, OptimizationSnapshot};
use crate::studio::panels::decade_name;

/// Plots the merit of the current and of the best lens, decades up and steps across.
pub(super) fn plot(ui: &mut Ui, search: &OptimizationSnapshot) {
    let decade = |value: f64| if value > 0.0 { value.log10() } else { f64::NAN };
    let curve = |merit: fn(&MeritSample) -> f64| -> PlotPoints<'static> {
        let points = search.history.iter().map(|point| [point.step as f64, decade(merit(point))]);
        points.filter(|[_, y]| y.is_finite()).collect()
    };
    let (current, best) = (curve(|point| point.current), curve(|point| point.best));
    let visuals = ui.visuals();
    let (weak, strong) = (visuals.weak_text_color(), visuals.hyperlink_color);
    let plot = Plot::new("merit history")
        .height(ui.available_height())
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .y_axis_min_width(40.0)
        .grid_color(visuals.widgets.noninteractive.bg_stroke.color)
        .grid_spacing(18.0..=120.0)
        .set_margin_fraction(vec2(0.01, 0.08))
        .y_axis_formatter(|mark, _| decade_name(mark.value));
    let shown = plot.show(ui, |plot| {
        plot.line(Line::new("current", current).color(weak).width(1.0));
        plot.line(Line::new("best", best).color(strong).width(2.0));
    });
    let text = "Merit against steps";
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, text));
}
