//! The tree of versions: a line for each, with a mark in the column of its branch.

use std::collections::BTreeMap;

use egui::text::{LayoutJob, TextFormat, TextWrapping};
use egui::{Color32, Pos2, Rect, Role, Sense, Stroke, TextStyle, Ui, Vec2, WidgetInfo, pos2, vec2};

use super::node;
use crate::session::{HistoryNode, OptimizationCurve, SessionView};
use crate::studio::number;
use crate::studio::panels::optimizer::clicked_step;
use crate::studio::panels::widgets::{fixed_plot, log_axis, plot_curve};
use crate::studio::text::capitalize;
use crate::studio::thumbnails::Thumbnails;

/// The largest width of a branch and the height of a version.
const CELL: [f32; 2] = [12.0, 46.0];
/// The width of all branches that leaves room for the words, and the smallest width of one.
const BRANCHES_WIDTH: f32 = 96.0;
const LEAST_BRANCH_WIDTH: f32 = 4.0;
/// The size of the drawing of a version.
const THUMBNAIL: Vec2 = vec2(84.0, 42.0);
/// The most branches beside each other; those beyond have no lines.
const MAX_BRANCHES: usize = 40;
/// The smallest change of the merit that is told, relative to it.
const LEAST_CHANGE: f64 = 5e-4;
/// The height of the curve of an optimization.
const CURVE_HEIGHT: f32 = 92.0;

/// Shows the tree, the newest version first; the one that was clicked, if one was.
pub(super) fn tree(
    ui: &mut Ui,
    view: &SessionView,
    selected: Option<u64>,
    thumbnails: &mut Thumbnails,
) -> Option<u64> {
    let columns = columns(view);
    let count = columns.values().max().map_or(1, |last| last + 1).min(MAX_BRANCHES);
    let width = (BRANCHES_WIDTH / count as f32).clamp(LEAST_BRANCH_WIDTH, CELL[0]);
    let mut marks: BTreeMap<u64, Pos2> = BTreeMap::new();
    let mut clicked = None;
    ui.spacing_mut().item_spacing.y = 0.0;
    for version in view.history.iter().rev() {
        ui.horizontal(|ui| {
            let size = vec2(width * count as f32, CELL[1]);
            let (rect, _) = ui.allocate_exact_size(size, Sense::hover());
            let column = columns.get(&version.id).copied().unwrap_or(0);
            if column < count {
                let place = pos2(rect.left() + width * (column as f32 + 0.5), rect.center().y);
                marks.insert(version.id, place);
            }
            let (drawing, _) = ui.allocate_exact_size(THUMBNAIL, Sense::hover());
            if ui.is_rect_visible(drawing) {
                thumbnails.paint(ui, &version.lens, &version.lens, drawing);
            }
            if version_button(ui, view, version, selected == Some(version.id)) {
                clicked = Some(version.id);
            }
        });
    }
    paint_branches(ui, view, &marks);
    clicked
}

/// The title of a version above its merit, its seed and its time; true if it was clicked.
fn version_button(
    ui: &mut Ui,
    view: &SessionView,
    version: &HistoryNode,
    is_selected: bool,
) -> bool {
    let is_present = version.id == view.version_id;
    let size = vec2(ui.available_width(), CELL[1]);
    let (rect, response) = ui.allocate_exact_size(size, Sense::click());
    let look = ui.style().interact_selectable(&response, is_selected);
    if is_selected || response.hovered() || response.has_focus() {
        ui.painter().rect_filled(rect, look.corner_radius, look.weak_bg_fill);
    }
    let visuals = ui.visuals();
    let own = |color| if is_selected { visuals.selection.stroke.color } else { color };
    let first = if is_present { visuals.strong_text_color() } else { visuals.text_color() };
    let facts = [facts_text(view, version), clock_text(version)];
    let facts = facts.into_iter().filter(|fact| !fact.is_empty()).collect::<Vec<_>>().join(", ");
    let lines = [
        (title_text(version), TextStyle::Body, own(first), 2),
        (facts, TextStyle::Small, own(visuals.weak_text_color()), 1),
    ];
    paint_lines(ui, rect.shrink2(vec2(5.0, 0.0)), lines);
    let label = line_text(view, version);
    let label = if is_present { format!("Present version: {label}") } else { label };
    response.widget_info(|| WidgetInfo::labeled(Role::Button, true, &label));
    response.on_hover_text(format!("{label}\n{}", time_text(version))).clicked()
}

/// Texts below each other in the middle of a place; each is cut after some rows.
fn paint_lines(ui: &Ui, rect: Rect, lines: [(String, TextStyle, Color32, usize); 2]) {
    let galleys = lines.map(|(text, style, color, max_rows)| {
        let format = TextFormat::simple(style.resolve(ui.style()), color);
        let mut job = LayoutJob::single_section(text, format);
        job.wrap = TextWrapping { max_width: rect.width(), max_rows, ..TextWrapping::default() };
        ui.painter().layout_job(job)
    });
    let height: f32 = galleys.iter().map(|galley| galley.size().y).sum();
    let mut place = rect.left_center() - vec2(0.0, 0.5 * height);
    for galley in galleys {
        let step = galley.size().y;
        ui.painter_at(rect).galley(place, galley, ui.visuals().text_color());
        place.y += step;
    }
}

/// The column of each version.
fn columns(view: &SessionView) -> BTreeMap<u64, usize> {
    let rows: BTreeMap<u64, usize> =
        view.history.iter().enumerate().map(|(row, version)| (version.id, row)).collect();
    let parent = |version: &HistoryNode| rows.get(&version.parent?).copied();
    let parents: Vec<Option<usize>> = view.history.iter().map(|version| parent(version)).collect();
    view.history.iter().map(|version| version.id).zip(assign_columns(&parents)).collect()
}

/// The column of each version by the row of its parent: that of the parent for its first child. Any other one
/// begins a branch, which has a column to itself from the row of the parent to its last version.
fn assign_columns(parents: &[Option<usize>]) -> Vec<usize> {
    let branches = branches(parents);
    let mut last = vec![0; parents.len()];
    branches.iter().enumerate().for_each(|(row, first)| last[*first] = row);
    let mut taken: Vec<Vec<[usize; 2]>> = Vec::new();
    let mut columns = vec![0; parents.len()];
    for (row, first) in branches.into_iter().enumerate() {
        if first != row {
            columns[row] = columns[first];
            continue;
        }
        let span = [parents[row].unwrap_or(row), last[row]];
        let is_free = |spans: &Vec<[usize; 2]>| {
            spans.iter().all(|other| other[1] < span[0] || span[1] < other[0])
        };
        columns[row] = taken.iter().position(is_free).unwrap_or(taken.len());
        taken.resize(taken.len().max(columns[row] + 1), Vec::new());
        taken[columns[row]].push(span);
    }
    columns
}

/// The row of the first version of the branch of each version.
fn branches(parents: &[Option<usize>]) -> Vec<usize> {
    let mut is_followed = vec![false; parents.len()];
    let mut branches: Vec<usize> = Vec::with_capacity(parents.len());
    for (row, parent) in parents.iter().enumerate() {
        let goes_on = parent.filter(|parent| !std::mem::replace(&mut is_followed[*parent], true));
        branches.push(goes_on.map_or(row, |parent| branches[parent]));
    }
    branches
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

/// The name or title of a version.
fn title_text(version: &HistoryNode) -> String {
    capitalize(version.name.as_deref().unwrap_or(&version.title))
}

/// The merit of a version, its change, and the seed of the run that found it.
fn facts_text(view: &SessionView, version: &HistoryNode) -> String {
    let before = version.parent.and_then(|id| node(view, id)?.merit);
    let merit = version.merit.map(|merit| {
        let changed = before.filter(|old| (merit - old).abs() >= LEAST_CHANGE * old.abs());
        let change = changed.and_then(|before| number::format_change(before, merit, 1));
        let change = change.map(|change| format!(" ({change})")).unwrap_or_default();
        format!("merit {}{change}", number::format_digits(merit, 4))
    });
    let seed = version.seed.map(|seed| format!("seed {seed}"));
    merit.into_iter().chain(seed).collect::<Vec<_>>().join(", ")
}

/// The title of a version with what is known of it.
fn line_text(view: &SessionView, version: &HistoryNode) -> String {
    let facts = facts_text(view, version);
    let separator = if facts.is_empty() { "" } else { ": " };
    format!("{}{separator}{facts}", title_text(version))
}

/// The time of day of a version.
fn clock_text(version: &HistoryNode) -> String {
    let [hours, minutes, seconds] =
        [version.time / 3600 % 24, version.time / 60 % 60, version.time % 60];
    format!("{hours:02}:{minutes:02}:{seconds:02} UTC")
}

/// The time of a version and what led to it.
fn time_text(version: &HistoryNode) -> String {
    format!("{}, {}", capitalize(&version.title), clock_text(version))
}

/// The merit of an optimization against its steps; the step that was clicked, if one was.
pub(super) fn curve_plot(ui: &mut Ui, curve: &OptimizationCurve) -> Option<usize> {
    let points = curve.points.iter().filter(|point| point.merit > 0.0);
    let points = points.map(|point| [point.step as f64, point.merit.log10()]);
    let plot = fixed_plot(ui, "course of the optimization", CURVE_HEIGHT).x_axis_label("step");
    let plot = log_axis(plot, "merit");
    let color = ui.visuals().hyperlink_color;
    let shown = plot.show(ui, |plot| plot.line(plot_curve("merit", points).color(color)));
    let label = "Merit against steps of this version";
    shown.response.widget_info(|| WidgetInfo::labeled(Role::Image, true, label));
    clicked_step(&shown.response, &shown.transform)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_that_are_tried_from_one_version_have_columns_of_their_own() {
        let parents: Vec<Option<usize>> =
            std::iter::once(None).chain((1..13).map(|_| Some(0))).collect();
        assert_eq!(assign_columns(&parents), [0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]);
    }

    #[test]
    fn a_column_is_taken_again_where_its_branch_has_ended() {
        // A trial from each of the versions 0, 2, and 4 of a chain.
        let parents =
            [None, Some(0), Some(0), Some(1), Some(3), Some(3), Some(4), Some(6), Some(6)];
        assert_eq!(assign_columns(&parents), [0, 0, 1, 0, 0, 1, 0, 0, 1]);
        // A branch that goes on beside the first one.
        let parents = [None, Some(0), Some(0), Some(2), Some(1), Some(3), Some(1)];
        assert_eq!(assign_columns(&parents), [0, 0, 1, 1, 0, 1, 2]);
    }
}
