//! One surface on the way of a ray forwards and back, over numbers that may carry the derivative along
//! an error of making.
//!
//! Every surface is taken as a sag `z(r²)`, with `G = z(r²) − z` zero on it and `N = −∇G`, so that one
//! adjoint serves all forms. A point of the ray near the surface is known from an earlier trace: only
//! derivatives move it, by one step of Newton's iteration. Errors enter as derivatives: numbers of the
//! surface get theirs, and a surface that is moved by `d` and turned by `ω` takes the ray as the
//! centred one takes it in a frame that is moved so.

use super::refraction::SagDerivatives;
use crate::lens::ASPHERE_TERMS;
use crate::math::{Dual, Real, Vec3};
use crate::trace::interface::{Interface, SurfaceForm};

/// A number that an error of making may change to first order: a plain one ignores errors.
pub(super) trait ErrorReal: Real {
    /// The same number with this added to its derivative along the error.
    #[must_use]
    fn shifted(self, by: f64) -> Self;

    /// Its derivative along the error.
    fn along_error(self) -> f64;
}

impl ErrorReal for f64 {
    #[inline(always)]
    fn shifted(self, _by: f64) -> Self {
        self
    }
    #[inline(always)]
    fn along_error(self) -> f64 {
        0.0
    }
}

impl ErrorReal for Dual<f64, 1> {
    #[inline(always)]
    fn shifted(self, by: f64) -> Self {
        Self { value: self.value, slope: [self.slope[0] + by] }
    }
    #[inline(always)]
    fn along_error(self) -> f64 {
        self.slope[0]
    }
}

/// A vector with these added to its derivatives along the error.
#[inline(always)]
fn shifted<R: ErrorReal>(v: Vec3<R>, by: Vec3<f64>) -> Vec3<R> {
    Vec3::new(v.x.shifted(by.x), v.y.shifted(by.y), v.z.shifted(by.z))
}

/// The vector product.
#[inline(always)]
pub(super) fn cross<R: Real>(a: Vec3<R>, b: Vec3<R>) -> Vec3<R> {
    Vec3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

/// The errors of one surface for one ray, as a direction in which derivatives are taken.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SurfaceErrors {
    pub(super) curvature: f64,
    pub(super) conic: f64,
    /// Of the coefficient of r⁴.
    pub(super) fourth: f64,
    /// Of the coefficient of y².
    pub(super) astigmatism: f64,
    /// Of the gap in front.
    pub(super) gap: f64,
    pub(super) index_before: f64,
    pub(super) index_behind: f64,
    pub(super) decenter: [f64; 2],
    pub(super) tilt: [f64; 2],
}

impl SurfaceErrors {
    #[inline(always)]
    fn turn(&self) -> Vec3<f64> {
        Vec3::new(self.tilt[0], self.tilt[1], 0.0)
    }

    /// The displacement of a point that moves with the surface.
    #[inline(always)]
    fn displacement(&self, p: Vec3<f64>) -> Vec3<f64> {
        Vec3::new(self.decenter[0], self.decenter[1], 0.0) + cross(self.turn(), p)
    }

    /// The change of the sag at a point.
    #[inline(always)]
    fn sag(&self, x: f64, y: f64) -> f64 {
        let r2 = x * x + y * y;
        self.fourth * r2 * r2 + self.astigmatism * y * y
    }

    /// Its derivatives by x and y.
    #[inline(always)]
    fn sag_slopes(&self, x: f64, y: f64) -> [f64; 2] {
        let radial = 4.0 * self.fourth * (x * x + y * y);
        [radial * x, (radial + 2.0 * self.astigmatism) * y]
    }

    /// Its second derivatives by x and x, x and y, y and y.
    #[inline(always)]
    fn sag_bends(&self, x: f64, y: f64) -> [f64; 3] {
        let (radial, cubic) = (4.0 * self.fourth * (x * x + y * y), 8.0 * self.fourth);
        let yy = radial + cubic * y * y + 2.0 * self.astigmatism;
        [radial + cubic * x * x, cubic * x * y, yy]
    }
}

/// A surface whose numbers carry derivatives along the errors of one ray.
#[derive(Clone, Copy)]
pub(super) struct PerturbedSurface<'a, R, const QUADRIC: bool> {
    plain: &'a Interface<f64>,
    errors: SurfaceErrors,
    curvature: R,
    /// The conic constant plus one.
    k1: R,
    index_before: R,
    index_behind: R,
}

/// A ray at a surface, in the frame of the surface.
#[derive(Clone, Copy)]
pub(super) struct SurfaceHit<R> {
    pub(super) point: Vec3<R>,
    /// The optical direction in front.
    pub(super) k: Vec3<R>,
    /// The parameter of the point along the ray.
    pub(super) s: R,
    /// `k'·N` behind.
    pub(super) a_behind: R,
}

/// The derivatives of a result by what a ray meets at a surface.
pub(super) struct HitAdjoint<R> {
    /// By a displacement of the ray in front.
    pub(super) by_point: Vec3<R>,
    /// By its optical direction at the point of incidence.
    pub(super) by_k: Vec3<R>,
    pub(super) by_curvature: R,
    pub(super) by_conic: R,
    /// By the sag, and by `dz/dr²`.
    pub(super) by_sag: [R; 2],
    pub(super) by_astigmatism: R,
    pub(super) by_index_before: R,
    pub(super) by_index_behind: R,
    /// The optical direction behind, in the frame of the surface.
    pub(super) k_behind: Vec3<R>,
}

impl<'a, R: ErrorReal, const QUADRIC: bool> PerturbedSurface<'a, R, QUADRIC> {
    #[inline(always)]
    pub(super) fn new(plain: &'a Interface<f64>, errors: SurfaceErrors) -> Self {
        let number = R::from_f64;
        Self {
            plain,
            errors,
            curvature: number(plain.curvature).shifted(errors.curvature),
            k1: number(1.0 + plain.conic).shifted(errors.conic),
            index_before: number(plain.index_before).shifted(errors.index_before),
            index_behind: number(plain.index_behind).shifted(errors.index_behind),
        }
    }

    /// The surface as the tracer knows it, for forms beyond conics.
    #[inline(always)]
    fn asphere(&self) -> Interface<R> {
        let mut surface = self.plain.map(R::from_f64);
        (surface.curvature, surface.conic) = (self.curvature, self.k1 - R::ONE);
        surface
    }

    /// The height of the sag above the centred vertex without the errors that are polynomials.
    #[inline(always)]
    fn plain_height(&self, p: Vec3<R>) -> R {
        p.z.shifted(-self.errors.sag(p.x.value(), p.y.value()))
    }

    #[inline(always)]
    fn sag_derivatives(&self, p: Vec3<R>) -> SagDerivatives<R> {
        let r2 = p.x * p.x + p.y * p.y;
        if QUADRIC {
            let root = R::ONE - self.curvature * self.k1 * self.plain_height(p);
            SagDerivatives::of_conic([self.curvature, self.k1], root, r2)
        } else {
            SagDerivatives::new(&self.asphere(), r2)
        }
    }

    /// `dn2 = n'² − n²`.
    #[inline(always)]
    fn dn2(&self) -> R {
        (self.index_behind - self.index_before) * (self.index_behind + self.index_before)
    }

    #[inline(always)]
    fn normal(&self, p: Vec3<R>, sag: &SagDerivatives<R>) -> Vec3<R> {
        let double = -(sag.slope + sag.slope);
        let [fx, fy] = self.errors.sag_slopes(p.x.value(), p.y.value());
        Vec3::new((p.x * double).shifted(-fx), (p.y * double).shifted(-fy), R::ONE)
    }

    /// The distance along the ray from a point near the surface to the surface: for derivatives alone.
    #[inline(always)]
    fn newton_step(&self, p: Vec3<R>, k: Vec3<f64>) -> f64 {
        let v = p.value();
        let height = self.plain_height(p);
        let along = v.x * k.x + v.y * k.y;
        if QUADRIC {
            let square = p.x * p.x + p.y * p.y + self.k1 * height * height;
            let g = self.curvature * square * R::from_f64(0.5) - height;
            let root = 1.0 - self.plain.curvature * (1.0 + self.plain.conic) * v.z;
            g.along_error() / (root * k.z - self.plain.curvature * along)
        } else {
            let (z, slope) = self.asphere().sag(p.x * p.x + p.y * p.y);
            (z - height).along_error() / (k.z - 2.0 * slope.value() * along)
        }
    }

    /// Takes a ray from the frame of the vertex before to the surface, at the parameter `s` that an
    /// earlier trace found.
    #[inline(always)]
    pub(super) fn meet(&self, p: Vec3<R>, k: Vec3<R>, s: f64) -> SurfaceHit<R> {
        let gap = R::from_f64(self.plain.gap).shifted(self.errors.gap);
        let p = Vec3::new(p.x, p.y, p.z - gap);
        let (p, k) = (
            shifted(p, -self.errors.displacement(p.value())),
            shifted(k, -cross(self.errors.turn(), k.value())),
        );
        let point = p + k * R::from_f64(s);
        let step = if R::ORDER > 0 { self.newton_step(point, k.value()) } else { 0.0 };
        let point = shifted(point, k.value() * step);
        let zero = R::ZERO;
        SurfaceHit { point, k, s: R::from_f64(s).shifted(step), a_behind: zero }
    }

    /// Refracts or reflects a ray that has met the surface; its point and optical direction behind, in
    /// the frame of the centred vertex.
    #[inline(always)]
    pub(super) fn refract(&self, hit: &mut SurfaceHit<R>) -> (Vec3<R>, Vec3<R>) {
        let normal = self.normal(hit.point, &self.sag_derivatives(hit.point));
        let (a, m) = (hit.k.dot(normal), normal.dot(normal));
        hit.a_behind = if self.plain.mirror {
            -a
        } else {
            R::from_f64(self.plain.sense) * (a * a + self.dn2() * m).sqrt()
        };
        let k = hit.k + normal * ((hit.a_behind - a) / m);
        let p = shifted(hit.point, self.errors.displacement(hit.point.value()));
        (p, shifted(k, cross(self.errors.turn(), k.value())))
    }

    /// The adjoint of [`Self::refract`] and of the crossing itself, from the derivatives by the ray
    /// behind.
    #[inline(always)]
    pub(super) fn adjoint(
        &self,
        hit: &SurfaceHit<R>,
        by_point: Vec3<R>,
        by_k: Vec3<R>,
    ) -> HitAdjoint<R> {
        let turn = self.errors.turn();
        let by_point = shifted(by_point, -cross(turn, by_point.value()));
        let by_k = shifted(by_k, -cross(turn, by_k.value()));
        let sag = self.sag_derivatives(hit.point);
        let normal = self.normal(hit.point, &sag);
        let (a, m, half) = (hit.k.dot(normal), normal.dot(normal), R::from_f64(0.5));
        let inverse = R::ONE / m;
        let gamma = (hit.a_behind - a) * inverse;
        let by_behind = by_k.dot(normal) * inverse;
        let (by_a, by_m, by_dn2);
        if self.plain.mirror {
            by_a = -(by_behind + by_behind);
            by_m = -(gamma * by_behind);
            by_dn2 = R::ZERO;
        } else {
            let by_square = by_behind * half / hit.a_behind;
            by_a = (by_square + by_square) * a - by_behind;
            by_m = by_square * self.dn2() - gamma * by_behind;
            by_dn2 = by_square * m;
        }
        let by_normal = by_k * gamma + hit.k * by_a + normal * (by_m + by_m);
        let k_behind = hit.k + normal * gamma;
        let by_k = by_k + normal * by_a;
        let double = by_dn2 + by_dn2;
        let indices = [-(double * self.index_before), double * self.index_behind];
        self.meeting_adjoint(hit, (sag, normal), (by_point, by_k), by_normal, (indices, k_behind))
    }

    /// The adjoint of the crossing alone, for a surface at which rays end.
    #[inline(always)]
    pub(super) fn end_adjoint(
        &self,
        hit: &SurfaceHit<R>,
        by_point: Vec3<R>,
        by_k: Vec3<R>,
    ) -> HitAdjoint<R> {
        let sag = self.sag_derivatives(hit.point);
        let normal = self.normal(hit.point, &sag);
        let none = ([R::ZERO; 2], hit.k);
        self.meeting_adjoint(hit, (sag, normal), (by_point, by_k), Vec3::default(), none)
    }

    #[inline(always)]
    fn meeting_adjoint(
        &self,
        hit: &SurfaceHit<R>,
        (sag, normal): (SagDerivatives<R>, Vec3<R>),
        (by_point, by_k): (Vec3<R>, Vec3<R>),
        by_normal: Vec3<R>,
        (indices, k_behind): ([R; 2], Vec3<R>),
    ) -> HitAdjoint<R> {
        let (p, n) = (hit.point, by_normal);
        // N = (−2 x w − ∂f/∂x, −2 y w − ∂f/∂y, 1) with w = dz/dr² and f the errors of the sag.
        let by_w = -(p.x * n.x + p.y * n.y) * R::TWO;
        let radial = by_w * sag.second * R::TWO;
        let double = -(sag.slope + sag.slope);
        let [xx, xy, yy] = self.errors.sag_bends(p.x.value(), p.y.value());
        let (nx, ny) = (n.x.value(), n.y.value());
        let bent = Vec3::new(-(xx * nx + xy * ny), -(xy * nx + yy * ny), 0.0);
        let across = Vec3::new(p.x * radial + n.x * double, p.y * radial + n.y * double, R::ZERO);
        let by_point = shifted(by_point + across, bent);
        let by_z = by_point.dot(hit.k) / hit.k.dot(normal);
        let (by_curvature, by_conic) = sag.by_conic(by_z, by_w);
        HitAdjoint {
            by_point: by_point - normal * by_z,
            by_k,
            by_curvature,
            by_conic,
            by_sag: [by_z, by_w],
            by_astigmatism: by_z * p.y * p.y - (p.y + p.y) * n.y,
            by_index_before: indices[0],
            by_index_behind: indices[1],
            k_behind,
        }
    }

    /// The derivatives by the coefficients of r⁴ to r¹⁶.
    #[inline(always)]
    pub(super) fn by_terms(&self, hit: &SurfaceHit<R>, met: &HitAdjoint<R>) -> [R; ASPHERE_TERMS] {
        let [by_z, by_w] = met.by_sag;
        self.sag_derivatives(hit.point).by_terms(by_z, by_w)
    }

    /// The adjoint of the way from the frame of the vertex before to the point of incidence: the
    /// derivatives by the point and by the optical direction of the ray there.
    #[inline(always)]
    pub(super) fn transfer_adjoint(
        &self,
        hit: &SurfaceHit<R>,
        met: &HitAdjoint<R>,
    ) -> (Vec3<R>, Vec3<R>) {
        let by_k = met.by_k + met.by_point * hit.s;
        let turn = self.errors.turn();
        let by_point = shifted(met.by_point, cross(turn, met.by_point.value()));
        (by_point, shifted(by_k, cross(turn, by_k.value())))
    }
}

/// True for a surface that is a conic, a sphere or a plane.
pub(super) fn is_quadric(surface: &Interface<f64>) -> bool {
    surface.form != SurfaceForm::Asphere
}
