//! Two curves: the loss against the steps, and the index along a line beside the exact one.

use egui::{Role, Ui, WidgetInfo, vec2};
use egui_plot::{AxisHints, Corner, Legend, LineStyle, Plot, VLine};

use super::text;
use crate::session::{GrinRun, LossSample, SessionView};
use crate::studio::panels::decade_name;
use crate::studio::panels::widgets::{fixed_plot, plot_curve};

/// The share of width and height that counts as a corner.
const NEAR: f64 = 0.4;

/// The corner with the fewest points of some curves in it, for a legend.
fn free_corner<'a>(curves: impl Iterator<Item = &'a [[f64; 2]]>) -> Corner {
    let points: Vec<[f64; 2]> = curves.flatten().copied().collect();
    let range = |axis: usize| {
        let all = || points.iter().map(|point| point[axis]);
        (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max))
    };
    let [across, up] = [range(0), range(1)];
    let share = |value: f64, (low, high): (f64, f64)| (value - low) / (high - low).max(1e-300);
    let corners = [
        (Corner::RightTop, [1.0, 1.0]),
        (Corner::RightBottom, [1.0, 0.0]),
        (Corner::LeftBottom, [0.0, 0.0]),
        (Corner::LeftTop, [0.0, 1.0]),
    ];
    let overlaps = |[x, y]: [f64; 2]| {
        let is_near = |p: &&[f64; 2]| {
            (share(p[0], across) - x).abs() < NEAR && (share(p[1], up) - y).abs() < NEAR
        };
        points.iter().filter(is_near).count()
    };
    corners
        .into_iter()
        .min_by_key(|(_, at)| overlaps(*at))
        .map_or(Corner::RightTop, |(corner, _)| corner)
}

/// A plot that only shows, in all the room that is left.
fn plot(ui: &Ui, name: &str, legend: Corner) -> Plot<'static> {
    fixed_plot(ui, name, ui.available_height().max(120.0))
        .y_axis_min_width(44.0)
        .set_margin_fraction(vec2(0.02, 0.06))
        .legend(Legend::default().position(legend).background_alpha(0.6))
}

/// The loss of the current and of the best field, decades up and steps across; a line where the
/// field becomes finer.
pub(super) fn loss_plot(ui: &mut Ui, run: &GrinRun) {
    if run.history.is_empty() {
        ui.weak("No step has been taken yet: press Optimize.");
        return;
    }
    ui.label(text::losses_text(run));
    let decade = |value: f64| if value > 0.0 { value.log10() } else { f64::NAN };
    let curve = |loss: fn(&LossSample) -> f64| -> Vec<[f64; 2]> {
        let points = run.history.iter().map(|point| [point.step as f64, decade(loss(point))]);
        points.filter(|[_, y]| y.is_finite()).collect()
    };
    let (current, best) = (curve(|point| point.current), curve(|point| point.best));
    let levels = run.history.windows(2).filter(|pair| pair[0].level != pair[1].level);
    let levels: Vec<f64> = levels.map(|pair| pair[0].step as f64).collect();
    let visuals = ui.visuals();
    let (weak, strong) = (visuals.weak_text_color(), visuals.hyperlink_color);
    let corner = free_corner([&current, &best].into_iter().map(Vec::as_slice));
    let steps = AxisHints::new_x().label("steps").label_spacing(24.0..=44.0);
    let plot = plot(ui, "loss of the field", corner)
        .custom_x_axes(vec![steps])
        .y_axis_formatter(|mark, _| decade_name(mark.value));
    let shown = plot.show(ui, |plot| {
        for step in levels {
            plot.vline(VLine::new("finer", step).color(weak.gamma_multiply(0.5)).width(1.0));
        }
        plot.line(plot_curve("rays of the step", current).color(weak).width(1.0));
        plot.line(plot_curve("best, all rays", best).color(strong).width(2.0));
    });
    let text = format!("Loss against {} steps", run.history.len());
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &text));
}

/// The index along a line, with the exact one and the one at the start beside it.
pub(super) fn profile_plot(ui: &mut Ui, view: &SessionView) {
    let Some(Ok(slice)) = view.grin.slice.as_deref() else {
        ui.weak("Computing the slice…");
        return;
    };
    let profile = &slice.profile;
    ui.label(text::profile_text(slice));
    let visuals = ui.visuals();
    let (weak, strong) = (visuals.weak_text_color(), visuals.strong_text_color());
    let now = visuals.hyperlink_color;
    let curves = [&profile.start, &profile.current, &profile.reference];
    let corner = free_corner(curves.into_iter().map(Vec::as_slice));
    let along = AxisHints::new_x().label(format!("{}, mm", profile.along));
    let plot = plot(ui, "profile of the field", corner)
        .custom_x_axes(vec![along.label_spacing(24.0..=44.0)])
        .y_axis_formatter(|mark, range| {
            let width = (range.end() - range.start()).max(1e-9);
            let digits = (1.0 - width.log10().floor()).clamp(1.0, 10.0) as usize;
            format!("{:.digits$}", mark.value)
        });
    let shown = plot.show(ui, |plot| {
        let line = |name: &'static str, points: &[[f64; 2]]| plot_curve(name, points.to_vec());
        if !profile.start.is_empty() {
            plot.line(line("start", &profile.start).color(weak).width(1.0));
        }
        plot.line(line("index", &profile.current).color(now).width(2.0));
        if !profile.reference.is_empty() {
            let exact = line("exact", &profile.reference).color(strong).width(1.2);
            plot.line(exact.style(LineStyle::dashed_dense()));
        }
    });
    let text = format!("Index along {}", profile.along);
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &text));
}
