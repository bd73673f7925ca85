//! How a field that was found differs from the one that is known to be the answer, and whether a
//! maker can make it.

use super::medium::{Medium, NoField};
use super::space::length;
use super::task::{FieldKind, Task};
use crate::grin::Field;
use crate::math::Vec3;

/// Points along a side of the box around the space.
const LATTICE: usize = 40;
/// Points along a radius.
const RADIAL: usize = 400;

/// The difference between two fields over the space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// `‖η - η*‖ / ‖η*‖`.
    pub relative: f64,
    /// The same after the mean of `η² - η*²` is taken off: rays do not see that offset.
    pub without_offset: f64,
    /// That mean.
    pub offset: f64,
}

/// What a field is like, over the space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extremes {
    /// Smallest index.
    pub low: f64,
    /// Largest index.
    pub high: f64,
    /// Steepest index, in 1/mm.
    pub slope: f64,
}

impl Task {
    /// How a field differs from the exact one; `None` where none is known.
    ///
    /// # Errors
    /// A volume that cannot be read.
    pub fn difference(&self, medium: &Medium) -> Result<Option<Difference>, NoField> {
        let Some(exact) = &self.exact else { return Ok(None) };
        Ok(Some(self.difference_from(medium, &*exact.field::<f64>()?)))
    }

    /// How a field differs from another one.
    pub fn difference_from(&self, medium: &Medium, exact: &dyn Field<f64>) -> Difference {
        difference(medium.field(), exact, &self.places())
    }

    /// The range of the index over the space, and how steep it is.
    pub fn extremes(&self, medium: &Medium) -> Extremes {
        let none = Extremes { low: f64::INFINITY, high: f64::NEG_INFINITY, slope: 0.0 };
        self.places().into_iter().fold(none, |found, (p, _)| {
            let sample = medium.field().sample(p);
            Extremes {
                low: found.low.min(sample.index),
                high: found.high.max(sample.index),
                slope: found.slope.max(length(sample.gradient)),
            }
        })
    }

    /// Points all over the space, or along the radius that a spline depends on, each with its share.
    fn places(&self) -> Vec<(Vec3<f64>, f64)> {
        let along = |radius: f64, power: i32| {
            let at = |i: usize| radius * (i as f64 + 0.5) / RADIAL as f64;
            (0..RADIAL).map(|i| (Vec3::new(at(i), 0.0, 0.0), at(i).powi(power))).collect()
        };
        match self.field {
            FieldKind::Sphere { radius } => along(radius, 2),
            FieldKind::Cylinder { radius } => along(radius, 1),
            FieldKind::Trilinear { .. } | FieldKind::Tricubic { .. } => {
                self.space.lattice(LATTICE).into_iter().map(|p| (p, 1.0)).collect()
            }
        }
    }
}

fn difference(
    found: &dyn Field<f64>,
    exact: &dyn Field<f64>,
    places: &[(Vec3<f64>, f64)],
) -> Difference {
    let pairs: Vec<[f64; 3]> = places
        .iter()
        .map(|(p, share)| [found.sample(*p).index, exact.sample(*p).index, *share])
        .collect();
    let mean = |of: &dyn Fn(&[f64; 3]) -> f64| {
        let all: f64 = pairs.iter().map(|pair| pair[2]).sum();
        pairs.iter().map(|pair| pair[2] * of(pair)).sum::<f64>() / all
    };
    let offset = mean(&|[found, exact, _]| found * found - exact * exact);
    let norm = mean(&|[_, exact, _]| exact * exact);
    let plain = mean(&|[found, exact, _]| (found - exact).powi(2));
    let level = |found: f64| (found * found - offset).max(0.0).sqrt();
    let shape = mean(&|[found, exact, _]| (level(*found) - exact).powi(2));
    Difference { relative: (plain / norm).sqrt(), without_offset: (shape / norm).sqrt(), offset }
}
