//! The outcome and the weight of each kind of mutation, and its colour and symbol in plots.

use egui::{Color32, DragValue, Grid, RichText, Sense, Shape, Stroke, Ui, Vec2, Visuals, pos2};
use egui_plot::MarkerShape;

use super::ShownSearch;
use crate::search::{MutationKind, MutationStatistics, Refusal, SteerCommand};
use crate::session::{StructureSearchCommand, StructureSearchSnapshot};
use crate::studio::actions::Actions;
use crate::studio::number;
use crate::studio::palette::{Palette, color32};
use crate::studio::text::capitalize;

const HEADINGS: [(&str, &str); 7] = [
    ("Mutation", ""),
    ("Weight", "Relative frequency; 0 excludes the mutation"),
    ("Tried", "Number of attempts"),
    ("Refused", "Attempts that did not apply; hover for the most common reason"),
    ("Better", "Ended descents that gave a better lens than the one before the mutation"),
    ("Retained", "Descents whose lens was retained"),
    ("Length", "Mean length of its descents, in moves"),
];

/// The table of all kinds.
pub(super) fn table(ui: &mut Ui, search: ShownSearch<'_>, actions: &mut Actions) {
    Grid::new("moves").num_columns(HEADINGS.len()).spacing([9.0, 3.0]).striped(true).show(
        ui,
        |ui| {
            for (name, hint) in HEADINGS {
                let label = ui.weak(name);
                if !hint.is_empty() {
                    label.on_hover_text(hint);
                }
            }
            ui.end_row();
            // Displacements are made in iterated searches, and are no row of other runs.
            let is_made = |kind: &MutationKind| {
                *kind != MutationKind::Displacement
                    || search.run.statistics.kinds.contains_key(kind)
            };
            for kind in kinds().filter(is_made) {
                row(ui, search, kind, actions);
                ui.end_row();
            }
        },
    );
    refusal_summary(ui, search.run);
}

fn row(ui: &mut Ui, search: ShownSearch<'_>, kind: MutationKind, actions: &mut Actions) {
    let ShownSearch { view, run } = search;
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        symbol(ui, kind);
        ui.label(kind.name());
    });
    let mut weight = run.weights.of(kind);
    let drag = DragValue::new(&mut weight).range(0.0..=100.0).speed(0.02).max_decimals(2);
    let name = format!("Weight of {}", kind.name());
    let drag = ui.add_enabled(view.structure_search.run.is_active(), drag).accessible_name(&name);
    if drag.changed() {
        actions.push(StructureSearchCommand::Control(SteerCommand::Weight(kind, weight)));
    }
    let statistics = run.statistics.kinds.get(&kind).cloned().unwrap_or_default();
    ui.label(statistics.tried.to_string());
    refusal_cell(ui, kind, &statistics);
    ui.label(format!("{} of {}", statistics.improved, statistics.ended));
    ui.label(statistics.entered.to_string());
    let life = statistics.mean_moves().map(|moves| number::format_digits(moves, 3));
    ui.label(life.unwrap_or_else(|| "–".to_owned()));
}

fn refusal_cell(ui: &mut Ui, kind: MutationKind, statistics: &MutationStatistics) {
    let refused: u64 = statistics.refused.values().sum();
    let label = ui.label((refused + statistics.rejected).to_string());
    if let Some((why, count)) = most_common_refusal(statistics) {
        label
            .on_hover_text(format!("{} was refused {count} times: {why}", capitalize(kind.name())));
    }
}

fn most_common_refusal(statistics: &MutationStatistics) -> Option<(Refusal, u64)> {
    let most = statistics.refused.iter().max_by_key(|(_, count)| **count);
    most.map(|(refusal, count)| (*refusal, *count))
}

/// The commonest reason of each kind, in words.
fn refusal_summary(ui: &mut Ui, run: &StructureSearchSnapshot) {
    ui.add_space(6.0);
    for kind in kinds() {
        let statistics = run.statistics.kinds.get(&kind);
        if let Some((why, count)) = statistics.and_then(most_common_refusal) {
            let text = format!("{}, {count} × refused: {}", kind.name(), why);
            ui.label(RichText::new(capitalize(&text)).small().weak());
        }
    }
}

/// Every kind, in the order in which they are shown.
pub(super) fn kinds() -> impl Iterator<Item = MutationKind> {
    MutationKind::MUTATIONS.into_iter().chain([MutationKind::Global, MutationKind::Displacement])
}

/// The place of a kind among all.
fn index(kind: MutationKind) -> usize {
    kinds().position(|other| other == kind).unwrap_or(0)
}

/// The colour of a kind; the strong one for the start.
pub(super) fn color(visuals: &Visuals, kind: Option<MutationKind>) -> Color32 {
    let palette = Palette::for_visuals(visuals);
    kind.map_or_else(|| visuals.strong_text_color(), |kind| color32(palette.mutation(index(kind))))
}

/// The shape of a kind.
pub(super) fn shape(kind: MutationKind) -> MarkerShape {
    const SHAPES: [MarkerShape; 10] = [
        MarkerShape::Up,
        MarkerShape::Down,
        MarkerShape::Square,
        MarkerShape::Diamond,
        MarkerShape::Left,
        MarkerShape::Circle,
        MarkerShape::Right,
        MarkerShape::Asterisk,
        MarkerShape::Plus,
        MarkerShape::Cross,
    ];
    SHAPES[index(kind) % SHAPES.len()]
}

/// The lines of two marks.
const PLUS: [[f32; 4]; 2] = [[-1.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 1.0]];
const CROSS: [[f32; 4]; 2] = [[-0.8, -0.8, 0.8, 0.8], [-0.8, 0.8, 0.8, -0.8]];

/// The side of a mark in a line of text, in points.
pub(super) const SYMBOL: f32 = 11.0;

/// The mark of a kind, in a line of text.
pub(super) fn symbol(ui: &mut Ui, kind: MutationKind) {
    let (rect, _) = ui.allocate_exact_size(Vec2::splat(SYMBOL), Sense::hover());
    let (center, color) = (rect.center(), color(ui.visuals(), Some(kind)));
    let corner = |x: f32, y: f32| pos2(center.x + 4.5 * x, center.y + 4.5 * y);
    let filled = |corners: Vec<egui::Pos2>| Shape::convex_polygon(corners, color, Stroke::NONE);
    let strokes = |lines: &[[f32; 4]]| {
        let line = |[a, b, c, d]: &[f32; 4]| {
            Shape::line_segment([corner(*a, *b), corner(*c, *d)], Stroke::new(1.5, color))
        };
        Shape::Vec(lines.iter().map(line).collect())
    };
    let shape = match shape(kind) {
        MarkerShape::Up => filled(vec![corner(0.0, -1.0), corner(0.9, 0.8), corner(-0.9, 0.8)]),
        MarkerShape::Down => filled(vec![corner(0.0, 1.0), corner(0.9, -0.8), corner(-0.9, -0.8)]),
        MarkerShape::Left => filled(vec![corner(-1.0, 0.0), corner(0.8, -0.9), corner(0.8, 0.9)]),
        MarkerShape::Right => filled(vec![corner(1.0, 0.0), corner(-0.8, -0.9), corner(-0.8, 0.9)]),
        MarkerShape::Square => {
            filled(vec![corner(-0.8, -0.8), corner(0.8, -0.8), corner(0.8, 0.8), corner(-0.8, 0.8)])
        }
        MarkerShape::Diamond => {
            filled(vec![corner(0.0, -1.0), corner(1.0, 0.0), corner(0.0, 1.0), corner(-1.0, 0.0)])
        }
        MarkerShape::Plus => strokes(&PLUS),
        MarkerShape::Cross => strokes(&CROSS),
        MarkerShape::Asterisk => Shape::Vec(vec![strokes(&PLUS), strokes(&CROSS)]),
        MarkerShape::Circle => Shape::circle_filled(center, 4.0, color),
    };
    ui.painter().add(shape);
}
