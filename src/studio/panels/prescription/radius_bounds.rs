//! Bounds of a curvature as bounds of the radius, which is what a designer reads in the table.
//!
//! An interval of curvatures is one of radii as long as it stays on one side of the plane. One that
//! contains the plane allows the radii beyond its ends: R ≤ -20 mm or R ≥ 50 mm.

use crate::studio::number::format_number;

/// The bounds `[minimum, maximum]` of the curvature for those of the radius. A minimum of opposite
/// sign to the maximum keeps the radius outside of both.
pub(super) fn curvature_bounds([low, high]: [Option<f64>; 2]) -> [Option<f64>; 2] {
    match [low, high].map(|radius| radius.map(f64::recip)) {
        [Some(a), Some(b)] => [Some(a.min(b)), Some(a.max(b))],
        [Some(a), None] if a > 0.0 => [Some(0.0), Some(a)],
        [Some(a), None] => [None, Some(a)],
        [None, Some(b)] if b < 0.0 => [Some(b), Some(0.0)],
        [None, Some(b)] => [Some(b), None],
        [None, None] => [None, None],
    }
}

/// The bounds `[minimum, maximum]` of the radius for those of the curvature; both absent where an
/// interval of radii cannot say it: see [`describe`].
pub(super) fn radius_bounds(bounds: [Option<f64>; 2]) -> [Option<f64>; 2] {
    let radius = |curvature: f64| Some(curvature.recip());
    match bounds {
        [Some(a), Some(b)] if a == 0.0 && b > 0.0 => [radius(b), None],
        [Some(a), Some(b)] if b == 0.0 && a < 0.0 => [None, radius(a)],
        [Some(a), Some(b)] if a * b > 0.0 => [radius(b), radius(a)],
        [Some(a), Some(b)] if a * b < 0.0 => [radius(a), radius(b)],
        [None, Some(b)] if b < 0.0 => [radius(b), None],
        [Some(a), None] if a > 0.0 => [None, radius(a)],
        _ => [None, None],
    }
}

/// The radii that bounds of the curvature allow.
pub(super) fn describe([low, high]: [Option<f64>; 2]) -> String {
    let (a, b) = (low.unwrap_or(f64::NEG_INFINITY), high.unwrap_or(f64::INFINITY));
    let at_most = |curvature: f64| format!("R ≤ {} mm", format_number(curvature.recip()));
    let at_least = |curvature: f64| format!("R ≥ {} mm", format_number(curvature.recip()));
    let side = |ends: [Option<String>; 2], all: &str| {
        let ends: Vec<String> = ends.into_iter().flatten().collect();
        if ends.is_empty() { all.to_owned() } else { ends.join(" and ") }
    };
    let negative = (a < 0.0).then(|| {
        let (near, far) = ((b < 0.0).then(|| at_least(b)), low.map(at_most));
        side([near, far], "R < 0")
    });
    let plane = (a <= 0.0 && b >= 0.0).then(|| "plane".to_owned());
    let positive = (b > 0.0).then(|| {
        let (near, far) = (high.map(at_least), (a > 0.0).then(|| at_most(a)));
        side([near, far], "R > 0")
    });
    [negative, plane, positive].into_iter().flatten().collect::<Vec<_>>().join(", or ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radii_and_curvatures_bound_each_other() {
        let cases = [
            ([Some(20.0), Some(40.0)], [Some(0.025), Some(0.05)]),
            ([Some(-40.0), Some(-20.0)], [Some(-0.05), Some(-0.025)]),
            ([Some(20.0), None], [Some(0.0), Some(0.05)]),
            ([None, Some(-20.0)], [Some(-0.05), Some(0.0)]),
            ([None, Some(20.0)], [Some(0.05), None]),
            ([Some(-20.0), None], [None, Some(-0.05)]),
            ([Some(-20.0), Some(50.0)], [Some(-0.05), Some(0.02)]),
            ([None, None], [None, None]),
        ];
        for (radii, curvatures) in cases {
            assert_eq!(curvature_bounds(radii), curvatures);
            assert_eq!(radius_bounds(curvatures), radii);
        }
    }

    #[test]
    fn the_allowed_radii_are_said_in_words() {
        assert_eq!(describe([Some(0.025), Some(0.05)]), "R ≥ 20 mm and R ≤ 40 mm");
        assert_eq!(describe([Some(-0.05), Some(0.02)]), "R ≤ -20 mm, or plane, or R ≥ 50 mm");
        assert_eq!(describe([Some(-0.05), None]), "R ≤ -20 mm, or plane, or R > 0");
        assert_eq!(describe([None, None]), "R < 0, or plane, or R > 0");
    }
}
