//! How a field that was found differs from the one that is known to be the answer, and whether a
//! maker can make it.

use super::given::ReferenceFieldError;
use super::medium::GrinField;
use super::range::IndexBound;
use super::task::{FieldRepresentation, GrinTask};
use crate::grin::IndexField;
use crate::math::Vec3;

/// Points along a side of the box around the space.
const LATTICE: usize = 40;
/// Points along a radius.
const RADIAL: usize = 400;

/// Two fields are the same whose mean square difference is below this part of their square.
const ROUNDING_DIFFERENCE: f64 = 1e-26;

/// The difference between two fields over the space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldDifference {
    /// `‖η - η*‖ / ‖η*‖`.
    pub relative: f64,
    /// The same after the mean of `η² - η*²` is taken off: rays do not see that offset.
    pub without_offset: f64,
    /// That mean.
    pub offset: f64,
    /// `‖η - η*‖ / ‖η* - η₀‖` with `η₀` the field to begin with: 1 for a search that found nothing,
    /// infinite where the answer is the field to begin with, but for rounding: there is nothing to
    /// find.
    pub relative_to_contrast: f64,
}

/// What a field is like, over the space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldExtremes {
    /// Smallest index.
    pub low: f64,
    /// Largest index.
    pub high: f64,
    /// Steepest index, in 1/mm.
    pub slope: f64,
    /// Where these three are, in mm.
    pub at: [Vec3<f64>; 3],
}

impl GrinTask {
    /// How a field differs from the exact one; `None` where none is known.
    ///
    /// # Errors
    /// A volume that cannot be read.
    pub fn difference(
        &self,
        medium: &GrinField,
    ) -> Result<Option<FieldDifference>, ReferenceFieldError> {
        let Some(exact) = &self.exact else { return Ok(None) };
        self.difference_from(medium, &*exact.field::<f64>()?).map(Some)
    }

    /// How a field differs from another one.
    ///
    /// # Errors
    /// A field to begin with that cannot be read.
    pub fn difference_from(
        &self,
        medium: &GrinField,
        exact: &dyn IndexField<f64>,
    ) -> Result<FieldDifference, ReferenceFieldError> {
        let start = self.start.index()?;
        Ok(difference(medium.field(), exact, &*start, &self.comparison_points()))
    }

    /// The range of the index over the space, and how steep it is.
    pub fn extremes(&self, medium: &GrinField) -> FieldExtremes {
        let spaces = self.spaces();
        let [low, high] =
            [IndexBound::Low, IndexBound::High].map(|bound| medium.extreme_index(&spaces, bound));
        let slope = medium.locate_max_slope(self.space);
        FieldExtremes { low: low.0, high: high.0, slope: slope.0, at: [low.1, high.1, slope.1] }
    }

    /// Points all over the space, or along the radius that a spline depends on, each with its share.
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
