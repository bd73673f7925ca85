//! One surface as a ray meets it: where, under which angle, and how it goes on.
//!
//! The formulas are free of branches on the ray, so that the same text traces one ray, a vector
//! of rays and a dual number. With `p` the start of the ray in the frame of the surface, `k` its
//! optical direction, `c` the curvature and `κ` the conic constant (Welford, *Aberrations of
//! Optical Systems*, 1986, section 4.4):
//!
//! ```text
//! A = c (n² + κ kz²)   B = kz − c (p·k + κ z kz)   F = c (p² + κ z²) − 2 z
//! k·N = σ √(B² − A F)  s = F / (B + k·N), or (B − k·N) / A where B and σ disagree
//! ```

use super::asphere;
use crate::lens::{ASPHERE_TERMS, Shape, System};
use crate::math::Real;
use crate::math::Vec3;

/// The form of a surface, as far as it decides what has to be computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SurfaceForm {
    Plane,
    Sphere,
    Conic,
    Asphere,
}

/// A surface with every constant that does not depend on the ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct Interface<R> {
    pub(super) form: SurfaceForm,
    pub(super) mirror: bool,
    /// Whether rays come from so far away that they are first moved to their point of closest
    /// approach: `B² − A F` would cancel otherwise.
    pub(super) starts_far: bool,
    /// The sense of travel σ in front of the surface, +1 or −1.
    pub(super) sense: R,
    /// The distance from the vertex before.
    pub(super) gap: R,
    pub(super) curvature: R,
    pub(super) conic: R,
    pub(super) terms: [R; ASPHERE_TERMS],
    /// The surface whose index the light is in when it arrives; `None` for the index in front of
    /// the first one. A mirror sets no index.
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
    /// The square of the radius of the obstruction, 0 where there is none.
    pub(super) obstruction2: R,
    /// `1 − (1+κ) c z` may not fall below this: 0 on the sag sheet, anything where the far half
    /// of an ellipsoid counts too.
    pub(super) min_normal_z: R,
    /// The largest slope of an asphere inside its semi-diameter; infinite where there is no bound.
    pub(super) slope_bound: f64,
    /// The lowest and the highest point of an asphere inside its semi-diameter.
    pub(super) sag_range: (f64, f64),
}

/// Where a ray meets a surface, before anything happens to it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Intersection<R> {
    /// The point in the frame of the surface.
    pub(super) point: Vec3<R>,
    /// How far along `k` it lies.
    pub(super) s: R,
    /// The normal `N`, of length `√m`.
    pub(super) normal: Vec3<R>,
    /// `k·N`.
    pub(super) a: R,
    /// `N·N`.
    pub(super) m: R,
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

/// Rays that travel farther than this many radii of curvature are moved close first.
const FAR_START: f64 = 0.5;

/// The surfaces of a system, prepared.
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
    /// Meets the surface and goes on behind it; `p` is in the frame of the vertex before.
    #[inline(always)]
    pub(super) fn cross(&self, p: Vec3<R>, k: Vec3<R>) -> Refraction<R> {
        let start = Vec3::new(p.x, p.y, p.z - self.gap);
        let met = match self.form {
            SurfaceForm::Plane => self.intersect_plane(start, k),
            SurfaceForm::Sphere => self.intersect_sphere(start, k),
            SurfaceForm::Conic => self.intersect_conic(start, k),
            SurfaceForm::Asphere => self.intersect_asphere(start, k),
        };
        let crossing = self.refract(met, k);
        let clipped = crossing.clipped || self.obstructs(met.point);
        Refraction { clipped, ..crossing }
    }

    /// Whether a point of the surface lies inside its obstruction. Asked apart from
    /// [`Interface::refract`], so that the many surfaces without one pay nothing.
    #[inline(always)]
    pub(super) fn obstructs(&self, p: Vec3<R>) -> bool {
        p.x * p.x + p.y * p.y < self.obstruction2
    }

    /// Clips at the rim, then refracts or reflects.
    #[inline(always)]
    pub(super) fn refract(&self, met: Intersection<R>, k: Vec3<R>) -> Refraction<R> {
        let p = met.point;
        let clipped = !(p.x * p.x + p.y * p.y <= self.rim2);
        let (gamma, reflected) =
            if self.mirror { (-(met.a + met.a) / met.m, false) } else { self.snell_factor(&met) };
        let k = k + met.normal * gamma;
        Refraction { point: p, k, s: met.s, missed: met.missed, clipped, reflected }
    }

    /// `Γ` of Snell's law `k' = k + Γ N`, and whether the ray is totally reflected instead.
    #[inline(always)]
    fn snell_factor(&self, met: &Intersection<R>) -> (R, bool) {
        let behind2 = met.a * met.a + self.dn2 * met.m;
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

    /// The root of `A s² − 2 B s + F` where `k·N` has the sense of travel, with `k·N`, and whether
    /// there is none. The form without cancellation is chosen by the sign of `B`.
    #[inline(always)]
    fn root(&self, a: R, b: R, f: R) -> (R, R, bool) {
        let square = b * b - a * f;
        let normal = self.sense * square.sqrt();
        let along = self.sense * b >= R::ZERO;
        let above = R::select(along, f, b - normal);
        let below = R::select(along, b + normal, a);
        (above / below, normal, !(square > R::ZERO))
    }

    /// The point of closest approach to the vertex, and how far along `k` it lies; the start
    /// itself where nothing would cancel.
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
        let (start, before) = self.closest_approach(p, k);
        let s = asphere::find_crossing(self.value(), start.value(), k.value(), -before.value());
        let mut s = R::from_f64(s.unwrap_or(f64::NAN));
        for _ in 0..R::ORDER {
            let (f, slope) = self.height_above(start + k * s, k);
            s -= f / slope;
        }
        self.intersection_on_asphere(start, k, s, before)
    }

    /// The meeting at `start + s k`, which lies on the asphere; missed where `s` is not a number.
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
        let slope = -(dz_dr2 + dz_dr2);
        let normal = Vec3::new(point.x * slope, point.y * slope, R::ONE);
        let a = k.dot(normal);
        let missed = !(self.sense * a > R::ZERO);
        Intersection { point, s: before + s, normal, a, m: normal.dot(normal), missed }
    }

    /// The same surface without derivatives.
    pub(super) fn value(&self) -> Interface<f64> {
        Interface {
            form: self.form,
            mirror: self.mirror,
            starts_far: self.starts_far,
            sense: self.sense.value(),
            gap: self.gap.value(),
            curvature: self.curvature.value(),
            conic: self.conic.value(),
            terms: self.terms.map(Real::value),
            medium_before: self.medium_before,
            index_before: self.index_before.value(),
            n2: self.n2.value(),
            index_behind: self.index_behind.value(),
            dn2: self.dn2.value(),
            rim2: self.rim2.value(),
            obstruction2: self.obstruction2.value(),
            min_normal_z: self.min_normal_z.value(),
            slope_bound: self.slope_bound,
            sag_range: self.sag_range,
        }
    }

    /// `z(r) − z` at a point and its slope along `k`.
    #[inline(always)]
    pub(super) fn height_above(&self, point: Vec3<R>, k: Vec3<R>) -> (R, R) {
        let (z, dz_dr2) = self.sag(point.x * point.x + point.y * point.y);
        let along = (point.x * k.x + point.y * k.y) * dz_dr2;
        (z - point.z, along + along - k.z)
    }

    /// Sag and its derivative by r²; at the edge of the conic beyond it.
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
