//! Places of labels beside marks, so that no label covers another one or a mark.

use egui::{Pos2, Rect, Vec2, vec2};

/// The distances from a mark at which a label may stand, in points.
const DISTANCES: [f32; 7] = [8.0, 20.0, 36.0, 56.0, 80.0, 108.0, 140.0];
/// The room around a label, in points.
pub(super) const MARGIN: f32 = 2.0;
/// The directions from a mark in which a label may stand, the usual ones first.
const DIRECTIONS: [Vec2; 8] = [
    vec2(1.0, -1.0),
    vec2(-1.0, 1.0),
    vec2(1.0, 1.0),
    vec2(-1.0, -1.0),
    vec2(1.0, 0.0),
    vec2(-1.0, 0.0),
    vec2(0.0, -1.0),
    vec2(0.0, 1.0),
];

/// The places of labels of some sizes beside their marks within a frame; marks have a radius.
pub(super) fn label_places(marks: &[(Pos2, Vec2)], radius: f32, frame: Rect) -> Vec<Rect> {
    let mark =
        |(place, _): &(Pos2, Vec2)| Rect::from_center_size(*place, Vec2::splat(2.0 * radius));
    let mut taken: Vec<Rect> = marks.iter().map(mark).collect();
    let mut places = Vec::new();
    for (place, size) in marks {
        let found = label_place(*place, *size, frame, &taken);
        taken.push(found.expand(MARGIN));
        places.push(found);
    }
    places
}

/// The first place that is free, or else the one that covers least.
fn label_place(mark: Pos2, size: Vec2, frame: Rect, taken: &[Rect]) -> Rect {
    let at = |distance: f32, direction: Vec2| {
        let center = mark + direction.normalized() * distance + 0.5 * direction * size;
        Rect::from_center_size(center, size)
    };
    let all = DISTANCES.into_iter().flat_map(|far| DIRECTIONS.map(|direction| at(far, direction)));
    let covered = |label: &Rect| {
        let area = |other: &Rect| label.expand(MARGIN).intersect(*other).size().max(Vec2::ZERO);
        let others: f32 = taken.iter().map(|other| area(other).x * area(other).y).sum();
        let inside = area(&frame);
        others + (label.expand(MARGIN).area() - inside.x * inside.y)
    };
    let mut best = (f32::INFINITY, Rect::from_center_size(mark, size));
    for label in all {
        let cost = covered(&label);
        if cost < 0.01 {
            return label;
        }
        if cost < best.0 {
            best = (cost, label);
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::pos2;

    #[test]
    fn labels_of_near_marks_cover_neither_each_other_nor_a_mark() {
        let frame = Rect::from_min_size(pos2(0.0, 0.0), vec2(300.0, 200.0));
        let marks: Vec<(Pos2, Vec2)> = (0..6)
            .map(|i| (pos2(295.0 - 7.0 * i as f32, 5.0 + 2.0 * i as f32), vec2(50.0, 12.0)))
            .collect();
        let places = label_places(&marks, 4.0, frame);
        for (i, place) in places.iter().enumerate() {
            assert!(frame.contains_rect(*place), "{place}");
            let apart = |other: &Rect| !place.intersects(*other);
            assert!(places[..i].iter().all(apart), "{places:?}");
            assert!(
                marks.iter().all(|(mark, _)| place.distance_to_pos(*mark) >= 4.0),
                "{places:?}"
            );
        }
    }
}
