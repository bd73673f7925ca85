//! A medium as a table of its indices, for programs that have another formula or none for it.
//!
//! At the wavelengths of the lens the table has the very index of this program; between them the other
//! program interpolates.

use crate::lens::glass;
use crate::lens::{Medium, Wavelength};

/// The number of entries beside the wavelengths of the lens.
const ENTRIES: usize = 12;

/// Wavelengths in µm and the indices there, within the range of a medium in µm: somewhat wider than that of
/// the wavelengths of the lens, as far as the formula reaches.
pub(super) fn index_table(
    waves: &[Wavelength],
    range: [f64; 2],
    index: impl Fn(f64) -> Option<f64>,
) -> Vec<(f64, f64)> {
    let own = || waves.iter().map(|wave| wave.um);
    let (least, most) = (own().fold(range[1], f64::min), own().fold(range[0], f64::max));
    let (low, high) = (range[0].max(0.9 * least), range[1].min(1.1 * most));
    let even = (0..ENTRIES).map(|k| low + (high - low) * k as f64 / (ENTRIES - 1) as f64);
    let mut table: Vec<f64> = own().chain(even).collect();
    table.sort_by(f64::total_cmp);
    // Entries that nearly coincide would spoil the interpolation.
    let is_own = |um: f64| own().any(|wave| wave == um);
    table.dedup_by(|b, a| *b == *a || *b - *a < 1e-4 && !is_own(*b));
    table.into_iter().filter_map(|um| Some((um, index(um)?))).collect()
}

/// The table of a catalogue or a model glass; `None` for another medium.
pub(super) fn glass_table(waves: &[Wavelength], medium: &Medium) -> Option<Vec<(f64, f64)>> {
    match medium {
        Medium::Glass(name) => {
            let glass = glass::find(name)?;
            Some(index_table(waves, glass.range_um, |um| glass.index(um)))
        }
        Medium::Model { nd, vd } => {
            let index = |um| Some(glass::model_index(*nd, *vd, um));
            Some(index_table(waves, [0.0, f64::INFINITY], index))
        }
        _ => None,
    }
}
