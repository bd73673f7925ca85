//! The mean square spot of a field as a function of the position of the image plane.
//!
//! Behind the lens rays are straight: a displacement δ of the image plane moves each point by δ times
//! its slope, so that the mean square distance from the centroid is exactly `a + 2 b δ + c δ²`.

use crate::math::Real;

/// The mean square of the distances from the centroid is `a + 2 b δ + c δ²` in mm² for an image plane
/// that is displaced by δ mm.
#[derive(Debug, Clone, Copy, Default)]
pub struct SpotMoments<R> {
    /// The mean square at the image plane itself.
    pub a: R,
    /// Half of its derivative by the displacement.
    pub b: R,
    /// The mean square of the centred slopes.
    pub c: R,
}

/// A ray at the image plane: its point in mm, then its slopes `L/N` and `M/N`.
pub(super) type ImageRay<R> = [R; 4];

impl<R: Real> SpotMoments<R> {
    /// The moments of weighted rays whose weights add up to 1.
    pub(super) fn new(rays: &[(ImageRay<R>, f64)]) -> Self {
        let mut center = [R::ZERO; 4];
        for (ray, weight) in rays {
            for (sum, number) in center.iter_mut().zip(ray) {
                *sum += *number * R::from_f64(*weight);
            }
        }
        let mut moments = Self::default();
        for (ray, weight) in rays {
            let [x, y, u, v] = [0, 1, 2, 3].map(|i| ray[i] - center[i]);
            let weight = R::from_f64(*weight);
            moments.a += (x * x + y * y) * weight;
            moments.b += (x * u + y * v) * weight;
            moments.c += (u * u + v * v) * weight;
        }
        moments
    }

    /// The mean square distance from the centroid in mm², at a displaced image plane.
    pub fn at(&self, displacement: R) -> R {
        self.a + displacement * (self.b + self.b + self.c * displacement)
    }

    /// The moments multiplied by a weight.
    #[must_use]
    pub(super) fn weighted(&self, weight: f64) -> Self {
        let weight = R::from_f64(weight);
        Self { a: self.a * weight, b: self.b * weight, c: self.c * weight }
    }

    /// The sum of the moments of several fields.
    pub(super) fn sum(all: impl Iterator<Item = Self>) -> Self {
        all.fold(Self::default(), |s, m| Self { a: s.a + m.a, b: s.b + m.b, c: s.c + m.c })
    }
}

/// The displacement of the image plane in mm at which the mean of the mean squares is least.
pub fn best_focus<R: Real>(mean: &SpotMoments<R>) -> R {
    -(mean.b / mean.c)
}
