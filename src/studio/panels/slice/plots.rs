//! Two curves: the loss against the steps, and the index along a line beside the exact one.

use eframe::egui::{Role, Ui, WidgetInfo, vec2};
use egui_plot::{Corner, Legend, Line, LineStyle, Plot, PlotPoints, VLine};

use super::words;
use crate::session::{Formation, Loss, View};
use crate::studio::panels::decade_name;

/// A plot that only shows, in all the room that is left.
fn plot(ui: &Ui, name: &str) -> Plot<'static> {
    Plot::new(name.to_owned())
        .height(ui.available_height().max(120.0))
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .y_axis_min_width(44.0)
        .grid_color(ui.visuals().widgets.noninteractive.bg_stroke.color)
        .grid_spacing(18.0..=110.0)
        .set_margin_fraction(vec2(0.02, 0.06))
        .legend(Legend::default().position(Corner::RightTop).background_alpha(0.6))
}

/// The loss of the current and of the best field, decades up and steps across; a line where the
/// field becomes finer.
pub(super) fn loss(ui: &mut Ui, run: &Formation) {
    if run.history.is_empty() {
        ui.weak("No step has been taken yet: press Optimize.");
        return;
    }
    ui.label(words::losses(run));
    let decade = |value: f64| if value > 0.0 { value.log10() } else { f64::NAN };
    let curve = |loss: fn(&Loss) -> f64| -> PlotPoints<'static> {
        let points = run.history.iter().map(|point| [point.step as f64, decade(loss(point))]);
        points.filter(|[_, y]| y.is_finite()).collect()
    };
    let (current, best) = (curve(|point| point.current), curve(|point| point.best));
    let levels = run.history.windows(2).filter(|pair| pair[0].level != pair[1].level);
    let levels: Vec<f64> = levels.map(|pair| pair[0].step as f64).collect();
    let visuals = ui.visuals();
    let (weak, strong) = (visuals.weak_text_color(), visuals.hyperlink_color);
    let plot = plot(ui, "loss of the field")
        .x_axis_label("steps")
        .y_axis_formatter(|mark, _| decade_name(mark.value));
    let shown = plot.show(ui, |plot| {
        for step in levels {
            plot.vline(VLine::new("finer", step).color(weak.gamma_multiply(0.5)).width(1.0));
        }
        plot.line(Line::new("rays of the step", current).color(weak).width(1.0));
        plot.line(Line::new("best, all rays", best).color(strong).width(2.0));
    });
    let text = format!("Loss against {} steps", run.history.len());
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &text));
}

/// The index along a line, with the exact one and the one at the start beside it.
pub(super) fn profile(ui: &mut Ui, view: &View) {
    let Some(Ok(slice)) = view.forming.slice.as_deref() else {
        ui.weak("Laying the slice…");
        return;
    };
    let profile = &slice.profile;
    ui.label(words::profile(slice));
    let visuals = ui.visuals();
    let (weak, strong) = (visuals.weak_text_color(), visuals.strong_text_color());
    let now = visuals.hyperlink_color;
    let plot = plot(ui, "profile of the field")
        .x_axis_label(format!("{}, mm", profile.along))
        .y_axis_formatter(|mark, range| {
            let width = (range.end() - range.start()).max(1e-9);
            let digits = (1.0 - width.log10().floor()).clamp(1.0, 10.0) as usize;
            format!("{:.digits$}", mark.value)
        });
    let shown = plot.show(ui, |plot| {
        let line = |name: &'static str, points: &[[f64; 2]]| Line::new(name, points.to_vec());
        if !profile.start.is_empty() {
            plot.line(line("start", &profile.start).color(weak).width(1.0));
        }
        plot.line(line("index", &profile.now).color(now).width(2.0));
        if !profile.exact.is_empty() {
            let exact = line("exact", &profile.exact).color(strong).width(1.2);
            plot.line(exact.style(LineStyle::dashed_dense()));
        }
    });
    let text = format!("Index along {}", profile.along);
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &text));
}
