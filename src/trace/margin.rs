//! How narrowly a ray passes each surface.
//!
//! The set of rays that get through a lens ends where one of these margins is zero. They are
//! smooth along a family of rays on both sides of that place, so that it can be found to the last
//! digit by a root finder, which yes or no could not.

use super::Tracer;
use super::interface::{Interface, Intersection, SurfaceForm};
use super::single::{Ray, optical_direction};
use crate::math::Real;
use crate::math::Vec3;

/// What may end a ray at a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RayLimit {
    /// The surface is not met: the ray passes by it.
    Miss,
    /// The ray meets the far half of a sphere or conic, behind its equator, which does not count.
    Equator,
    /// The ray meets it outside the semi-diameter.
    Rim,
    /// The ray meets it inside the obstruction.
    Obstruction,
    /// The ray is totally reflected.
    TotalReflection,
    /// The ray leaves the gradient in front of the surface through its side.
    Side,
}

impl<R: Real> Tracer<R> {
    /// Follows a ray and calls `visit` with every hurdle on its way and the margin by which it is
    /// taken: positive for a ray that passes, negative for one that does not. A ray goes on behind
    /// a rim or an obstruction that clips it, but not behind a surface that it misses or that
    /// reflects it totally.
    ///
    /// The margin is `sd² − r²` in mm² at a rim and `r² − h²` at an obstruction, the square of the
    /// optical direction's component along the normal at a miss and at a total reflection, −1 at an
    /// asphere that is missed, and the normal's component along the axis at an equator. Where a
    /// gradient touches a surface it is treated like an asphere, and the side of the glass like a rim.
    pub fn margins(&self, ray: Ray<R>, mut visit: impl FnMut(usize, RayLimit, R)) {
        let mut k = optical_direction(ray.direction, self.index_before);
        let mut point = ray.point;
        for (i, interface) in self.interfaces.iter().enumerate() {
            if self.touches_grin(i) {
                let arrival = self.propagate(i, point, k);
                arrival.margins(i, &mut visit);
                let Some(passed) = arrival.cross_at_edge(None) else { return };
                (point, k) = passed;
                continue;
            }
            let start = Vec3::new(point.x, point.y, point.z - interface.gap);
            let met = interface.intersect(start, k);
            let passes_by = met.missed && !interface.is_behind_equator(&met);
            visit(i, RayLimit::Miss, interface.miss_margin(&met, start, k, passes_by));
            if passes_by {
                return;
            }
            if interface.has_equator() {
                visit(i, RayLimit::Equator, interface.equator_margin(&met));
            }
            if met.missed {
                return;
            }
            let p = met.point;
            if interface.rim2.value() < f64::INFINITY {
                visit(i, RayLimit::Rim, interface.rim_margin(p));
            }
            if interface.obstruction2.value() > 0.0 {
                visit(i, RayLimit::Obstruction, interface.obstruction_margin(p));
            }
            if !interface.mirror {
                let behind2 = met.a * met.a + interface.dn2 * met.m;
                visit(i, RayLimit::TotalReflection, behind2);
                if !(behind2 >= R::ZERO) {
                    return;
                }
            }
            k = interface.refract(met, k).k;
            point = p;
        }
    }
}

impl<R: Real> Interface<R> {
    pub(super) fn rim_margin(&self, p: Vec3<R>) -> R {
        self.rim2 - (p.x * p.x + p.y * p.y)
    }

    pub(super) fn obstruction_margin(&self, p: Vec3<R>) -> R {
        p.x * p.x + p.y * p.y - self.obstruction2
    }

    pub(super) fn intersect(&self, start: Vec3<R>, k: Vec3<R>) -> Intersection<R> {
        match self.form {
            SurfaceForm::Plane => self.intersect_plane(start, k),
            SurfaceForm::Sphere => self.intersect_sphere(start, k),
            SurfaceForm::Conic => self.intersect_conic(start, k),
            SurfaceForm::Asphere => self.intersect_asphere(start, k),
        }
    }

    /// `(k·N)²`, negative where no point of the ray lies on the surface.
    fn miss_margin(&self, met: &Intersection<R>, p: Vec3<R>, k: Vec3<R>, passes_by: bool) -> R {
        let square = match self.form {
            SurfaceForm::Plane => return self.sense * k.z,
            SurfaceForm::Asphere if met.missed => return -R::ONE,
            SurfaceForm::Asphere => return met.a * met.a,
            SurfaceForm::Sphere | SurfaceForm::Conic => self.discriminant(p, k),
        };
        // Rounding may tell the two computations of the discriminant apart: the ray decides.
        let agrees = passes_by != (square > R::ZERO);
        R::select(agrees, square, R::ZERO - R::from_f64(f64::from(u8::from(passes_by))))
    }

    /// Whether only the half of the surface in front of its equator counts.
    fn has_equator(&self) -> bool {
        matches!(self.form, SurfaceForm::Sphere | SurfaceForm::Conic)
            && self.min_normal_z.value() > f64::NEG_INFINITY
    }

    /// The normal's component along the axis, negative behind the equator.
    pub(super) fn equator_margin(&self, met: &Intersection<R>) -> R {
        met.normal.z - self.min_normal_z
    }

    /// Whether the ray meets the surface behind its equator, instead of not at all.
    fn is_behind_equator(&self, met: &Intersection<R>) -> bool {
        self.has_equator() && self.equator_margin(met) < R::ZERO
    }

    pub(super) fn discriminant(&self, p: Vec3<R>, k: Vec3<R>) -> R {
        let c = self.curvature;
        let axial = self.conic * p.z;
        let b = k.z - c * (p.dot(k) + axial * k.z);
        let f = c * (p.dot(p) + axial * p.z) - (p.z + p.z);
        b * b - c * (self.n2 + self.conic * k.z * k.z) * f
    }
}
