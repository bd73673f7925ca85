//! The intersection of a ray with one surface, and its refraction or reflection there.
//!
//! The formulas have no branches on the ray, so that the same code traces one ray, a vector of rays
//! and a dual number. With `p` the start of the ray in the frame of the surface, `k` its
//! optical direction, `c` the curvature and `κ` the conic constant (Welford, *Aberrations of
//! Optical Systems*, 1986, section 4.4):
//!
//! ```text
//! A = c (n² + κ kz²)   B = kz − c (p·k + κ z kz)   F = c (p² + κ z²) − 2 z
//! k·N = σ √(B² − A F)  s = F / (B + k·N), or (B − k·N) / A where B and σ disagree
//! ```

use super::asphere;
use super::asphere_crossing;
use super::propagation::LocalIndices;
use crate::lens::{ASPHERE_TERMS, Shape, System};
use crate::math::Real;
use crate::math::Vec3;

/// The form of a surface, which decides what has to be computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SurfaceForm {
    Plane,
    Sphere,
    Conic,
    Asphere,
}

/// A surface between two media, with every constant that does not depend on the ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct Interface<R> {
    pub(super) form: SurfaceForm,
    pub(super) mirror: bool,
    /// True if rays start so far away that they are first moved to their point of closest approach,
    /// because `B² − A F` would cancel otherwise.
    pub(super) starts_far: bool,
    /// The sense of travel σ in front of the surface, +1 or −1.
    pub(super) sense: R,
    /// The thickness of the gap in front, in mm.
    pub(super) gap: R,
    pub(super) curvature: R,
    pub(super) conic: R,
    pub(super) terms: [R; ASPHERE_TERMS],
    /// The last surface in front that is not a mirror, whose index the light travels in; `None` for
    /// the index of object space.
    pub(super) medium_before: Option<usize>,
    /// The index in front.
    pub(super) index_before: R,
    /// Its square.
    pub(super) n2: R,
    /// The index behind.
    pub(super) index_behind: R,
    /// `n'² − n²`, computed as a product so that nearly equal indices keep their difference.
    pub(super) dn2: R,
    /// The square of the semi-diameter.
    pub(super) rim2: R,
    /// The square of the radius of the obstruction; 0 for none.
    pub(super) obstruction2: R,
    /// The least permitted `1 − (1+κ) c z`, the component of the normal along the axis: 0, or −∞ for
    /// a hyperhemisphere.
    pub(super) min_normal_z: R,
    /// A bound of the slope of an asphere inside its semi-diameter; infinite if there is none.
    pub(super) slope_bound: f64,
    /// A lower and an upper bound of the sag of an asphere inside its semi-diameter, in mm.
    pub(super) sag_range: (f64, f64),
}

/// The intersection of a ray with a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Intersection<R> {
    /// The point in the frame of the surface.
    pub(super) point: Vec3<R>,
    /// The parameter of the point along the ray: the start plus `s k`.
    pub(super) s: R,
    /// The normal `N`, of length `√m`.
    pub(super) normal: Vec3<R>,
    /// `k·N`.
    pub(super) a: R,
    /// `N·N`.
    pub(super) m: R,
    /// True if the ray does not meet the surface.
    pub(super) missed: bool,
}

/// A ray just behind a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Refraction<R> {
    pub(super) point: Vec3<R>,
    pub(super) k: Vec3<R>,
    pub(super) s: R,
    pub(super) missed: bool,
    pub(super) clipped: bool,
    pub(super) reflected: bool,
}

/// The length of a gap in radii of curvature beyond which rays are moved to their point of closest
/// approach first.
const FAR_START: f64 = 0.5;

/// The surfaces of a system, prepared for tracing.
pub(super) fn interfaces<R: Real>(system: &System<R>) -> Vec<Interface<R>> {
    let (mut n, mut gap, mut sense) = (system.index_before, R::ZERO, R::ONE);
    let mut medium = None;
    let prepare = |(i, surface): (usize, &crate::lens::Surface<R>)| {
        let (curvature, conic, terms) = surface.shape.numbers();
        let behind = if surface.mirror { n } else { surface.index };
        let rim2 = surface.semi_diameter * surface.semi_diameter;
        let whole = surface.hyperhemisphere && conic.value() > -1.0;
        let interface = Interface {
            form: form(&surface.shape),
            mirror: surface.mirror,
            starts_far: i == 0 || (curvature.value() * gap.value()).abs() > FAR_START,
            sense,
            gap,
            curvature,
            conic,
            terms,
            medium_before: medium,
            index_before: n,
            n2: n * n,
            index_behind: behind,
            dn2: (behind - n) * (behind + n),
            rim2,
            obstruction2: surface.obstruction * surface.obstruction,
            min_normal_z: R::from_f64(if whole { f64::NEG_INFINITY } else { 0.0 }),
            slope_bound: asphere::slope_bound(&surface.shape, surface.semi_diameter.value()),
            sag_range: asphere::sag_range(&surface.shape, surface.semi_diameter.value()),
        };
        (n, gap) = (behind, surface.thickness);
        medium = if surface.mirror { medium } else { Some(i) };
        sense = if surface.mirror { -sense } else { sense };
        interface
    };
    system.surfaces.iter().enumerate().map(prepare).collect()
}

fn form<R>(shape: &Shape<R>) -> SurfaceForm {
    match shape {
        Shape::Plane => SurfaceForm::Plane,
        Shape::Sphere { .. } => SurfaceForm::Sphere,
        Shape::Conic { .. } => SurfaceForm::Conic,
        Shape::Asphere { .. } => SurfaceForm::Asphere,
    }
}

impl<R: Real> Interface<R> {
    /// The intersection with a ray that starts at `start` in the frame of the surface.
    #[inline(always)]
    pub(super) fn intersect(&self, start: Vec3<R>, k: Vec3<R>) -> Intersection<R> {
        match self.form {
            SurfaceForm::Plane => self.intersect_plane(start, k),
            SurfaceForm::Sphere => self.intersect_sphere(start, k),
            SurfaceForm::Conic => self.intersect_conic(start, k),
            SurfaceForm::Asphere => self.intersect_asphere(start, k),
        }
    }

    /// True if a point of the surface lies inside its obstruction. Not part of
    /// [`Interface::refract`], so that surfaces without an obstruction cost nothing.
    #[inline(always)]
    pub(super) fn obstructs(&self, p: Vec3<R>) -> bool {
        p.x * p.x + p.y * p.y < self.obstruction2
    }

    /// Clips a ray at the rim, then refracts or reflects it; `dn2` is `n'² − n²` at the point.
    #[inline(always)]
    pub(super) fn refract(&self, met: Intersection<R>, k: Vec3<R>, dn2: R) -> Refraction<R> {
        let p = met.point;
        let clipped = !(p.x * p.x + p.y * p.y <= self.rim2);
        let (gamma, reflected) = if self.mirror {
            (-(met.a + met.a) / met.m, false)
        } else {
            self.snell_factor(&met, dn2)
        };
        let k = k + met.normal * gamma;
        Refraction { point: p, k, s: met.s, missed: met.missed, clipped, reflected }
    }

    /// `Γ` of Snell's law `k' = k + Γ N`; and true if the ray is totally reflected instead.
    #[inline(always)]
    fn snell_factor(&self, met: &Intersection<R>, dn2: R) -> (R, bool) {
        let behind2 = met.a * met.a + dn2 * met.m;
        let behind = self.sense * behind2.sqrt();
        let gamma = (behind - met.a) / met.m;
        (gamma, !(behind2 >= R::ZERO))
    }

    #[inline(always)]
    pub(super) fn intersect_plane(&self, p: Vec3<R>, k: Vec3<R>) -> Intersection<R> {
        let s = -p.z / k.z;
        Intersection {
            point: Vec3::new(p.x + k.x * s, p.y + k.y * s, R::ZERO),
            s,
            normal: Vec3::new(R::ZERO, R::ZERO, R::ONE),
            a: k.z,
            m: R::ONE,
            missed: !(self.sense * k.z > R::ZERO),
        }
    }

    #[inline(always)]
    pub(super) fn intersect_sphere(&self, p: Vec3<R>, k: Vec3<R>) -> Intersection<R> {
        let c = self.curvature;
        let (p, before) = self.closest_approach(p, k);
        let b = k.z - c * p.dot(k);
        let f = c * p.dot(p) - (p.z + p.z);
        let (s, a, missed) = self.root(c * self.n2, b, f);
        let point = p + k * s;
        let normal = Vec3::new(-(c * point.x), -(c * point.y), R::ONE - c * point.z);
        let missed = missed | !(normal.z >= self.min_normal_z);
        Intersection { point, s: before + s, normal, a, m: R::ONE, missed }
    }

    #[inline(always)]
    pub(super) fn intersect_conic(&self, p: Vec3<R>, k: Vec3<R>) -> Intersection<R> {
        let c = self.curvature;
        let (p, before) = self.closest_approach(p, k);
        let axial = self.conic * p.z;
        let b = k.z - c * (p.dot(k) + axial * k.z);
        let f = c * (p.dot(p) + axial * p.z) - (p.z + p.z);
        let (s, a, missed) = self.root(c * (self.n2 + self.conic * k.z * k.z), b, f);
        let point = p + k * s;
        let normal_z = R::ONE - c * (point.z + self.conic * point.z);
        let normal = Vec3::new(-(c * point.x), -(c * point.y), normal_z);
        let missed = missed | !(normal_z >= self.min_normal_z);
        Intersection { point, s: before + s, normal, a, m: normal.dot(normal), missed }
    }

    /// The root of `A s² − 2 B s + F` for which `k·N` has the sense of travel, `k·N`, and true if
    /// there is no root. The sign of `B` selects the form without cancellation.
    #[inline(always)]
    fn root(&self, a: R, b: R, f: R) -> (R, R, bool) {
        let square = b * b - a * f;
        let normal = self.sense * square.sqrt();
        let along = self.sense * b >= R::ZERO;
        let above = R::select(along, f, b - normal);
        let below = R::select(along, b + normal, a);
        (above / below, normal, !(square > R::ZERO))
    }

    /// The point of the ray closest to the vertex and its parameter along `k`; the start itself if
    /// nothing would cancel.
    #[inline(always)]
    pub(super) fn closest_approach(&self, p: Vec3<R>, k: Vec3<R>) -> (Vec3<R>, R) {
        if self.starts_far {
            let s = -p.dot(k) / self.n2;
            (p + k * s, s)
        } else {
            (p, R::ZERO)
        }
    }

    pub(super) fn intersect_asphere(&self, p: Vec3<R>, k: Vec3<R>) -> Intersection<R> {
        self.intersect_asphere_by(p, k, asphere_crossing::find_crossing)
    }

    /// The point at which Newton's iteration ends, for a ray that is lost already: a point of the
    /// asphere as a rule, at a small and bounded cost.
    pub(super) fn approach_asphere(&self, p: Vec3<R>, k: Vec3<R>) -> Intersection<R> {
        self.intersect_asphere_by(p, k, |surface, p, k, _| {
            Some(asphere_crossing::newton_end(&surface, p, k))
        })
    }

    /// The intersection near the one that `find` returns from the surface, a point of the ray, its
    /// direction, and the parameter of its start.
    #[inline(always)]
    fn intersect_asphere_by(
        &self,
        p: Vec3<R>,
        k: Vec3<R>,
        find: impl Fn(Interface<f64>, Vec3<f64>, Vec3<f64>, f64) -> Option<f64>,
    ) -> Intersection<R> {
        let (start, before) = self.closest_approach(p, k);
        let s = find(self.value(), start.value(), k.value(), -before.value());
        let mut s = R::from_f64(s.unwrap_or(f64::NAN));
        for _ in 0..R::ORDER {
            let (f, slope) = self.height_above(start + k * s, k);
            s -= f / slope;
        }
        self.intersection_on_asphere(start, k, s, before)
    }

    /// The intersection at `start + s k`, which lies on the asphere; missed if `s` is NaN.
    #[inline(always)]
    pub(super) fn intersection_on_asphere(
        &self,
        start: Vec3<R>,
        k: Vec3<R>,
        s: R,
        before: R,
    ) -> Intersection<R> {
        let point = start + k * s;
        let (_, dz_dr2) = self.sag(point.x * point.x + point.y * point.y);
        self.intersection_with_slope(point, k, before + s, dz_dr2)
    }

    /// The intersection at a point that lies on the surface.
    #[inline(always)]
    pub(super) fn intersection_at(&self, point: Vec3<R>, k: Vec3<R>, s: R) -> Intersection<R> {
        let (_, dz_dr2) = self.surface_sag(point.x * point.x + point.y * point.y);
        self.intersection_with_slope(point, k, s, dz_dr2)
    }

    /// The intersection at a point at which `dz/dr²` is known.
    #[inline(always)]
    fn intersection_with_slope(
        &self,
        point: Vec3<R>,
        k: Vec3<R>,
        s: R,
        dz_dr2: R,
    ) -> Intersection<R> {
        let slope = -(dz_dr2 + dz_dr2);
        let normal = Vec3::new(point.x * slope, point.y * slope, R::ONE);
        let a = k.dot(normal);
        let missed = !(self.sense * a > R::ZERO);
        Intersection { point, s, normal, a, m: normal.dot(normal), missed }
    }

    /// The height of a point above the surface along the sense of travel, negative in front of it,
    /// and its derivative along `v`. The point is in the frame of a vertex `gap` mm in front.
    pub(super) fn signed_height(&self, x: Vec3<R>, v: Vec3<R>, gap: R) -> (R, R) {
        let (sag, dz_dr2) = self.surface_sag(x.x * x.x + x.y * x.y);
        let along = (x.x * v.x + x.y * v.y) * dz_dr2;
        (self.sense * (x.z - gap - sag), self.sense * (v.z - along - along))
    }

    /// True if the conic exists at the distance of a point from the axis.
    pub(super) fn exists_at(&self, x: Vec3<R>) -> bool {
        let r2 = x.x * x.x + x.y * x.y;
        (R::ONE + self.conic) * self.curvature * self.curvature * r2 < R::ONE
    }

    /// The indices on both sides.
    #[inline(always)]
    pub(super) fn indices(&self) -> LocalIndices<R> {
        let (n2, dn2) = (self.n2, self.dn2);
        LocalIndices { before: self.index_before, n2, behind: self.index_behind, dn2 }
    }

    /// The same surface without derivatives.
    pub(super) fn value(&self) -> Interface<f64> {
        self.map(Real::value)
    }

    /// The same surface with every number mapped by `f`.
    #[inline(always)]
    pub(super) fn map<S: Real>(&self, f: impl Fn(R) -> S) -> Interface<S> {
        Interface {
            form: self.form,
            mirror: self.mirror,
            starts_far: self.starts_far,
            sense: f(self.sense),
            gap: f(self.gap),
            curvature: f(self.curvature),
            conic: f(self.conic),
            terms: self.terms.map(&f),
            medium_before: self.medium_before,
            index_before: f(self.index_before),
            n2: f(self.n2),
            index_behind: f(self.index_behind),
            dn2: f(self.dn2),
            rim2: f(self.rim2),
            obstruction2: f(self.obstruction2),
            min_normal_z: f(self.min_normal_z),
            slope_bound: self.slope_bound,
            sag_range: self.sag_range,
        }
    }

    /// `z(r) − z` at a point, and its derivative along `k`.
    #[inline(always)]
    pub(super) fn height_above(&self, point: Vec3<R>, k: Vec3<R>) -> (R, R) {
        let (z, dz_dr2) = self.sag(point.x * point.x + point.y * point.y);
        let along = (point.x * k.x + point.y * k.y) * dz_dr2;
        (z - point.z, along + along - k.z)
    }

    /// As [`Interface::sag`], without computing a plane.
    #[inline(always)]
    fn surface_sag(&self, r2: R) -> (R, R) {
        if self.form == SurfaceForm::Plane { (R::ZERO, R::ZERO) } else { self.sag(r2) }
    }

    /// The sag and its derivative by r²; beyond the edge of the conic, with the conic part at its
    /// edge.
    #[inline(always)]
    pub(super) fn sag(&self, r2: R) -> (R, R) {
        let c = self.curvature;
        let radicand = R::ONE - (R::ONE + self.conic) * c * c * r2;
        let root = R::select(radicand > R::ZERO, radicand, R::ZERO).sqrt();
        let (mut sum, mut slope) = (R::ZERO, R::ZERO);
        for a in self.terms.into_iter().rev() {
            slope = slope * r2 + sum;
            sum = sum * r2 + a;
        }
        let polynomial_slope = (slope * r2 + sum + sum) * r2;
        (c * r2 / (R::ONE + root) + sum * r2 * r2, c / (root + root) + polynomial_slope)
    }
}
