//! The choice whether the rest of a lens keeps its place when an element is added or removed.

use super::queries::{has_solve, shortest_gap};
use super::singlet::sag;
use crate::lens::Lens;
use crate::search::SearchRules;

/// The probability that the rest of the lens keeps its place if the gap has room; otherwise it is
/// shifted.
pub(super) const KEEP_PROBABILITY: f64 = 0.9;

/// The choice whether the rest of the lens keeps its place when an element is added to a gap.
#[derive(Debug, Clone, Copy)]
pub(super) struct SpacingChoice {
    pub(super) gap: usize,
    /// The length of the element with its air space, in mm.
    pub(super) length: f64,
    /// True if the rest of the lens keeps its place.
    pub(super) keeps_rest: bool,
}

impl SpacingChoice {
    /// The probability that a new element makes this choice; `None` if it cannot.
    pub(super) fn probability(self, lens: &Lens, rules: &SearchRules) -> Option<f64> {
        let keeps = keep_probability(lens, Some(self.gap), rules, self.length);
        let chance = if self.keeps_rest { keeps } else { 1.0 - keeps };
        (chance > 0.0).then_some(chance)
    }
}

/// The probability that the rest of the lens keeps its place; 0 if there is no room.
pub(super) fn keep_probability(
    lens: &Lens,
    gap: Option<usize>,
    rules: &SearchRules,
    length: f64,
) -> f64 {
    let fits = |gap: usize| has_choice(lens, gap) && gap_fits(lens, gap, rules, length);
    if gap.is_some_and(fits) { KEEP_PROBABILITY } else { 0.0 }
}

/// True if a gap has room for a length, on the axis and at the edge.
pub(super) fn gap_fits(lens: &Lens, gap: usize, rules: &SearchRules, length: f64) -> bool {
    let left = shortest_gap(lens, gap) - length;
    if gap + 1 == lens.surfaces.len() {
        return left >= rules.back_focus.unwrap_or(0.0);
    }
    let [front, rear] = [gap, gap + 1].map(|row| &lens.surfaces[row]);
    let semi_diameters = [front, rear].map(|row| row.semi_diameter.unwrap_or(f64::INFINITY));
    let rim = semi_diameters[0].min(semi_diameters[1]);
    let narrower = if rim.is_finite() {
        lens.light_direction(gap) * (sag(front.curvature, rim) - sag(rear.curvature, rim))
    } else {
        0.0
    };
    left >= rules.air_center[0].max(rules.air_edge + narrower)
}

/// True if a gap has a length of its own that can become shorter.
pub(super) fn has_choice(lens: &Lens, gap: usize) -> bool {
    !has_solve(lens, gap)
}
