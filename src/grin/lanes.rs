//! Blocks of rays side by side: the loops over them have no branch on a ray.

use crate::math::{Real, Vec3};

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

/// `x += c h v` in every lane.
#[inline(always)]
pub(super) fn drift<R: Real>(x: &mut LaneVectors<R>, v: &LaneVectors<R>, h: &LaneScalars<R>, c: R) {
    for (lane, h) in h.iter().enumerate() {
        let step = c * *h;
        x.x[lane] += v.x[lane] * step;
        x.y[lane] += v.y[lane] * step;
        x.z[lane] += v.z[lane] * step;
    }
}
