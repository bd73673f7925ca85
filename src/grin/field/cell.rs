//! Rounding down to the index of a cell, without branches or casts that SIMD lanes lack.

/// The first number whose neighbours are 1 apart.
const INTEGER_SPACING: f64 = 4503599627370496.0; // 2⁵²

/// The cell of a coordinate counted in cells from the first, clamped to `0..=last`; a value that is
/// not a number falls into the first.
#[inline(always)]
pub(super) fn floor_cell(u: f64, last: f64) -> f64 {
    let inside = u.max(0.0).min(last);
    let rounded = (inside + INTEGER_SPACING) - INTEGER_SPACING;
    if rounded > inside { rounded - 1.0 } else { rounded }
}

/// A whole number from 0 to below 2⁵² as an integer: the low bits of its mantissa.
#[inline(always)]
pub(super) fn to_index(whole: f64) -> usize {
    ((whole + INTEGER_SPACING).to_bits() - INTEGER_SPACING.to_bits()) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_is_the_floor_within_the_grid() {
        for u in [0.0, 0.3, 0.5, 0.999, 1.0, 1.5, 2.0, 2.5, 6.9999999, 7.0, 7.5, 1e300] {
            assert_eq!(floor_cell(u, 7.0), u.floor().min(7.0), "{u}");
            assert_eq!(to_index(floor_cell(u, 7.0)), (u as usize).min(7), "{u}");
        }
        for u in [-0.0, -0.5, -1e300, f64::NAN] {
            assert_eq!(to_index(floor_cell(u, 7.0)), 0, "{u}");
        }
    }
}
