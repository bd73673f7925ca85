//! The elements that a lens has in addition to another lens.

use super::{Lens, Medium, Row};

/// The cost of an element that is added or removed.
const NEW: f64 = 1.0;
/// The largest cost of a change of shape. It is below that of an added element: two elements of the
/// same glass always match, and their shapes only decide between several candidates.
const BENT: f64 = 0.9;
/// The difference in index from which two model glasses do not match.
const INDEX: f64 = 0.2;

/// The surfaces of a lens, counted from 0, after which there is an element that `own` does not have.
///
/// The elements of both lenses are aligned in their order at the least cost (an edit distance);
/// elements that match none of `own` are the added ones.
pub fn added_glass(lens: &Lens, own: &Lens) -> Vec<usize> {
    let (rows, old) = (glass_pieces(lens), glass_pieces(own));
    let size = own.total_track();
    let costs = costs(&rows, &old, size);
    let (mut i, mut j) = (rows.len(), old.len());
    let mut added = Vec::new();
    while i > 0 {
        if costs[i][j] == costs[i - 1][j] + NEW {
            i -= 1;
            added.push(rows[i].surface);
        } else if j > 0 && costs[i][j] == costs[i][j - 1] + NEW {
            j -= 1;
        } else {
            i -= 1;
            j = j.saturating_sub(1);
        }
    }
    added.reverse();
    added
}

/// An element: the glass after a surface.
struct GlassPiece<'a> {
    surface: usize,
    medium: &'a Medium,
    curvatures: [f64; 2],
}

fn glass_pieces(lens: &Lens) -> Vec<GlassPiece<'_>> {
    let is_glass = |row: &Row| match row.medium {
        Medium::Air | Medium::Mirror => false,
        Medium::Index(n) => n >= 1.05,
        Medium::Glass(_) | Medium::Model { .. } | Medium::Grin(_) => true,
    };
    let pairs = lens.surfaces.windows(2).enumerate();
    let glass = pairs.filter(|(_, pair)| is_glass(&pair[0]));
    let piece = |(at, pair): (usize, &'_ [Row])| (at, [pair[0].curvature, pair[1].curvature]);
    glass
        .map(piece)
        .map(|(at, curvatures)| GlassPiece {
            surface: at,
            medium: &lens.surfaces[at].medium,
            curvatures,
        })
        .collect()
}

/// The least cost of turning the first `j` old elements into the first `i` new ones.
fn costs(rows: &[GlassPiece<'_>], old: &[GlassPiece<'_>], size: f64) -> Vec<Vec<f64>> {
    let mut costs = vec![vec![0.0; old.len() + 1]; rows.len() + 1];
    for i in 0..=rows.len() {
        for j in 0..=old.len() {
            let removed = if j > 0 { costs[i][j - 1] + NEW } else { f64::INFINITY };
            let new = if i > 0 { costs[i - 1][j] + NEW } else { f64::INFINITY };
            let same = if i > 0 && j > 0 {
                costs[i - 1][j - 1] + difference(&rows[i - 1], &old[j - 1], size)
            } else {
                f64::INFINITY
            };
            let least = removed.min(new).min(same);
            costs[i][j] = if least.is_finite() { least } else { 0.0 };
        }
    }
    costs
}

/// The cost of matching two elements: 0 to 1 for the same glass, infinite for different ones.
fn difference(a: &GlassPiece<'_>, b: &GlassPiece<'_>, size: f64) -> f64 {
    let glass = match (a.medium, b.medium) {
        (Medium::Model { nd: a, .. }, Medium::Model { nd: b, .. }) => {
            let off = (a - b).abs() / INDEX;
            if off < 1.0 { 0.1 * off } else { f64::INFINITY }
        }
        (a, b) if a == b => 0.0,
        _ => f64::INFINITY,
    };
    let bend: f64 = a.curvatures.iter().zip(b.curvatures).map(|(a, b)| (a - b).abs()).sum();
    let bend = size * bend;
    glass + BENT * bend / (1.0 + bend)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::blank;

    fn lens(glasses: &[(&str, f64)]) -> Lens {
        let mut lens = blank();
        let row = lens.surfaces[1].clone();
        lens.surfaces.clear();
        for (name, curvature) in glasses {
            let medium = Medium::Glass((*name).to_owned());
            lens.surfaces.push(Row { medium, curvature: *curvature, ..row.clone() });
            lens.surfaces.push(Row { curvature: -curvature, ..row.clone() });
        }
        lens
    }

    #[test]
    fn elements_without_a_match_are_added() {
        let own = lens(&[("A", 0.02), ("B", 0.01), ("A", -0.03)]);
        let cases = [
            (vec![("A", 0.02), ("B", 0.01), ("A", -0.03)], vec![]),
            (vec![("A", 0.04), ("B", -0.01), ("A", -0.01)], vec![]),
            (vec![("A", 0.02), ("A", -0.03)], vec![]),
            (vec![("A", 0.02), ("C", 0.05), ("B", 0.01), ("A", -0.03)], vec![2]),
            (vec![("A", 0.3), ("A", 0.02), ("B", 0.01), ("D", 0.0)], vec![0, 6]),
        ];
        for (glasses, added) in cases {
            assert_eq!(added_glass(&lens(&glasses), &own), added, "{glasses:?}");
        }
        // Of two elements of one glass, the one of the other shape is the added one.
        let single = lens(&[("A", 0.02)]);
        assert_eq!(added_glass(&lens(&[("A", 0.02), ("A", 0.3)]), &single), [2]);
        assert_eq!(added_glass(&lens(&[("A", 0.3), ("A", 0.02)]), &single), [0]);
        assert_eq!(added_glass(&lens(&[]), &own), [0; 0]);
        assert_eq!(added_glass(&own, &lens(&[])), [0, 2, 4]);
    }
}
