//! Questions about a lens that mutations ask.

use crate::lens::{Lens, Medium, Parameter, Quantity, Row};

/// True if a quantity is the gap behind a row.
pub(super) fn is_gap(quantity: Quantity) -> bool {
    quantity == Quantity::Thickness
}

/// True if a quantity belongs to the medium behind a row: the index or a gradient-index
/// coefficient.
pub(super) fn is_of_medium(quantity: Quantity) -> bool {
    matches!(quantity, Quantity::Index | Quantity::Grin(_))
}

/// True if a pickup reads or sets a quantity of a row that `is_it` selects.
pub(super) fn has_pickup(lens: &Lens, row: usize, is_it: impl Fn(Quantity) -> bool) -> bool {
    let concerned = |p: Parameter| p.surface == row && is_it(p.quantity);
    lens.pickups.iter().any(|pickup| concerned(pickup.parameter) || concerned(pickup.source))
}

/// True if a gap has its own thickness at some zoom position.
pub(super) fn is_zoomed(lens: &Lens, row: usize) -> bool {
    lens.is_zoomed(row, Quantity::Thickness)
}

/// True if a surface is a plain sphere or plane.
pub(super) fn is_plain(row: &Row) -> bool {
    let figured = row.conic != 0.0 || row.asphere.iter().any(|a| *a != 0.0);
    let blocks = row.obstruction.is_some() || !row.apertures.is_empty();
    !figured && !row.hyperhemisphere && !blocks
}

/// The minimum length of a gap over the zoom positions, positive along the light.
pub(super) fn shortest_gap(lens: &Lens, row: usize) -> f64 {
    let gaps = (0..lens.zoom_positions()).filter_map(|zoom| lens.thickness_at(row, zoom));
    let sense = lens.light_direction(row);
    gaps.fold(f64::INFINITY, |least, gap| least.min(sense * gap))
}

/// True if the length of a gap is solved for focus.
pub(super) fn has_solve(lens: &Lens, row: usize) -> bool {
    lens.image_solve.is_some() && row + 1 == lens.surfaces.len()
}

/// The medium in the gap behind a row; behind a mirror that in front of it.
pub(super) fn medium_after(lens: &Lens, row: usize) -> Medium {
    let media = lens.surfaces[..=row].iter().rev().map(|row| &row.medium);
    media.chain([&lens.object_medium]).find(|m| **m != Medium::Mirror).cloned().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_surface_with_any_figure_is_not_plain() {
        let sphere = || Row { curvature: 0.02, ..Row::default() };
        assert!(is_plain(&sphere()) && is_plain(&Row { asphere: vec![0.0; 3], ..sphere() }));
        for figured in [
            Row { conic: -1.0, ..sphere() },
            Row { asphere: vec![0.0, 1e-9], ..sphere() },
            Row { conic: 0.2, asphere: vec![1e-7], ..sphere() },
            Row { hyperhemisphere: true, ..sphere() },
            Row { obstruction: Some(1.0), ..sphere() },
        ] {
            assert!(!is_plain(&figured), "{figured:?}");
        }
    }
}
