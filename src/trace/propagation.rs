//! Propagation of a ray through a gap to the next surface.
//!
//! A gap is a propagator: in a homogeneous medium the ray is a straight line, in a GRIN medium it
//! moves by the steps of [`super::grin_gap`]. At a surface that a GRIN medium touches, the indices in
//! Snell's law are those at the point of intersection. Everything behind the intersection is the same
//! for both.

use super::Tracer;
use super::deflection::Deflection;
use super::fate::{CLIPPED, MISSED, TOTAL_REFLECTION};
use super::grin_gap::GrinGap;
use super::interface::{Interface, Intersection, Refraction, SurfaceForm};
use crate::grin::RayState;
use crate::math::{Real, Vec3};

/// The refractive indices at a point of a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct LocalIndices<R> {
    /// The index in front.
    pub(super) before: R,
    /// Its square.
    pub(super) n2: R,
    /// The index behind.
    pub(super) behind: R,
    /// `n'² − n²`.
    pub(super) dn2: R,
}

/// A ray that has been propagated to a surface, or is lost on the way.
#[derive(Debug, Clone, Copy)]
pub(super) struct PropagatedRay<'a, R> {
    pub(super) surface: &'a Interface<R>,
    pub(super) indices: LocalIndices<R>,
    pub(super) met: Intersection<R>,
    /// The optical direction in front of the surface.
    pub(super) k: Vec3<R>,
    /// The optical path from the surface before, in mm.
    pub(super) path: R,
    /// The start of the ray in the frame of the surface, if no GRIN medium touches the surface.
    start: Option<Vec3<R>>,
    /// The cause of a loss inside a GRIN medium.
    lost: Option<u32>,
    /// The rule by which the surface deflects light beside.
    ideal: Option<Deflection<R>>,
    /// In a GRIN medium, the least difference on the way between the squares of the radius of the
    /// glass and of the distance from the axis, in mm².
    side: Option<R>,
}

impl<'a, R: Real> PropagatedRay<'a, R> {
    /// A straight ray to a surface between homogeneous media, from `start` in the frame of the
    /// surface.
    #[inline(always)]
    pub(super) fn straight(surface: &'a Interface<R>, start: Vec3<R>, k: Vec3<R>) -> Self {
        let met = surface.intersect(start, k);
        let path = met.s * surface.n2;
        let (start, indices) = (Some(start), surface.indices());
        Self { surface, indices, met, k, path, start, lost: None, ideal: None, side: None }
    }

    /// A ray to a point of a surface between homogeneous media for which no closed form exists.
    pub(super) fn met_at(surface: &'a Interface<R>, met: Intersection<R>, k: Vec3<R>) -> Self {
        let (path, indices) = (met.s * surface.n2, surface.indices());
        Self { surface, indices, met, k, path, start: None, lost: None, ideal: None, side: None }
    }

    /// The same ray at a surface that deflects light by a rule.
    pub(super) fn deflected_by(self, ideal: Deflection<R>) -> Self {
        let path = self.path + ideal.path(self.met.point, self.k);
        Self { path, ideal: Some(ideal), ..self }
    }

    /// The square of the component of the direction behind along the normal; negative for a ray that is
    /// totally reflected, or in an order that no light is in.
    #[inline(always)]
    pub(super) fn reflection_margin(&self) -> R {
        match &self.ideal {
            None => self.met.a * self.met.a + self.indices.dn2 * self.met.m,
            Some(ideal) => ideal.margin(self.k, self.met.normal),
        }
    }

    /// The direction behind of a ray whose margin is zero, which leaves along the surface.
    #[inline(always)]
    pub(super) fn grazing(&self) -> Vec3<R> {
        let met = &self.met;
        match &self.ideal {
            None => self.k - met.normal * (met.a / met.m),
            Some(ideal) => ideal.grazing(self.k, met),
        }
    }

    #[inline(always)]
    pub(super) fn ideal(&self) -> Option<&Deflection<R>> {
        self.ideal.as_ref()
    }

    /// True if the surface may send a ray back that meets it.
    pub(super) fn may_reflect(&self) -> bool {
        !self.surface.mirror || self.ideal.is_some()
    }

    /// Refracts or reflects the ray; clips it at the rim and at the obstruction.
    #[inline(always)]
    pub(super) fn refract(&self) -> Refraction<R> {
        let refraction = self.surface.refract(self.met, self.k, self.indices.dn2);
        let clipped = refraction.clipped | self.surface.obstructs(self.met.point);
        match &self.ideal {
            None => Refraction { clipped, ..refraction },
            Some(ideal) => {
                let k = ideal.deflect(self.met.point, self.k, self.met.normal);
                let reflected = !(self.reflection_margin() >= R::ZERO);
                let k = if reflected { self.k } else { k };
                Refraction { k, clipped, reflected, ..refraction }
            }
        }
    }

    /// The first cause of a loss; `None` for a ray that gets through.
    #[inline(always)]
    pub(super) fn loss_cause(&self, refraction: &Refraction<R>) -> Option<u32> {
        if self.lost.is_some() {
            self.lost
        } else if self.met.missed {
            Some(MISSED)
        } else if refraction.clipped {
            Some(CLIPPED)
        } else {
            refraction.reflected.then_some(TOTAL_REFLECTION)
        }
    }

    /// The end, in the frame of the surface, of a ray that starts at `p` in the frame of the surface
    /// before and does not reach the surface: the point at which a GRIN medium loses it, or else its
    /// start.
    #[inline(always)]
    pub(super) fn end_position(&self, p: Vec3<R>) -> Vec3<R> {
        match self.lost {
            Some(MISSED) | None => Vec3::new(p.x, p.y, p.z - self.surface.gap),
            Some(_) => self.met.point,
        }
    }

    /// The start of a ray whose intersection has a closed form: a straight one, to a plane, sphere or
    /// conic.
    #[inline(always)]
    pub(super) fn closed_form_start(&self) -> Option<Vec3<R>> {
        self.start.filter(|_| self.surface.form != SurfaceForm::Asphere)
    }

    /// True if no GRIN medium touches the surface.
    #[inline(always)]
    pub(super) fn is_straight(&self) -> bool {
        self.start.is_some()
    }

    /// The margin at the side of the glass; see [`super::RayLimit::Side`].
    #[inline(always)]
    pub(super) fn side_margin(&self) -> Option<R> {
        self.side
    }

    /// True for a ray that a GRIN medium loses elsewhere than at the side of the glass.
    #[inline(always)]
    pub(super) fn is_lost_inside(&self) -> bool {
        self.lost.is_some_and(|cause| cause != CLIPPED)
    }
}

/// A surface with the media on both sides.
#[derive(Debug, Clone, Copy)]
pub(super) struct SurfaceSite<'a, R> {
    pub(super) surface: &'a Interface<R>,
    /// The surface before.
    pub(super) entry: Option<&'a Interface<R>>,
    /// The GRIN medium in front.
    pub(super) before: Option<&'a GrinGap<R>>,
    /// The GRIN medium behind.
    pub(super) behind: Option<&'a GrinGap<R>>,
}

impl<'a, R: Real> SurfaceSite<'a, R> {
    /// True if a GRIN medium touches the surface.
    pub(super) fn touches_grin(&self) -> bool {
        self.before.is_some() || self.behind.is_some()
    }

    /// Propagates a ray from the frame of the surface before. Never part of the loops that trace
    /// homogeneous media, whose registers it would occupy.
    #[inline(never)]
    pub(super) fn propagate(&self, p: Vec3<R>, k: Vec3<R>) -> PropagatedRay<'a, R> {
        let surface = self.surface;
        let Some(gap) = self.before else {
            let straight =
                PropagatedRay::straight(surface, Vec3::new(p.x, p.y, p.z - surface.gap), k);
            let indices = self.local_indices(straight.met.point);
            return PropagatedRay { indices, start: None, ..straight };
        };
        let (indices, start) = (surface.indices(), None);
        match gap.cross(surface, self.entry, RayState { x: p, v: k, path: R::ZERO }) {
            Ok(exit) => {
                let RayState { x, v: k, path } = exit.state;
                let point = Vec3::new(x.x, x.y, x.z - surface.gap);
                let met = surface.intersection_at(point, k, exit.length);
                let side = gap.side2 - exit.widest;
                let lost = (side < R::ZERO && !met.missed).then_some(CLIPPED);
                let indices = self.local_indices(point);
                let (ideal, side) = (None, Some(side));
                PropagatedRay { surface, indices, met, k, path, start, lost, ideal, side }
            }
            Err((cause, RayState { x, v: k, path })) => {
                let point = Vec3::new(x.x, x.y, x.z - surface.gap);
                let met = surface.intersection_at(point, k, R::ZERO);
                let met = Intersection { missed: true, ..met };
                PropagatedRay {
                    surface,
                    indices,
                    met,
                    k,
                    path,
                    start,
                    lost: Some(cause),
                    ideal: None,
                    side: None,
                }
            }
        }
    }

    /// The indices at a point of the surface.
    fn local_indices(&self, point: Vec3<R>) -> LocalIndices<R> {
        let surface = self.surface;
        let in_front = Vec3::new(point.x, point.y, point.z + surface.gap);
        let n2 = self.before.map_or(surface.n2, |gap| gap.field.force(in_front).square);
        let behind2 = match self.behind {
            Some(gap) => gap.field.force(point).square,
            None => surface.index_behind * surface.index_behind,
        };
        LocalIndices { before: n2.sqrt(), n2, behind: behind2.sqrt(), dn2: behind2 - n2 }
    }

    /// The surface with the indices at one of its points.
    pub(super) fn local_surface(&self, point: Vec3<R>) -> Interface<R> {
        let LocalIndices { before, n2, behind, dn2 } = self.local_indices(point);
        Interface { index_before: before, n2, index_behind: behind, dn2, ..*self.surface }
    }
}

impl<R: Real> Tracer<R> {
    /// The GRIN medium in front of a surface.
    pub(super) fn grin_gap_before(&self, surface: usize) -> Option<&GrinGap<R>> {
        self.grin_gap_behind(surface.checked_sub(1)?)
    }

    /// The GRIN medium behind a surface.
    pub(super) fn grin_gap_behind(&self, surface: usize) -> Option<&GrinGap<R>> {
        self.grin_gaps.get(surface)?.as_ref()
    }

    /// True if a GRIN medium touches a surface.
    #[inline(always)]
    pub(super) fn touches_grin(&self, surface: usize) -> bool {
        !self.grin_gaps.is_empty() && self.site(surface).touches_grin()
    }

    /// True if a GRIN medium touches a surface, or if it is not centred.
    #[inline(always)]
    pub(super) fn is_general(&self, surface: usize) -> bool {
        self.touches_grin(surface) || self.mount(surface).is_some()
    }

    /// A surface with the media on both sides.
    pub(super) fn site(&self, surface: usize) -> SurfaceSite<'_, R> {
        SurfaceSite {
            surface: &self.interfaces[surface],
            entry: surface.checked_sub(1).map(|before| &self.interfaces[before]),
            before: self.grin_gap_before(surface),
            behind: self.grin_gap_behind(surface),
        }
    }

    /// Propagates a ray from the frame of the surface before to a surface, in whose own frame the
    /// result is. `GENERAL` must be true for a lens with GRIN media or poses; loops are compiled apart
    /// for others, since both in one cost registers.
    #[inline(always)]
    pub(super) fn propagate<const GENERAL: bool>(
        &self,
        i: usize,
        p: Vec3<R>,
        k: Vec3<R>,
    ) -> PropagatedRay<'_, R> {
        let surface = &self.interfaces[i];
        if GENERAL {
            if self.touches_grin(i) {
                return self.site(i).propagate(p, k);
            }
            if let Some(mount) = self.mount(i) {
                return mount.propagate(surface, p, k);
            }
        }
        PropagatedRay::straight(surface, Vec3::new(p.x, p.y, p.z - surface.gap), k)
    }
}
