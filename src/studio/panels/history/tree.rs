//! The tree of versions: a line for each, with a mark in the column of its branch.

use std::collections::BTreeMap;

use egui::{Button, Pos2, RichText, Role, Sense, Stroke, Ui, Vec2, WidgetInfo, pos2, vec2};
use egui_plot::{Line, PlotPoints};

use super::node;
use crate::session::{HistoryNode, OptimizationCurve, SessionView};
use crate::studio::number;
use crate::studio::panels::decade_name;
use crate::studio::panels::optimizer::clicked_step;
use crate::studio::panels::widgets::fixed_plot;
use crate::studio::text::capitalize;
use crate::studio::thumbnails::Thumbnails;

/// The width of a branch and the height of a version.
const CELL: [f32; 2] = [12.0, 20.0];
/// The size of the drawing of a version.
const THUMBNAIL: Vec2 = vec2(44.0, 18.0);
/// The smallest change of the merit that is told, relative to it.
const LEAST_CHANGE: f64 = 5e-4;
/// The height of the curve of an optimization.
const CURVE_HEIGHT: f32 = 64.0;

/// Shows the tree, the newest version first; the one that was clicked, if one was.
pub(super) fn tree(
    ui: &mut Ui,
    view: &SessionView,
    selected: Option<u64>,
    thumbnails: &mut Thumbnails,
) -> Option<u64> {
    let columns = columns(view);
    let count = columns.values().max().map_or(1, |last| last + 1);
    let mut marks: BTreeMap<u64, Pos2> = BTreeMap::new();
    let mut clicked = None;
    ui.spacing_mut().item_spacing.y = 0.0;
    for version in view.history.iter().rev() {
        ui.horizontal(|ui| {
            let size = vec2(CELL[0] * count as f32, CELL[1]);
            let (rect, _) = ui.allocate_exact_size(size, Sense::hover());
            let column = columns.get(&version.id).copied().unwrap_or(0);
            let place = pos2(rect.left() + CELL[0] * (column as f32 + 0.5), rect.center().y);
            marks.insert(version.id, place);
            let (drawing, _) = ui.allocate_exact_size(THUMBNAIL, Sense::hover());
            if ui.is_rect_visible(drawing) {
                thumbnails.paint(ui, &version.lens, &version.lens, drawing);
            }
            let text = line_text(view, version);
            let is_present = version.id == view.version_id;
            let mut words = RichText::new(&text);
            if is_present {
                words = words.strong();
            }
            let button = Button::selectable(selected == Some(version.id), words);
            let response = ui.add(button.truncate());
            let label = if is_present { format!("Present version: {text}") } else { text.clone() };
            response.widget_info(|| WidgetInfo::labeled(Role::Button, true, &label));
            if response.on_hover_text(time_text(version)).clicked() {
                clicked = Some(version.id);
            }
        });
    }
    paint_branches(ui, view, &marks);
    clicked
}

/// The column of each version: that of its parent for the first child, a new one for the others.
fn columns(view: &SessionView) -> BTreeMap<u64, usize> {
    let mut columns = BTreeMap::new();
    let mut followed = BTreeMap::new();
    let mut next = 0;
    for version in view.history.iter() {
        let parent = version.parent.and_then(|parent| columns.get(&parent).copied());
        let is_first = version.parent.is_none_or(|id| followed.insert(id, version.id).is_none());
        let column = parent.filter(|_| is_first).unwrap_or_else(|| {
            next += 1;
            next - 1
        });
        columns.insert(version.id, column);
    }
    columns
}

fn paint_branches(ui: &Ui, view: &SessionView, marks: &BTreeMap<u64, Pos2>) {
    let visuals = ui.visuals();
    let stroke = Stroke::new(1.0, visuals.weak_text_color());
    for version in view.history.iter() {
        let Some(place) = marks.get(&version.id) else { continue };
        if let Some(from) = version.parent.and_then(|parent| marks.get(&parent)) {
            let corner = pos2(place.x, from.y);
            ui.painter().line_segment([*from, corner], stroke);
            ui.painter().line_segment([corner, *place], stroke);
        }
        let is_present = version.id == view.version_id;
        let color = if is_present { visuals.hyperlink_color } else { visuals.weak_text_color() };
        ui.painter().circle_filled(*place, if is_present { 4.5 } else { 3.0 }, color);
    }
}

/// The name or title of a version, its merit, and the change of the merit.
fn line_text(view: &SessionView, version: &HistoryNode) -> String {
    let title = capitalize(version.name.as_deref().unwrap_or(&version.title));
    let Some(merit) = version.merit else { return title };
    let short = number::format_digits(merit, 4);
    let before = version.parent.and_then(|id| node(view, id)?.merit);
    let changed = before.filter(|before| (merit - before).abs() >= LEAST_CHANGE * before.abs());
    let change = changed.and_then(|before| number::format_change(before, merit, 1));
    let seed = version.seed.map(|seed| format!(", seed {seed}")).unwrap_or_default();
    match change {
        Some(change) => format!("{title}: merit {short} ({change}){seed}"),
        None => format!("{title}: merit {short}{seed}"),
    }
}

/// The time of a version and what led to it.
fn time_text(version: &HistoryNode) -> String {
    let [hours, minutes, seconds] =
        [version.time / 3600 % 24, version.time / 60 % 60, version.time % 60];
    format!("{}, {hours:02}:{minutes:02}:{seconds:02} UTC", capitalize(&version.title))
}

/// The merit of an optimization against its steps; the step that was clicked, if one was.
pub(super) fn curve_plot(ui: &mut Ui, curve: &OptimizationCurve) -> Option<usize> {
    let points = curve.points.iter().filter(|point| point.merit > 0.0);
    let points: PlotPoints<'_> =
        points.map(|point| [point.step as f64, point.merit.log10()]).collect();
    let plot = fixed_plot("course of the optimization", CURVE_HEIGHT)
        .y_axis_min_width(40.0)
        .y_axis_formatter(|mark, _| decade_name(mark.value));
    let color = ui.visuals().hyperlink_color;
    let shown = plot.show(ui, |plot| plot.line(Line::new("merit", points).color(color)));
    let label = "Merit against steps of this version";
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, label));
    clicked_step(&shown.response, &shown.transform)
}
