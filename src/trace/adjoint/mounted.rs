//! The adjoint of a surface that is decentred, tilted or irregular.
//!
//! The block enters the surface's own frame, is retraced through the surface there, and leaves the
//! frame in front of it. The derivatives by the state of a ray turn with the frame, because a rotation
//! is its own inverse transpose.

use super::GradientSink;
use super::block::AdjointBlock;
use super::refraction::{SagDerivatives, SagRefractionAdjoint, SurfaceNormal, unrefract};
use crate::lens::Pose;
use crate::math::{Real, Vec3};
use crate::trace::Tracer;
use crate::trace::batch::BLOCK;
use crate::trace::interface::Interface;
use crate::trace::mount::Mount;

impl<R: Real> Tracer<R> {
    /// Retraces a block through a surface with a mount to the surface before, and hands over the
    /// derivatives by the numbers of the surface.
    #[inline(never)]
    pub(super) fn backward_mounted(
        &self,
        adjoint: &mut AdjointBlock<R>,
        i: usize,
        mount: &Mount<R>,
        sink: &mut impl GradientSink<R>,
    ) {
        let interface = &self.interfaces[i];
        // The gap in front belongs to the frame of the centred vertex.
        let own = Interface { gap: R::ZERO, ..*interface };
        adjoint.enter(&mount.behind);
        match mount.astigmatism {
            None => adjoint.retrace_surface(&own, None),
            Some(q) => adjoint.retrace_irregular(&own, q),
        }
        adjoint.leave(&mount.pose, interface.gap);
        adjoint.accumulate(interface, i, sink);
    }
}

impl<R: Real> AdjointBlock<R> {
    /// Turns the block from the frame behind a surface into its own.
    fn enter(&mut self, pose: &Pose<R>) {
        for j in 0..BLOCK {
            let (p, k) = self.block.state(j);
            self.block.set(j, pose.point_in(p), pose.direction_in(k));
            self.set(j, pose.direction_in(self.by_point(j)), pose.direction_in(self.by_k(j)));
        }
    }

    /// Turns the block, in front of a surface, into the frame of the centred vertex before.
    fn leave(&mut self, pose: &Pose<R>, gap: R) {
        for j in 0..BLOCK {
            let (p, k) = self.block.state(j);
            let p = pose.point_out(p);
            self.block.set(j, Vec3::new(p.x, p.y, p.z + gap), pose.direction_out(k));
            let by_point = pose.direction_out(self.by_point(j));
            self.set(j, by_point, pose.direction_out(self.by_k(j)));
            self.by_gap[j] = -by_point.z;
        }
    }

    /// Retraces the block through a surface with the sag `z(r²) + q y²`.
    fn retrace_irregular(&mut self, surface: &Interface<R>, q: R) {
        for j in 0..BLOCK {
            let (p, behind) = self.block.state(j);
            let at = unrefract_irregular(surface, p, behind, self.by_k(j), self.by_point(j), q);
            let lambda = at.step_multiplier(self.by_opl[j] * surface.n2);
            self.set_shape_derivatives(j, &at.sag, lambda, at.by_slope);
            self.transfer_back(surface, j, p, &at.back, at.by_point - at.normal * lambda);
        }
    }
}

/// The adjoint of refraction at a point of a surface with the sag `z(r²) + q y²`.
fn unrefract_irregular<R: Real>(
    surface: &Interface<R>,
    p: Vec3<R>,
    behind: Vec3<R>,
    by_behind: Vec3<R>,
    by_point: Vec3<R>,
    q: R,
) -> SagRefractionAdjoint<R> {
    let sag = SagDerivatives::new(surface, p.x * p.x + p.y * p.y);
    let slope = -(sag.slope + sag.slope);
    let slope_y = slope - (q + q);
    let vector = Vec3::new(p.x * slope, p.y * slope_y, R::ONE);
    let back = unrefract(
        surface,
        SurfaceNormal { vector, m: vector.dot(vector), unit: false },
        behind,
        by_behind,
    );
    // N = (−2 x w, −2 y (w + q), 1) with w = dz/dr².
    let n = back.by_normal;
    let by_slope = -(p.x * n.x + p.y * n.y) * R::TWO;
    let radial = by_slope * sag.second * R::TWO;
    let along = Vec3::new(p.x * radial + n.x * slope, p.y * radial + n.y * slope_y, R::ZERO);
    let by_point = by_point + along;
    SagRefractionAdjoint { sag, normal: vector, back, by_point, by_slope, by_n2: R::ZERO }
}
