//! Blocks of rays side by side: the loops over them have no branch on a ray.

use crate::math::Real;
use crate::math::Vec3;

/// Rays in a block. A single ray is one chain of dependent operations; this many hide its latency.
pub const LANES: usize = 16;

/// One number for each ray of a block.
pub type LaneScalars<R> = [R; LANES];

/// One vector for each ray of a block.
pub type LaneVectors<R> = Vec3<LaneScalars<R>>;

/// The vector of one ray.
#[inline(always)]
pub(super) fn get<R: Real>(columns: &LaneVectors<R>, lane: usize) -> Vec3<R> {
    Vec3::new(columns.x[lane], columns.y[lane], columns.z[lane])
}

/// Sets the vector of one ray.
#[inline(always)]
pub(super) fn put<R: Real>(columns: &mut LaneVectors<R>, lane: usize, v: Vec3<R>) {
    columns.x[lane] = v.x;
    columns.y[lane] = v.y;
    columns.z[lane] = v.z;
}
