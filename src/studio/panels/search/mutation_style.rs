//! The colour and the symbol of each kind of mutation.

use egui::{Color32, Sense, Shape, Stroke, Ui, Visuals, pos2, vec2};
use egui_plot::MarkerShape;

use crate::search::MutationKind;
use crate::studio::palette::{Palette, color32};

/// Every kind, in the order in which they are shown.
pub(super) fn kinds() -> impl Iterator<Item = MutationKind> {
    MutationKind::MUTATIONS.into_iter().chain([MutationKind::Global])
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

/// The mark of a kind, in a line of text.
pub(super) fn symbol(ui: &mut Ui, kind: MutationKind) {
    let (rect, _) = ui.allocate_exact_size(vec2(11.0, 11.0), Sense::hover());
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
