//! A field between grid nodes by trilinear interpolation.
//!
//! Its gradient jumps from voxel to voxel. Inside a voxel the second derivatives along the axes are
//! zero, and delta functions on the faces carry all of them. The discrete ray map does not see the
//! faces, so its exact transpose, or automatic differentiation, converges to a wrong derivative at
//! any resolution: `d(loss)/dx₀` of the sampled Luneburg lens is 1.2 where it should be 0. The
//! smoothed diagonal fills the gap with the second differences of the nodes and brings it to 4e-4.

use super::{Field, Grain, Grid, GridError, Hessian, Sample};
use crate::math::Real;
use crate::math::Vec3;

/// What stands on the diagonal of the Hessian.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Diagonal {
    /// Zero, as differentiation inside a voxel gives: the exact transpose of the discrete map, for
    /// comparison.
    Exact,
    /// Second differences of the nodes, interpolated: what the field means. For optimisation.
    #[default]
    Smoothed,
}

/// Node values with trilinear interpolation between them. Beyond the grid the outermost voxels
/// continue.
#[derive(Debug, Clone, PartialEq)]
pub struct Trilinear<R> {
    grid: Grid<R>,
    values: Vec<R>,
    /// What stands on the diagonal of the Hessian.
    pub diagonal: Diagonal,
}

/// The eight corners of a voxel in pairs along x, and where in it a point lies.
struct Voxel<R> {
    pairs: [[R; 2]; 4],
    t: Vec3<R>,
}

/// What the faces, edges and corners of a voxel say at a point, in units of voxels.
struct Blend<R> {
    value: R,
    slope: Vec3<R>,
    mixed: Vec3<R>,
}

impl<R: Real> Voxel<R> {
    /// Interpolates along x, then y, then z; differences instead of weights, for fewer operations.
    #[inline(always)]
    fn blend(&self) -> Blend<R> {
        let t = self.t;
        let dx = self.pairs.map(|[a, b]| b - a);
        let edge = |n: usize| self.pairs[n][0] + t.x * dx[n];
        let (e0, e1, e2, e3) = (edge(0), edge(1), edge(2), edge(3));
        let (dy0, dy1) = (e1 - e0, e3 - e2);
        let (face0, face1) = (e0 + t.y * dy0, e2 + t.y * dy1);
        let (dxy0, dxy1) = (dx[1] - dx[0], dx[3] - dx[2]);
        let (dx0, dx1) = (dx[0] + t.y * dxy0, dx[2] + t.y * dxy1);
        let (dz, dzx, dyz) = (face1 - face0, dx1 - dx0, dy1 - dy0);
        Blend {
            value: face0 + t.z * dz,
            slope: Vec3::new(dx0 + t.z * dzx, dy0 + t.z * dyz, dz),
            mixed: Vec3::new(dyz, dzx, dxy0 + t.z * (dxy1 - dxy0)),
        }
    }
}

impl<R: Real> Trilinear<R> {
    /// The field of these values, in the order of [`Grid`], with the smoothed diagonal.
    ///
    /// # Errors
    /// Fewer than two nodes on an axis, or values that do not fit or are no numbers.
    pub fn new(grid: Grid<R>, values: Vec<R>) -> Result<Self, GridError> {
        grid.check(&values, 2)?;
        Ok(Self { grid, values, diagonal: Diagonal::default() })
    }

    /// The field that takes these values at the nodes.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn sampled(grid: Grid<R>, value: impl Fn(Vec3<R>) -> R) -> Result<Self, GridError> {
        let values = (0..grid.nodes()).map(|n| value(grid.node(n))).collect();
        Self::new(grid, values)
    }

    /// Where the nodes stand.
    pub fn grid(&self) -> &Grid<R> {
        &self.grid
    }

    /// The number of the first corner of the voxel of a point, and where in it the point lies.
    #[inline(always)]
    fn corner(&self, at: Vec3<R>) -> (usize, Vec3<R>) {
        let (cell, t) = self.grid.locate(at, 2);
        (self.grid.number(cell), t)
    }

    /// How far apart the four pairs of a voxel lie.
    #[inline(always)]
    fn strides(&self) -> [usize; 4] {
        let [nx, ny, _] = self.grid.counts();
        [0, nx, nx * ny, nx * ny + nx]
    }

    #[inline(always)]
    fn voxel(&self, first: usize, t: Vec3<R>) -> Voxel<R> {
        let pair = |offset: usize| {
            let pair = &self.values[first + offset..first + offset + 2];
            [pair[0], pair[1]]
        };
        Voxel { pairs: self.strides().map(pair), t }
    }

    #[inline(always)]
    fn slope(&self, blend: &Blend<R>) -> Vec3<R> {
        let (d, s) = (self.grid.density, blend.slope);
        Vec3::new(s.x * d.x, s.y * d.y, s.z * d.z)
    }

    #[inline(always)]
    fn mixed(&self, blend: &Blend<R>) -> Vec3<R> {
        let (d, m) = (self.grid.density, blend.mixed);
        Vec3::new(m.x * d.y * d.z, m.y * d.z * d.x, m.z * d.x * d.y)
    }

    /// The trilinear blend of the second differences of the nodes along each axis.
    fn smoothed_diagonal(&self, at: Vec3<R>) -> Vec3<R> {
        let (cell, t) = self.grid.locate(at, 2);
        let d = self.grid.density;
        Vec3::new(
            self.second_difference(0, cell, t) * d.x * d.x,
            self.second_difference(1, cell, t) * d.y * d.y,
            self.second_difference(2, cell, t) * d.z * d.z,
        )
    }

    /// The second differences along one axis at the corners of a voxel, blended. At the outermost
    /// nodes, which have no neighbour outside, the difference of the next node inwards holds.
    fn second_difference(&self, axis: usize, cell: [usize; 3], t: Vec3<R>) -> R {
        let count = self.grid.counts()[axis];
        if count < 3 {
            return R::ZERO;
        }
        let [nx, ny, _] = self.grid.counts();
        let stride = [1, nx, nx * ny][axis];
        let mut sum = R::ZERO;
        for corner in 0..8 {
            let on = [corner & 1, corner >> 1 & 1, corner >> 2];
            let mut node = [cell[0] + on[0], cell[1] + on[1], cell[2] + on[2]];
            node[axis] = node[axis].clamp(1, count - 2);
            let n = self.grid.number(node);
            let values = &self.values;
            let difference = (values[n + stride] - values[n]) - (values[n] - values[n - stride]);
            let weight = |on: usize, t: R| if on == 1 { t } else { R::ONE - t };
            sum += difference * weight(on[0], t.x) * weight(on[1], t.y) * weight(on[2], t.z);
        }
        sum
    }
}

impl<R: Real> Field<R> for Trilinear<R> {
    fn parameters(&self) -> &[R] {
        &self.values
    }

    fn parameters_mut(&mut self) -> &mut [R] {
        &mut self.values
    }

    #[inline(always)]
    fn sample(&self, at: Vec3<R>) -> Sample<R> {
        let (first, t) = self.corner(at);
        let blend = self.voxel(first, t).blend();
        Sample { index: blend.value, gradient: self.slope(&blend) }
    }

    #[inline(always)]
    fn hessian(&self, at: Vec3<R>) -> Hessian<R> {
        let (first, t) = self.corner(at);
        let mixed = self.mixed(&self.voxel(first, t).blend());
        let diagonal = match self.diagonal {
            Diagonal::Exact => Vec3::default(),
            Diagonal::Smoothed => self.smoothed_diagonal(at),
        };
        Hessian { diagonal, mixed }
    }

    #[inline(always)]
    fn deposit(&self, at: Vec3<R>, weight: R, pull: Vec3<R>, gradient: &mut [R]) {
        let (first, t) = self.corner(at);
        let d = self.grid.density;
        let pull = Vec3::new(pull.x * d.x, pull.y * d.y, pull.z * d.z);
        let weights = |t: R| [R::ONE - t, t];
        let (y, z) = (weights(t.y), weights(t.z));
        for (n, offset) in self.strides().into_iter().enumerate() {
            let (j, k) = (n & 1, n >> 1);
            let sign = |on: usize| if on == 1 { R::ONE } else { -R::ONE };
            let along = pull.x * y[j] * z[k];
            let edge = weight * y[j] * z[k] + pull.y * sign(j) * z[k] + pull.z * sign(k) * y[j];
            let pair = &mut gradient[first + offset..first + offset + 2];
            pair[0] += edge * (R::ONE - t.x) - along;
            pair[1] += edge * t.x + along;
        }
    }

    fn grain(&self) -> Grain {
        Grain { voxel: Some(self.grid.voxel()), continuous_force: false }
    }
}
