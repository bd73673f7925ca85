//! The retained lenses as cards with thumbnails, and the buttons of the selected one.

use std::sync::Arc;

use egui::{
    Align2, Button, Color32, CursorIcon, FontId, Rect, Response, Role, Sense, Stroke, StrokeKind,
    Ui, Vec2, WidgetInfo, pos2, vec2,
};

use super::{SelectedLens, ShownSearch, text};
use crate::search::SteerCommand;
use crate::session::{Command, FoundLens, SessionView, StructureSearchCommand};
use crate::studio::actions::Actions;
use crate::studio::file_dialog::FileRequest;
use crate::studio::panels::total_track;
use crate::studio::panels::widgets::{ActionButton, action_buttons};
use crate::studio::thumbnails::Thumbnails;

/// The least width and the height of a card.
const CARD: Vec2 = vec2(148.0, 112.0);
/// The least height of a card.
const MIN_HEIGHT: f32 = 84.0;
/// The part of a card for its words.
const WORDS: f32 = 30.0;
/// The part of a card for its number, above the drawing.
const CORNER: f32 = 12.0;

/// The number by which the retained lenses are sorted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum CardOrder {
    /// The smallest merit first.
    #[default]
    Merit,
    /// The smallest spot first.
    Spot,
    /// The brightest first.
    Light,
    /// The fewest elements first.
    Elements,
    /// The shortest first.
    Length,
}

impl CardOrder {
    /// Every order.
    pub(super) const ALL: [Self; 5] =
        [Self::Merit, Self::Spot, Self::Light, Self::Elements, Self::Length];

    /// The order in words.
    pub(super) const fn text(self) -> &'static str {
        match self {
            Self::Merit => "By merit",
            Self::Spot => "By spot",
            Self::Light => "By light",
            Self::Elements => "By elements",
            Self::Length => "By length",
        }
    }

    /// The number of a lens, less for one that comes first; infinite for one that has none yet.
    fn key(self, found: &FoundLens) -> f64 {
        let score = found.score.as_ref().and_then(|scored| scored.score.as_ref().ok());
        let key = match self {
            Self::Merit => Some(found.merit),
            Self::Spot => score.map(|point| point.spot),
            Self::Light => score.map(|point| -point.light),
            Self::Elements => Some(found.elements as f64),
            Self::Length => total_track(&found.lens, 0),
        };
        key.unwrap_or(f64::INFINITY)
    }
}

/// The places of the cards, which they keep while the pointer is over them: a click gets the lens that
/// is seen, although the search goes on.
#[derive(Debug, Default)]
pub(super) struct CardPlaces {
    placed: Vec<Arc<FoundLens>>,
    /// The area of the cards in the last frame.
    area: Option<Rect>,
}

impl CardPlaces {
    /// The lenses, sorted, in the places of their cards.
    fn arrange(&mut self, ui: &Ui, sorted: Vec<Arc<FoundLens>>) -> Vec<Arc<FoundLens>> {
        let is_pointed_at = self.area.is_some_and(|area| ui.rect_contains_pointer(area));
        self.placed = if is_pointed_at { keep_places(&self.placed, sorted) } else { sorted };
        self.placed.clone()
    }
}

/// The lenses in the places that they had; others come where one has left, or at the end.
fn keep_places(before: &[Arc<FoundLens>], lenses: Vec<Arc<FoundLens>>) -> Vec<Arc<FoundLens>> {
    let is_same = |a: &FoundLens, b: &FoundLens| a.number == b.number && a.lens == b.lens;
    let (mut known, new): (Vec<_>, Vec<_>) =
        lenses.into_iter().partition(|lens| before.iter().any(|placed| is_same(placed, lens)));
    let mut new = new.into_iter();
    let mut places: Vec<Arc<FoundLens>> = before
        .iter()
        .filter_map(|placed| match known.iter().position(|lens| is_same(placed, lens)) {
            Some(i) => Some(known.swap_remove(i)),
            None => new.next(),
        })
        .collect();
    places.extend(new);
    places
}

/// Shows the retained lenses in an order; the clicked one, if any.
pub(super) fn cards(
    ui: &mut Ui,
    search: ShownSearch<'_>,
    chosen: Option<&SelectedLens>,
    order: CardOrder,
    places: &mut CardPlaces,
    thumbnails: &mut Thumbnails,
) -> Option<Arc<FoundLens>> {
    let run = search.run;
    let same =
        |found: &Arc<FoundLens>| (found.number, found.merit) == (run.best.number, run.best.merit);
    let is_retained = run.reservoir.iter().any(same);
    let best = (!is_retained).then_some(&run.best);
    let keyed = best.into_iter().chain(&run.reservoir).map(|found| (order.key(found), found));
    let mut shown: Vec<_> = keyed.collect();
    shown.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let shown = shown.into_iter().map(|(_, found)| Arc::clone(found)).collect();
    let shown = places.arrange(ui, shown);
    let drawn = ui.scope(|ui| card_rows(ui, search, chosen, &shown, thumbnails));
    places.area = Some(drawn.response.rect);
    drawn.inner
}

/// Shows cards side by side in rows; the lens of the clicked one, if any.
fn card_rows(
    ui: &mut Ui,
    search: ShownSearch<'_>,
    chosen: Option<&SelectedLens>,
    shown: &[Arc<FoundLens>],
    thumbnails: &mut Thumbnails,
) -> Option<Arc<FoundLens>> {
    let ShownSearch { view, run } = search;
    let width = ui.available_width();
    let gap = 4.0;
    let columns = ((width + gap) / (CARD.x + gap)).floor().max(1.0);
    // A row of cards is visible whole where that is possible.
    let height = (ui.available_height() - gap).clamp(MIN_HEIGHT, CARD.y);
    let size = vec2((width - gap * (columns - 1.0)) / columns, height);
    let mut clicked = None;
    ui.spacing_mut().item_spacing = vec2(gap, gap);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small number")]
    for row in shown.chunks(columns as usize) {
        ui.horizontal(|ui| {
            for found in row {
                let look = CardStyle {
                    selected: chosen.is_some_and(|chosen| chosen.is(found)),
                    mark: match found.number {
                        _ if !run.reservoir.iter().any(|kept| Arc::ptr_eq(kept, found)) => {
                            CardMark::Best
                        }
                        number if run.pinned == Some(number) => CardMark::Pinned,
                        _ => CardMark::None,
                    },
                };
                if card(ui, view, found, size, look, thumbnails).clicked() {
                    clicked = Some(Arc::clone(found));
                }
            }
        });
    }
    clicked
}

/// The style of a card.
#[derive(Clone, Copy)]
struct CardStyle {
    selected: bool,
    mark: CardMark,
}

/// The word on a card.
#[derive(Clone, Copy)]
enum CardMark {
    None,
    /// New descents start from the lens.
    Pinned,
    /// The best lens of a generation that still descends: the card beside it may have its number.
    Best,
}

impl CardMark {
    const fn text(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Pinned => "pinned",
            Self::Best => "best so far",
        }
    }
}

fn card(
    ui: &mut Ui,
    view: &SessionView,
    found: &FoundLens,
    size: Vec2,
    look: CardStyle,
    thumbnails: &mut Thumbnails,
) -> Response {
    let (rect, response) = ui.allocate_exact_size(size, Sense::click());
    let text = text::lens_text(found);
    let mark = look.mark.text();
    let separator = if mark.is_empty() { "" } else { ", " };
    let words = text.replace('\n', ", ");
    let label = format!("Lens {}{separator}{mark}: {words}", found.number);
    response.widget_info(|| WidgetInfo::labeled(Role::Button, true, &label));
    let visuals = ui.visuals();
    let stroke = if look.selected {
        Stroke::new(2.0, visuals.selection.stroke.color)
    } else if response.hovered() || response.has_focus() {
        visuals.widgets.hovered.bg_stroke
    } else {
        Stroke::new(1.0, visuals.widgets.noninteractive.bg_stroke.color)
    };
    ui.painter().rect(rect, 3.0, visuals.extreme_bg_color, stroke, StrokeKind::Inside);
    let drawing = Rect::from_min_max(
        pos2(rect.left(), rect.top() + CORNER),
        pos2(rect.right(), rect.bottom() - WORDS),
    );
    thumbnails.paint(ui, &found.lens, &view.lens, drawing.shrink(4.0));
    let colors = [ui.visuals().text_color(), ui.visuals().weak_text_color()];
    caption(ui, rect, &text, colors);
    let corner = match look.mark {
        CardMark::Pinned => mark.to_owned(),
        _ => format!("{}{separator}{mark}", found.number),
    };
    let font = FontId::proportional(10.0);
    let color = ui.visuals().weak_text_color();
    ui.painter().text(rect.min + vec2(5.0, 3.0), Align2::LEFT_TOP, corner, font, color);
    response.on_hover_cursor(CursorIcon::PointingHand).on_hover_text(label)
}

/// The first two lines of a text, at the bottom of a card.
fn caption(ui: &Ui, rect: Rect, text: &str, colors: [Color32; 2]) {
    let painter = ui.painter_at(rect.shrink(3.0));
    for (i, (line, color)) in text.lines().zip(colors).enumerate() {
        let at = pos2(rect.left() + 6.0, rect.bottom() - WORDS + 13.0 * i as f32);
        painter.text(at, Align2::LEFT_TOP, line, FontId::proportional(11.0), color);
    }
}

/// Buttons to accept, pin or export a lens; true if the design is to be shown again.
pub(super) fn lens_buttons(
    ui: &mut Ui,
    search: ShownSearch<'_>,
    number: u64,
    actions: &mut Actions,
) -> bool {
    let ShownSearch { view, run } = search;
    let exporting = view.structure_search.exporting.contains(&number);
    let accept = format!("Make lens {number} the design, as one undo step");
    let pin = if run.pinned == Some(number) {
        let command = StructureSearchCommand::Control(SteerCommand::Unpin);
        let hint = "Start new descents from any retained lens again";
        ActionButton::new("Unpin", view.structure_search.run.is_active(), command).hint(hint)
    } else {
        let command = StructureSearchCommand::Control(SteerCommand::Pin(number));
        let hint = "Start every new descent of an iterated search or of RESTORE from this lens";
        ActionButton::new("Pin", view.structure_search.run.is_active(), command).hint(hint)
    };
    let buttons = [
        ActionButton::new("Accept", true, StructureSearchCommand::Accept(number)).hint(&accept),
        pin,
        ActionButton::new(
            if exporting { "Finalizing…" } else { "Export…" },
            !exporting,
            FileRequest::ExportSearchLens(number),
        )
        .hint(
            "Replace model glasses by catalogue glasses, satisfy all manufacturing limits, and \
             write the lens; if a limit cannot be satisfied, it is named and nothing is written",
        ),
    ];
    let mut back = false;
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = 4.0;
        action_buttons(ui, buttons, actions);
        let shown = view.preview_lens.is_some();
        let button = ui.add_enabled(shown, Button::new("Show the design"));
        back = button.on_hover_text("Show the design again in all panels").clicked();
    });
    if back {
        actions.push(Command::Preview(None));
    }
    back
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::blank;

    fn found(number: u64) -> Arc<FoundLens> {
        let lens = Arc::new(blank());
        Arc::new(FoundLens { number, merit: 1.0, elements: 1, lens, score: None })
    }

    /// A lens that is better than all others does not push their cards aside.
    #[test]
    fn cards_keep_their_places_and_a_new_one_takes_that_of_one_that_left() {
        let kept = |before: &[u64], now: &[u64]| -> Vec<u64> {
            let before: Vec<_> = before.iter().map(|number| found(*number)).collect();
            let now = now.iter().map(|number| found(*number)).collect();
            keep_places(&before, now).iter().map(|lens| lens.number).collect()
        };
        assert_eq!(kept(&[1, 2, 3], &[4, 3, 1]), [1, 4, 3]);
        assert_eq!(kept(&[1, 2, 3], &[5, 4, 2, 3, 1]), [1, 2, 3, 5, 4]);
        assert_eq!(kept(&[1, 2, 3], &[3, 1]), [1, 3]);
        assert_eq!(kept(&[], &[2, 1]), [2, 1]);
    }
}
