//! The part of a picture that is shown: all of it, or fewer pixels that are larger.

use egui::{Pos2, Rect, Vec2, pos2, vec2};

/// The largest magnification.
const MOST: f32 = 60.0;

/// A part of a picture, in shares of its width and height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Magnifier {
    center: Pos2,
    factor: f32,
}

impl Default for Magnifier {
    fn default() -> Self {
        Self { center: pos2(0.5, 0.5), factor: 1.0 }
    }
}

impl Magnifier {
    /// The part that is shown.
    pub(super) fn part(self) -> Rect {
        Rect::from_center_size(self.center, Vec2::splat(self.factor.recip()))
    }

    /// The place of the picture, in shares, at a place of the area that shows the part, in shares too.
    pub(super) fn place(self, at: Pos2) -> Pos2 {
        self.part().min + self.part().size() * at.to_vec2()
    }

    /// The part after a magnification about a place of the area, in shares.
    #[must_use]
    pub(super) fn zoomed(self, by: f32, at: Pos2) -> Self {
        let factor = (self.factor * by).clamp(1.0, MOST);
        // The place under the pointer stays there.
        let under = self.place(at);
        let center = under - (at - pos2(0.5, 0.5)) / factor;
        Self { center, factor }.inside()
    }

    /// The part after a movement by shares of the area.
    #[must_use]
    pub(super) fn dragged(self, by: Vec2) -> Self {
        Self { center: self.center - by / self.factor, ..self }.inside()
    }

    /// True if all is shown.
    pub(super) fn is_whole(self) -> bool {
        self.factor <= 1.0
    }

    fn inside(self) -> Self {
        let half = 0.5 / self.factor;
        let clamp = |v: f32| v.clamp(half, 1.0 - half);
        let Pos2 { x, y } = self.center;
        Self { center: Pos2::ZERO + vec2(clamp(x), clamp(y)), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_under_the_pointer_stays_there_and_no_part_lies_outside() {
        let at = pos2(0.25, 0.75);
        let near = Magnifier::default().zoomed(4.0, at);
        assert!((near.place(at) - at).length() < 1e-6, "{near:?}");
        let moved = near.dragged(vec2(-100.0, 0.0));
        assert!((moved.part().max.x - 1.0).abs() < 1e-6, "{moved:?}");
        let back = moved.zoomed(0.01, at);
        assert!(back.is_whole() && back.part().min.distance(Pos2::ZERO) < 1e-6, "{back:?}");
    }
}
