//! Square pictures of one size and scale side by side, each with words above and below.

use egui::{Align, Align2, Layout as Arrange, Rect, TextStyle, Ui, UiBuilder, Vec2, pos2, vec2};

use crate::studio::draw::{length_text, round_length_below};

/// The room that the words of a cell take, in points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CellLayout {
    pub(super) above: f32,
    pub(super) below: f32,
}

impl CellLayout {
    /// Cells that fill a part of the window, their pictures as large as can be.
    pub(super) fn cells(self, rect: Rect, count: usize) -> Vec<Rect> {
        let size = |columns: usize| {
            let rows = count.div_ceil(columns);
            vec2(rect.width() / columns as f32, rect.height() / rows as f32)
        };
        let side =
            |columns: &usize| self.picture(Rect::from_min_size(rect.min, size(*columns))).width();
        let columns = (1..=count).max_by(|a, b| side(a).total_cmp(&side(b)));
        let Some(columns) = columns else { return Vec::new() };
        let size = size(columns);
        let place = |i: usize| vec2((i % columns) as f32 * size.x, (i / columns) as f32 * size.y);
        (0..count).map(|i| Rect::from_min_size(rect.min + place(i), size)).collect()
    }

    /// The square of a cell in which its picture is.
    pub(super) fn picture(self, cell: Rect) -> Rect {
        let room = cell.size() - vec2(6.0, self.above + self.below);
        let side = room.min_elem().max(1.0);
        let middle = pos2(cell.center().x, cell.top() + self.above + 0.5 * room.y.max(side));
        Rect::from_center_size(middle, Vec2::splat(side))
    }

    /// The line above the picture of a cell.
    pub(super) fn above(self, cell: Rect) -> Rect {
        let picture = self.picture(cell);
        let corner = pos2(picture.left(), picture.top() - self.above);
        Rect::from_min_max(corner, picture.right_top())
    }

    /// The lines below the picture of a cell.
    pub(super) fn below(self, cell: Rect) -> Rect {
        let bottom = self.picture(cell).bottom();
        Rect::from_min_max(
            pos2(cell.left() + 3.0, bottom + 2.0),
            pos2(cell.right(), bottom + self.below),
        )
    }
}

/// Shows something in a part of the window and nothing beyond it.
pub(super) fn show_within(ui: &mut Ui, rect: Rect, show: impl FnOnce(&mut Ui)) {
    let builder = UiBuilder::new().max_rect(rect).layout(Arrange::top_down(Align::Min));
    ui.scope_builder(builder, |ui| {
        ui.set_clip_rect(rect.expand(2.0).intersect(ui.clip_rect()));
        show(ui);
    });
}

/// A bar of a round length in a corner of a picture, with its length: at most a share of the
/// width. `scale` is in points per mm.
pub(super) fn scale_bar(ui: &Ui, picture: Rect, scale: f64, share: f64) {
    let length = round_length_below(share * f64::from(picture.width()) / scale);
    #[expect(clippy::cast_possible_truncation, reason = "a part of the picture's width")]
    let width = (length * scale) as f32;
    let color = ui.visuals().strong_text_color();
    let corner = picture.left_bottom() + vec2(6.0, -6.0);
    let rect = Rect::from_min_size(corner - vec2(0.0, 2.0), vec2(width, 2.0));
    let painter = ui.painter();
    painter.rect_filled(rect, 0.0, color);
    let font = TextStyle::Small.resolve(ui.style());
    let at = rect.left_top() - vec2(0.0, 1.0);
    painter.text(at, Align2::LEFT_BOTTOM, length_text(length), font, color);
}
