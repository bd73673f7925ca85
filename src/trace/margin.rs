//! Margins: by how much a ray stays inside the limits of each surface.
//!
//! The set of rays that get through a lens ends where one of the margins is zero. Along a family of
//! rays a margin is smooth on both sides of that edge, so that a root finder finds the edge to the
//! last digit, which the mere fate of rays would not permit.

use super::Tracer;
use super::aperture::ApertureSet;
use super::interface::{Interface, SurfaceForm};
use super::propagation::PropagatedRay;
use super::single::{Ray, optical_direction};
use crate::math::{Real, Vec3};

/// A limit at which a surface, or the gap in front of it, ends rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RayLimit {
    /// The ray misses the surface.
    Miss,
    /// The ray meets the far half of a sphere or conic, behind its equator, which is not part of the
    /// surface.
    Equator,
    /// The ray meets the surface outside the semi-diameter.
    Rim,
    /// The ray meets the surface inside the obstruction.
    Obstruction,
    /// The ray meets the surface outside an aperture that is no circle about the vertex, at the side of it
    /// with this number, counted over all such apertures of the surface.
    Aperture(u16),
    /// The ray meets the surface inside an obscuration that is no circle about the vertex, counted so.
    Obscuration(u16),
    /// The ray is totally reflected.
    TotalReflection,
    /// The ray leaves the GRIN medium in front of the surface through its side.
    Side,
}

impl RayLimit {
    /// True if light is blocked inside: the limit ends a shadow, beyond which there may be light again.
    pub fn is_shadow(self) -> bool {
        matches!(self, Self::Obstruction | Self::Obscuration(_))
    }

    /// True if light may go on behind the limit in the same direction: beyond a shadow, or beyond a notch of
    /// an aperture.
    pub fn may_hide_light(self) -> bool {
        self.is_shadow() || matches!(self, Self::Aperture(_))
    }

    /// True if the limit is the edge of an aperture, which follows from the point on the surface alone: rays go on
    /// beyond it in a lens without apertures.
    pub fn is_edge_of_aperture(self) -> bool {
        matches!(self, Self::Rim | Self::Obstruction | Self::Aperture(_) | Self::Obscuration(_))
    }
}

impl<R: Real> Tracer<R> {
    /// Traces a ray and calls `visit` with every surface, each of its limits and the margin there:
    /// positive for a ray inside the limit, negative for one outside. A ray continues behind a rim or
    /// an obstruction that clips it, but not behind a surface that it misses or that reflects it
    /// totally. Of an obscuration with several sides, and of an aperture that is not convex, the side alone
    /// is visited that decides.
    ///
    /// The margin is `sd² − r²` in mm² at a rim and `r² − h²` at an obstruction, in mm the distance from a
    /// straight side of another aperture, the square of the
    /// component of the optical direction along the normal at a miss and at a total reflection, −1 at
    /// an asphere that is missed, and the component of the normal along the axis at an equator. A
    /// surface that a GRIN medium touches is treated as an asphere, and the side of the medium as a
    /// rim.
    pub fn margins(&self, ray: Ray<R>, visit: impl FnMut(usize, RayLimit, R)) {
        if self.is_plain() {
            self.margins_loop::<false>(ray, visit);
        } else {
            self.margins_loop::<true>(ray, visit);
        }
    }

    fn margins_loop<const GENERAL: bool>(
        &self,
        ray: Ray<R>,
        mut visit: impl FnMut(usize, RayLimit, R),
    ) {
        let mut k = optical_direction(ray.direction, self.index_before);
        let mut point = ray.point;
        for i in 0..self.interfaces.len() {
            let arrived = self.propagate::<GENERAL>(i, point, k);
            arrived.margins(i, self.apertures.clipping(i), &mut visit);
            let Some(behind) = arrived.cross_at_edge(None) else { return };
            (point, k) = self.state_out(i, behind);
        }
    }
}

impl<R: Real> PropagatedRay<'_, R> {
    /// Visits the margins at the surface, up to the first limit that the ray cannot pass.
    #[inline(always)]
    fn margins(
        &self,
        i: usize,
        apertures: Option<&ApertureSet<R>>,
        visit: &mut impl FnMut(usize, RayLimit, R),
    ) {
        let (surface, met) = (self.surface, &self.met);
        let passes_by = met.missed && !self.is_behind_equator();
        visit(i, RayLimit::Miss, self.miss_margin(passes_by));
        if passes_by {
            return;
        }
        if self.has_equator() {
            visit(i, RayLimit::Equator, self.equator_margin());
        }
        if met.missed {
            return;
        }
        if surface.rim2.value() < f64::INFINITY {
            visit(i, RayLimit::Rim, surface.rim_margin(met.point));
        }
        if let Some(side) = self.side_margin().filter(|side| side.value() < f64::INFINITY) {
            visit(i, RayLimit::Side, side);
        }
        if surface.obstruction2.value() > 0.0 {
            visit(i, RayLimit::Obstruction, surface.obstruction_margin(met.point));
        }
        if let Some(apertures) = apertures {
            apertures.visit(met.point, |limit, margin| visit(i, limit, margin));
        }
        if self.may_reflect() {
            visit(i, RayLimit::TotalReflection, self.reflection_margin());
        }
    }

    /// The margin at one limit of the surface; see [`Tracer::margins`].
    #[inline(always)]
    pub(super) fn margin(&self, limit: RayLimit, apertures: Option<&ApertureSet<R>>) -> R {
        let (surface, met) = (self.surface, &self.met);
        match limit {
            RayLimit::Rim => surface.rim_margin(met.point),
            RayLimit::Obstruction => surface.obstruction_margin(met.point),
            RayLimit::Aperture(side) | RayLimit::Obscuration(side) => {
                apertures.map_or(R::ONE, |apertures| apertures.margin(side, met.point))
            }
            RayLimit::TotalReflection => self.reflection_margin(),
            RayLimit::Equator if self.has_closed_form() => self.equator_margin(),
            RayLimit::Equator => R::ONE,
            RayLimit::Side => self.side_margin().unwrap_or(R::ONE),
            RayLimit::Miss => match self.closed_form_miss_margin() {
                Some(margin) => margin,
                None if met.missed && !self.is_straight() => -R::ONE,
                None => met.a * met.a,
            },
        }
    }

    /// `(k·N)²`, negative if no point of the ray lies on the surface.
    #[inline(always)]
    fn miss_margin(&self, passes_by: bool) -> R {
        let square = match self.closed_form_miss_margin() {
            Some(margin) if self.surface.form == SurfaceForm::Plane => return margin,
            Some(square) => square,
            None if self.met.missed => return -R::ONE,
            None => return self.met.a * self.met.a,
        };
        // Rounding may tell the two computations of the discriminant apart: the ray decides.
        let agrees = passes_by != (square > R::ZERO);
        R::select(agrees, square, R::ZERO - R::from_f64(f64::from(u8::from(passes_by))))
    }

    /// The margin at a miss of a straight ray: at a plane the component of `k` along the axis, at a
    /// sphere or conic the discriminant.
    #[inline(always)]
    fn closed_form_miss_margin(&self) -> Option<R> {
        let start = self.closed_form_start()?;
        Some(match self.surface.form {
            SurfaceForm::Plane => self.surface.sense * self.k.z,
            _ => self.surface.discriminant(start, self.k),
        })
    }

    /// The component of the normal along the axis, negative behind the equator.
    #[inline(always)]
    fn equator_margin(&self) -> R {
        self.met.normal.z - self.surface.min_normal_z
    }

    /// True if the far half of a sphere or conic is not part of the surface.
    #[inline(always)]
    fn has_equator(&self) -> bool {
        self.has_closed_form()
            && self.surface.form != SurfaceForm::Plane
            && self.surface.min_normal_z.value() > f64::NEG_INFINITY
    }

    /// True if the ray meets the surface behind its equator.
    #[inline(always)]
    fn is_behind_equator(&self) -> bool {
        self.has_equator() && self.equator_margin() < R::ZERO
    }

    #[inline(always)]
    fn has_closed_form(&self) -> bool {
        self.closed_form_start().is_some()
    }
}

impl<R: Real> Interface<R> {
    #[inline(always)]
    pub(super) fn rim_margin(&self, p: Vec3<R>) -> R {
        self.rim2 - (p.x * p.x + p.y * p.y)
    }

    #[inline(always)]
    pub(super) fn obstruction_margin(&self, p: Vec3<R>) -> R {
        p.x * p.x + p.y * p.y - self.obstruction2
    }

    /// `(k·N)²` at the intersection of a straight ray with a sphere or conic, negative for a miss.
    #[inline(always)]
    fn discriminant(&self, p: Vec3<R>, k: Vec3<R>) -> R {
        let c = self.curvature;
        let axial = self.conic * p.z;
        let b = k.z - c * (p.dot(k) + axial * k.z);
        let f = c * (p.dot(p) + axial * p.z) - (p.z + p.z);
        b * b - c * (self.n2 + self.conic * k.z * k.z) * f
    }
}
