//! Legibility of the window: texts stand out from the ground below them, and nothing covers the parts
//! that a person needs to see.

use aplanat::optimize::pareto::{Front, ParetoPoint};
use aplanat::session::{Command, RunStatus, SessionView};
use aplanat::studio::panels::ParetoPanel;
use egui::epaint::{ClippedShape, TextShape};
use egui::{Color32, Pos2, Rect, Rgba, Shape, Theme};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use std::collections::BTreeSet;
use std::sync::Arc;

use crate::harness::{LOWER, PanelState, painted_places, panel_harness, small_harness};
use crate::panels::fronts;
use crate::window::window;

/// The least contrast of small text (WCAG 2.1, success criterion 1.4.3).
const READABLE: f32 = 4.5;
/// The least contrast of any text, notes beside the numbers included.
const DISCERNIBLE: f32 = 3.0;

/// The shapes of a frame, in the order in which they are painted.
fn shapes(painted: &[ClippedShape]) -> Vec<&Shape> {
    fn add<'a>(shape: &'a Shape, all: &mut Vec<&'a Shape>) {
        match shape {
            Shape::Vec(parts) => parts.iter().for_each(|part| add(part, all)),
            shape => all.push(shape),
        }
    }
    let mut all = Vec::new();
    painted.iter().for_each(|clipped| add(&clipped.shape, &mut all));
    all
}

/// The relative luminance of an opaque colour.
fn luminance(color: Color32) -> f32 {
    let color = Rgba::from(color);
    0.2126 * color.r() + 0.7152 * color.g() + 0.0722 * color.b()
}

/// The contrast of two opaque colours, 1 to 21.
fn contrast(a: Color32, b: Color32) -> f32 {
    let [a, b] = [luminance(a), luminance(b)];
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

fn text_color(text: &TextShape) -> Color32 {
    let own = text.galley.job.sections.first().map(|section| section.format.color);
    let own = own.filter(|color| *color != Color32::PLACEHOLDER);
    text.override_text_color.or(own).unwrap_or(text.fallback_color)
}

/// The colour of the last opaque rectangle below a place, of those that are painted first.
fn ground(below: &[&Shape], place: Pos2) -> Option<Color32> {
    below.iter().rev().find_map(|shape| match shape {
        Shape::Rect(rect) if rect.fill.is_opaque() && rect.rect.contains(place) => Some(rect.fill),
        _ => None,
    })
}

/// The texts of a frame with their contrast to what lies below them.
fn contrasts(painted: &[ClippedShape]) -> Vec<(String, f32)> {
    let all = shapes(painted);
    let texts = all.iter().enumerate().filter_map(|(i, shape)| match shape {
        Shape::Text(text) if text_color(text).is_opaque() => Some((i, text)),
        _ => None,
    });
    let of_text = |(i, text): (usize, &TextShape)| {
        let ground = ground(&all[..i], text.visual_bounding_rect().center())?;
        Some((text.galley.text().to_owned(), contrast(text_color(text), ground)))
    };
    texts.filter_map(of_text).collect()
}

fn front(view: SessionView, theme: Theme) -> Harness<'static, PanelState<ParetoPanel>> {
    let mut harness = panel_harness(ParetoPanel::default(), view);
    harness.ctx.set_theme(theme);
    harness.run();
    harness
}

#[test]
fn the_text_of_a_progress_bar_is_readable_in_both_themes() {
    for theme in [Theme::Dark, Theme::Light] {
        let harness = front(fronts(RunStatus::Running), theme);
        let contrasts = contrasts(&harness.output().shapes);
        let of_bar = contrasts.iter().find(|(text, _)| text.starts_with("Running"));
        let (text, contrast) = of_bar.expect("a progress bar with its text");
        assert!(*contrast >= READABLE, "{theme:?}: {text}: {contrast}");
    }
}

#[test]
fn every_text_of_the_window_stands_out_in_both_themes() {
    let mut harness = window();
    for theme in [Theme::Dark, Theme::Light] {
        harness.ctx.set_theme(theme);
        harness.run_steps(3);
        let contrasts = contrasts(&harness.output().shapes);
        assert!(contrasts.len() > 100);
        for (text, contrast) in contrasts {
            assert!(contrast >= DISCERNIBLE, "{theme:?}: {text}: {contrast}");
        }
    }
}

/// The places of the crosses of a plot: the middles of short lines of a colour.
fn crosses(painted: &[ClippedShape], color: Color32) -> Vec<Pos2> {
    let cross = |shape: &&Shape| match shape {
        Shape::LineSegment { points: [a, b], stroke } => {
            let is_stroke = (4.0..20.0).contains(&a.distance(*b)) && stroke.color == color;
            is_stroke.then(|| a.lerp(*b, 0.5))
        }
        _ => None,
    };
    shapes(painted).iter().filter_map(cross).collect()
}

#[test]
fn the_legend_of_the_front_does_not_cover_the_start() {
    for (spot, light) in [(0.002, 10.0), (0.002, 110.0), (0.09, 10.0), (0.09, 110.0)] {
        let mut view = fronts(RunStatus::Finished);
        let run = Arc::make_mut(view.pareto.run.snapshot.as_mut().unwrap());
        let start = Arc::make_mut(&mut run.start);
        (start.spot, start.light) = (spot, light);
        let harness = front(view, Theme::Dark);
        let legend = ["start", "run 2: 0.5000", "fixed rays: 0.5000"];
        let legend = legend.map(|entry| harness.get_by_label(entry).rect());
        let legend = legend.into_iter().fold(Rect::NOTHING, Rect::union);
        let color = harness.ctx.global_style().visuals.strong_text_color();
        let starts = crosses(&harness.output().shapes, color);
        assert!(!starts.is_empty(), "the start is drawn");
        for start in starts {
            assert!(!legend.contains(start), "{spot} mm, {light} mm²: {start:?} in {legend:?}");
        }
    }
}

/// The default room of the panel in a window of 1280 by 800 points.
fn small_front(view: SessionView) -> Harness<'static, PanelState<ParetoPanel>> {
    let mut harness = small_harness(ParetoPanel::default(), view, LOWER);
    harness.run();
    harness
}

/// Wherever the lenses of a front lie, its legend is beside the plot.
#[test]
fn the_legend_of_the_front_covers_no_lens() {
    let harness = small_front(fronts(RunStatus::Finished));
    let plot = harness.get_by_label_contains("Front of ").rect();
    assert!(plot.height() > 90.0, "{plot:?}");
    for entry in ["tried", "start", "run 2: 0.5000", "fixed rays: 0.5000"] {
        let entry = harness.get_by_label(entry).rect();
        assert!(!plot.intersects(entry), "{entry:?} in {plot:?}");
    }
    let texts = painted_places(&harness);
    let title = texts.iter().find(|(text, _)| text.starts_with("RMS") && text.ends_with("µm"));
    // It is turned: its length is along the axis.
    let length = title.expect("the axis has a title").1.width();
    assert!(length < plot.height(), "{length} along {}", plot.height());
}

/// An axis without numbers tells nothing, however little of it a front takes.
#[test]
fn every_axis_of_the_front_has_two_numbers_at_least() {
    for width in [0.02, 0.3, 1.9, 5.0] {
        let mut view = fronts(RunStatus::Finished);
        view.pareto.earlier.clear();
        let run = Arc::make_mut(view.pareto.run.snapshot.as_mut().unwrap());
        run.biased = None;
        let near = |share: f64| {
            let start = &run.start;
            let (spot, light) = (0.024 + 1e-3 * share * width, 70.0 + share * width);
            Arc::new(ParetoPoint { spot, light, ..ParetoPoint::clone(start) })
        };
        let (start, points) = (near(0.0), [0.4, 0.7, 1.0].map(near));
        let mut front = Front::default();
        points.iter().for_each(|point| {
            front.insert(ParetoPoint::clone(point));
        });
        (run.start, run.main.front) = (start, Arc::new(front));
        let harness = small_front(view);
        let plot = harness.get_by_label_contains("Front of ").rect();
        let numbers: Vec<_> = painted_places(&harness)
            .into_iter()
            .filter(|(text, place)| text.parse::<f64>().is_ok() && place.top() > plot.top() - 10.0)
            .collect();
        let left: Vec<_> =
            numbers.iter().filter(|(_, place)| place.right() <= plot.left() + 1.0).collect();
        let below: Vec<_> =
            numbers.iter().filter(|(_, place)| place.top() >= plot.bottom() - 1.0).collect();
        for axis in [left, below] {
            let texts: BTreeSet<_> = axis.iter().map(|(text, _)| text).collect();
            assert!(texts.len() >= 2 && texts.len() == axis.len(), "{width}: {axis:?}");
        }
    }
}

#[test]
fn a_long_message_ends_before_the_texts_at_the_right() {
    let mut harness = window();
    let path = format!("/nowhere/{}.json", "long/".repeat(60));
    harness.state_mut().session_mut().apply(Command::Open(path.into()));
    harness.run_steps(3);
    let message = harness.get_all_by_label_contains("/nowhere/").last().unwrap().rect();
    let timing = harness.get_by_label_contains("all numbers in").rect();
    assert!(message.right() <= timing.left(), "{message:?} {timing:?}");
    assert!(message.left() < 200.0 && timing.right() > 1200.0);
}

#[test]
fn the_explanation_of_a_menu_item_covers_no_item() {
    let mut harness = window();
    harness.ctx.all_styles_mut(|style| {
        style.interaction.tooltip_delay = 0.0;
        style.interaction.show_tooltips_only_when_still = false;
    });
    harness.state_mut().session_mut().apply(Command::Select(Some(2)));
    harness.get_by_label("Element").click();
    // No explanation follows a click for a moment.
    harness.run_steps(30);
    let hints = [
        ("Add an element…", "A singlet or a cemented doublet of some focal length"),
        ("Reverse the element", "The last surface comes first"),
        ("Remove the element", "Air takes its place"),
    ];
    let items = hints.map(|(item, _)| harness.get_by_label_contains(item).rect());
    for (item, hint) in hints {
        harness.get_by_label_contains(item).hover();
        harness.run_steps(6);
        let hint = harness.get_by_label(hint).rect();
        for covered in items {
            assert!(!hint.intersects(covered), "{item}: {hint:?} over {covered:?}");
        }
    }
}

/// What is written on a selected row is read as well as anything else.
#[test]
fn the_text_of_a_selected_row_is_readable_in_both_themes() {
    let mut harness = window();
    harness.state_mut().session_mut().apply(Command::Select(Some(2)));
    for theme in [Theme::Dark, Theme::Light] {
        harness.ctx.set_theme(theme);
        harness.run_steps(3);
        let selection = harness.ctx.global_style().visuals.selection.bg_fill;
        let painted = harness.output().shapes.clone();
        let all = shapes(&painted);
        let mut count = 0;
        for (i, shape) in all.iter().enumerate() {
            let Shape::Text(text) = shape else { continue };
            let place = text.visual_bounding_rect().center();
            let words = text.galley.text();
            if ground(&all[..i], place) == Some(selection) && words.contains(char::is_alphanumeric)
            {
                count += usize::from(text_color(text).is_opaque());
                let contrast = contrast(text_color(text), selection);
                assert!(contrast >= READABLE, "{theme:?}: {words}: {contrast}");
            }
        }
        assert!(count >= 4, "{theme:?}: {count} texts of the row");
    }
}
