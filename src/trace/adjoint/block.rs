//! A block of rays on its way back through the surfaces, with the adjoint of each crossing.

use super::refraction::{
    RefractionAdjoint, SagDerivatives, SurfaceNormal, conic_normal, sphere_normal, unrefract,
    unrefract_at_sag,
};
use super::{GradientSink, LimitAdjoint};
use crate::lens::{APERTURE_NUMBERS, ASPHERE_TERMS};
use crate::math::{Real, Vec3};
use crate::trace::SurfaceParameter;
use crate::trace::aperture::ApertureSet;
use crate::trace::batch::{BLOCK, RayBlock};
use crate::trace::interface::{Interface, SurfaceForm};

/// A block of rays on its way back: its state, the derivatives by its state, and those by the numbers
/// of the surface just passed. One value, so that the compiler sees that no columns overlap.
pub(super) struct AdjointBlock<R> {
    pub(super) block: RayBlock<R>,
    /// The distance to the surface.
    pub(super) s: [R; BLOCK],
    pub(super) by_x: [R; BLOCK],
    pub(super) by_y: [R; BLOCK],
    pub(super) by_z: [R; BLOCK],
    pub(super) by_kx: [R; BLOCK],
    pub(super) by_ky: [R; BLOCK],
    pub(super) by_kz: [R; BLOCK],
    pub(super) by_opl: [R; BLOCK],
    pub(super) by_curvature: [R; BLOCK],
    pub(super) by_conic: [R; BLOCK],
    pub(super) by_gap: [R; BLOCK],
    pub(super) by_semi_diameter: [R; BLOCK],
    pub(super) by_index_before: [R; BLOCK],
    pub(super) by_index_behind: [R; BLOCK],
    pub(super) by_terms: [[R; BLOCK]; ASPHERE_TERMS],
}

impl<R: Real> AdjointBlock<R> {
    #[inline(always)]
    pub(super) fn new(block: RayBlock<R>) -> Self {
        let zero = [R::ZERO; BLOCK];
        Self {
            block,
            s: zero,
            by_x: zero,
            by_y: zero,
            by_z: zero,
            by_kx: zero,
            by_ky: zero,
            by_kz: zero,
            by_opl: zero,
            by_curvature: zero,
            by_conic: zero,
            by_gap: zero,
            by_semi_diameter: zero,
            by_index_before: zero,
            by_index_behind: zero,
            by_terms: [zero; ASPHERE_TERMS],
        }
    }

    #[inline(always)]
    pub(super) fn by_point(&self, j: usize) -> Vec3<R> {
        Vec3::new(self.by_x[j], self.by_y[j], self.by_z[j])
    }

    #[inline(always)]
    pub(super) fn by_k(&self, j: usize) -> Vec3<R> {
        Vec3::new(self.by_kx[j], self.by_ky[j], self.by_kz[j])
    }

    #[inline(always)]
    pub(super) fn set(&mut self, j: usize, by_point: Vec3<R>, by_k: Vec3<R>) {
        (self.by_x[j], self.by_y[j], self.by_z[j]) = (by_point.x, by_point.y, by_point.z);
        (self.by_kx[j], self.by_ky[j], self.by_kz[j]) = (by_k.x, by_k.y, by_k.z);
    }

    /// Retraces the block through a surface to the one before.
    #[inline(always)]
    pub(super) fn retrace_surface(
        &mut self,
        surface: &Interface<R>,
        limits: Option<&LimitAdjoint<R>>,
    ) {
        let sheet = limits.and_then(|limits| {
            self.rim_adjoint(surface, &limits.rim);
            if let Some(by_limit) = &limits.obstruction {
                self.radius_adjoint(by_limit, -(R::ONE / surface.obstruction2));
            }
            limits.conic_edge.as_ref().map(|sheet| self.conic_edge_adjoint(surface, sheet))
        });
        let angle = limits.map(|limits| &limits.angle);
        match surface.form {
            SurfaceForm::Plane | SurfaceForm::Sphere => self.retrace(surface, sphere_normal, angle),
            SurfaceForm::Conic => self.retrace(surface, conic_normal, angle),
            SurfaceForm::Asphere => self.retrace_asphere(surface, angle),
        }
        if let Some([by_curvature, by_conic]) = sheet {
            for j in 0..BLOCK {
                self.by_curvature[j] += by_curvature[j];
                self.by_conic[j] += by_conic[j];
            }
        }
    }

    /// The adjoint of the rim.
    #[inline(always)]
    fn rim_adjoint(&mut self, surface: &Interface<R>, by_limit: &[R; BLOCK]) {
        let (inverse, radius) = (R::ONE / surface.rim2, surface.rim2.sqrt());
        self.radius_adjoint(by_limit, inverse);
        for (j, by_limit) in by_limit.iter().enumerate() {
            let (p, _) = self.block.state(j);
            self.by_semi_diameter[j] = -(*by_limit * inverse * (p.x * p.x + p.y * p.y) / radius);
        }
    }

    /// The adjoint of half the square of the distance from the axis, multiplied by `factor`.
    #[inline(always)]
    fn radius_adjoint(&mut self, by_limit: &[R; BLOCK], factor: R) {
        for (j, by_limit) in by_limit.iter().enumerate() {
            let (p, _) = self.block.state(j);
            let share = *by_limit * factor;
            self.by_x[j] += p.x * share;
            self.by_y[j] += p.y * share;
        }
    }

    /// The adjoint of the sides of apertures, whose limit functions are minus the distances from them.
    #[inline(never)]
    pub(super) fn aperture_adjoint(
        &mut self,
        apertures: &ApertureSet<R>,
        by_limits: &[[R; BLOCK]],
        surface: usize,
        sink: &mut impl GradientSink<R>,
    ) {
        let scale = R::from_f64(1.0 / apertures.extent());
        for (side, by_limit) in by_limits.iter().enumerate() {
            let side = side as u16;
            let (mut first, mut numbers) = (0, [[R::ZERO; BLOCK]; APERTURE_NUMBERS]);
            for (j, by_limit) in by_limit.iter().enumerate() {
                let (p, _) = self.block.state(j);
                let share = *by_limit * scale;
                let share = if apertures.margin(side, p) < R::ZERO { share } else { -share };
                let [x, y] = apertures.by_point(side, p);
                self.by_x[j] += share * x;
                self.by_y[j] += share * y;
                let by = apertures.by_numbers(side, p);
                first = by.0;
                numbers.iter_mut().zip(by.1).for_each(|(lanes, by)| lanes[j] = share * by);
            }
            for (number, lanes) in numbers.iter().enumerate() {
                let lanes = self.mask_lost(lanes);
                sink.add_lanes(Some(surface), SurfaceParameter::Aperture(first + number), &lanes);
            }
        }
    }

    /// The adjoint of the edge of a conic. Returns the derivatives by curvature and conic constant.
    #[inline(always)]
    fn conic_edge_adjoint(
        &mut self,
        surface: &Interface<R>,
        by_limit: &[R; BLOCK],
    ) -> [[R; BLOCK]; 2] {
        let (c, k1) = (surface.curvature, R::ONE + surface.conic);
        let mut by_shape = [[R::ZERO; BLOCK]; 2];
        for (j, by_limit) in by_limit.iter().enumerate() {
            let (p, _) = self.block.state(j);
            if surface.form == SurfaceForm::Asphere {
                let (r2, by_limit) = (p.x * p.x + p.y * p.y, c * *by_limit);
                let outward = k1 * c * by_limit * R::TWO;
                self.by_x[j] += p.x * outward;
                self.by_y[j] += p.y * outward;
                (by_shape[0][j], by_shape[1][j]) = (k1 * r2 * by_limit * R::TWO, c * r2 * by_limit);
            } else {
                let along = p.z * *by_limit;
                self.by_z[j] += k1 * c * *by_limit;
                (by_shape[0][j], by_shape[1][j]) = (k1 * along, c * along);
            }
        }
        by_shape
    }

    /// Retraces the block through a conic, a sphere or a plane to the surface before.
    #[inline(always)]
    fn retrace(
        &mut self,
        surface: &Interface<R>,
        normal: impl Fn(&Interface<R>, Vec3<R>) -> SurfaceNormal<R>,
        angle: Option<&[R; BLOCK]>,
    ) {
        let surface = *surface;
        let (c, k1) = (surface.curvature, R::ONE + surface.conic);
        let half = R::from_f64(0.5);
        for j in 0..BLOCK {
            let (p, behind) = self.block.state(j);
            let normal = normal(&surface, p);
            let mut back = unrefract(&surface, normal, behind, self.by_k(j));
            let mut by_n2 = R::ZERO;
            if let Some(angle) = angle {
                (back, by_n2) = surface.angle_limit_adjoint(angle[j], normal, back);
            }
            let n = back.by_normal;
            let by_point = self.by_point(j) - Vec3::new(n.x * c, n.y * c, n.z * (k1 * c));
            let lambda = (by_point.dot(back.k) + self.by_opl[j] * surface.n2) / back.a;
            let bulge = p.x * p.x + p.y * p.y + k1 * p.z * p.z;
            self.by_curvature[j] = lambda * bulge * half - (p.x * n.x + p.y * n.y + k1 * p.z * n.z);
            if !normal.unit {
                self.by_conic[j] = c * p.z * (lambda * p.z * half - n.z);
            }
            self.transfer_back(&surface, j, p, &back, by_point - normal.vector * lambda);
            if angle.is_some() {
                self.by_index_before[j] += by_n2 * surface.index_before * R::TWO;
            }
        }
    }

    /// Retraces the block through an asphere to the surface before.
    #[inline(always)]
    fn retrace_asphere(&mut self, surface: &Interface<R>, angle: Option<&[R; BLOCK]>) {
        let surface = *surface;
        for j in 0..BLOCK {
            let (p, behind) = self.block.state(j);
            let (by_k, by_point) = (self.by_k(j), self.by_point(j));
            let angle = angle.map(|angle| angle[j]);
            let at = unrefract_at_sag(&surface, p, behind, by_k, by_point, angle);
            let lambda = at.step_multiplier(self.by_opl[j] * surface.n2);
            self.set_shape_derivatives(j, &at.sag, lambda, at.by_slope);
            self.transfer_back(&surface, j, p, &at.back, at.by_point - at.normal * lambda);
            if angle.is_some() {
                self.by_index_before[j] += at.by_n2 * surface.index_before * R::TWO;
            }
        }
    }

    /// Sets the derivatives by the numbers of the form of a surface, from those by z and by `dz/dr²`.
    #[inline(always)]
    pub(super) fn set_shape_derivatives(
        &mut self,
        j: usize,
        sag: &SagDerivatives<R>,
        by_z: R,
        by_slope: R,
    ) {
        (self.by_curvature[j], self.by_conic[j]) = sag.by_conic(by_z, by_slope);
        let terms = sag.by_terms(by_z, by_slope);
        self.by_terms.iter_mut().zip(terms).for_each(|(column, by_term)| column[j] = by_term);
    }

    /// The adjoint of the transfer from the surface before.
    #[inline(always)]
    pub(super) fn transfer_back(
        &mut self,
        surface: &Interface<R>,
        j: usize,
        p: Vec3<R>,
        back: &RefractionAdjoint<R>,
        by_start: Vec3<R>,
    ) {
        let s = self.s[j];
        let start = p - back.k * s;
        self.by_gap[j] = -by_start.z;
        // dn2 = n'² − n², and the optical path is s n².
        self.by_index_behind[j] = back.by_dn2 * surface.index_behind * R::TWO;
        let path = self.by_opl[j] * s;
        self.by_index_before[j] = (path - back.by_dn2) * surface.index_before * R::TWO;
        self.set(j, by_start, back.by_k + by_start * s);
        self.block.set(j, Vec3::new(start.x, start.y, start.z + surface.gap), back.k);
    }

    /// The column with zeros for the lost rays.
    #[inline(always)]
    pub(super) fn mask_lost(&self, lanes: &[R; BLOCK]) -> [R; BLOCK] {
        std::array::from_fn(|j| R::select(self.block.code[j] > R::ZERO, R::ZERO, lanes[j]))
    }

    /// Hands over the derivatives by the numbers of the surface.
    #[inline(always)]
    pub(super) fn accumulate(
        &self,
        surface: &Interface<R>,
        i: usize,
        sink: &mut impl GradientSink<R>,
    ) {
        let masked = |lanes: &[R; BLOCK]| self.mask_lost(lanes);
        sink.add_lanes(Some(i), SurfaceParameter::Curvature, &masked(&self.by_curvature));
        if matches!(surface.form, SurfaceForm::Conic | SurfaceForm::Asphere) {
            sink.add_lanes(Some(i), SurfaceParameter::Conic, &masked(&self.by_conic));
        }
        if surface.form == SurfaceForm::Asphere {
            for (term, lanes) in self.by_terms.iter().enumerate() {
                sink.add_lanes(Some(i), SurfaceParameter::AsphereTerm(term), &masked(lanes));
            }
        }
        if let Some(before) = i.checked_sub(1) {
            sink.add_lanes(Some(before), SurfaceParameter::Thickness, &masked(&self.by_gap));
        }
        sink.add_lanes(
            surface.medium_before,
            SurfaceParameter::Index,
            &masked(&self.by_index_before),
        );
        let behind = if surface.mirror { surface.medium_before } else { Some(i) };
        sink.add_lanes(behind, SurfaceParameter::Index, &masked(&self.by_index_behind));
    }
}
