//! Regular grids: nodes with constant spacing along each axis.
//!
//! A coordinate is rounded down to the index of its cell without branches or casts that SIMD lanes
//! lack.

use crate::math::{Real, Vec3};

/// Nodes on a regular grid. Node `(i, j, k)` is at `low + (i hx, j hy, k hz)` and has the number
/// `(k ny + j) nx + i`: x runs fastest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RegularGrid<R> {
    counts: [usize; 3],
    low: Vec3<R>,
    spacing: Vec3<R>,
    /// `1/h` on each axis.
    pub(super) inverse_spacing: Vec3<R>,
}

/// Values or a grid that do not make a sampled field.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GridError {
    /// Too few nodes along an axis.
    #[error("{found} nodes along {axis}, expected at least {least}")]
    TooFew {
        /// `x`, `y` or `z`.
        axis: char,
        /// The number of nodes.
        found: usize,
        /// The smallest valid number of nodes.
        least: usize,
    },
    /// The number of values differs from the number of nodes.
    #[error("{found} values for {expected} nodes")]
    Values {
        /// The number of values.
        found: usize,
        /// The number of nodes.
        expected: usize,
    },
    /// A spacing that is not positive, or a corner that is not a number.
    #[error("the grid has no extent along {axis}")]
    Extent {
        /// `x`, `y` or `z`.
        axis: char,
    },
    /// A value that is not a finite number.
    #[error("value {node} is not a finite number")]
    NotANumber {
        /// The number of the value, counted from 0.
        node: usize,
    },
}

impl<R: Real> RegularGrid<R> {
    /// Nodes that begin at the corner `low`, `spacing` apart.
    ///
    /// # Errors
    /// [`GridError::Extent`] for a spacing that is not positive.
    pub fn new(counts: [usize; 3], low: Vec3<R>, spacing: Vec3<R>) -> Result<Self, GridError> {
        let axes = [('x', low.x, spacing.x), ('y', low.y, spacing.y), ('z', low.z, spacing.z)];
        for (axis, low, spacing) in axes {
            let positive = spacing > R::ZERO && spacing.is_finite() && low.is_finite();
            if !positive || !(R::ONE / spacing).is_finite() {
                return Err(GridError::Extent { axis });
            }
        }
        let one = R::ONE;
        let density = Vec3::new(one / spacing.x, one / spacing.y, one / spacing.z);
        Ok(Self { counts, low, spacing, inverse_spacing: density })
    }

    /// A cube of `count³` nodes from `-half` to `half` on each axis.
    ///
    /// # Errors
    /// Fewer than two nodes, or no extent.
    pub fn cube(count: usize, half: R) -> Result<Self, GridError> {
        if count < 2 {
            return Err(GridError::TooFew { axis: 'x', found: count, least: 2 });
        }
        let h = (half + half) / R::from_f64((count - 1) as f64);
        Self::new([count; 3], Vec3::new(-half, -half, -half), Vec3::new(h, h, h))
    }

    /// The numbers of nodes along x, y and z.
    pub fn counts(&self) -> [usize; 3] {
        self.counts
    }

    /// The position of the first node.
    pub fn low(&self) -> Vec3<R> {
        self.low
    }

    /// The distance between neighbours along x, y and z.
    pub fn spacing(&self) -> Vec3<R> {
        self.spacing
    }

    /// The total number of nodes; saturates at the largest integer.
    pub fn node_count(&self) -> usize {
        let [x, y, z] = self.counts;
        x.saturating_mul(y).saturating_mul(z)
    }

    /// The position of node number `n`.
    pub fn node(&self, n: usize) -> Vec3<R> {
        let [nx, ny, _] = self.counts;
        let at = |i: usize| R::from_f64(i as f64);
        Vec3::new(
            self.low.x + at(n % nx) * self.spacing.x,
            self.low.y + at(n / nx % ny) * self.spacing.y,
            self.low.z + at(n / nx / ny) * self.spacing.z,
        )
    }

    /// The smallest spacing.
    pub(super) fn smallest_spacing(&self) -> f64 {
        self.spacing.x.value().min(self.spacing.y.value()).min(self.spacing.z.value())
    }

    /// Checks that values fit the grid.
    pub(super) fn check(&self, values: &[R], least: usize) -> Result<(), GridError> {
        for (axis, found) in ['x', 'y', 'z'].into_iter().zip(self.counts) {
            if found < least {
                return Err(GridError::TooFew { axis, found, least });
            }
        }
        if values.len() != self.node_count() {
            return Err(GridError::Values { found: values.len(), expected: self.node_count() });
        }
        match values.iter().position(|value| !value.is_finite()) {
            Some(node) => Err(GridError::NotANumber { node }),
            None => Ok(()),
        }
    }

    /// The cell of a point, whose support is `width` nodes wide; outside the grid the outermost
    /// cell.
    #[inline(always)]
    pub(super) fn locate(&self, at: Vec3<R>, width: usize) -> GridCell<R> {
        let [nx, ny, nz] = self.counts;
        let (x, tx) = locate_along(at.x, self.low.x, self.inverse_spacing.x, nx - width);
        let (y, ty) = locate_along(at.y, self.low.y, self.inverse_spacing.y, ny - width);
        let (z, tz) = locate_along(at.z, self.low.z, self.inverse_spacing.z, nz - width);
        let first = (z * ny as f64 + y) * nx as f64 + x;
        GridCell { cell: [x, y, z], first: to_index(first), t: Vec3::new(tx, ty, tz) }
    }
}

/// The cell of a grid that contains a point, and the position in it.
#[derive(Debug, Clone, Copy)]
pub(super) struct GridCell<R> {
    /// The number of the cell along each axis, a whole number.
    pub(super) cell: [f64; 3],
    /// The number of the first node of the support.
    pub(super) first: usize,
    /// The position within the cell: from 0 to 1 unless it is outside the grid.
    pub(super) t: Vec3<R>,
}

/// The cell along one axis and the position within it.
#[inline(always)]
fn locate_along<R: Real>(x: R, low: R, density: R, last: usize) -> (f64, R) {
    let u = (x - low) * density;
    let i = floor_cell(u.value(), last as f64);
    (i, u - R::from_f64(i))
}

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
