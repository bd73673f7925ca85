//! The merit against iterations with a mark for every mutation (figure 4.6 of Teh, *Computational
//! Lens Design*), and below it how many elements the lens of the chain has.

use egui::{
    Id, PointerButton, RichText, Role, TextStyle, TextWrapMode, Ui, WidgetInfo, WidgetText, vec2,
};
use egui_plot::{Line, LineStyle, Plot, PlotPoint, PlotPoints, PlotResponse, PlotUi, Points};

use super::{ShownSearch, moves, text};
use crate::search::MutationKind;
use crate::session::{DescentMark, HistorySample, StructureSearchSnapshot};
use crate::studio::panels::widgets::{fixed_plot, log_axis, plot_curve};

/// The distance in points within which the pointer picks a mark.
const NEAR: f32 = 10.0;
/// The height of the plot of elements, with the title of its axis.
const STRIP: f32 = 68.0;
/// The height of the legend.
const LEGEND: f32 = 22.0;
/// The height of a page that has room for the curves and the retained lenses.
const ROOMY: f32 = 340.0;
/// The room for the numbers at the left.
const AXIS: f32 = 68.0;

/// True if a page has room for the curves above the retained lenses.
pub(super) fn has_room(ui: &Ui) -> bool {
    ui.available_height() > ROOMY
}

/// Shows both above other things; the generation of the mark that was clicked, if one was.
pub(super) fn plots(ui: &mut Ui, search: ShownSearch<'_>, chosen: Option<u64>) -> Option<u64> {
    let height = (0.3 * ui.available_height()).clamp(80.0, 260.0);
    plots_with(ui, search, chosen, height)
}

/// The same on a page of their own.
pub(super) fn large_plots(
    ui: &mut Ui,
    search: ShownSearch<'_>,
    chosen: Option<u64>,
) -> Option<u64> {
    let height = (ui.available_height() - STRIP - LEGEND - 12.0).clamp(80.0, 600.0);
    plots_with(ui, search, chosen, height)
}

fn plots_with(
    ui: &mut Ui,
    search: ShownSearch<'_>,
    chosen: Option<u64>,
    height: f32,
) -> Option<u64> {
    let ShownSearch { view, run } = search;
    let chain = view.structure_search.previewed_chain.unwrap_or(0);
    let clicked = merit_plot(ui, run, chain, chosen, height);
    elements_plot(ui, run, chain);
    legend(ui, run);
    clicked
}

fn plot(ui: &Ui, name: &str, height: f32) -> Plot<'static> {
    fixed_plot(ui, name, height)
        .show_crosshair(false)
        .label_formatter(|_| None)
        .y_axis_min_width(AXIS)
        .link_axis(Id::unique("search history"), [true, false])
        .set_margin_fraction(vec2(0.01, 0.08))
}

fn decade(merit: f64) -> Option<f64> {
    (merit > 0.0 && merit.is_finite()).then(|| merit.log10())
}

fn merit_plot(
    ui: &mut Ui,
    run: &StructureSearchSnapshot,
    chain: usize,
    chosen: Option<u64>,
    height: f32,
) -> Option<u64> {
    let plot = log_axis(plot(ui, "merit of the search", height), "merit").show_axes([false, true]);
    let visuals = ui.visuals().clone();
    let shown = plot.show(ui, |plot| {
        let faint = visuals.weak_text_color().gamma_multiply(0.4);
        for other in (0..run.chains.len()).filter(|other| *other != chain) {
            plot.line(plot_curve("chain", chain_curve(run, other)).color(faint).width(0.8));
        }
        let weak = visuals.weak_text_color();
        plot.line(plot_curve("previewed chain", chain_curve(run, chain)).color(weak).width(1.2));
        start_line(plot, run, visuals.warn_fg_color);
        let best = run.history.moments.iter();
        let best = best.filter_map(|m| Some([m.round as f64, decade(m.best)?]));
        plot.line(plot_curve("best", best).color(visuals.hyperlink_color).width(2.0));
        mutation_marks(plot, run, &visuals);
        if let Some(mark) = run.history.marks.iter().find(|mark| Some(mark.number) == chosen) {
            let ring =
                Points::new("chosen", mark_point(mark).into_iter().collect::<PlotPoints<'_>>());
            plot.points(ring.radius(7.0).filled(false).color(visuals.strong_text_color()));
        }
    });
    let history = &run.history;
    let (moments, mutations) = (history.moments.len(), history.marks.len());
    let label = format!("Merit against iterations: {moments} moments, {mutations} descents");
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &label));
    hovered_mark(ui, run, &shown)
}

/// The merit of the start across all iterations.
fn start_line(plot: &mut PlotUi<'_>, run: &StructureSearchSnapshot, color: egui::Color32) {
    let (first, last) = (run.history.moments.first(), run.history.moments.last());
    if let (Some(first), Some(last), Some(y)) = (first, last, decade(run.start.merit)) {
        let ends = vec![[first.round as f64, y], [last.round as f64, y]];
        let line = Line::new("start", ends).color(color).style(LineStyle::dashed_dense());
        plot.line(line.width(1.0));
    }
}

fn chain_curve(run: &StructureSearchSnapshot, chain: usize) -> Vec<[f64; 2]> {
    let merit = |moment: &HistorySample| {
        let (merit, _) = moment.chains.get(chain).copied().flatten()?;
        Some([moment.round as f64, decade(merit)?])
    };
    run.history.moments.iter().filter_map(merit).collect()
}

fn mark_point(mark: &DescentMark) -> Option<[f64; 2]> {
    Some([mark.round as f64, decade(mark.merit)?])
}

/// Every mutation at the merit to which it led; those of retained lenses are larger.
fn mutation_marks(plot: &mut PlotUi<'_>, run: &StructureSearchSnapshot, visuals: &egui::Visuals) {
    for kind in moves::kinds() {
        for (entered, radius) in [(false, 2.6), (true, 4.8)] {
            let of_kind = run.history.marks.iter();
            let of_kind = of_kind.filter(|m| m.kind == Some(kind) && m.entered == entered);
            let places: Vec<[f64; 2]> = of_kind.filter_map(mark_point).collect();
            if !places.is_empty() {
                let color = moves::color(visuals, Some(kind));
                let points = Points::new(kind.name(), places).shape(moves::shape(kind));
                plot.points(points.radius(radius).color(color));
            }
        }
    }
}

/// Describes the mark under the pointer; its generation if it was clicked.
fn hovered_mark(ui: &Ui, run: &StructureSearchSnapshot, shown: &PlotResponse<()>) -> Option<u64> {
    let pointer = shown.response.hover_pos()?;
    let on_screen = |mark: &DescentMark| {
        let [x, y] = mark_point(mark)?;
        Some(shown.transform.position_from_point(&PlotPoint::new(x, y)))
    };
    let distance =
        |mark: &&DescentMark| on_screen(mark).map_or(f32::INFINITY, |p| p.distance(pointer));
    let marks = run.history.marks.iter();
    let mark = marks.min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    if distance(&mark) > NEAR {
        return None;
    }
    if let Some(place) = on_screen(mark) {
        let ring = ui.visuals().selection.stroke;
        ui.painter_at(shown.response.rect).circle_stroke(place, 7.0, ring);
    }
    let text = match run.node(mark.number) {
        Some(node) => format!(
            "Lens {}\n{}\n{}",
            node.number,
            text::mutation_text(node),
            text::outcome_text(node)
        ),
        None => {
            format!(
                "Lens {}, no longer stored; merit {}",
                mark.number,
                text::merit_text(mark.merit)
            )
        }
    };
    let response = shown.response.clone().on_hover_text_at_pointer(text);
    let clicked = response.clicked_by(PointerButton::Primary);
    clicked.then_some(mark.number).filter(|number| run.lens_by_number(*number).is_some())
}

/// The number of elements of the lens of a chain.
fn elements_plot(ui: &mut Ui, run: &StructureSearchSnapshot, chain: usize) {
    let steps: Vec<[f64; 2]> = run
        .history
        .moments
        .iter()
        .filter_map(|moment| {
            let (_, elements) = moment.chains.get(chain).copied().flatten()?;
            Some([moment.round as f64, elements as f64])
        })
        .collect();
    let counts = steps.iter().map(|[_, count]| *count);
    let (low, high) = counts.fold((f64::MAX, f64::MIN), |(l, h), c| (l.min(c), h.max(c)));
    let visuals = ui.visuals();
    let line = visuals.strong_text_color();
    let plot = plot(ui, "elements of the search", STRIP)
        .x_axis_label("iteration")
        .y_axis_label("elements")
        .y_axis_formatter(|mark, _| format!("{:.0}", mark.value));
    let shown = plot.show(ui, |plot| {
        if low <= high {
            plot.set_plot_bounds_y(low - 0.7..=high + 0.7);
        }
        plot.line(plot_curve("elements", step_curve(&steps)).color(line).width(1.5));
    });
    let now = steps.last().map_or(0.0, |[_, count]| *count);
    let label = format!("Elements of chain {} against iterations: {now} now", chain + 1);
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &label));
}

/// The corners of a step curve: a value holds until the next sample.
fn step_curve(steps: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut stairs: Vec<[f64; 2]> = Vec::with_capacity(2 * steps.len());
    for step in steps {
        if let Some([_, count]) = stairs.last().copied()
            && count != step[1]
        {
            stairs.push([step[0], count]);
        }
        stairs.push(*step);
    }
    stairs.dedup();
    stairs
}

/// The marks of the kinds that have occurred.
fn legend(ui: &mut Ui, run: &StructureSearchSnapshot) {
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        for kind in moves::kinds() {
            if run.history.marks.iter().any(|mark| mark.kind == Some(kind)) {
                legend_entry(ui, kind);
            }
        }
    });
}

/// A mark with its name, on one line with it.
fn legend_entry(ui: &mut Ui, kind: MutationKind) {
    let name = WidgetText::from(RichText::new(kind.name()).small());
    let extend = Some(TextWrapMode::Extend);
    let name = name.into_galley(ui, extend, f32::INFINITY, TextStyle::Small);
    let width = moves::SYMBOL + ui.spacing().item_spacing.x + name.size().x;
    if ui.available_size_before_wrap().x < width {
        ui.end_row();
    }
    moves::symbol(ui, kind);
    ui.label(name);
    ui.add_space(4.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_curve_has_no_repeated_points() {
        let steps = [[0.0, 6.0], [3.0, 7.0], [3.0, 7.0], [3.0, 7.0], [4.0, 7.0]];
        assert_eq!(step_curve(&steps), [[0.0, 6.0], [3.0, 6.0], [3.0, 7.0], [4.0, 7.0]]);
    }
}
