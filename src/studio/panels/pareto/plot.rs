//! The plane of light and sharpness: the front over all that was tried, the biased front and
//! earlier ones in grey, the design as a ring.

use std::ops::RangeInclusive;

use egui::{
    Color32, CursorIcon, PointerButton, Pos2, RichText, Role, Sense, Shape, Stroke, Ui, WidgetInfo,
    vec2,
};
use egui_plot::{
    AxisHints, LineStyle, MarkerShape, Plot, PlotPoint, PlotTransform, PlotUi, Points,
};

use super::text;
use crate::optimize::pareto::{Front, ParetoPoint};
use crate::session::{ParetoPass, ParetoRun, RunView, SessionView};
use crate::studio::panels::RMS_OVER_FIELDS;
use crate::studio::panels::widgets::{plot_curve, round_axes};

/// The distance in points within which the pointer picks a lens.
const NEAR: f32 = 14.0;
/// The margin around the shown range, as a share of it.
const MARGIN: f64 = 0.06;
/// The height in points below which the title of the axis of spots is a short one.
const LOW: f32 = 240.0;

/// A lens that was clicked.
pub(super) struct ClickedDesign {
    pub(super) design: ParetoPoint,
    pub(super) double: bool,
}

/// Light in mm² and spot in µm.
fn plot_point(design: &ParetoPoint) -> [f64; 2] {
    [design.light, 1e3 * design.radius()]
}

fn plot_points(front: &Front) -> Vec<[f64; 2]> {
    front.points().iter().map(plot_point).collect()
}

/// Shows the plane in all the room that is left; the lens that was clicked, if one was.
pub(super) fn plot(
    ui: &mut Ui,
    view: &SessionView,
    run: &ParetoRun,
    chosen: Option<&ParetoPoint>,
    fitted: &mut bool,
) -> Option<ClickedDesign> {
    let colors = ParetoColors::of(ui);
    let bounds = bounds(view, run);
    legend(ui, view, run, chosen.is_some(), &colors);
    let height = ui.available_height();
    // A title longer than its axis would lie over the legend.
    let what = if height < LOW { "RMS" } else { RMS_OVER_FIELDS };
    let as_built = if run.start.as_built.is_some() { " as built" } else { "" };
    let spot = format!("{what}{as_built}, µm");
    let light = AxisHints::new_x().label("light, mm²");
    let spot = AxisHints::new_y().label(spot).min_thickness(36.0);
    let plot = Plot::new("front")
        .height(height)
        .allow_scroll(false)
        .allow_double_click_reset(false)
        .show_crosshair(false)
        .label_formatter(|_| None)
        .grid_color(ui.visuals().widgets.noninteractive.bg_stroke.color);
    let plot = round_axes(plot, [light, spot]);
    let fit = *fitted;
    let shown = plot.show(ui, |plot| {
        if fit {
            plot.set_plot_bounds_x(bounds[0].clone());
            plot.set_plot_bounds_y(bounds[1].clone());
        }
        draw(plot, view, run, chosen, &colors);
    });
    let response = shown.response;
    if response.dragged() || response.hovered() && ui.input(|input| input.zoom_delta() != 1.0) {
        *fitted = false;
    }
    let label = format!("Front of {} lenses, spot against light", run.main.front.points().len());
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &label));
    let (design, at) = nearest(view, run, response.hover_pos()?, &shown.transform)?;
    let ring = ui.visuals().selection.stroke;
    ui.painter_at(response.rect).circle_stroke(at, 7.0, ring);
    let clicked = response.clicked_by(PointerButton::Primary);
    let twice = response.double_clicked_by(PointerButton::Primary);
    response
        .on_hover_cursor(CursorIcon::PointingHand)
        .on_hover_text_at_pointer(text::design_text(design, &run.start));
    (clicked || twice).then(|| ClickedDesign { design: design.clone(), double: twice })
}

/// The latest states of earlier runs.
fn earlier_runs(view: &SessionView) -> impl Iterator<Item = &ParetoRun> {
    view.pareto.earlier.iter().filter_map(|run| run.snapshot.as_deref())
}

/// The legend entry of a run: its number and its hypervolume.
fn run_name(view: &RunView<ParetoRun>, run: &ParetoRun) -> String {
    let number = view.id.map_or(0, |id| id.number);
    format!("run {number}: {:.4}", run.main.hypervolume)
}

/// The legend entry of the front of fixed rays.
fn biased_name(pass: &ParetoPass) -> String {
    format!("fixed rays: {:.4}", pass.hypervolume)
}

/// The lens nearest to a place on the screen: of the front, of the biased one, of earlier ones.
fn nearest<'a>(
    view: &'a SessionView,
    run: &'a ParetoRun,
    pointer: Pos2,
    transform: &PlotTransform,
) -> Option<(&'a ParetoPoint, Pos2)> {
    let earlier = earlier_runs(view).flat_map(|run| run.main.front.points());
    let biased = run.biased.iter().flat_map(|pass| pass.front.points());
    let all = run.main.front.points().iter().chain(biased).chain(earlier);
    let on_screen = |design: &'a ParetoPoint| {
        let [x, y] = plot_point(design);
        (design, transform.position_from_point(&PlotPoint::new(x, y)))
    };
    let distance = |(_, at): &(&ParetoPoint, Pos2)| at.distance(pointer);
    let near = all.map(on_screen).filter(|found| distance(found) < NEAR);
    near.min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// The range of both axes that shows all fronts, the start and the design; lenses tried on the way
/// may lie far outside.
fn bounds(view: &SessionView, run: &ParetoRun) -> [RangeInclusive<f64>; 2] {
    let legs = std::iter::once(&run.main).chain(&run.biased);
    let legs = legs.chain(earlier_runs(view).map(|run| &run.main));
    let mut points: Vec<[f64; 2]> = legs.flat_map(|pass| plot_points(&pass.front)).collect();
    points.push(plot_point(&run.start));
    points.extend(design_point(view));
    [0, 1].map(|axis| {
        let values = points.iter().map(|point| point[axis]).filter(|value| value.is_finite());
        let (low, high) = values
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), value| (l.min(value), h.max(value)));
        // A single point has no range of its own.
        let margin = (MARGIN * (high - low)).max(0.02 * high.abs()).max(f64::MIN_POSITIVE);
        low - margin..=high + margin
    })
}

/// The spot and the light of the design.
fn design_point(view: &SessionView) -> Option<[f64; 2]> {
    let scored = view.design_score.as_deref()?;
    Some(plot_point(scored.score.as_ref().ok()?))
}

/// The colours of the plot.
struct ParetoColors {
    front: Color32,
    biased: Color32,
    faint: Color32,
    strong: Color32,
    selected: Color32,
}

impl ParetoColors {
    fn of(ui: &Ui) -> Self {
        let visuals = ui.visuals();
        Self {
            front: visuals.hyperlink_color,
            biased: visuals.weak_text_color(),
            faint: visuals.weak_text_color().gamma_multiply(0.45),
            strong: visuals.strong_text_color(),
            selected: visuals.warn_fg_color,
        }
    }
}

/// The marks of the plot as the legend shows them.
#[derive(Clone, Copy)]
enum LegendMark {
    Dot,
    Line,
    Dashes,
    Cross,
    Ring,
}

/// Explains the marks above the plot, where they can cover no lens.
fn legend(ui: &mut Ui, view: &SessionView, run: &ParetoRun, chosen: bool, colors: &ParetoColors) {
    let mut entries = vec![("tried".to_owned(), LegendMark::Dot, colors.faint)];
    for run in &view.pareto.earlier {
        let Some(earlier) = &run.snapshot else { continue };
        entries.push((run_name(run, earlier), LegendMark::Line, colors.faint));
    }
    if let Some(biased) = &run.biased {
        entries.push((biased_name(biased), LegendMark::Dashes, colors.biased));
    }
    entries.push((run_name(&view.pareto.run, run), LegendMark::Line, colors.front));
    entries.push(("start".to_owned(), LegendMark::Cross, colors.strong));
    if design_point(view).is_some() {
        entries.push(("design".to_owned(), LegendMark::Ring, colors.strong));
    }
    if chosen {
        entries.push(("shown lens".to_owned(), LegendMark::Ring, colors.selected));
    }
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing = vec2(4.0, 1.0);
        for (name, mark, color) in entries {
            // A mark and its name stay on one line.
            ui.horizontal(|ui| {
                legend_mark(ui, mark, color);
                ui.label(RichText::new(name).small());
                ui.add_space(4.0);
            });
        }
    });
}

fn legend_mark(ui: &mut Ui, mark: LegendMark, color: Color32) {
    let (rect, _) = ui.allocate_exact_size(vec2(14.0, 10.0), Sense::hover());
    let (painter, stroke) = (ui.painter(), Stroke::new(1.5, color));
    let center = rect.center();
    match mark {
        LegendMark::Dot => {
            painter.circle_filled(center, 1.5, color);
        }
        LegendMark::Line => {
            painter.hline(rect.x_range(), center.y, stroke);
            painter.circle_filled(center, 2.6, color);
        }
        LegendMark::Dashes => {
            let ends = [rect.left_center(), rect.right_center()];
            painter.extend(Shape::dashed_line(&ends, stroke, 4.0, 2.0));
        }
        LegendMark::Cross => {
            for arm in [vec2(3.0, 3.0), vec2(3.0, -3.0)] {
                painter.line(vec![center - arm, center + arm], stroke);
            }
        }
        LegendMark::Ring => {
            painter.circle_stroke(center, 4.0, stroke);
        }
    }
}

fn draw(
    plot: &mut PlotUi<'_>,
    view: &SessionView,
    run: &ParetoRun,
    chosen: Option<&ParetoPoint>,
    colors: &ParetoColors,
) {
    let tried: Vec<[f64; 2]> =
        run.current_pass().evaluated.iter().map(|[spot, light]| [*light, 1e3 * spot]).collect();
    plot.points(Points::new("tried", tried).radius(1.2).color(colors.faint).allow_hover(false));
    for run in &view.pareto.earlier {
        let Some(earlier) = &run.snapshot else { continue };
        let name = run_name(run, earlier);
        curve(plot, &name, &earlier.main.front, colors.faint, LineStyle::Solid);
    }
    if let Some(biased) = &run.biased {
        let name = biased_name(biased);
        curve(plot, &name, &biased.front, colors.biased, LineStyle::dashed_dense());
    }
    let name = run_name(&view.pareto.run, run);
    curve(plot, &name, &run.main.front, colors.front, LineStyle::Solid);
    let start = Points::new("start", vec![plot_point(&run.start)]).shape(MarkerShape::Cross);
    plot.points(start.radius(5.0).color(colors.strong).allow_hover(false));
    if let Some(here) = design_point(view) {
        ring(plot, "design", here, 6.0, colors.strong);
    }
    if let Some(chosen) = chosen {
        ring(plot, "shown lens", plot_point(chosen), 8.0, colors.selected);
    }
}

/// A front as connected points.
fn curve(plot: &mut PlotUi<'_>, name: &str, front: &Front, color: Color32, style: LineStyle) {
    let line = plot_curve(name, plot_points(front)).color(color).width(1.2);
    plot.line(line.style(style).allow_hover(false));
    plot.points(Points::new(name, plot_points(front)).color(color).radius(2.6).allow_hover(false));
}

fn ring(plot: &mut PlotUi<'_>, name: &str, at: [f64; 2], radius: f32, color: Color32) {
    let ring = Points::new(name, vec![at]).shape(MarkerShape::Circle).filled(false);
    plot.points(ring.radius(radius).color(color).allow_hover(false));
}
