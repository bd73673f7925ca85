//! The difference between a field and its reference, and the range of its index and gradient.

use crate::grin::IndexField;
use crate::grin_design::ReferenceFieldError;
use crate::grin_design::field::GrinField;
use crate::grin_design::field::index_bounds::IndexBound;
use crate::grin_design::task::{FieldRepresentation, GrinTask};
use crate::math::Vec3;
use serde::Serialize;

/// Points along a side of the bounding box of the domain.
const LATTICE: usize = 40;
/// Points along a radius.
const RADIAL: usize = 400;

/// Fields count as equal if their mean square difference is below this fraction of their mean
/// square.
const ROUNDING_DIFFERENCE: f64 = 1e-26;

/// The difference between two fields over the domain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FieldDifference {
    /// `‖η - η*‖ / ‖η*‖`.
    pub relative: f64,
    /// The same after subtraction of the mean of `η² - η*²`: rays do not depend on that offset.
    pub without_offset: f64,
    /// That mean.
    pub offset: f64,
    /// `‖η - η*‖ / ‖η* - η₀‖` with the initial field `η₀`: 1 for an optimization that found
    /// nothing, infinite where the reference is the initial field up to rounding.
    #[serde(rename = "of_contrast")]
    pub relative_to_contrast: f64,
}

/// The range of the index and the largest gradient over the domain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldExtremes {
    /// The smallest index.
    pub low: f64,
    /// The largest index.
    pub high: f64,
    /// The largest gradient of the index, in 1/mm.
    pub slope: f64,
    /// The positions of these three, in mm.
    pub at: [Vec3<f64>; 3],
}

impl GrinTask {
    /// The difference from the reference field; `None` without a reference.
    ///
    /// # Errors
    /// A volume that has not been read.
    pub fn difference(
        &self,
        field: &GrinField,
    ) -> Result<Option<FieldDifference>, ReferenceFieldError> {
        let Some(exact) = &self.exact else { return Ok(None) };
        self.difference_from(field, &*exact.field::<f64>()?).map(Some)
    }

    /// The difference from another field.
    ///
    /// # Errors
    /// An initial volume that has not been read.
    pub fn difference_from(
        &self,
        field: &GrinField,
        exact: &dyn IndexField<f64>,
    ) -> Result<FieldDifference, ReferenceFieldError> {
        let start = self.start.index()?;
        Ok(difference(field.index_field(), exact, &*start, &self.comparison_points()))
    }

    /// The range of the index over the domain, and its largest gradient.
    pub fn extremes(&self, field: &GrinField) -> FieldExtremes {
        let spaces = self.spaces();
        let [low, high] =
            [IndexBound::Low, IndexBound::High].map(|bound| field.extreme_index(&spaces, bound));
        let slope = field.locate_max_slope(self.space);
        FieldExtremes { low: low.0, high: high.0, slope: slope.0, at: [low.1, high.1, slope.1] }
    }

    /// Points over the domain, or along the radius of a spline, each with its weight.
    fn comparison_points(&self) -> Vec<(Vec3<f64>, f64)> {
        let along = |radius: f64, power: i32| {
            let at = |i: usize| radius * (i as f64 + 0.5) / RADIAL as f64;
            (0..RADIAL).map(|i| (Vec3::new(at(i), 0.0, 0.0), at(i).powi(power))).collect()
        };
        match self.field {
            FieldRepresentation::Sphere { radius } => along(radius, 2),
            FieldRepresentation::Cylinder { radius } => along(radius, 1),
            FieldRepresentation::Trilinear { .. } | FieldRepresentation::Tricubic { .. } => {
                self.space.lattice(LATTICE).into_iter().map(|p| (p, 1.0)).collect()
            }
        }
    }
}

fn difference(
    found: &dyn IndexField<f64>,
    exact: &dyn IndexField<f64>,
    start: &dyn Fn(Vec3<f64>) -> f64,
    places: &[(Vec3<f64>, f64)],
) -> FieldDifference {
    let three = |p: Vec3<f64>| [found.sample(p).index, exact.sample(p).index, start(p)];
    let all: Vec<([f64; 3], f64)> = places.iter().map(|(p, share)| (three(*p), *share)).collect();
    let mean = |of: &dyn Fn(&[f64; 3]) -> f64| {
        let shares: f64 = all.iter().map(|(_, share)| share).sum();
        all.iter().map(|(three, share)| share * of(three)).sum::<f64>() / shares
    };
    let offset = mean(&|[found, exact, _]| found * found - exact * exact);
    let norm = mean(&|[_, exact, _]| exact * exact);
    let plain = mean(&|[found, exact, _]| (found - exact).powi(2));
    let contrast = mean(&|[_, exact, start]| (exact - start).powi(2));
    let level = |found: f64| (found * found - offset).max(0.0).sqrt();
    let shape = mean(&|[found, exact, _]| (level(*found) - exact).powi(2));
    FieldDifference {
        relative: (plain / norm).sqrt(),
        without_offset: (shape / norm).sqrt(),
        offset,
        relative_to_contrast: if contrast > ROUNDING_DIFFERENCE * norm {
            (plain / contrast).sqrt()
        } else {
            f64::INFINITY
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grin::field::{RegularGrid, Trilinear};

    fn linear(value: impl Fn(f64) -> f64) -> Trilinear<f64> {
        let grid = RegularGrid::cube(3, 1.0).unwrap();
        Trilinear::from_function(grid, |at| value(at.z)).unwrap()
    }

    /// An index of 1.55 and 1.45 at two places where it should be 1.4, and was 1 at the start.
    #[test]
    fn differences_are_shares_of_the_norms() {
        let (found, exact) = (linear(|z| 1.5 + 0.1 * z), linear(|_| 1.4));
        let places = [-0.5, 0.5].map(|z| (Vec3::new(0.0, 0.0, z), 1.0));
        let of = difference(&found, &exact, &|_| 1.0, &places);
        let near = |found: f64, exact: f64| {
            assert!((found - exact).abs() < 1e-12, "{found} {exact}: {of:?}");
        };
        let root_mean = |a: f64, b: f64| (0.5 * (a * a + b * b)).sqrt();
        near(of.relative, root_mean(0.15, 0.05) / 1.4);
        near(of.relative_to_contrast, root_mean(0.15, 0.05) / 0.4);
        near(of.offset, 0.5 * (1.55 * 1.55 + 1.45 * 1.45) - 1.96);
        // The squares of both are 0.15 from their mean, which the offset makes that of the reference.
        let [low, high] = [1.96_f64 - 0.15, 1.96 + 0.15].map(f64::sqrt);
        near(of.without_offset, root_mean(low - 1.4, high - 1.4) / 1.4);
    }
}
