//! The adjoint of a surface that a GRIN medium touches, and of the gap in front of it.
//!
//! There are three differences to a surface between homogeneous media. The indices in Snell's law
//! are those at the point, so that `n'² − n²` contributes to the derivative by the point. The ray that
//! arrives is not straight: the length of its last step follows from `N·dx + …` over `N·∂x/∂τ`. And
//! the gap is retraced step by step.

use super::GradientSink;
use super::block::AdjointBlock;
use super::refraction::{SagRefractionAdjoint, unrefract_at_sag};
use crate::grin::RayState;
use crate::grin::field::ProfileGradient;
use crate::lens::PROFILE_TERMS;
use crate::math::{Real, Vec3};
use crate::trace::batch::BLOCK;
use crate::trace::grin_gap::{GrinGap, StateAdjoint};
use crate::trace::propagation::SurfaceSite;
use crate::trace::{SurfaceParameter, Tracer};

/// Derivatives by the coefficients of a gap, for a block of rays.
type GrinTermColumns<R> = [[R; BLOCK]; PROFILE_TERMS];

impl<R: Real> Tracer<R> {
    /// Retraces a block through a surface that a GRIN medium touches to the surface before, and hands
    /// over the derivatives by the numbers of both and of the gaps.
    #[inline(never)]
    pub(super) fn backward_grin(
        &self,
        adjoint: &mut AdjointBlock<R>,
        i: usize,
        sink: &mut impl GradientSink<R>,
    ) {
        let site = self.site(i);
        let mut by_front: GrinTermColumns<R> = [[R::ZERO; BLOCK]; PROFILE_TERMS];
        let mut by_behind = by_front;
        for j in 0..BLOCK {
            if adjoint.block.code[j] > R::ZERO {
                continue;
            }
            let (front, behind) = adjoint.retrace_grin(&site, j);
            for k in 0..PROFILE_TERMS {
                (by_front[k][j], by_behind[k][j]) = (front.terms[k], behind.terms[k]);
            }
            if site.behind.is_some() {
                adjoint.by_index_behind[j] = behind.base;
            }
            if site.before.is_some() {
                adjoint.by_index_before[j] = front.base;
            }
        }
        adjoint.accumulate(site.surface, i, sink);
        let front = i.checked_sub(1).filter(|_| site.before.is_some());
        let behind = site.behind.map(|_| i);
        for (gap, columns) in [(front, by_front), (behind, by_behind)] {
            for (k, lanes) in columns.iter().enumerate().filter(|_| gap.is_some()) {
                sink.add_lanes(gap, SurfaceParameter::GrinTerm(k), &adjoint.mask_lost(lanes));
            }
        }
    }
}

impl<R: Real> AdjointBlock<R> {
    /// Retraces one ray through a surface to the one before. Returns the derivatives by the GRIN
    /// media in front and behind.
    fn retrace_grin(
        &mut self,
        site: &SurfaceSite<'_, R>,
        j: usize,
    ) -> (ProfileGradient<R>, ProfileGradient<R>) {
        let (point, k) = self.block.state(j);
        let surface = site.local_surface(point);
        let mut at = unrefract_at_sag(&surface, point, k, self.by_k(j), self.by_point(j), None);
        let mut behind = ProfileGradient::default();
        if let Some(gap) = site.behind {
            at.by_point = at.by_point + gap.field.force(point).force * (R::TWO * at.back.by_dn2);
            gap.field.accumulate(point, at.back.by_dn2, Vec3::default(), &mut behind);
        }
        let mut front = ProfileGradient::default();
        if let Some(gap) = site.before {
            let end = Vec3::new(point.x, point.y, point.z + surface.gap);
            self.retrace_gap(gap, j, end, &at, &mut front);
            self.by_index_behind[j] = at.back.by_dn2 * surface.index_behind * R::TWO;
        } else {
            let lambda = at.step_multiplier(self.by_opl[j] * surface.n2);
            self.set_shape_derivatives(j, &at.sag, lambda, at.by_slope);
            self.transfer_back(&surface, j, point, &at.back, at.by_point - at.normal * lambda);
        }
        (front, behind)
    }

    /// The adjoint of the propagation through a GRIN medium to a point of the surface, `x` in the frame
    /// of the surface before.
    fn retrace_gap(
        &mut self,
        gap: &GrinGap<R>,
        j: usize,
        x: Vec3<R>,
        at: &SagRefractionAdjoint<R>,
        by: &mut ProfileGradient<R>,
    ) {
        let back = &at.back;
        let end = RayState { x, v: back.k, path: R::ZERO };
        let by_path = self.by_opl[j];
        // The index in front belongs to the end of the gap.
        let by_x = at.by_point - gap.field.force(x).force * (R::TWO * back.by_dn2);
        gap.field.accumulate(x, -back.by_dn2, Vec3::default(), by);
        let rate = gap.final_rate(end, self.s[j]);
        let gain = by_x.dot(rate.x) + back.by_k.dot(rate.v) + by_path * rate.path;
        let lambda = gain / at.normal.dot(rate.x);
        self.set_shape_derivatives(j, &at.sag, lambda, at.by_slope);
        self.by_gap[j] = at.normal.z * lambda - at.by_point.z;
        let by_end = StateAdjoint { x: by_x - at.normal * lambda, v: back.by_k, path: by_path };
        let (start, by_start) = gap.backward(end, self.s[j], by_end, by);
        self.block.set(j, start.x, start.v);
        self.set(j, by_start.x, by_start.v);
    }
}
