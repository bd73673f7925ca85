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
use super::gap::Gap;
use super::interface::{Crossing, Form, Interface, Meeting};
use crate::grin::State;
use crate::math::{Real, Vec3};

/// A ray that has come to a surface, or is lost on the way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arrival<R> {
    /// The surface, with the indices at the place where it is met.
    pub(super) surface: Interface<R>,
    pub(super) met: Meeting<R>,
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

impl<R: Real> Arrival<R> {
    /// Clips at the rim and refracts.
    pub(super) fn go_on(&self) -> Crossing<R> {
        let crossing = self.surface.go_on(self.met, self.k);
        Crossing { clipped: crossing.clipped || self.surface.obstructs(self.met.point), ..crossing }
    }

    /// The first thing that goes wrong.
    pub(super) fn cause(&self, crossing: &Crossing<R>) -> Option<u32> {
        let at_surface = if crossing.clipped {
            Some(CLIPPED)
        } else {
            crossing.reflected.then_some(TOTAL_REFLECTION)
        };
        self.lost.or(at_surface)
    }

    /// Where a ray stands that came from `p` and misses the surface, in the frame of the surface:
    /// where the gradient leaves it, or in glass where it was before.
    pub(super) fn stand(&self, p: Vec3<R>) -> Vec3<R> {
        match self.lost {
            Some(MISSED) | None => Vec3::new(p.x, p.y, p.z - self.surface.gap),
            Some(_) => self.met.point,
        }
    }
}

impl<R: Real> Tracer<R> {
    /// The gradient in front of a surface.
    pub(super) fn gap_before(&self, surface: usize) -> Option<&Gap<R>> {
        self.gap_behind(surface.checked_sub(1)?)
    }

    /// The gradient behind a surface.
    pub(super) fn gap_behind(&self, surface: usize) -> Option<&Gap<R>> {
        self.gaps.get(surface)?.as_ref()
    }

    /// Whether a gradient touches a surface.
    #[inline(always)]
    pub(super) fn touches_gradient(&self, surface: usize) -> bool {
        !self.gaps.is_empty()
            && (self.gap_before(surface).is_some() || self.gap_behind(surface).is_some())
    }

    /// Brings a ray from the frame of the surface before to a surface. Never part of the loops that
    /// trace glass, whose registers it would take.
    #[inline(never)]
    pub(super) fn arrive_at(&self, i: usize, p: Vec3<R>, k: Vec3<R>) -> Arrival<R> {
        let surface = &self.interfaces[i];
        let start = Vec3::new(p.x, p.y, p.z - surface.gap);
        let Some(gap) = self.gap_before(i) else {
            let met = surface.meeting(start, k);
            let lost = met.missed.then_some(MISSED);
            let (surface, path) = (self.local(i, met.point), met.s * surface.n2);
            return Arrival { surface, met, k, path, lost, side: None };
        };
        let entry = i.checked_sub(1).map(|before| &self.interfaces[before]);
        match gap.cross(surface, entry, State { x: p, v: k, path: R::ZERO }) {
            Ok(crossed) => {
                let State { x, v, path } = crossed.state;
                let point = Vec3::new(x.x, x.y, x.z - surface.gap);
                let met = surface.meeting_at(point, v, crossed.length);
                let side = gap.side2 - crossed.widest;
                let lost = if side < R::ZERO { Some(CLIPPED) } else { None };
                let lost = if met.missed { Some(MISSED) } else { lost };
                Arrival { surface: self.local(i, point), met, k: v, path, lost, side: Some(side) }
            }
            Err((cause, state)) => {
                let point = Vec3::new(state.x.x, state.x.y, state.x.z - surface.gap);
                let met = surface.meeting_at(point, state.v, R::ZERO);
                let met = Meeting { missed: true, ..met };
                let (k, path) = (state.v, state.path);
                Arrival { surface: *surface, met, k, path, lost: Some(cause), side: None }
            }
        }
    }

    /// A surface with the indices at one of its points.
    pub(super) fn local(&self, i: usize, point: Vec3<R>) -> Interface<R> {
        let surface = self.interfaces[i];
        if !self.touches_gradient(i) {
            return surface;
        }
        let there = Vec3::new(point.x, point.y, point.z + surface.gap);
        let before2 = self.gap_before(i).map_or(surface.n2, |gap| gap.field.force(there).square);
        let behind2 = match self.gap_behind(i) {
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
    fn meeting_at(&self, point: Vec3<R>, k: Vec3<R>, s: R) -> Meeting<R> {
        let slope = -(self.steepness(point) * R::TWO);
        let normal = Vec3::new(point.x * slope, point.y * slope, R::ONE);
        let a = k.dot(normal);
        let missed = !(self.sense * a > R::ZERO);
        Meeting { point, s, normal, a, m: normal.dot(normal), missed }
    }

    /// `dz/dr²` at a point.
    fn steepness(&self, point: Vec3<R>) -> R {
        if self.form == Form::Plane {
            return R::ZERO;
        }
        self.sag(point.x * point.x + point.y * point.y).1
    }

    /// How far a point lies behind the surface along the sense of travel, and how fast that grows
    /// along `v`. The point is in the frame of the surface before, from which this one is `gap` away.
    pub(super) fn passed_by(&self, x: Vec3<R>, v: Vec3<R>, gap: R) -> (R, R) {
        let z = x.z - gap;
        if self.form == Form::Plane {
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
