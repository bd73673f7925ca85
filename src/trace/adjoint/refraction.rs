//! The adjoint of refraction and reflection at a surface, and the derivatives of the sag.

use crate::lens::ASPHERE_TERMS;
use crate::math::{Real, Vec3};
use crate::trace::interface::Interface;

/// The normal of a surface.
#[derive(Clone, Copy)]
pub(super) struct SurfaceNormal<R> {
    pub(super) vector: Vec3<R>,
    /// `N·N`.
    pub(super) m: R,
    /// True if `m` is 1 at every point of the surface.
    pub(super) unit: bool,
}

#[inline(always)]
pub(super) fn sphere_normal<R: Real>(surface: &Interface<R>, p: Vec3<R>) -> SurfaceNormal<R> {
    let c = surface.curvature;
    let vector = Vec3::new(-(c * p.x), -(c * p.y), R::ONE - c * p.z);
    SurfaceNormal { vector, m: R::ONE, unit: true }
}

#[inline(always)]
pub(super) fn conic_normal<R: Real>(surface: &Interface<R>, p: Vec3<R>) -> SurfaceNormal<R> {
    let c = surface.curvature;
    let vector = Vec3::new(-(c * p.x), -(c * p.y), R::ONE - c * (p.z + surface.conic * p.z));
    SurfaceNormal { vector, m: vector.dot(vector), unit: false }
}

/// The adjoint of refraction.
#[derive(Clone, Copy)]
pub(super) struct RefractionAdjoint<R> {
    /// The optical direction in front.
    pub(super) k: Vec3<R>,
    /// `k·N`.
    pub(super) a: R,
    pub(super) by_k: Vec3<R>,
    pub(super) by_normal: Vec3<R>,
    pub(super) by_dn2: R,
}

/// Retraces refraction or reflection, from the direction behind and the derivative by it.
#[inline(always)]
pub(super) fn unrefract<R: Real>(
    surface: &Interface<R>,
    normal: SurfaceNormal<R>,
    behind: Vec3<R>,
    by_behind: Vec3<R>,
) -> RefractionAdjoint<R> {
    let SurfaceNormal { vector, m, unit } = normal;
    let a_behind = behind.dot(vector);
    let by_gamma = by_behind.dot(vector);
    let inverse_m = if unit { R::ONE } else { R::ONE / m };
    let (a, gamma, by_a, by_m, by_dn2);
    if surface.mirror {
        a = -a_behind;
        gamma = -((a + a) * inverse_m);
        by_a = -((by_gamma + by_gamma) * inverse_m);
        by_m = -(gamma * by_gamma * inverse_m);
        by_dn2 = R::ZERO;
    } else {
        a = surface.sense * (a_behind * a_behind - surface.dn2 * m).sqrt();
        gamma = (a_behind - a) * inverse_m;
        let scaled = by_gamma / a_behind;
        by_a = -(scaled * gamma);
        by_dn2 = scaled * R::from_f64(0.5);
        by_m = (by_dn2 * surface.dn2 - by_gamma * gamma) * inverse_m;
    }
    let k = behind - vector * gamma;
    let mut by_normal = by_behind * gamma + k * by_a;
    if !unit {
        by_normal = by_normal + vector * (by_m + by_m);
    }
    RefractionAdjoint { k, a, by_k: by_behind + vector * by_a, by_normal, by_dn2 }
}

impl<R: Real> Interface<R> {
    /// Adds the adjoint of the angle limit. Returns with it the derivative by the square of the index
    /// in front that is not part of `by_dn2`.
    #[inline(always)]
    pub(super) fn angle_limit_adjoint(
        &self,
        by_limit: R,
        normal: SurfaceNormal<R>,
        back: RefractionAdjoint<R>,
    ) -> (RefractionAdjoint<R>, R) {
        let share = by_limit / self.n2;
        let loss = self.index_drop2();
        let by_a = -((back.a + back.a) * share);
        let mut by_normal = back.by_normal + back.k * by_a;
        if !normal.unit {
            by_normal = by_normal + normal.vector * (loss * share * R::TWO);
        }
        let by_k = back.by_k + normal.vector * by_a;
        let by_behind2 = R::select(loss > R::ZERO, -(share * normal.m), R::ZERO);
        let by_dn2 = back.by_dn2 + by_behind2;
        let by_n2 = (back.a * back.a - loss * normal.m) * share / self.n2;
        (RefractionAdjoint { by_k, by_normal, by_dn2, ..back }, by_n2)
    }
}

/// The adjoint of refraction at a surface that is given by its sag.
pub(super) struct SagRefractionAdjoint<R> {
    pub(super) sag: SagDerivatives<R>,
    /// `∇G` of the surface, with the component 1 along the axis.
    pub(super) normal: Vec3<R>,
    pub(super) back: RefractionAdjoint<R>,
    /// By the point, without the constraint that it lies on the surface.
    pub(super) by_point: Vec3<R>,
    /// By `dz/dr²`.
    pub(super) by_slope: R,
    /// By the square of the index in front, from the angle limit.
    pub(super) by_n2: R,
}

/// The adjoint of refraction at a point of a surface that is given by its sag; `angle` is the
/// derivative by the angle limit.
#[inline(always)]
pub(super) fn unrefract_at_sag<R: Real>(
    surface: &Interface<R>,
    p: Vec3<R>,
    behind: Vec3<R>,
    by_behind: Vec3<R>,
    by_point: Vec3<R>,
    angle: Option<R>,
) -> SagRefractionAdjoint<R> {
    let sag = SagDerivatives::new(surface, p.x * p.x + p.y * p.y);
    let slope = -(sag.slope + sag.slope);
    let vector = Vec3::new(p.x * slope, p.y * slope, R::ONE);
    let normal = SurfaceNormal { vector, m: vector.dot(vector), unit: false };
    let mut back = unrefract(surface, normal, behind, by_behind);
    let mut by_n2 = R::ZERO;
    if let Some(angle) = angle {
        (back, by_n2) = surface.angle_limit_adjoint(angle, normal, back);
    }
    // N = (−2 x w, −2 y w, 1) with w = dz/dr².
    let n = back.by_normal;
    let by_slope = -(p.x * n.x + p.y * n.y) * R::TWO;
    let radial = by_slope * sag.second * R::TWO;
    let by_point =
        by_point + Vec3::new(p.x * radial + n.x * slope, p.y * radial + n.y * slope, R::ZERO);
    SagRefractionAdjoint { sag, normal: vector, back, by_point, by_slope, by_n2 }
}

impl<R: Real> SagRefractionAdjoint<R> {
    /// The derivative by the equation of the surface, for a straight ray in front of it; `by_s` is the
    /// derivative by the length of the ray apart from the point.
    #[inline(always)]
    pub(super) fn step_multiplier(&self, by_s: R) -> R {
        (self.by_point.dot(self.back.k) + by_s) / self.back.a
    }
}

/// `w = dz/dr²` of an asphere at a distance from the axis, and all derivatives of z and w.
pub(super) struct SagDerivatives<R> {
    r2: R,
    curvature: R,
    /// `√(1 − (1+κ) c² r²)`.
    root: R,
    /// `w`.
    pub(super) slope: R,
    /// `dw/dr²`.
    pub(super) second: R,
}

impl<R: Real> SagDerivatives<R> {
    #[inline(always)]
    pub(super) fn new(surface: &Interface<R>, r2: R) -> Self {
        let c = surface.curvature;
        let square = (R::ONE + surface.conic) * c * c;
        let root = (R::ONE - square * r2).sqrt();
        let (mut slope, mut bend) = (R::ZERO, R::ZERO);
        for (j, a) in surface.terms.into_iter().enumerate().rev() {
            let degree = R::from_f64(j as f64 + 2.0);
            bend = bend * r2 + a * degree * (degree - R::ONE);
            slope = slope * r2 + a * degree;
        }
        Self {
            r2,
            curvature: c,
            root,
            slope: c / (root + root) + slope * r2,
            second: c * square / (R::from_f64(4.0) * root * root * root) + bend,
        }
    }

    /// Those of a conic with this curvature and conic constant plus one, where the root `1 − (1+κ) c z`
    /// of its sag is known.
    #[inline(always)]
    pub(super) fn of_conic([curvature, k1]: [R; 2], root: R, r2: R) -> Self {
        let half = R::from_f64(0.5);
        let slope = curvature * half / root;
        let second = k1 * (slope * slope) * (slope + slope);
        Self { r2, curvature, root, slope, second }
    }

    /// The derivatives by curvature and conic constant, from those by z and by w.
    #[inline(always)]
    pub(super) fn by_conic(&self, by_z: R, by_w: R) -> (R, R) {
        let (c, q, r2) = (self.curvature, self.root, self.r2);
        let (one_q, cube) = (R::ONE + q, q * q * q);
        let by_curvature = by_z * r2 / (q * one_q) + by_w / (cube + cube);
        let c3 = c * c * c * r2;
        let by_conic =
            by_z * c3 * r2 / (R::TWO * q * one_q * one_q) + by_w * c3 / (R::from_f64(4.0) * cube);
        (by_curvature, by_conic)
    }

    /// The derivatives by the coefficients, from those by z and by w.
    #[inline(always)]
    pub(super) fn by_terms(&self, by_z: R, by_w: R) -> [R; ASPHERE_TERMS] {
        let mut power = self.r2;
        std::array::from_fn(|term| {
            let by_term = power * (by_z * self.r2 + by_w * R::from_f64(term as f64 + 2.0));
            power = power * self.r2;
            by_term
        })
    }
}
