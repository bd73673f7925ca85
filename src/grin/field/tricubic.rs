//! A field of tricubic B-splines on a grid: its force and the derivative of its force are
//! continuous.
//!
//! The coefficients are not values at the nodes. A field with `n` cells on an axis has `n + 3`
//! coefficients there; the first lies one spacing before the domain.

use super::bspline::{basis, basis_curvatures, basis_slopes};
use super::{FieldResolution, GridError, Hessian, IndexField, IndexSample, RegularGrid};
use crate::math::{Real, Vec3};

/// Coefficients of tricubic B-splines. Beyond the domain the polynomials of the outermost cells
/// continue.
#[derive(Debug, Clone, PartialEq)]
pub struct Tricubic<R> {
    /// The numbers of coefficients, the spacing, and the lower corner of the domain.
    grid: RegularGrid<R>,
    coefficients: Vec<R>,
}

/// Four weights along each axis.
type AxisWeights<R> = Vec3<[R; 4]>;

impl<R: Real> Tricubic<R> {
    /// The field of these coefficients, in the order of [`RegularGrid`]. `grid.low()` is the lower
    /// corner of the *domain*, which has three cells less than there are coefficients on each axis.
    ///
    /// # Errors
    /// Fewer than four coefficients on an axis, or values that do not fit or are not finite.
    pub fn new(grid: RegularGrid<R>, coefficients: Vec<R>) -> Result<Self, GridError> {
        grid.check(&coefficients, 4)?;
        Ok(Self { grid, coefficients })
    }

    /// An approximation of a smooth function over a cube from `-half` to `half` with `cells³`
    /// cells.
    ///
    /// The coefficients are `f - h²/6 ∇²f` at their positions, by differences: accurate to fourth
    /// order in the spacing.
    ///
    /// # Errors
    /// No cells, or values that are not finite.
    pub fn approximate(cells: usize, half: R, f: impl Fn(Vec3<R>) -> R) -> Result<Self, GridError> {
        let domain = RegularGrid::cube(cells + 1, half)?;
        let h = domain.spacing().x;
        let grid = RegularGrid::new([cells + 3; 3], domain.low(), domain.spacing())?;
        let place = |n: usize| grid.node(n) - Vec3::new(h, h, h);
        let coefficient = |p: Vec3<R>| {
            let centre = f(p);
            let mut around = R::ZERO;
            for step in [
                Vec3::new(h, R::ZERO, R::ZERO),
                Vec3::new(R::ZERO, h, R::ZERO),
                Vec3::new(R::ZERO, R::ZERO, h),
            ] {
                around += (f(p + step) - centre) + (f(p - step) - centre);
            }
            centre - around * R::from_f64(1.0 / 6.0)
        };
        Self::new(grid, (0..grid.node_count()).map(|n| coefficient(place(n))).collect())
    }

    /// The numbers of coefficients, the spacing, and the lower corner of the domain.
    pub fn grid(&self) -> &RegularGrid<R> {
        &self.grid
    }

    /// The first coefficient of the support at a point, and the position within its cell.
    #[inline(always)]
    fn locate(&self, at: Vec3<R>) -> (usize, Vec3<R>) {
        let place = self.grid.locate(at, 4);
        (place.first, place.t)
    }

    /// The number of the first of four coefficients in row `j` of layer `k`.
    #[inline(always)]
    fn row(&self, first: usize, j: usize, k: usize) -> usize {
        let [nx, ny, _] = self.grid.counts();
        first + (k * ny + j) * nx
    }
}

#[inline(always)]
fn weights<R: Real>(t: Vec3<R>, of: impl Fn(R) -> [R; 4]) -> AxisWeights<R> {
    Vec3::new(of(t.x), of(t.y), of(t.z))
}

#[inline(always)]
fn sum<R: Real>(weights: [R; 4], values: &[R]) -> R {
    (weights[0] * values[0] + weights[1] * values[1])
        + (weights[2] * values[2] + weights[3] * values[3])
}

impl<R: Real> IndexField<R> for Tricubic<R> {
    fn parameters(&self) -> &[R] {
        &self.coefficients
    }

    fn parameters_mut(&mut self) -> &mut [R] {
        &mut self.coefficients
    }

    #[inline(always)]
    fn sample(&self, at: Vec3<R>) -> IndexSample<R> {
        let (first, t) = self.locate(at);
        let (b, s) = (weights(t, basis), weights(t, basis_slopes));
        let (mut index, mut g) = (R::ZERO, Vec3::default());
        for k in 0..4 {
            // The layer: its value, and its slopes along x and y.
            let (mut value, mut dx, mut dy) = (R::ZERO, R::ZERO, R::ZERO);
            for j in 0..4 {
                let row = self.row(first, j, k);
                let row = &self.coefficients[row..row + 4];
                let along = sum(b.x, row);
                value += b.y[j] * along;
                dx += b.y[j] * sum(s.x, row);
                dy += s.y[j] * along;
            }
            index += b.z[k] * value;
            g = g + Vec3::new(b.z[k] * dx, b.z[k] * dy, s.z[k] * value);
        }
        let d = self.grid.inverse_spacing;
        IndexSample { index, gradient: Vec3::new(g.x * d.x, g.y * d.y, g.z * d.z) }
    }

    #[inline(always)]
    fn hessian(&self, at: Vec3<R>) -> Hessian<R> {
        self.sample_and_hessian(at).1
    }

    #[inline(always)]
    fn sample_and_hessian(&self, at: Vec3<R>) -> (IndexSample<R>, Hessian<R>) {
        let (first, t) = self.locate(at);
        let (b, s, c) = (weights(t, basis), weights(t, basis_slopes), weights(t, basis_curvatures));
        let (mut index, mut g) = (R::ZERO, Vec3::default());
        let (mut diagonal, mut mixed) = (Vec3::default(), Vec3::default());
        for k in 0..4 {
            let [mut value, mut dx, mut dy, mut dxx, mut dxy, mut dyy] = [R::ZERO; 6];
            for j in 0..4 {
                let row = self.row(first, j, k);
                let row = &self.coefficients[row..row + 4];
                let (along, slope) = (sum(b.x, row), sum(s.x, row));
                value += b.y[j] * along;
                dx += b.y[j] * slope;
                dy += s.y[j] * along;
                dxx += b.y[j] * sum(c.x, row);
                dxy += s.y[j] * slope;
                dyy += c.y[j] * along;
            }
            index += b.z[k] * value;
            g = g + Vec3::new(b.z[k] * dx, b.z[k] * dy, s.z[k] * value);
            diagonal = diagonal + Vec3::new(b.z[k] * dxx, b.z[k] * dyy, c.z[k] * value);
            mixed = mixed + Vec3::new(s.z[k] * dy, s.z[k] * dx, b.z[k] * dxy);
        }
        let d = self.grid.inverse_spacing;
        let sample = IndexSample { index, gradient: Vec3::new(g.x * d.x, g.y * d.y, g.z * d.z) };
        let hessian = Hessian {
            diagonal: Vec3::new(
                diagonal.x * d.x * d.x,
                diagonal.y * d.y * d.y,
                diagonal.z * d.z * d.z,
            ),
            mixed: Vec3::new(mixed.x * d.y * d.z, mixed.y * d.z * d.x, mixed.z * d.x * d.y),
        };
        (sample, hessian)
    }

    #[inline(always)]
    fn accumulate(&self, at: Vec3<R>, weight: R, pull: Vec3<R>, gradient: &mut [R]) {
        let (first, t) = self.locate(at);
        let (b, s) = (weights(t, basis), weights(t, basis_slopes));
        let d = self.grid.inverse_spacing;
        let pull = Vec3::new(pull.x * d.x, pull.y * d.y, pull.z * d.z);
        for k in 0..4 {
            for j in 0..4 {
                let yz = b.y[j] * b.z[k];
                let across = weight * yz + pull.y * s.y[j] * b.z[k] + pull.z * b.y[j] * s.z[k];
                let row = self.row(first, j, k);
                for (i, g) in gradient[row..row + 4].iter_mut().enumerate() {
                    *g += across * b.x[i] + pull.x * yz * s.x[i];
                }
            }
        }
    }

    fn resolution(&self) -> FieldResolution {
        FieldResolution { voxel: Some(self.grid.smallest_spacing()), continuous_force: true }
    }
}
