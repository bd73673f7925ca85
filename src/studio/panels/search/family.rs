//! The ancestors of a lens: the last generations as a tree, with merit downwards and time to the
//! right, and the line of one of them in words.

use std::sync::Arc;

use egui::{
    Color32, CursorIcon, Label, Painter, Pos2, Rect, RichText, Role, Sense, Stroke, Ui, WidgetInfo,
    pos2, vec2,
};

use super::{ShownSearch, moves, text};
use crate::lens::Lens;
use crate::search::{LineageNode, OfferOutcome};
use crate::session::StructureSearchSnapshot;
use crate::studio::thumbnails::Thumbnails;

/// The number of last generations that the tree shows, besides the line of the selected one.
const MAX_NODES: usize = 80;
/// The distance in points within which the pointer picks a generation.
const NEAR: f32 = 10.0;
/// The height of the tree.
const HEIGHT: f32 = 120.0;

type Generation = Arc<LineageNode<Arc<Lens>>>;

/// Shows the tree; the generation that was clicked, if one was.
pub(super) fn tree(ui: &mut Ui, run: &StructureSearchSnapshot, number: u64) -> Option<u64> {
    let line: Vec<u64> = run.ancestry(number).map(|node| node.number).collect();
    let shown = shown_generations(run, &line);
    let size = vec2(ui.available_width(), HEIGHT);
    let (rect, response) = ui.allocate_exact_size(size, Sense::click());
    let label = format!("Family tree of {} generations", shown.len());
    response.widget_info(|| WidgetInfo::labeled(Role::Image, true, &label));
    let places = node_positions(&shown, rect.shrink2(vec2(8.0, 8.0)));
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
    draw_descent(&painter, ui, &shown, &places, &line);
    if let Some(i) = shown.iter().position(|node| node.number == number) {
        painter.circle_stroke(places[i], 6.5, Stroke::new(1.5, ui.visuals().strong_text_color()));
    }
    let (node, at) = nearest_generation(&shown, &places, response.hover_pos()?)?;
    painter.circle_stroke(at, 6.5, ui.visuals().selection.stroke);
    let text = format!(
        "Lens {}\n{}\n{}",
        node.number,
        text::mutation_text(node),
        text::outcome_text(node)
    );
    let response =
        response.on_hover_cursor(CursorIcon::PointingHand).on_hover_text_at_pointer(text);
    response.clicked().then_some(node.number)
}

/// Explains the places and the sizes of the tree.
pub(super) fn legend(ui: &mut Ui) {
    let text = "Merit downwards, logarithmic; time to the right. Large: retained.";
    ui.label(RichText::new(text).small().weak());
}

/// The latest generations, and all those on a line of descent.
fn shown_generations<'a>(run: &'a StructureSearchSnapshot, line: &[u64]) -> Vec<&'a Generation> {
    let first = run.lineage.len().saturating_sub(MAX_NODES);
    let is_shown = |(i, node): &(usize, &Generation)| *i >= first || line.contains(&node.number);
    run.lineage.iter().enumerate().filter(is_shown).map(|(_, node)| node).collect()
}

/// Draws every generation at its place, with a line from its parent.
fn draw_descent(painter: &Painter, ui: &Ui, shown: &[&Generation], places: &[Pos2], line: &[u64]) {
    let place_of = |wanted: u64| {
        let place = shown.iter().position(|node| node.number == wanted)?;
        Some(places[place])
    };
    for (node, at) in shown.iter().zip(places) {
        let on_line = line.contains(&node.number);
        if let Some(from) = node.parent.and_then(place_of) {
            let color = if on_line { ui.visuals().hyperlink_color } else { faint(ui) };
            let stroke = Stroke::new(if on_line { 1.8 } else { 0.7 }, color);
            painter.line_segment([from, *at], stroke);
        }
    }
    for (node, at) in shown.iter().zip(places) {
        let accepted = node.offer.is_some_and(OfferOutcome::is_accepted);
        let radius = if accepted { 4.2 } else { 2.4 };
        painter.circle_filled(*at, radius, moves::color(ui.visuals(), node.kind));
    }
}

/// The generation whose place is nearest to a pointer that is near one.
fn nearest_generation<'a>(
    shown: &[&'a Generation],
    places: &[Pos2],
    pointer: Pos2,
) -> Option<(&'a Generation, Pos2)> {
    let distance = |at: &Pos2| at.distance(pointer);
    let near =
        places.iter().enumerate().min_by(|(_, a), (_, b)| distance(a).total_cmp(&distance(b)));
    let (i, at) = near.filter(|(_, at)| distance(at) < NEAR)?;
    Some((shown[i], *at))
}

fn faint(ui: &Ui) -> Color32 {
    ui.visuals().weak_text_color().gamma_multiply(0.6)
}

/// The position of each generation: in the order of birth, the better the lower.
fn node_positions(shown: &[&Generation], rect: Rect) -> Vec<Pos2> {
    let height = |node: &Generation| {
        let merit = node.best_loss;
        if merit > 0.0 && merit.is_finite() { Some(merit.log10()) } else { None }
    };
    let heights = shown.iter().filter_map(|node| height(node));
    let (low, high) = heights.fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(y), h.max(y)));
    let range = (high - low).max(1e-9);
    let count = shown.len().saturating_sub(1).max(1) as f32;
    let place = |(i, node): (usize, &&Generation)| {
        let share = height(node).map_or(0.0, |y| ((high - y) / range) as f32);
        let x = rect.left() + rect.width() * i as f32 / count;
        pos2(x, rect.top() + rect.height() * share)
    };
    shown.iter().enumerate().map(place).collect()
}

/// Shows the ancestors of a lens in words, the youngest first; the clicked one, if any.
pub(super) fn ancestors(
    ui: &mut Ui,
    search: ShownSearch<'_>,
    number: u64,
    thumbnails: &mut Thumbnails,
) -> Option<u64> {
    let ShownSearch { view, run } = search;
    let mut clicked = None;
    let generations: Vec<&Generation> = run.ancestry(number).collect();
    if generations.is_empty() {
        ui.weak(format!("Lens {number} is no longer stored."));
    }
    for node in &generations {
        ui.horizontal(|ui| {
            let (rect, response) = ui.allocate_exact_size(vec2(86.0, 52.0), Sense::click());
            let label = format!("Show lens {}", node.number);
            response.widget_info(|| WidgetInfo::labeled(Role::Button, true, &label));
            ui.painter().rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
            thumbnails.paint(ui, &node.point, &view.lens, rect.shrink(2.0));
            if response.on_hover_cursor(CursorIcon::PointingHand).clicked() {
                clicked = Some(node.number);
            }
            ui.vertical(|ui| generation_text(ui, node));
        });
    }
    let oldest = generations.last();
    if let Some(parent) = oldest.and_then(|node| node.parent) {
        ui.weak(format!("Its parent, lens {parent}, is no longer stored."));
    }
    clicked
}

fn generation_text(ui: &mut Ui, node: &Generation) {
    ui.spacing_mut().item_spacing.y = 1.0;
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        if let Some(kind) = node.kind {
            moves::symbol(ui, kind);
        }
        ui.add(Label::new(RichText::new(format!("Lens {}", node.number)).strong()));
        ui.add(Label::new(text::mutation_text(node)).wrap());
    });
    for text in text::outcome_text(node).lines() {
        ui.add(Label::new(RichText::new(text).small().weak()).wrap());
    }
}
