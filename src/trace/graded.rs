//! Light in a gap that a gradient fills.
//!
//! A ray is refracted into the gap by the index at the very point, then moved by the steps of
//! [`grin`](crate::grin): `dx/dσ = v`, `dv/dσ = n ∇n` with `|v| = n`, so that `v` is what elsewhere
//! is called the optical direction `k`, to the next surface, where the index at that point refracts it.
//!
//! The steps of a gap are in [`super::gap`]; all have the same length, which a plan chooses (see
//! [`super::step`]).

use super::Tracer;
use super::fate::{CLIPPED, MISSED, TOTAL_REFLECTION};
use super::gap::GrinGap;
use super::interface::{Interface, Intersection, Refraction, SurfaceForm};
use crate::grin::RayState;
use crate::math::{Real, Vec3};

/// A ray that has come to a surface, or is lost on the way.
#[derive(Debug, Clone, Copy)]
pub(super) struct PropagatedRay<R> {
    /// The surface, with the indices at the place where it is met.
    pub(super) surface: Interface<R>,
    pub(super) met: Intersection<R>,
    /// The optical direction in front of the surface.
    pub(super) k: Vec3<R>,
    /// The optical path from the surface before.
    pub(super) path: R,
    /// Why it does not arrive, if it does not.
    pub(super) lost: Option<u32>,
    /// In a gradient, by how much the square of its distance from the axis stays below that of the
    /// side of the glass.
    pub(super) side: Option<R>,
}

impl<R: Real> PropagatedRay<R> {
    /// Clips at the rim and refracts.
    pub(super) fn refract(&self) -> Refraction<R> {
        let crossing = self.surface.refract(self.met, self.k);
        Refraction {
            clipped: crossing.clipped || self.surface.obstructs(self.met.point),
            ..crossing
        }
    }

    /// The first thing that goes wrong.
    pub(super) fn loss_cause(&self, crossing: &Refraction<R>) -> Option<u32> {
        let at_surface = if crossing.clipped {
            Some(CLIPPED)
        } else {
            crossing.reflected.then_some(TOTAL_REFLECTION)
        };
        self.lost.or(at_surface)
    }

    /// Where a ray stands that came from `p` and misses the surface, in the frame of the surface:
    /// where the gradient leaves it, or in glass where it was before.
    pub(super) fn end_position(&self, p: Vec3<R>) -> Vec3<R> {
        match self.lost {
            Some(MISSED) | None => Vec3::new(p.x, p.y, p.z - self.surface.gap),
            Some(_) => self.met.point,
        }
    }
}

impl<R: Real> Tracer<R> {
    /// The gradient in front of a surface.
    pub(super) fn grin_gap_before(&self, surface: usize) -> Option<&GrinGap<R>> {
        self.grin_gap_behind(surface.checked_sub(1)?)
    }

    /// The gradient behind a surface.
    pub(super) fn grin_gap_behind(&self, surface: usize) -> Option<&GrinGap<R>> {
        self.grin_gaps.get(surface)?.as_ref()
    }

    /// Whether a gradient touches a surface.
    #[inline(always)]
    pub(super) fn touches_grin(&self, surface: usize) -> bool {
        !self.grin_gaps.is_empty()
            && (self.grin_gap_before(surface).is_some() || self.grin_gap_behind(surface).is_some())
    }

    /// Brings a ray from the frame of the surface before to a surface. Never part of the loops that
    /// trace glass, whose registers it would take.
    #[inline(never)]
    pub(super) fn propagate(&self, i: usize, p: Vec3<R>, k: Vec3<R>) -> PropagatedRay<R> {
        let surface = &self.interfaces[i];
        let start = Vec3::new(p.x, p.y, p.z - surface.gap);
        let Some(gap) = self.grin_gap_before(i) else {
            let met = surface.intersect(start, k);
            let lost = met.missed.then_some(MISSED);
            let (surface, path) = (self.with_local_indices(i, met.point), met.s * surface.n2);
            return PropagatedRay { surface, met, k, path, lost, side: None };
        };
        let entry = i.checked_sub(1).map(|before| &self.interfaces[before]);
        match gap.cross(surface, entry, RayState { x: p, v: k, path: R::ZERO }) {
            Ok(crossed) => {
                let RayState { x, v, path } = crossed.state;
                let point = Vec3::new(x.x, x.y, x.z - surface.gap);
                let met = surface.intersection_at(point, v, crossed.length);
                let side = gap.side2 - crossed.widest;
                let lost = if side < R::ZERO { Some(CLIPPED) } else { None };
                let lost = if met.missed { Some(MISSED) } else { lost };
                PropagatedRay {
                    surface: self.with_local_indices(i, point),
                    met,
                    k: v,
                    path,
                    lost,
                    side: Some(side),
                }
            }
            Err((cause, state)) => {
                let point = Vec3::new(state.x.x, state.x.y, state.x.z - surface.gap);
                let met = surface.intersection_at(point, state.v, R::ZERO);
                let met = Intersection { missed: true, ..met };
                let (k, path) = (state.v, state.path);
                PropagatedRay { surface: *surface, met, k, path, lost: Some(cause), side: None }
            }
        }
    }

    /// A surface with the indices at one of its points.
    pub(super) fn with_local_indices(&self, i: usize, point: Vec3<R>) -> Interface<R> {
        let surface = self.interfaces[i];
        if !self.touches_grin(i) {
            return surface;
        }
        let there = Vec3::new(point.x, point.y, point.z + surface.gap);
        let before2 =
            self.grin_gap_before(i).map_or(surface.n2, |gap| gap.field.force(there).square);
        let behind2 = match self.grin_gap_behind(i) {
            Some(gap) => gap.field.force(point).square,
            None => surface.index_behind * surface.index_behind,
        };
        Interface {
            index_before: before2.sqrt(),
            n2: before2,
            index_behind: behind2.sqrt(),
            dn2: behind2 - before2,
            ..surface
        }
    }
}

impl<R: Real> Interface<R> {
    /// The meeting at a point that lies on the surface.
    fn intersection_at(&self, point: Vec3<R>, k: Vec3<R>, s: R) -> Intersection<R> {
        let slope = -(self.sag_slope(point) * R::TWO);
        let normal = Vec3::new(point.x * slope, point.y * slope, R::ONE);
        let a = k.dot(normal);
        let missed = !(self.sense * a > R::ZERO);
        Intersection { point, s, normal, a, m: normal.dot(normal), missed }
    }

    /// `dz/dr²` at a point.
    fn sag_slope(&self, point: Vec3<R>) -> R {
        if self.form == SurfaceForm::Plane {
            return R::ZERO;
        }
        self.sag(point.x * point.x + point.y * point.y).1
    }

    /// How far a point lies behind the surface along the sense of travel, and how fast that grows
    /// along `v`. The point is in the frame of the surface before, from which this one is `gap` away.
    pub(super) fn signed_height(&self, x: Vec3<R>, v: Vec3<R>, gap: R) -> (R, R) {
        let z = x.z - gap;
        if self.form == SurfaceForm::Plane {
            return (self.sense * z, self.sense * v.z);
        }
        let (sag, steep) = self.sag(x.x * x.x + x.y * x.y);
        let along = (x.x * v.x + x.y * v.y) * steep;
        (self.sense * (z - sag), self.sense * (v.z - along - along))
    }

    /// Whether the conic exists so far from the axis.
    pub(super) fn exists_at(&self, x: Vec3<R>) -> bool {
        let r2 = x.x * x.x + x.y * x.y;
        (R::ONE + self.conic) * self.curvature * self.curvature * r2 < R::ONE
    }
}
