//! Groups of rays on their way through a lens with errors of making, as columns.

use super::errors::{ErrorNumber, ErrorRows};
use super::sag_crossing::{ErrorReal, SurfaceErrors, SurfaceHit};
use crate::math::Vec3;
use crate::trace::interface::Interface;

/// The number of rays that are traced back at once.
pub(super) const LANES: usize = 16;

/// Vectors of some rays, as columns.
#[derive(Clone, Copy)]
pub(super) struct Vectors<R> {
    pub(super) x: [R; LANES],
    pub(super) y: [R; LANES],
    pub(super) z: [R; LANES],
}

impl<R: ErrorReal> Vectors<R> {
    pub(super) fn zero() -> Self {
        Self { x: [R::ZERO; LANES], y: [R::ZERO; LANES], z: [R::ZERO; LANES] }
    }

    #[inline(always)]
    pub(super) fn get(&self, j: usize) -> Vec3<R> {
        Vec3::new(self.x[j], self.y[j], self.z[j])
    }

    #[inline(always)]
    pub(super) fn set(&mut self, j: usize, v: Vec3<R>) {
        (self.x[j], self.y[j], self.z[j]) = (v.x, v.y, v.z);
    }

    /// The differences from other vectors.
    #[inline(always)]
    pub(super) fn less(&self, other: &Self) -> Self {
        let mut less = *self;
        for j in 0..LANES {
            less.set(j, self.get(j) - other.get(j));
        }
        less
    }

    /// The parts along the axis.
    #[inline(always)]
    pub(super) fn along_axis(&self) -> [R; LANES] {
        self.z
    }
}

/// Some rays in one place, or the derivatives by them.
#[derive(Clone, Copy)]
pub(super) struct RayColumns<R> {
    pub(super) point: Vectors<R>,
    pub(super) k: Vectors<R>,
}

/// Some rays at a surface, in its frame.
#[derive(Clone, Copy)]
pub(super) struct HitColumns<R> {
    pub(super) at: RayColumns<R>,
    pub(super) s: [R; LANES],
    a_behind: [R; LANES],
}

impl<R: ErrorReal> HitColumns<R> {
    pub(super) fn zero() -> Self {
        let at = RayColumns { point: Vectors::zero(), k: Vectors::zero() };
        Self { at, s: [R::ZERO; LANES], a_behind: [R::ZERO; LANES] }
    }

    #[inline(always)]
    pub(super) fn get(&self, j: usize) -> SurfaceHit<R> {
        let (point, k) = (self.at.point.get(j), self.at.k.get(j));
        SurfaceHit { point, k, s: self.s[j], a_behind: self.a_behind[j] }
    }

    #[inline(always)]
    pub(super) fn set(&mut self, j: usize, hit: &SurfaceHit<R>) {
        self.at.point.set(j, hit.point);
        self.at.k.set(j, hit.k);
        (self.s[j], self.a_behind[j]) = (hit.s, hit.a_behind);
    }
}

/// The errors of a surface for some rays: those of [`ErrorNumber`] in order, then those of the gap and
/// of the index in front.
pub(super) struct ErrorColumns([[f64; LANES]; ErrorNumber::COUNT + 2]);

impl ErrorColumns {
    pub(super) const NONE: Self = Self([[0.0; LANES]; ErrorNumber::COUNT + 2]);

    #[inline(always)]
    pub(super) fn get(&self, j: usize) -> SurfaceErrors {
        let of = |number: ErrorNumber| self.0[number as usize][j];
        SurfaceErrors {
            curvature: of(ErrorNumber::Curvature),
            conic: of(ErrorNumber::Conic),
            fourth: of(ErrorNumber::Fourth),
            astigmatism: of(ErrorNumber::Astigmatism),
            gap: self.0[ErrorNumber::COUNT][j],
            index_before: self.0[ErrorNumber::COUNT + 1][j],
            index_behind: of(ErrorNumber::Index),
            decenter: [of(ErrorNumber::DecenterX), of(ErrorNumber::DecenterY)],
            tilt: [of(ErrorNumber::TiltX), of(ErrorNumber::TiltY)],
        }
    }

    /// Those of a surface, for the rays from a number on.
    #[inline(always)]
    pub(super) fn load(
        rows: &ErrorRows,
        axis: usize,
        surface: (usize, &Interface<f64>),
        rays: Lane,
    ) -> Self {
        let (i, interface) = surface;
        let mut columns = Self::NONE;
        for number in ErrorNumber::ALL {
            columns.copy(number as usize, rows.row(axis, i, number), rays);
        }
        if let Some(before) = i.checked_sub(1) {
            columns.copy(ErrorNumber::COUNT, rows.row(axis, before, ErrorNumber::Thickness), rays);
        }
        if let Some(medium) = interface.medium_before {
            let row = rows.row(axis, medium, ErrorNumber::Index);
            columns.copy(ErrorNumber::COUNT + 1, row, rays);
            if interface.mirror {
                columns.copy(ErrorNumber::Index as usize, row, rays);
            }
        }
        columns
    }

    /// Copies the part of a row for some rays.
    #[inline(always)]
    fn copy(&mut self, to: usize, row: &[f64], Lane { from, count }: Lane) {
        self.0[to][..count].copy_from_slice(&row[from..from + count]);
    }
}

/// The rays of one group of lanes: the first and how many.
#[derive(Clone, Copy)]
pub(super) struct Lane {
    pub(super) from: usize,
    pub(super) count: usize,
}

/// Some rays on their way to the image, as an earlier trace found them.
pub(super) struct TracedLanes {
    pub(super) lane: Lane,
    pub(super) start: RayColumns<f64>,
    /// The distance to each surface.
    pub(super) distances: Vec<[f64; LANES]>,
}
