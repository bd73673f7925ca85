//! A field with trilinear interpolation between the nodes of a grid.
//!
//! Its gradient jumps from voxel to voxel. Inside a voxel the second derivatives along the axes are
//! zero, and delta functions on the faces carry all of them. The discrete ray map does not see the
//! faces, so its exact transpose, or automatic differentiation, converges to a wrong derivative at
//! any resolution: `d(loss)/dx₀` of the sampled Luneburg lens is 1.2 where it should be 0. The
//! smoothed diagonal fills the gap with the second differences of the nodes and brings it to 4e-4.
//!
//! A block of rays is evaluated in three passes, so that SIMD lanes do all but the second: locate
//! the voxels, gather the nodes, interpolate.

use super::grid::GridCell;
use super::{
    FieldResolution, GridError, Hessian, IndexField, IndexSample, IndexSamples, RegularGrid,
};
use crate::grin::lanes::{LANES, LaneScalars, LaneVectors, get, put};
use crate::math::{Real, Vec3};

/// The diagonal of the Hessian of a trilinear field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum HessianDiagonal {
    /// Zero, as differentiation inside a voxel gives: the exact transpose of the discrete map, for
    /// comparison.
    Exact,
    /// Second differences of the nodes, interpolated: the second derivatives of the sampled
    /// function. For optimization.
    #[default]
    Smoothed,
}

/// Node values with trilinear interpolation between them. Beyond the grid the outermost voxels
/// continue.
#[derive(Debug, Clone, PartialEq)]
pub struct Trilinear<R> {
    grid: RegularGrid<R>,
    values: Vec<R>,
    /// The diagonal of the Hessian.
    pub diagonal: HessianDiagonal,
}

/// The eight corners of a voxel: x runs fastest.
type Corners<R> = [R; 8];

/// The nodes before and behind a voxel on the four lines through its corners along each axis, in
/// the order x, y, z, the lines in the order of their corners.
type OuterNodes<R> = [[R; 2]; 12];

/// The interpolated value, gradient and mixed derivatives at a point, in units of voxels.
struct VoxelSample<R> {
    value: R,
    slope: Vec3<R>,
    mixed: Vec3<R>,
}

/// Two neighbours along x.
#[inline(always)]
fn pair<R: Real>(values: &[R], first: usize) -> [R; 2] {
    let pair = &values[first..][..2];
    [pair[0], pair[1]]
}

/// Interpolates along x, then y, then z; differences instead of weights, for fewer operations.
#[inline(always)]
fn interpolate<R: Real>(c: &Corners<R>, t: Vec3<R>) -> VoxelSample<R> {
    let dx = [c[1] - c[0], c[3] - c[2], c[5] - c[4], c[7] - c[6]];
    let edges = [c[0] + t.x * dx[0], c[2] + t.x * dx[1], c[4] + t.x * dx[2], c[6] + t.x * dx[3]];
    let (dy0, dy1) = (edges[1] - edges[0], edges[3] - edges[2]);
    let (face0, face1) = (edges[0] + t.y * dy0, edges[2] + t.y * dy1);
    let (dxy0, dxy1) = (dx[1] - dx[0], dx[3] - dx[2]);
    let (dx0, dx1) = (dx[0] + t.y * dxy0, dx[2] + t.y * dxy1);
    let (dz, dzx, dyz) = (face1 - face0, dx1 - dx0, dy1 - dy0);
    VoxelSample {
        value: face0 + t.z * dz,
        slope: Vec3::new(dx0 + t.z * dzx, dy0 + t.z * dyz, dz),
        mixed: Vec3::new(dyz, dzx, dxy0 + t.z * (dxy1 - dxy0)),
    }
}

/// The second differences of the nodes along each axis, interpolated, in units of voxels.
///
/// On an edge from `a` to `b` between `before` and `behind` the two second differences,
/// interpolated, are `(1-t) before + t behind + (b - a) (1 - 2t) - ((1-t) a + t b)`. Interpolated over
/// the four edges along an axis, the last two terms are the slope and the value of the blend.
#[inline(always)]
fn second_differences<R: Real>(blend: &VoxelSample<R>, outer: Vec3<R>, t: Vec3<R>) -> Vec3<R> {
    let axis = |outer: R, slope: R, t: R| outer + slope * (R::ONE - t - t) - blend.value;
    let slope = blend.slope;
    Vec3::new(axis(outer.x, slope.x, t.x), axis(outer.y, slope.y, t.y), axis(outer.z, slope.z, t.z))
}

/// Interpolates the nodes around a voxel over the four edges of each axis.
#[inline(always)]
fn interpolate_outer<R: Real>(outer: &OuterNodes<R>, t: Vec3<R>) -> Vec3<R> {
    let lerp = |a: R, b: R, t: R| a + t * (b - a);
    let line = |n: usize, t: R| lerp(outer[n][0], outer[n][1], t);
    let four = |n: usize, along: R, s: R, t: R| {
        let (a, b) = (
            lerp(line(n, along), line(n + 1, along), s),
            lerp(line(n + 2, along), line(n + 3, along), s),
        );
        lerp(a, b, t)
    };
    Vec3::new(four(0, t.x, t.y, t.z), four(4, t.y, t.x, t.z), four(8, t.z, t.x, t.y))
}

impl<R: Real> Trilinear<R> {
    /// The field of these values, in the order of [`RegularGrid`], with the smoothed diagonal.
    ///
    /// # Errors
    /// Fewer than two nodes on an axis, or values that do not fit or are not finite.
    pub fn new(grid: RegularGrid<R>, values: Vec<R>) -> Result<Self, GridError> {
        grid.check(&values, 2)?;
        Ok(Self { grid, values, diagonal: HessianDiagonal::default() })
    }

    /// The field with the values of a function at the nodes.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn from_function(
        grid: RegularGrid<R>,
        value: impl Fn(Vec3<R>) -> R,
    ) -> Result<Self, GridError> {
        let values = (0..grid.node_count()).map(|n| value(grid.node(n))).collect();
        Self::new(grid, values)
    }

    /// The grid of its nodes.
    pub fn grid(&self) -> &RegularGrid<R> {
        &self.grid
    }

    /// The offsets of the four pairs of corners along x from the first corner.
    #[inline(always)]
    fn strides(&self) -> [usize; 4] {
        let [nx, ny, _] = self.grid.counts();
        [0, nx, nx * ny, nx * ny + nx]
    }

    #[inline(always)]
    fn corners(&self, first: usize) -> Corners<R> {
        // One bounds check for all corners; the offsets that remain to be checked are the same for
        // every voxel.
        let [_, row, layer, both] = self.strides();
        let near = &self.values[first..][..both + 2];
        let (a, b) = (pair(near, 0), pair(near, row));
        let (c, d) = (pair(near, layer), pair(near, both));
        [a[0], a[1], b[0], b[1], c[0], c[1], d[0], d[1]]
    }

    /// The nodes around a voxel, interpolated at the point for each axis; at the rim of the grid,
    /// values that continue the second difference of the next node inwards.
    #[inline(always)]
    fn outer(&self, place: &GridCell<R>) -> Vec3<R> {
        if self.is_at_rim(place) {
            return self.outer_at_rim(place);
        }
        self.outer_inside(place.first, place.t)
    }

    /// True if a voxel has no neighbour on some side.
    #[inline(always)]
    fn is_at_rim(&self, place: &GridCell<R>) -> bool {
        let [nx, ny, nz] = self.grid.counts();
        let [x, y, z] = place.cell;
        let within = |cell: f64, count: usize| (cell > 0.0) & (cell + 3.0 < count as f64);
        !(within(x, nx) & within(y, ny) & within(z, nz))
    }

    #[inline(always)]
    fn outer_inside(&self, first: usize, t: Vec3<R>) -> Vec3<R> {
        // One bounds check, as for the corners: the first node is one layer before them.
        let [_, row, layer, both] = self.strides();
        let near = &self.values[first - layer..][..2 * layer + both + 2];
        let across = |stride: usize, step: usize| {
            let (a, b) = (pair(near, layer + stride - step), pair(near, layer + stride + 2 * step));
            [[a[0], b[0]], [a[1], b[1]]]
        };
        let along = |stride: usize| {
            let four = &near[layer + stride - 1..][..4];
            [four[0], four[3]]
        };
        let [y0, y1] = [across(0, row), across(layer, row)];
        let [z0, z1] = [across(0, layer), across(row, layer)];
        let (x0, x1, x2, x3) = (along(0), along(row), along(layer), along(both));
        let outer = [x0, x1, x2, x3, y0[0], y0[1], y1[0], y1[1], z0[0], z0[1], z1[0], z1[1]];
        interpolate_outer(&outer, t)
    }

    #[cold]
    #[inline(never)]
    fn outer_at_rim(&self, place: &GridCell<R>) -> Vec3<R> {
        let [_, row, layer, _] = self.strides();
        let starts = [[0, row, layer, layer + row], [0, 1, layer, layer + 1], [0, 1, row, row + 1]];
        let steps = [1, row, layer];
        let mut outer = [[R::ZERO; 2]; 12];
        for axis in 0..3 {
            let (cell, count) = (place.cell[axis] as usize, self.grid.counts()[axis]);
            for (line, start) in starts[axis].into_iter().enumerate() {
                let first = place.first + start;
                outer[4 * axis + line] = self.neighbours(first, steps[axis], cell, count);
            }
        }
        interpolate_outer(&outer, place.t)
    }

    /// The nodes before and behind an edge that begins at node `first`, in cell `cell` of a line.
    fn neighbours(&self, first: usize, step: usize, cell: usize, count: usize) -> [R; 2] {
        let at = |n: usize| self.values[n];
        let (a, b) = (at(first), at(first + step));
        let (has_before, has_behind) = (cell > 0, cell + 2 < count);
        let before = || at(first - step);
        let behind = || at(first + 2 * step);
        // From b - 2a + before = behind - 2b + a, or 0 where there is neither.
        match (has_before, has_behind) {
            (true, true) => [before(), behind()],
            (true, false) => [before(), before() + (b - a) * R::from_f64(3.0)],
            (false, true) => [behind() - (b - a) * R::from_f64(3.0), behind()],
            (false, false) => [a - (b - a), b + (b - a)],
        }
    }

    #[inline(always)]
    fn to_sample(&self, blend: &VoxelSample<R>) -> IndexSample<R> {
        let (d, s) = (self.grid.inverse_spacing, blend.slope);
        let gradient = Vec3::new(s.x * d.x, s.y * d.y, s.z * d.z);
        IndexSample { index: blend.value, gradient }
    }

    #[inline(always)]
    fn to_hessian(&self, mixed: Vec3<R>, diagonal: Vec3<R>) -> Hessian<R> {
        let d = self.grid.inverse_spacing;
        Hessian {
            diagonal: Vec3::new(
                diagonal.x * d.x * d.x,
                diagonal.y * d.y * d.y,
                diagonal.z * d.z * d.z,
            ),
            mixed: Vec3::new(mixed.x * d.y * d.z, mixed.y * d.z * d.x, mixed.z * d.x * d.y),
        }
    }

    /// The contribution of each corner of a voxel to the gradient by the parameters.
    #[inline(always)]
    fn corner_shares(&self, t: Vec3<R>, weight: R, pull: Vec3<R>) -> Corners<R> {
        let d = self.grid.inverse_spacing;
        let (px, py, pz) = (pull.x * d.x, pull.y * d.y, pull.z * d.z);
        let (sy, sz) = (R::ONE - t.y, R::ONE - t.z);
        let pair = |y: R, z: R, py: R, pz: R| {
            let along = px * y * z;
            let behind = (weight * y * z + py * z + pz * y) * t.x;
            let both = weight * y * z + py * z + pz * y;
            [both - behind - along, behind + along]
        };
        let [a, b] = [pair(sy, sz, -py, -pz), pair(t.y, sz, py, -pz)];
        let [c, e] = [pair(sy, t.z, -py, pz), pair(t.y, t.z, py, pz)];
        [a[0], a[1], b[0], b[1], c[0], c[1], e[0], e[1]]
    }

    #[inline(always)]
    fn add_to_corners(&self, first: usize, shares: &Corners<R>, gradient: &mut [R]) {
        let strides = self.strides();
        let near = &mut gradient[first..][..strides[3] + 2];
        for (n, stride) in strides.into_iter().enumerate() {
            near[stride] += shares[2 * n];
            near[stride + 1] += shares[2 * n + 1];
        }
    }
}

/// Writes the corners of one ray into columns.
#[inline(always)]
fn scatter<R: Real>(columns: &mut [LaneScalars<R>; 8], lane: usize, corners: &Corners<R>) {
    for (column, corner) in columns.iter_mut().zip(corners) {
        column[lane] = *corner;
    }
}

/// Reads the corners of one ray from columns.
#[inline(always)]
fn gather<R: Real>(columns: &[LaneScalars<R>; 8], lane: usize) -> Corners<R> {
    std::array::from_fn(|n| columns[n][lane])
}

/// The voxels of a block of rays.
#[derive(Clone, Copy)]
struct GridCells<R> {
    cell: [[f64; LANES]; 3],
    first: [usize; LANES],
    at_rim: [bool; LANES],
    t: LaneVectors<R>,
}

impl<R: Real> GridCells<R> {
    #[inline(always)]
    fn get(&self, lane: usize) -> GridCell<R> {
        let cell = [self.cell[0][lane], self.cell[1][lane], self.cell[2][lane]];
        GridCell { cell, first: self.first[lane], t: get(&self.t, lane) }
    }
}

impl<R: Real> Trilinear<R> {
    #[inline(always)]
    fn locate_block(&self, at: &LaneVectors<R>) -> GridCells<R> {
        let mut places = GridCells {
            cell: [[0.0; LANES]; 3],
            first: [0; LANES],
            at_rim: [false; LANES],
            t: LaneVectors::default(),
        };
        for lane in 0..LANES {
            let place = self.grid.locate(get(at, lane), 2);
            for axis in 0..3 {
                places.cell[axis][lane] = place.cell[axis];
            }
            places.first[lane] = place.first;
            places.at_rim[lane] = self.is_at_rim(&place);
            put(&mut places.t, lane, place.t);
        }
        places
    }

    #[inline(always)]
    fn all_corners(&self, places: &GridCells<R>) -> [LaneScalars<R>; 8] {
        let mut all = [[R::ZERO; LANES]; 8];
        for lane in 0..LANES {
            scatter(&mut all, lane, &self.corners(places.first[lane]));
        }
        all
    }

    #[inline(always)]
    fn all_outer(&self, places: &GridCells<R>) -> LaneVectors<R> {
        let mut all = LaneVectors::default();
        if self.diagonal == HessianDiagonal::Smoothed {
            for lane in 0..LANES {
                let outer = if places.at_rim[lane] {
                    self.outer_at_rim(&places.get(lane))
                } else {
                    self.outer_inside(places.first[lane], get(&places.t, lane))
                };
                put(&mut all, lane, outer);
            }
        }
        all
    }
}

impl<R: Real> IndexField<R> for Trilinear<R> {
    fn parameters(&self) -> &[R] {
        &self.values
    }

    fn parameters_mut(&mut self) -> &mut [R] {
        &mut self.values
    }

    fn sample(&self, at: Vec3<R>) -> IndexSample<R> {
        let place = self.grid.locate(at, 2);
        self.to_sample(&interpolate(&self.corners(place.first), place.t))
    }

    fn hessian(&self, at: Vec3<R>) -> Hessian<R> {
        let place = self.grid.locate(at, 2);
        let blend = interpolate(&self.corners(place.first), place.t);
        let diagonal = match self.diagonal {
            HessianDiagonal::Exact => Vec3::default(),
            HessianDiagonal::Smoothed => second_differences(&blend, self.outer(&place), place.t),
        };
        self.to_hessian(blend.mixed, diagonal)
    }

    fn accumulate(&self, at: Vec3<R>, weight: R, pull: Vec3<R>, gradient: &mut [R]) {
        let place = self.grid.locate(at, 2);
        self.add_to_corners(place.first, &self.corner_shares(place.t, weight, pull), gradient);
    }

    fn resolution(&self) -> FieldResolution {
        FieldResolution { voxel: Some(self.grid.smallest_spacing()), continuous_force: false }
    }

    #[inline(always)]
    fn sample_lanes(&self, at: &LaneVectors<R>, out: &mut IndexSamples<R>) {
        let places = self.locate_block(at);
        let corners = self.all_corners(&places);
        for lane in 0..LANES {
            let corners = gather(&corners, lane);
            out.put(lane, self.to_sample(&interpolate(&corners, get(&places.t, lane))));
        }
    }

    #[inline(always)]
    fn hessian_lanes(
        &self,
        at: &LaneVectors<R>,
        times: &LaneVectors<R>,
        out: &mut IndexSamples<R>,
        product: &mut LaneVectors<R>,
    ) {
        let places = self.locate_block(at);
        let corners = self.all_corners(&places);
        let outer = self.all_outer(&places);
        let smoothed = self.diagonal == HessianDiagonal::Smoothed;
        for lane in 0..LANES {
            let t = get(&places.t, lane);
            let corners = gather(&corners, lane);
            let blend = interpolate(&corners, t);
            out.put(lane, self.to_sample(&blend));
            let diagonal = if smoothed {
                second_differences(&blend, get(&outer, lane), t)
            } else {
                Vec3::default()
            };
            let hessian = self.to_hessian(blend.mixed, diagonal);
            put(product, lane, hessian.times(get(times, lane)));
        }
    }

    #[inline(always)]
    fn accumulate_lanes(
        &self,
        at: &LaneVectors<R>,
        weight: &LaneScalars<R>,
        pull: &LaneVectors<R>,
        gradient: &mut [R],
    ) {
        let places = self.locate_block(at);
        let mut all = [[R::ZERO; LANES]; 8];
        for (lane, weight) in weight.iter().enumerate() {
            let shares = self.corner_shares(get(&places.t, lane), *weight, get(pull, lane));
            scatter(&mut all, lane, &shares);
        }
        for lane in 0..LANES {
            self.add_to_corners(places.first[lane], &gather(&all, lane), gradient);
        }
    }
}
