//! The adjoint of a surface that a gradient touches, and of the gap in front of it.
//!
//! As in [`super::backward`], with three differences. The indices in Snell's law belong to the point,
//! so that `n'² − n²` pulls at it. The ray that comes to the surface is no straight line: the length
//! of its last step gives way by `N·dx + …` over `N·∂x/∂τ`. And the gap is undone step by step.

use super::Tracer;
use super::backward::{
    AdjointBlock, GradientSink, RefractionAdjoint, SagDerivatives, SurfaceNormal, unrefract,
};
use super::batch::BLOCK;
use super::gap::StateAdjoint;
use super::slot::SurfaceParameter;
use crate::grin::RayState;
use crate::grin::field::ProfileGradient;
use crate::lens::PROFILE_TERMS;
use crate::math::{Real, Vec3};

/// What a surface passes on to what is in front of it.
struct SurfaceAdjoint<R> {
    /// The point in the frame of the surface.
    point: Vec3<R>,
    /// `∇G` of the surface, with the component 1 along the axis.
    normal: Vec3<R>,
    back: RefractionAdjoint<R>,
    /// By the point, but for its lying on the surface.
    by_point: Vec3<R>,
    sag: SagDerivatives<R>,
    /// By `dz/dr²`.
    by_slope: R,
}

/// Derivatives by the coefficients of a gap, for a block of rays.
type GrinTermColumns<R> = [[R; BLOCK]; PROFILE_TERMS];

impl<R: Real> Tracer<R> {
    /// Goes back through a surface that a gradient touches to the one before, and hands over the
    /// derivatives by its numbers and by those of the gap.
    #[inline(never)]
    pub(super) fn backward_grin(
        &self,
        way: &mut AdjointBlock<R>,
        i: usize,
        harvest: &mut impl GradientSink<R>,
    ) {
        let mut by_front: GrinTermColumns<R> = [[R::ZERO; BLOCK]; PROFILE_TERMS];
        let mut by_behind = by_front;
        for j in 0..BLOCK {
            if way.block.code[j] > R::ZERO {
                continue;
            }
            let mut behind = ProfileGradient::default();
            let passed = self.unrefract_at(way, i, j, &mut behind);
            let front = self.cross_back(way, i, j, passed);
            for k in 0..PROFILE_TERMS {
                (by_front[k][j], by_behind[k][j]) = (front.terms[k], behind.terms[k]);
            }
            if self.grin_gap_behind(i).is_some() {
                way.by_index_behind[j] = behind.base;
            }
            if self.grin_gap_before(i).is_some() {
                way.by_index_before[j] = front.base;
            }
        }
        way.accumulate(&self.interfaces[i], i, harvest);
        for (gap, columns) in [(i.checked_sub(1), by_front), (Some(i), by_behind)] {
            let Some(gap) = gap.filter(|gap| self.grin_gap_behind(*gap).is_some()) else {
                continue;
            };
            for (k, lanes) in columns.iter().enumerate() {
                harvest.add_lanes(Some(gap), SurfaceParameter::GrinTerm(k), &way.mask_lost(lanes));
            }
        }
    }

    /// The adjoint of refraction by the indices at the point.
    fn unrefract_at(
        &self,
        way: &AdjointBlock<R>,
        i: usize,
        j: usize,
        by_gap: &mut ProfileGradient<R>,
    ) -> SurfaceAdjoint<R> {
        let (point, behind) = way.block.state(j);
        let local = self.with_local_indices(i, point);
        let sag = SagDerivatives::new(&local, point.x * point.x + point.y * point.y);
        let slope = -(sag.slope + sag.slope);
        let vector = Vec3::new(point.x * slope, point.y * slope, R::ONE);
        let normal = SurfaceNormal { vector, m: vector.dot(vector), unit: false };
        let back = unrefract(&local, normal, behind, way.by_k(j));
        let n = back.by_normal;
        let by_slope = -(point.x * n.x + point.y * n.y) * R::TWO;
        let radial = by_slope * sag.second * R::TWO;
        let turned =
            Vec3::new(point.x * radial + n.x * slope, point.y * radial + n.y * slope, R::ZERO);
        let mut by_point = way.by_point(j) + turned;
        if let Some(gap) = self.grin_gap_behind(i) {
            by_point = by_point + gap.field.force(point).force * (R::TWO * back.by_dn2);
            gap.field.accumulate(point, back.by_dn2, Vec3::default(), by_gap);
        }
        SurfaceAdjoint { point, normal: vector, back, by_point, sag, by_slope }
    }

    /// The adjoint of the way to the surface; the derivatives by the gap before it, if that has a
    /// gradient.
    fn cross_back(
        &self,
        way: &mut AdjointBlock<R>,
        i: usize,
        j: usize,
        passed: SurfaceAdjoint<R>,
    ) -> ProfileGradient<R> {
        let SurfaceAdjoint { point, normal, back, by_point, sag, by_slope } = passed;
        let mut by = ProfileGradient::default();
        let Some(gap) = self.grin_gap_before(i) else {
            let surface = &self.interfaces[i];
            let local = self.with_local_indices(i, point);
            let lambda = (by_point.dot(back.k) + way.by_opl[j] * surface.n2) / back.a;
            way.set_shape_derivatives(j, &sag, lambda, by_slope);
            way.transfer_back(&local, j, point, &back, by_point - normal * lambda);
            return by;
        };
        let thickness = self.interfaces[i].gap;
        let x = Vec3::new(point.x, point.y, point.z + thickness);
        let end = RayState { x, v: back.k, path: R::ZERO };
        let by_path = way.by_opl[j];
        // The index in front belongs to the end of the gap.
        let by_x = by_point - gap.field.force(x).force * (R::TWO * back.by_dn2);
        gap.field.accumulate(x, -back.by_dn2, Vec3::default(), &mut by);
        let rate = gap.final_rate(end, way.s[j]);
        let gain = by_x.dot(rate.x) + back.by_k.dot(rate.v) + by_path * rate.path;
        let lambda = gain / normal.dot(rate.x);
        way.set_shape_derivatives(j, &sag, lambda, by_slope);
        way.by_gap[j] = normal.z * lambda - by_point.z;
        way.by_index_behind[j] =
            back.by_dn2 * self.with_local_indices(i, point).index_behind * R::TWO;
        let pull = StateAdjoint { x: by_x - normal * lambda, v: back.by_k, path: by_path };
        let (start, pull) = gap.backward(end, way.s[j], pull, &mut by);
        way.block.set(j, start.x, start.v);
        way.set(j, pull.x, pull.v);
        by
    }
}

impl<R: Real> AdjointBlock<R> {
    /// The derivatives by the numbers of the form of a surface, from those by z and by `dz/dr²`.
    fn set_shape_derivatives(&mut self, j: usize, sag: &SagDerivatives<R>, by_z: R, by_slope: R) {
        (self.by_curvature[j], self.by_conic[j]) = sag.by_conic(by_z, by_slope);
        let terms = sag.by_terms(by_z, by_slope);
        self.by_terms.iter_mut().zip(terms).for_each(|(column, by_term)| column[j] = by_term);
    }
}
