//! The variance of the wavefront of a field.
//!
//! The reference sphere lies about the image point of the chief ray on the image plane and goes
//! through a fixed point of the axis, the centre of the paraxial exit pupil of the lens as designed. A
//! ray with the direction `d` at the distance `off` from the centre of the sphere has the path
//! `−a + σ (√(ρ² − b²) − ρ)` to it beyond that of the chief ray, with `a = off·d`,
//! `b² = off² − a²`, the radius ρ and σ = −1 for a sphere in front of the image.

use crate::math::{Real, Vec3};

/// The variance of the wavefront, in squares of the primary wavelength.
#[derive(Debug, Clone, Copy, Default)]
pub struct WavefrontVariance<R> {
    /// About the chief ray's image point; the mean is removed.
    pub chief: R,
    /// The same after the best fit of a tilt across the pupil is removed too.
    pub tilt_removed: R,
}

/// A ray at the image plane: point and direction cosines in its frame, and the optical path in mm.
pub(super) struct PathRay<R> {
    pub(super) point: Vec3<R>,
    pub(super) direction: Vec3<R>,
    pub(super) path: R,
}

/// The path differences of rays from the chief ray, in mm: positive for a ray that is ahead.
///
/// `pupil` is the position of the exit pupil on the axis from the image plane, in mm, and `index` the
/// refractive index of image space.
pub(super) fn path_differences<R: Real>(
    rays: &[PathRay<R>],
    chief: &PathRay<R>,
    pupil: R,
    index: R,
) -> Vec<R> {
    let center = chief.point;
    let axis = Vec3::new(center.x, center.y, center.z - pupil);
    let square = axis.dot(axis);
    let radius = square.sqrt();
    let side = if pupil.value() < 0.0 { -R::ONE } else { R::ONE };
    let difference = |ray: &PathRay<R>| {
        let off = ray.point - center;
        let a = off.dot(ray.direction);
        let b2 = off.dot(off) - a * a;
        // √(ρ² − b²) − ρ without cancellation.
        let sagitta = -(b2 / ((square - b2).sqrt() + radius));
        chief.path - (ray.path + index * (side * sagitta - a))
    };
    rays.iter().map(difference).collect()
}

impl<R: Real> WavefrontVariance<R> {
    /// The variance of path differences in waves over weighted points of the pupil; the weights add up
    /// to 1.
    pub(super) fn new(waves: &[R], weights: &[f64], pupil: &[[f64; 2]]) -> Self {
        let mean = |of: &dyn Fn(usize) -> R| {
            weights.iter().enumerate().fold(R::ZERO, |s, (i, w)| s + of(i) * R::from_f64(*w))
        };
        let middle = mean(&|i| waves[i]);
        let variance = mean(&|i| (waves[i] - middle) * (waves[i] - middle));
        let center = [0, 1].map(|c| mean(&|i| R::from_f64(pupil[i][c])));
        let at = |i: usize, c: usize| R::from_f64(pupil[i][c]) - center[c];
        let tilt = [0, 1].map(|c| mean(&|i| (waves[i] - middle) * at(i, c)));
        let [xx, xy, yy] = [(0, 0), (0, 1), (1, 1)].map(|(c, d)| mean(&|i| at(i, c) * at(i, d)));
        let fitted =
            tilt[0] * tilt[0] * yy - tilt[0] * tilt[1] * (xy + xy) + tilt[1] * tilt[1] * xx;
        Self { chief: variance, tilt_removed: variance - fitted / (xx * yy - xy * xy) }
    }
}
